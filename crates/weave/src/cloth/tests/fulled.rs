//! Fulled cloth: its fibres lie in the openings, and none is lost.

use super::irregular::irregular;
use super::*;
use std::f64::consts::PI;

const SEED: u64 = 7;

/// An open plain weave of wool without hairs.
fn fulled(degree: Option<f64>) -> Cloth {
    let fulling = degree.map_or(String::new(), |d| format!("fulling = {d}"));
    let mut fabric = irregular(
        3,
        &format!(
            "preset = 'wool'\ntex = 60\nhairiness = {{ index = 0, length_mm = 1, reach_mm = 0.1 }}\n\
             {fulling}"
        ),
    );
    (fabric.warp.per_cm, fabric.weft.per_cm) = (Some(11.0), Some(11.0));
    Cloth::build(&fabric, &no_files, SEED).unwrap()
}

fn volume_mm3(all: &[Segment]) -> f64 {
    let piece = |s: &Segment| {
        let radius = 0.5 * (s.start_radius_mm + s.end_radius_mm);
        PI * f64::from(s.length_mm() * radius * radius)
    };
    all.iter().map(piece).sum()
}

/// Share of the cloth through which a perpendicular line meets no fibre: light that goes straight
/// through.
fn open_share(cloth: &Cloth) -> f64 {
    const CELL_MM: f32 = 0.01;
    let period = cloth.tile().period_mm();
    let counts = (period / CELL_MM).as_ivec2();
    let mut covered = vec![false; (counts.x * counts.y) as usize];
    for s in segments(cloth) {
        let steps = (s.length_mm() / CELL_MM).ceil().max(1.0) as i32;
        for i in 0..=steps {
            let at = s.start_mm.lerp(s.end_mm, i as f32 / steps as f32);
            let radius = s.start_radius_mm;
            let low = ((at.truncate() - radius) / CELL_MM).ceil().as_ivec2();
            let high = ((at.truncate() + radius) / CELL_MM).floor().as_ivec2();
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let [x, y] = [x.rem_euclid(counts.x), y.rem_euclid(counts.y)];
                    covered[(y * counts.x + x) as usize] = true;
                }
            }
        }
    }
    let open = covered.iter().filter(|c| !**c).count();
    open as f64 / covered.len() as f64
}

/// Share of the fibre that lies outside of all yarns.
fn outside(cloth: &Cloth, openings: &Openings) -> f64 {
    let (mut out, mut all) = (0.0, 0.0);
    for s in segments(cloth) {
        let middle = (0.5 * (s.start_mm + s.end_mm)).as_dvec3();
        all += f64::from(s.length_mm());
        out += f64::from(s.length_mm()) * f64::from(u8::from(openings.at(middle).0 > 1.0));
    }
    out / all
}

#[test]
fn fulling_closes_the_openings_and_keeps_the_fibre() {
    let [none, half, whole] = [None, Some(0.5), Some(1.0)].map(fulled);
    let before = volume_mm3(&segments(&none));
    for (degree, cloth) in [(0.5, &half), (1.0, &whole)] {
        let share = volume_mm3(&segments(cloth)) / before;
        // Where a fibre is cut, half a step may be lost.
        assert!((share - 1.0).abs() < 5e-3, "{degree}, seed {SEED}: {share}");
        let openings = cloth.openings.as_ref().unwrap();
        let [before, after] = [&none, cloth].map(|c| outside(c, openings));
        // Half of the fibres at most leave, and most of their length is outside of yarns.
        let left = after - before;
        assert!(
            (0.5 * 0.5 * degree..0.5 * degree).contains(&left),
            "{degree}, seed {SEED}: {left}"
        );
    }
    let open = [&none, &half, &whole].map(open_share);
    assert!(
        open[0] > 1.5 * open[1] && open[1] > 1.5 * open[2],
        "seed {SEED}: {open:?}"
    );
    // All lies within the heights of the tile.
    let bounds = whole.tile().bounds_mm;
    for s in segments(&whole) {
        assert!(s.start_mm.z > bounds.min.z && s.start_mm.z < bounds.max.z);
    }
}

#[test]
fn a_cloth_that_is_not_fulled_is_the_same_as_before() {
    let [none, zero] = [None, Some(0.0)].map(fulled);
    assert_eq!(segments(&none), segments(&zero));
    assert!(none.openings.is_none());
    // And equal seeds give equal felt.
    let [a, b] = [Some(0.7), Some(0.7)].map(fulled);
    assert_eq!(segments(&a), segments(&b));
}

/// Where a stretch leaves the yarn, felt goes on: every piece of felt begins where a fibre ends.
#[test]
fn felt_begins_where_fibres_end() {
    let cloth = fulled(Some(0.6));
    let mut found = 0;
    for batch in 0..cloth.batch_count() {
        let mut curves: Vec<(Segment, Segment)> = Vec::new();
        cloth.for_each_in_batch(batch, &mut |s| match curves.last_mut() {
            Some((_, last)) if last.fibre == s.fibre && last.end_mm == s.start_mm => *last = *s,
            _ => curves.push((*s, *s)),
        });
        for (first, _) in &curves {
            let ends = |c: &(Segment, Segment)| c.1.end_mm == first.start_mm;
            found += usize::from(curves.iter().any(ends));
        }
    }
    assert!(found > 100, "{found}");
}

#[test]
fn degrees_beyond_one_are_refused() {
    let words = "yarn.cotton.fulling: expected a number from 0 to 1, found 1.5";
    assert_contains(&refusal(&irregular(1, "fulling = 1.5")), words);
}
