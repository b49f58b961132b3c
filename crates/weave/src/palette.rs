//! Few colours that stand for those of an image.

use glam::Vec3;
use organza_basis::Rgb;

/// Colours that stand for those of an image: the box of its colours is halved where its
/// longest side is, as long as there may be more.
pub(crate) fn palette(pixels: &[Rgb], most: usize) -> Vec<Rgb> {
    // Steps that look equal, about as bright as they are perceived.
    let mut sorted: Vec<[u16; 3]> = pixels
        .iter()
        .map(|p| {
            p.0.to_array()
                .map(|x| (x.clamp(0.0, 1.0).sqrt() * 1023.0).round() as u16)
        })
        .collect();
    sorted.sort_unstable();
    sorted.dedup();
    let mut boxes = vec![sorted];
    while boxes.len() < most {
        let longest = |colours: &Vec<[u16; 3]>| {
            (0..3)
                .map(|c| {
                    let of = || colours.iter().map(|p| p[c]);
                    (of().max().unwrap_or(0) - of().min().unwrap_or(0), c)
                })
                .max()
                .unwrap_or((0, 0))
        };
        let found = boxes.iter().enumerate().max_by_key(|(_, b)| longest(b).0);
        let Some((index, side)) = found.map(|(i, b)| (i, longest(b))).filter(|f| f.1.0 > 0) else {
            break;
        };
        let mut colours = boxes.swap_remove(index);
        let channel = side.1;
        colours.sort_unstable_by_key(|p| (p[channel], *p));
        let of = |i: usize| f64::from(colours[i][channel]);
        let middle = 0.5 * (of(0) + of(colours.len() - 1));
        let half = colours.partition_point(|p| f64::from(p[channel]) <= middle);
        let upper = colours.split_off(half);
        boxes.extend([colours, upper]);
    }
    let mean = |colours: &Vec<[u16; 3]>| {
        let sum = |c: usize| -> f32 {
            let linear = |p: &[u16; 3]| (f32::from(p[c]) / 1023.0).powi(2);
            colours.iter().map(linear).sum()
        };
        Rgb::new(sum(0), sum(1), sum(2)) * (1.0 / colours.len().max(1) as f32)
    };
    boxes.iter().map(mean).collect()
}

/// A colour in steps that look about equal.
pub(crate) fn seen(colour: Rgb) -> Vec3 {
    colour.0.clamp(Vec3::ZERO, Vec3::ONE).map(f32::sqrt)
}

/// Number of the ink that looks most like a colour.
pub(crate) fn nearest(inks: &[Vec3], colour: Vec3) -> usize {
    let off = |ink: &Vec3| ink.distance_squared(colour);
    let best = inks
        .iter()
        .enumerate()
        .min_by(|a, b| off(a.1).total_cmp(&off(b.1)));
    best.map_or(0, |(i, _)| i)
}
