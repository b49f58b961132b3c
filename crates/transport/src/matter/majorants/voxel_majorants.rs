//! A majorant of every voxel and what is within reach of it, in one byte each.
//!
//! Trackers ask before they look a voxel up: most tentative collisions at a
//! node's majorant are empty, and a byte encodes that.

use glam::{IVec3, UVec3, Vec3};
use organza_basis::CellGrid;
use rayon::prelude::*;

/// Steps of the code in one octave: a bound is at most 4.4 % above what it
/// bounds.
const PER_OCTAVE: f32 = 16.0;

/// Majorants of the voxels of a cell grid, 1/mm.
pub struct VoxelMajorants {
    cell_grid: CellGrid,
    codes: Vec<u8>,
    /// Of every code; zero means nothing.
    majorants_per_mm: Vec<f32>,
}

impl VoxelMajorants {
    /// For every voxel the greatest of `extinction_per_mm` at most `reach` voxels
    /// away along each axis, rounded up.
    pub fn new(
        cell_grid: CellGrid,
        reach: IVec3,
        extinction_per_mm: impl Fn(UVec3) -> f32 + Sync,
    ) -> VoxelMajorants {
        let dims = cell_grid.dims();
        let area = dims.x as usize * dims.y as usize;
        let cells = |z| (0..area as u32).map(move |i| UVec3::new(i % dims.x, i / dims.x, z));
        let greatest = (0..dims.z)
            .into_par_iter()
            .map(|z| cells(z).map(&extinction_per_mm).fold(0.0f32, f32::max))
            .reduce(|| 0.0, f32::max);
        // A hair above, so that the last code bounds the greatest.
        let most = greatest * (1.0 + 1e-5);
        let mut majorants_per_mm: Vec<f32> = (0..=255)
            .map(|code| most * ((code - 255) as f32 / PER_OCTAVE).exp2())
            .collect();
        majorants_per_mm[0] = 0.0;
        let code = |value: f32| {
            if value <= 0.0 {
                return 0;
            }
            let below_most = ((most / value).log2() * PER_OCTAVE).floor();
            255 - below_most.clamp(0.0, 254.0) as u8
        };
        let mut codes = vec![0u8; area * dims.z as usize];
        let layers = codes.par_chunks_mut(area).zip(0..dims.z);
        layers.for_each(|(layer, z)| {
            for (out, cell) in layer.iter_mut().zip(cells(z)) {
                *out = code(extinction_per_mm(cell));
            }
        });
        for axis in 0..3 {
            spread(&cell_grid, &mut codes, axis, reach[axis]);
        }
        VoxelMajorants {
            cell_grid,
            codes,
            majorants_per_mm,
        }
    }

    /// The majorant at a local point.
    #[inline]
    pub fn at(&self, p: Vec3) -> f32 {
        let (c, dims) = (self.cell_grid.cell(p), self.cell_grid.dims());
        let place = (c.z as usize * dims.y as usize + c.y as usize) * dims.x as usize;
        self.majorants_per_mm[usize::from(self.codes[place + c.x as usize])]
    }
}

/// Replaces every code by the greatest at most `reach` away along an axis.
fn spread(cell_grid: &CellGrid, codes: &mut Vec<u8>, axis: usize, reach: i32) {
    if reach == 0 {
        return;
    }
    let dims = cell_grid.dims().as_usizevec3();
    let n = dims[axis];
    let wraps = cell_grid.repeats() && axis < 2;
    let old = &codes[..];
    let row = |y: usize, z: usize| &old[(z * dims.y + y) * dims.x..][..dims.x];
    let mut new = vec![0u8; old.len()];
    let rows = new.par_chunks_mut(dims.x).enumerate();
    rows.for_each(|(at, out)| {
        let (y, z) = (at % dims.y, at / dims.y);
        if axis == 0 {
            let own = row(y, z);
            raise(out, own);
            for by in 1..=reach as usize {
                let by = if wraps { by % n } else { by.min(n) };
                raise(&mut out[..n - by], &own[by..]);
                raise(&mut out[by..], &own[..n - by]);
                if wraps {
                    raise(&mut out[n - by..], &own[..by]);
                    raise(&mut out[..by], &own[n - by..]);
                }
            }
            return;
        }
        let here = if axis == 1 { y } else { z } as i32;
        for c in here - reach..=here + reach {
            let c = if wraps { c.rem_euclid(n as i32) } else { c };
            if (0..n as i32).contains(&c) {
                let c = c as usize;
                raise(out, if axis == 1 { row(c, z) } else { row(y, c) });
            }
        }
    });
    *codes = new;
}

/// Raises every value to at least that of the same place in `to`.
fn raise(values: &mut [u8], to: &[u8]) {
    for (value, &to) in values.iter_mut().zip(to) {
        *value = to.max(*value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::{Aabb, PathRng};

    #[test]
    fn majorants_are_the_greatest_within_reach_and_hardly_more() {
        let dims = UVec3::new(9, 7, 5);
        let mut rng = PathRng::from_seed(31);
        let values: Vec<f32> = (0..dims.element_product())
            .map(|_| (8.0 * rng.unit() - 4.0).exp2() * f32::from(rng.unit() < 0.3))
            .collect();
        let value = |c: UVec3| values[((c.z * dims.y + c.y) * dims.x + c.x) as usize];
        for repeats in [false, true] {
            let bounds_mm = Aabb::new(Vec3::ZERO, dims.as_vec3() * 0.01);
            let cell_grid = CellGrid::new(bounds_mm, dims, repeats).unwrap();
            let reach = IVec3::new(2, 1, 1);
            let majorants = VoxelMajorants::new(cell_grid, reach, value);
            for _ in 0..2000 {
                let p = Vec3::new(rng.unit(), rng.unit(), rng.unit()) * dims.as_vec3();
                let mut expected = 0.0f32;
                for x in -reach.x..=reach.x {
                    for y in -reach.y..=reach.y {
                        for z in -reach.z..=reach.z {
                            let c = p.floor().as_ivec3() + IVec3::new(x, y, z);
                            let inside =
                                c.cmpge(IVec3::ZERO).all() && c.cmplt(dims.as_ivec3()).all();
                            if inside || repeats && (0..dims.z as i32).contains(&c.z) {
                                let c = c.rem_euclid(dims.as_ivec3()).as_uvec3();
                                expected = expected.max(value(c));
                            }
                        }
                    }
                }
                let bound = majorants.at(p);
                assert!(bound >= expected, "seed 31, {p}: {bound}, {expected}");
                assert!(bound <= 1.05 * expected, "seed 31, {p}: {bound} {expected}");
            }
        }
    }
}
