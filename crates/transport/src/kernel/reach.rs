//! How far around every voxel a bound on the extinction holds.

use super::voxel_words::{MOST, REACH_CODES, bound_code, bound_of, steps_of};
use crate::Lattice;
use rayon::prelude::*;

/// The codes of the reach of a voxel and of the bound there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Surroundings {
    pub bound_code: u8,
    pub reach_code: u8,
}

/// The surroundings of every voxel, from its own bound as a share of the
/// greatest, for a mean free path of so many mm at the [greatest](MOST) bound.
///
/// Of the reaches tried, that with the longest flight on average: one that
/// begins at the bound `b` and goes on, after the way `d` to the border of the
/// reach, at the greatest is about `(d + greatest path) / (1 + b d)` long; the
/// border is half a voxel less than the reach away on average.
pub fn surroundings(lattice: &Lattice, bounds: Vec<f32>, path_mm: f32) -> Vec<Surroundings> {
    let dims = lattice.dims();
    let voxel_mm = lattice.voxel_mm().element_sum() / 3.0;
    let per_mm = 1.0 / (path_mm * MOST);
    let mut within = bounds;
    let nowhere = Surroundings {
        bound_code: 255,
        reach_code: 0,
    };
    let mut best = vec![(0.0f32, nowhere); within.len()];
    let mut steps_before = 1;
    for code in REACH_CODES {
        let steps = steps_of(code);
        if steps > dims.max_element() as usize {
            break;
        }
        spread_maximum(lattice, &mut within, steps - steps_before);
        steps_before = steps;
        let way_mm = (steps as f32 - 0.5) * voxel_mm;
        best.par_iter_mut().zip(&within).for_each(|(best, &bound)| {
            let bound_code = bound_code(bound);
            let depth = bound_of(bound_code) * per_mm * way_mm;
            let flight_mm = (way_mm + path_mm) / (1.0 + depth);
            if flight_mm > best.0 {
                let found = Surroundings {
                    bound_code: bound_code as u8,
                    reach_code: code as u8,
                };
                *best = (flight_mm, found);
            }
        });
    }
    best.into_iter().map(|(_, found)| found).collect()
}

/// Replaces every value by the greatest of those `by` steps away and its own,
/// along each axis in turn: from the greatest within n steps, those within
/// `n + by`, if `by` is at most n (or one).
fn spread_maximum(lattice: &Lattice, values: &mut Vec<f32>, by: usize) {
    if by == 0 {
        return;
    }
    let dims = lattice.dims();
    let n = [dims.x as usize, dims.y as usize, dims.z as usize];
    for axis in 0..3 {
        let wraps = lattice.repeats() && axis < 2;
        // Index of the neighbour `by` steps away, or the place itself.
        let shifted = |i: usize, forth: bool| match (wraps, forth) {
            (true, true) => (i + by) % n[axis],
            (true, false) => (i + n[axis] - by % n[axis]) % n[axis],
            (false, true) => (i + by).min(n[axis] - 1),
            (false, false) => i.saturating_sub(by),
        };
        let old = &values[..];
        let row = |y: usize, z: usize| &old[(z * n[1] + y) * n[0]..][..n[0]];
        let mut new = vec![0.0f32; old.len()];
        new.par_chunks_mut(n[0]).enumerate().for_each(|(at, out)| {
            let (y, z) = (at % n[1], at / n[1]);
            let own = row(y, z);
            if axis == 0 {
                for (x, out) in out.iter_mut().enumerate() {
                    let sides = own[shifted(x, true)].max(own[shifted(x, false)]);
                    *out = own[x].max(sides);
                }
                return;
            }
            let side = |forth| match axis {
                1 => row(shifted(y, forth), z),
                _ => row(y, shifted(z, forth)),
            };
            let sides = side(true).iter().zip(side(false));
            for (out, (&own, (&a, &b))) in out.iter_mut().zip(own.iter().zip(sides)) {
                *out = own.max(a.max(b));
            }
        });
        *values = new;
    }
}
