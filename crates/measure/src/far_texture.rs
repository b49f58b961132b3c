//! The texture of a far-field table, measured by paths from every texel.
//!
//! Paths are seen from directions that are drawn like those of [`measure_node`](crate::measure_node),
//! with the nodes of few rings, at places that are spread evenly over the texels of a period.
//! What they find is a matrix: a row for each texel, a column for each pair of nodes and each
//! channel. Its rows differ from their mean by the texture and by noise. The noise of each column is
//! measured from the squares of its contributions; with columns in units of it, the components
//! that stand out of the noise ([`components`]) are the images of the texture.

use crate::low_rank::components;
use crate::{Exit, MeasureError, PatchResponse, PathNames, PathRun};
use glam::{Vec2, Vec3};
use nalgebra::DMatrix;
use organza_basis::PathRng;
use organza_surface::table::{Rings, TextureLayout, TextureParts};
use organza_transport::Stats;

/// What paths from one node found at every texel: sums over paths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TexelSums {
    /// Paths from each texel.
    pub paths: f64,
    /// Paths from each texel that met nothing.
    pub straight: Vec<f32>,
    /// Scattered light: for each texel the nodes of the sphere, for each channel.
    pub scattered: Vec<[f32; 3]>,
    /// Squares of the contributions to each node, over all texels.
    pub squares: Vec<[f64; 3]>,
}

/// The rings between which textures are interpolated: those of the eye and of the light.
pub fn texture_rings() -> [Rings; 2] {
    let eye = [
        (0.0, 1),
        (20.0, 8),
        (40.0, 12),
        (60.0, 14),
        (78.0, 12),
        (90.0, 6),
    ];
    let light = [(0.0, 1), (30.0, 6), (55.0, 8), (75.0, 8), (90.0, 6)];
    let of = |degrees: &[(f32, u32)]| {
        let rings = degrees
            .iter()
            .map(|(theta, count)| (theta.to_radians(), *count));
        Rings::new(&rings.collect::<Vec<_>>()).unwrap_or_else(Rings::usual)
    };
    [of(&eye), of(&light)]
}

/// Streams of random numbers that belong to nodes of textures.
const TEXTURE_STREAMS: u64 = 3 << 57;
/// Paths that are traced together, which bounds memory.
const AT_ONCE: u64 = 1 << 14;

/// Traces `per_texel` paths from a node at every texel.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_texels(
    patch: &impl PatchResponse,
    [eye, light]: [&Rings; 2],
    layout: &TextureLayout,
    node: usize,
    per_texel: u64,
    seed: u64,
) -> Result<(TexelSums, Stats), MeasureError> {
    let (n, texels) = (light.sphere(), layout.texels());
    let mut sums = TexelSums {
        paths: per_texel as f64,
        straight: vec![0.0; texels],
        scattered: vec![[0.0; 3]; texels * n],
        squares: vec![[0.0; 3]; n],
    };
    let (mut stats, mut rejected) = (Stats::default(), 0);
    let start = |path: u64, rng: &mut PathRng| -> (Vec2, Vec3) {
        let w = eye.draw(node, rng);
        let texel = (path % texels as u64) as usize;
        let place = layout.place_mm(texel, rng.unit2());
        (layout.middle_from_texels(place, w), w)
    };
    let total = per_texel * texels as u64;
    for first in (0..total).step_by(AT_ONCE as usize) {
        let names = PathNames::new(
            seed,
            TEXTURE_STREAMS + node as u64,
            first..(first + AT_ONCE).min(total),
        );
        let mut path = first;
        let mut found = |exit: Exit| {
            let texel = (path % texels as u64) as usize;
            path += 1;
            let Some((to, weight)) = exit.finite(&mut rejected) else {
                return;
            };
            if exit.is_straight {
                sums.straight[texel] += 1.0;
                return;
            }
            let hats = light.hats(to);
            for (at, share) in hats.nodes.iter().zip(hats.values) {
                let value = (weight.0 * share).to_array();
                let slot = &mut sums.scattered[texel * n + *at as usize];
                slot.iter_mut().zip(value).for_each(|(s, v)| *s += v);
                let square = &mut sums.squares[*at as usize];
                let pairs = square.iter_mut().zip(value);
                pairs.for_each(|(s, v)| *s += f64::from(v * v));
            }
        };
        let run = PathRun::new(&names, &mut stats, &mut found);
        patch.each_exit_at(&start, run);
    }
    stats.rejected += rejected;
    MeasureError::check(&stats)?;
    Ok((sums, stats))
}

/// Values at pairs of nodes, for each channel, smoothed by the hats of both nodes.
fn smoothed(values: &[f32], [eye, light]: &[Vec<Vec<(u32, f64)>>; 2]) -> Vec<f32> {
    let (n, m) = (eye.len(), light.len());
    let mut half = vec![0.0f32; values.len()];
    for a in 0..n {
        for (b, list) in light.iter().enumerate() {
            for c in 0..3 {
                let terms = list
                    .iter()
                    .map(|&(to, share)| values[(a * m + to as usize) * 3 + c] * share as f32);
                half[(a * m + b) * 3 + c] = terms.sum();
            }
        }
    }
    let mut full = vec![0.0f32; values.len()];
    for (a, list) in eye.iter().enumerate() {
        for &(from, share) in list {
            let row = from as usize * 3 * m;
            let to = a * 3 * m;
            for i in 0..3 * m {
                full[to + i] += half[row + i] * share as f32;
            }
        }
    }
    full
}

/// Steps that undo the smoothing between the nodes: each adds what smoothing takes from the
/// functions. More steps fit the noise of pairs of nodes that little light connects.
const SHARPENING: usize = 2;
/// The largest value of an image in the file.
const IMAGE_UNIT: f32 = 32767.0;
/// The largest value of a function in the file.
const FUNCTION_UNIT: f32 = 127.0;

/// The texture of the sums of all nodes with at most `most` images, and how far each stands out of
/// the noise (1 at its edge). `None` unless there are sums for every node of the sphere.
pub fn far_texture(
    [eye, light]: [&Rings; 2],
    layout: &TextureLayout,
    nodes: &[TexelSums],
    most: usize,
    seed: u64,
) -> Option<(TextureParts, Vec<f64>)> {
    let (n, m, half, texels) = (
        eye.sphere(),
        light.sphere(),
        eye.hemisphere(),
        layout.texels(),
    );
    let complete = |s: &TexelSums| s.paths > 0.0 && s.scattered.len() == texels * m;
    if nodes.len() != n || !nodes.iter().all(complete) {
        return None;
    }
    // Column (a m + b) 3 + c: means over texels, and the deviation of a texel's noise.
    let columns = 3 * n * m;
    let (mut means, mut noises) = (vec![0.0f32; columns], vec![0.0f32; columns]);
    let per_column = means
        .chunks_exact_mut(3 * m)
        .zip(noises.chunks_exact_mut(3 * m));
    for (sums, (means, noises)) in nodes.iter().zip(per_column) {
        let paths = sums.paths * texels as f64;
        for b in 0..m {
            for c in 0..3 {
                let all: f64 = (0..texels)
                    .map(|x| f64::from(sums.scattered[x * m + b][c]))
                    .sum();
                let mean = all / paths;
                let variance = (sums.squares[b][c] / paths - mean * mean).max(0.0);
                means[3 * b + c] = mean as f32;
                noises[3 * b + c] = (variance / sums.paths).sqrt() as f32;
            }
        }
    }
    let matrix = DMatrix::from_fn(texels, columns, |x, column| {
        let (a, rest) = (column / (3 * m), column % (3 * m));
        let value = nodes[a].scattered[x * m + rest / 3][rest % 3] / nodes[a].paths as f32;
        let noise = noises[column];
        if noise > 0.0 {
            (value - means[column]) / noise
        } else {
            0.0
        }
    });
    let found = components(&matrix, most, seed);
    let overlaps = [eye.overlaps(), light.overlaps()];
    drop(matrix);
    let rank = found.len();
    let mut images = vec![0i16; texels * rank];
    let mut scales = vec![0.0f32; rank * n];
    let mut functions = vec![[0i8; 3]; rank * n * m];
    for (k, part) in found.iter().enumerate() {
        let sizes = part.left.iter().map(|v| v.abs());
        let largest = sizes.fold(0.0f32, f32::max).max(1e-20);
        for (x, v) in part.left.iter().enumerate() {
            images[x * rank + k] = (v / largest * IMAGE_UNIT).round() as i16;
        }
        // Over the table's value.
        let smooth: Vec<f32> = (0..columns)
            .map(|column| match means[column] > 0.0 {
                true => part.right[column] * noises[column] / means[column] * largest,
                false => 0.0,
            })
            .collect();
        let mut sharp = smooth.clone();
        for _ in 0..SHARPENING {
            let again = smoothed(&sharp, &overlaps);
            let terms = smooth.iter().zip(again);
            let pairs = sharp.iter_mut().zip(terms);
            pairs.for_each(|(s, (m, a))| *s += m - a);
        }
        let ratio = |column: usize| sharp[column];
        for a in 0..n {
            let row = 3 * m * a..3 * m * (a + 1);
            let scale = row.clone().map(|i| ratio(i).abs()).fold(0.0f32, f32::max);
            scales[k * n + a] = scale;
            for column in row.filter(|_| scale > 0.0) {
                let (b, c) = (column % (3 * m) / 3, column % 3);
                let value = (ratio(column) / scale * FUNCTION_UNIT).round();
                functions[(k * n + a) * m + b][c] = value as i8;
            }
        }
    }
    let share = |x: usize, a: usize| f64::from(nodes[a].straight[x]) / nodes[a].paths;
    let gaps = (0..texels).flat_map(|x| (0..half).map(move |a| (x, a)));
    let texture = TextureParts {
        eye: eye.clone(),
        light: light.clone(),
        layout: *layout,
        gaps: gaps
            .map(|(x, a)| (255.0 * share(x, a)).round() as u8)
            .collect(),
        images,
        scales,
        functions,
    };
    Some((texture, found.iter().map(|c| c.strength).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DrawNumbered, PatchResponse};
    use organza_basis::Rgb;
    use organza_scatter::Footprint;
    use organza_surface::table::Texture;
    use rayon::prelude::*;

    /// White sheets in stripes across the weft: on the left they reflect 0.8 and have no gaps, on
    /// the right 0.1 with gaps of a half.
    struct Stripes;

    const LAYOUT: TextureLayout = TextureLayout {
        size: glam::UVec2::new(8, 2),
        origin_mm: Vec2::ZERO,
        period_mm: Vec2::new(2.0, 0.5),
        heights_mm: [0.0; 2],
    };

    impl PatchResponse for Stripes {
        fn estimate_bsdf(&self, _: Vec3, _: Vec3, _: &mut PathRng, _: &mut Stats) -> Rgb {
            Rgb::BLACK
        }

        fn estimate_exit(&self, _: Vec3, _: &mut PathRng, _: &mut Stats) -> Exit {
            Exit::default()
        }

        fn each_exit_at(&self, start: &DrawNumbered<'_, (Vec2, Vec3)>, run: PathRun<'_, Exit>) {
            for path in run.names.paths.clone() {
                let mut rng = run.names.rng(path);
                let (place, w) = start(path, &mut rng);
                let is_left = place.x.rem_euclid(2.0) < 1.0;
                let is_straight = !is_left && rng.unit() < 0.5;
                let up = organza_basis::warp::cosine_hemisphere(rng.unit2());
                let to = Vec3::new(up.x, up.y, up.z.max(1e-4).copysign(w.z));
                let albedo = if is_left { 0.8 } else { 0.2 };
                let sent = if is_straight { (-w, 1.0) } else { (to, albedo) };
                (run.found)(Exit {
                    escape: Some((sent.0, Rgb::splat(sent.1))),
                    is_straight,
                    absorbed: Rgb::BLACK,
                });
            }
        }
    }

    #[test]
    fn planted_stripes_are_found_again() {
        let [eye, light] = &texture_rings();
        let sums: Vec<TexelSums> = (0..eye.sphere())
            .into_par_iter()
            .map(|node| {
                measure_texels(&Stripes, [eye, light], &LAYOUT, node, 256, 5)
                    .unwrap()
                    .0
            })
            .collect();
        let (parts, strengths) = far_texture([eye, light], &LAYOUT, &sums, 8, 1).unwrap();
        // One image holds two kinds of places.
        assert_eq!(strengths.len(), 1, "seed 5: {strengths:?}");
        let texture = Texture::new(&parts).unwrap();
        let mut rng = PathRng::from_seed(6);
        for _ in 0..100 {
            let mut above = || organza_basis::warp::cosine_hemisphere(rng.unit2());
            let [a, b] = [above(), above()].map(|w| Vec3::new(w.x, w.y, w.z.max(0.05)).normalize());
            let at = |x: f32| Footprint::point(Vec2::new(x, 0.2));
            let [left, right] = [0.5, 1.5].map(|x| texture.ratio(a, b, at(x)).0.x);
            // 0.8 and 0.1 over their mean, 0.45. A function has one part in 20 of noise: 4096
            // paths from a node, of which a pair of nodes gets one in 30.
            assert!((left - 1.778).abs() < 0.25, "seeds 5, 6: {left} {a} {b}");
            assert!((right - 0.222).abs() < 0.25, "seeds 5, 6: {right} {a} {b}");
            // The twin without texture has one.
            assert!((left - 1.0).abs() > 0.25 && (right - 1.0).abs() > 0.25);
            let [closed, open] = [0.5, 1.5].map(|x| texture.gap(a, 0.25, at(x)));
            assert!(closed < 4.0 * f32::EPSILON, "seeds 5, 6: {closed}");
            assert!((open - 0.5).abs() < 0.05, "seeds 5, 6: {open}");
        }
    }
}
