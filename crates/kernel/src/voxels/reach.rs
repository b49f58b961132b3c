//! How far around every voxel a bound on the extinction holds.

use super::voxel_words::{MOST, REACH_CODES, bound_code, bound_of, steps_of};
use glam::{UVec3, Vec3};
use organza_basis::{Aabb, CellGrid};
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
///
/// Bounds are compared by their codes, of which there are few: the greatest code
/// is that of the greatest bound, and flights are a table.
pub fn surroundings(
    cell_grid: &CellGrid,
    bounds: impl Iterator<Item = f32>,
    path_mm: f32,
) -> Vec<Surroundings> {
    surroundings_within(cell_grid, 0, bounds, path_mm)
}

/// The same for matter of which a place looks up voxels up to `apart` steps away, along
/// axes or diagonals.
pub fn surroundings_within(
    cell_grid: &CellGrid,
    apart: u32,
    bounds: impl Iterator<Item = f32>,
    path_mm: f32,
) -> Vec<Surroundings> {
    let mut within: Vec<u8> = bounds.map(|bound| bound_code(bound) as u8).collect();
    for _ in 0..apart {
        spread_maximum(cell_grid, &mut within, 1);
    }
    best_reaches(cell_grid, within, path_mm, usize::MAX)
}

/// Greatest reach of a voxel of a block: voxels around a block that are looked at.
const MOST_STEPS_IN_BLOCKS: u32 = 8;

/// The surroundings of every voxel of the blocks of a cloth, of which the grid is that of one.
/// Around a block, in x and y, any of the blocks may lie, and bounds hold for all of them.
pub fn surroundings_in_blocks(
    cell_grid: &CellGrid,
    bounds: impl Iterator<Item = f32>,
    path_mm: f32,
) -> Vec<Surroundings> {
    let dims = cell_grid.dims();
    let voxels = dims.element_product() as usize;
    let codes: Vec<u8> = bounds.map(|bound| bound_code(bound) as u8).collect();
    let mut any = vec![0u8; voxels];
    for block in codes.chunks_exact(voxels) {
        for (any, &code) in any.iter_mut().zip(block) {
            *any = code.max(*any);
        }
    }
    let pad = UVec3::new(MOST_STEPS_IN_BLOCKS, MOST_STEPS_IN_BLOCKS, 0);
    let padded = dims + 2 * pad;
    let box_mm = Aabb::new(Vec3::ZERO, padded.as_vec3() * cell_grid.voxel_mm());
    let Some(around) = CellGrid::new(box_mm, padded, false) else {
        return Vec::new();
    };
    let place = |c: UVec3, dims: UVec3| (c.x + dims.x * (c.y + dims.y * c.z)) as usize;
    let blocks = codes.par_chunks_exact(voxels);
    let of_block = |block: &[u8]| {
        let mut within = Vec::with_capacity(padded.element_product() as usize);
        for z in 0..padded.z {
            for y in 0..padded.y {
                for x in 0..padded.x {
                    let c = UVec3::new(x, y, z);
                    let inside = c.cmpge(pad).all() && c.cmplt(pad + dims).all();
                    let here = if inside { block } else { &any };
                    // A whole number of blocks more, so that nothing is negative.
                    let at = c + dims * pad - pad;
                    within.push(here[place(at % dims, dims)]);
                }
            }
        }
        let best = best_reaches(&around, within, path_mm, MOST_STEPS_IN_BLOCKS as usize);
        let rows = (0..dims.z).flat_map(move |z| (0..dims.y).map(move |y| UVec3::new(0, y, z)));
        rows.flat_map(|row| {
            let first = place(row + pad, padded);
            best[first..first + dims.x as usize].to_vec()
        })
        .collect::<Vec<_>>()
    };
    blocks.flat_map_iter(of_block).collect()
}

/// For every voxel, of the reaches of at most `most_steps` that with the longest flight, from
/// the codes of the voxels' bounds.
fn best_reaches(
    cell_grid: &CellGrid,
    mut within: Vec<u8>,
    path_mm: f32,
    most_steps: usize,
) -> Vec<Surroundings> {
    let dims = cell_grid.dims();
    let voxel_mm = cell_grid.voxel_mm().element_sum() / 3.0;
    let per_mm = 1.0 / (path_mm * MOST);
    let nowhere = Surroundings {
        bound_code: 255,
        reach_code: 0,
    };
    let mut best = vec![(0.0f32, nowhere); within.len()];
    let mut steps_before = 1;
    for code in REACH_CODES {
        let steps = steps_of(code);
        if steps > (dims.max_element() as usize).min(most_steps) {
            break;
        }
        spread_maximum(cell_grid, &mut within, steps - steps_before);
        steps_before = steps;
        let way_mm = (steps as f32 - 0.5) * voxel_mm;
        let flights_mm: [f32; 256] = std::array::from_fn(|bound_code| {
            let depth = bound_of(bound_code as u32) * per_mm * way_mm;
            (way_mm + path_mm) / (1.0 + depth)
        });
        let rows = best.par_chunks_mut(dims.x as usize);
        let rows = rows.zip(within.par_chunks(dims.x as usize));
        rows.for_each(|(best, within)| {
            for (best, &bound_code) in best.iter_mut().zip(within) {
                let flight_mm = flights_mm[usize::from(bound_code)];
                if flight_mm > best.0 {
                    let found = Surroundings {
                        bound_code,
                        reach_code: code as u8,
                    };
                    *best = (flight_mm, found);
                }
            }
        });
    }
    best.into_iter().map(|(_, found)| found).collect()
}

/// Replaces every value by the greatest of those `by` steps away and its own,
/// along each axis in turn: from the greatest within n steps, those within
/// `n + by`, if `by` is at most n (or one).
fn spread_maximum(cell_grid: &CellGrid, values: &mut Vec<u8>, by: usize) {
    if by == 0 {
        return;
    }
    let dims = cell_grid.dims();
    let n = [dims.x as usize, dims.y as usize, dims.z as usize];
    for axis in 0..3 {
        let wraps = cell_grid.repeats() && axis < 2;
        // Beyond the border there is the other side, or nothing more.
        let count = n[axis];
        let by = if wraps { by % count } else { by.min(count - 1) };
        let shifted = |i: usize, forth: bool| match (wraps, forth) {
            (true, true) => (i + by) % n[axis],
            (true, false) => (i + n[axis] - by) % n[axis],
            (false, true) => (i + by).min(n[axis] - 1),
            (false, false) => i.saturating_sub(by),
        };
        let old = &values[..];
        let row = |y: usize, z: usize| &old[(z * n[1] + y) * n[0]..][..n[0]];
        let mut new = vec![0u8; old.len()];
        new.par_chunks_mut(n[0]).enumerate().for_each(|(at, out)| {
            let (y, z) = (at % n[1], at / n[1]);
            let own = row(y, z);
            if axis == 0 {
                // Apart where neighbours lie inside the row, for whole rows at a time.
                out.copy_from_slice(own);
                let raise = |out: &mut [u8], own: &[u8]| {
                    for (out, &own) in out.iter_mut().zip(own) {
                        *out = own.max(*out);
                    }
                };
                let (inside, last) = (n[0] - by, n[0] - 1);
                raise(&mut out[..inside], &own[by..]);
                raise(&mut out[by..], &own[..inside]);
                if wraps {
                    raise(&mut out[inside..], &own[..by]);
                    raise(&mut out[..by], &own[inside..]);
                } else {
                    out[inside..]
                        .iter_mut()
                        .for_each(|o| *o = own[last].max(*o));
                    out[..by].iter_mut().for_each(|o| *o = own[0].max(*o));
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
