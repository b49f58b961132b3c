//! The grid of finest voxels that a tile is cut into.

use crate::Error;
use glam::{DVec3, UVec2, UVec3, Vec3};
use organza_basis::{Aabb, Tile};

/// Most levels of an octree: sums of 8^7 voxels still leave eleven bits of
/// length to the finest.
pub const MAX_LEVELS: u8 = 8;

/// Most voxels along one axis.
const MAX_DIM: f64 = 1_048_576.0;

/// By how much voxels may be larger or smaller than asked for so that a tile has more levels, as
/// a share; and where each of many parts of a tile is to be whole voxels.
const MOST_STRETCH: f64 = 0.1;
const MOST_STRETCH_OF_PARTS: f64 = 0.15;

/// A regular grid whose counts are multiples of the coarsest voxel, so that
/// every level covers the same box with whole voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Least corner.
    pub min_mm: DVec3,
    /// Edges of the finest voxel.
    pub voxel_mm: DVec3,
    /// Finest voxels along each axis.
    pub dims: UVec3,
    /// Number of levels.
    pub levels: u8,
    /// True when x and y wrap.
    pub repeats: bool,
}

impl Lattice {
    /// Cuts a tile into voxels of about `voxel_mm`.
    ///
    /// A period is divided exactly into whole voxels of the coarsest level, so that voxels
    /// become larger or smaller than requested; other extents are padded evenly on both sides.
    /// If `levels` is not given, the number of levels is the largest, up to six, that the tile
    /// can use and that changes voxels by at most a tenth. Where only a few voxels make a
    /// period, or `levels` is given, the change may be larger.
    pub fn new(tile: &Tile, voxel_mm: f32, levels: Option<u8>) -> Result<Lattice, Error> {
        Lattice::of_parts(tile, UVec2::ONE, voxel_mm, levels)
    }

    /// The same for a tile of so many equal parts along x and y, each of which becomes whole
    /// voxels of the coarsest level. Voxels may change a little more.
    pub fn of_parts(
        tile: &Tile,
        parts: UVec2,
        voxel_mm: f32,
        levels: Option<u8>,
    ) -> Result<Lattice, Error> {
        let voxel = f64::from(voxel_mm);
        if !(voxel.is_finite() && voxel > 0.0) {
            return Err(Error::Options(format!(
                "the voxel edge is {voxel_mm} mm; expected a positive number"
            )));
        }
        let (min, max) = (tile.bounds_mm.min.as_dvec3(), tile.bounds_mm.max.as_dvec3());
        let size = max - min;
        let flat = tile.repeats && size.truncate().min_element() <= 0.0;
        if !(min.is_finite() && max.is_finite() && size.cmpge(DVec3::ZERO).all()) || flat {
            return Err(Error::Tile(format!("{min} to {max} mm")));
        }
        if (size / voxel).max_element() > MAX_DIM {
            return Err(Error::Options(format!(
                "voxels of {voxel_mm} mm cut a tile of {size} mm into more than {MAX_DIM} along an axis"
            )));
        }
        let wraps = [tile.repeats, tile.repeats, false];
        let parts_of = parts.extend(1).as_dvec3();
        let most_stretch = if parts == UVec2::ONE {
            MOST_STRETCH
        } else {
            MOST_STRETCH_OF_PARTS
        };
        let fit = |levels: u8| -> Lattice {
            let block = f64::from(1u32 << (levels - 1));
            let mut fitted = Lattice {
                min_mm: min,
                voxel_mm: DVec3::splat(voxel),
                dims: UVec3::ONE,
                levels,
                repeats: tile.repeats,
            };
            for axis in 0..3 {
                let blocks = size[axis] / (voxel * block);
                if wraps[axis] {
                    let parts = parts_of[axis];
                    let n = (blocks / parts).round().max(1.0) * block * parts;
                    fitted.dims[axis] = n as u32;
                    fitted.voxel_mm[axis] = size[axis] / n;
                } else {
                    // Slightly less than the quotient, so that a box of exactly n voxels gets
                    // n.
                    let n = (blocks - 1e-6).ceil().max(1.0) * block;
                    fitted.dims[axis] = n as u32;
                    fitted.min_mm[axis] -= 0.5 * (n * voxel - size[axis]);
                }
            }
            fitted
        };
        // A table of bricks is indexed with 32 bits.
        let bricks = (size / (4.0 * voxel)).element_product();
        if bricks > 4e9 {
            return Err(Error::Options(format!(
                "voxels of {voxel_mm} mm cut a tile of {size} mm into more than an octree can address"
            )));
        }
        if let Some(levels) = levels {
            if !(1..=MAX_LEVELS).contains(&levels) {
                return Err(Error::Options(format!(
                    "{levels} levels; expected 1 to {MAX_LEVELS}"
                )));
            }
            return Ok(fit(levels));
        }
        let near = |l: &Lattice| {
            let stretch = l.voxel_mm / voxel - 1.0;
            stretch.abs().max_element() <= most_stretch
        };
        let useful = |l: &Lattice| (l.dims >> u32::from(l.levels - 1)).max_element() > 1;
        let chosen = (2..=6u8).rev().map(fit).find(|l| near(l) && useful(l));
        Ok(chosen.unwrap_or_else(|| fit(1)))
    }

    /// The box that the voxels fill.
    pub fn bounds_mm(&self) -> Aabb {
        let max = self.min_mm + self.voxel_mm * self.dims.as_dvec3();
        Aabb::new(self.min_mm.as_vec3(), max.as_vec3())
    }

    /// Voxels along each axis at a level.
    pub fn dims_at(&self, level: u8) -> UVec3 {
        self.dims >> u32::from(level)
    }

    /// Edges of a voxel at a level.
    pub fn voxel_at(&self, level: u8) -> DVec3 {
        self.voxel_mm * f64::from(1u32 << level)
    }

    /// Density that one quantum of length gives a cell of a level, mm / mm^3.
    pub fn density_of(&self, quantum_mm: f64, level: u8) -> f32 {
        (quantum_mm / self.voxel_at(level).element_product()) as f32
    }

    /// True for lattices that [`Lattice::new`] can make.
    pub fn is_sound(&self) -> bool {
        let block = 1 << (self.levels - 1);
        let dims = self.dims.to_array();
        self.min_mm.is_finite()
            && self.voxel_mm.is_finite()
            && self.voxel_mm.min_element() > 0.0
            && dims
                .iter()
                .all(|&n| n > 0 && n % block == 0 && f64::from(n) <= 2.0 * MAX_DIM)
            && bricks_across(self.dims).as_u64vec3().element_product() < u64::from(u32::MAX)
            && (self.min_mm + self.voxel_mm * self.dims.as_dvec3())
                .as_vec3()
                .is_finite()
    }

    /// Blocks along each axis.
    pub fn blocks_across(&self) -> UVec3 {
        (self.dims + (BLOCK - 1)) / BLOCK
    }

    /// Position in units of finest voxels from the least corner.
    pub fn grid_from_mm(&self, p_mm: Vec3) -> DVec3 {
        (p_mm.as_dvec3() - self.min_mm) / self.voxel_mm
    }
}

/// Bricks of 4 x 4 x 4 cells that cover so many cells.
pub fn bricks_across(dims: UVec3) -> UVec3 {
    (dims + 3) >> 2u32
}

/// Number of a brick in a grid of them: x fastest, then y, z.
#[inline]
pub fn brick_index(brick: UVec3, grid: UVec3) -> u32 {
    brick.x + grid.x * (brick.y + grid.y * brick.z)
}

/// The inverse of [`brick_index`].
pub fn brick_at(index: u32, grid: UVec3) -> UVec3 {
    let (x, rest) = (index % grid.x, index / grid.x);
    UVec3::new(x, rest % grid.y, rest / grid.y)
}

/// Bit of a cell in the masks of its brick; only the place in the brick counts.
#[inline]
pub fn bit_of(cell: UVec3) -> u32 {
    let c = cell & 3;
    c.x + 4 * c.y + 16 * c.z
}

/// Place of a bit in its brick: the inverse of [`bit_of`].
#[inline]
pub fn cell_of_bit(bit: u32) -> UVec3 {
    UVec3::new(bit & 3, bit >> 2 & 3, bit >> 4)
}

/// Voxels along an edge of a block. A block is filled and built up to the level at which it is
/// one brick in one pass. Its sums fit a second-level cache.
pub const BLOCK: u32 = 32;

/// Levels that are built block by block.
pub const LEVELS_IN_BLOCK: u8 = 4;

/// Voxels of a block.
pub const VOXELS: usize = (BLOCK * BLOCK * BLOCK) as usize;

/// Number of a voxel in its block: bricks of the block (x fastest, then y, z),
/// in each the bit of the voxel.
#[inline]
pub fn voxel_in_block(c: UVec3) -> u32 {
    let split = |c: u32, at: u32| (c >> 2) << (6 + 3 * at) | (c & 3) << (2 * at);
    split(c.x, 0) | split(c.y, 1) | split(c.z, 2)
}

/// The inverse of [`voxel_in_block`].
#[inline]
pub fn cell_in_block(voxel: u32) -> UVec3 {
    let brick = voxel >> 6;
    (UVec3::new(brick, brick >> 3, brick >> 6) & 7) * 4 + cell_of_bit(voxel & 63)
}

/// Place of the `i`-th of eight: x fastest, then y, z.
pub fn octant(i: u32) -> UVec3 {
    UVec3::new(i & 1, i >> 1 & 1, i >> 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(size: Vec3, repeats: bool) -> Tile {
        Tile {
            bounds_mm: Aabb::new(Vec3::ZERO, size),
            repeats,
        }
    }

    #[test]
    fn periods_are_cut_exactly_and_heights_are_padded() {
        for (x, y) in [(1.0, 1.0), (1.6, 0.93), (0.317, 2.2), (0.004, 0.1)] {
            let t = tile(Vec3::new(x, y, 0.4321), true);
            let l = Lattice::new(&t, 0.01, None).unwrap();
            let b = l.bounds_mm();
            assert!((b.max.x - x).abs() < 1e-6 && (b.max.y - y).abs() < 1e-6);
            assert!(b.min.z <= 0.0 && b.max.z >= 0.4321);
            assert!((b.min.z + b.max.z - 0.4321).abs() < 2.0 * f32::EPSILON);
            for level in 0..l.levels {
                assert_eq!(l.dims_at(level) << u32::from(level), l.dims);
            }
        }
    }

    #[test]
    fn voxels_of_a_block_are_numbered_brick_by_brick() {
        for voxel in 0..VOXELS as u32 {
            let c = cell_in_block(voxel);
            assert_eq!(voxel_in_block(c), voxel);
            assert_eq!(voxel & 63, bit_of(c));
            assert_eq!(voxel >> 6, brick_index(c >> 2u32, UVec3::splat(8)));
        }
    }

    #[test]
    fn only_lattices_that_tiles_can_have_are_sound() {
        let good = Lattice::new(&tile(Vec3::ONE, true), 0.1, Some(2)).unwrap();
        assert!(good.is_sound());
        let dims = |dims| Lattice { dims, ..good };
        let voxel_mm = |voxel_mm| Lattice { voxel_mm, ..good };
        let min_mm = |min_mm| Lattice { min_mm, ..good };
        for bad in [
            dims(UVec3::new(0, 8, 8)),
            // No multiple of the coarsest cell.
            dims(UVec3::new(8, 9, 8)),
            dims(UVec3::new(8, 8, 4 * MAX_DIM as u32)),
            // More bricks than 32 bits count.
            dims(UVec3::new(8192, 8192, 8192)),
            voxel_mm(DVec3::new(0.1, 0.0, 0.1)),
            voxel_mm(DVec3::new(0.1, 0.1, -0.1)),
            voxel_mm(DVec3::new(f64::NAN, 0.1, 0.1)),
            min_mm(DVec3::new(0.0, f64::INFINITY, 0.0)),
            // Beyond single precision.
            min_mm(DVec3::new(0.0, 0.0, 1e300)),
        ] {
            assert!(!bad.is_sound(), "{bad:?}");
        }
    }

    #[test]
    fn nonsense_is_refused() {
        let good = tile(Vec3::ONE, true);
        for v in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-9] {
            assert!(Lattice::new(&good, v, None).is_err(), "{v}");
        }
        assert!(Lattice::new(&good, 0.1, Some(0)).is_err());
        assert!(Lattice::new(&good, 0.1, Some(9)).is_err());
        let empty = Tile {
            bounds_mm: Aabb::EMPTY,
            repeats: false,
        };
        assert!(Lattice::new(&empty, 0.1, None).is_err());
        assert!(Lattice::new(&tile(Vec3::new(0.0, 1.0, 1.0), true), 0.1, None).is_err());
        assert!(Lattice::new(&tile(Vec3::ZERO, false), 0.1, None).is_ok());
    }
}
