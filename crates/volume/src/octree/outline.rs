//! The outline of matter inside coarse cells.
//!
//! A coarse cell that spreads its fibres evenly closes the gaps between yarns. Here a coarse
//! cell keeps the shape of its matter: of its 4 x 4 x 4 sub-cells, two levels finer, those
//! that hold no fibre are air, and the others share the populations of the cell evenly. The
//! amount of fibre stays exactly the same.
//!
//! Nothing is stored for it: the mask of the sub-cells of a cell is the occupancy mask of the
//! brick two levels below. At level 1 a cell has 2 x 2 x 2 sub-cells, an octant of a brick.

use super::Octree;
use crate::lattice::bit_of;
use glam::UVec3;
use organza_basis::{FibrePopulation, Mixture};

/// Levels between a cell and its sub-cells: those of one brick.
const OUTLINE_LEVELS: u8 = 2;

/// The bits of the first octant of a brick, 2 x 2 x 2 cells.
const OCTANT: u64 = 0x0033_0033;

/// The bit of a sub-cell in [`Octree::sub_cells`] of the cell around it, `depth` levels coarser.
#[inline]
pub fn sub_cell_bit(sub_cell: UVec3, depth: u8) -> u32 {
    let c = sub_cell & ((1 << depth) - 1);
    c.x | c.y << depth | c.z << (2 * depth)
}

impl Octree {
    /// The level whose cells are the sub-cells of `level`: two levels finer, but at least 0.
    pub fn outline_level(&self, level: u8) -> u8 {
        level.saturating_sub(OUTLINE_LEVELS)
    }

    /// The populations in a sub-cell of a cell of `level`: those of the cell, over the share
    /// of its sub-cells that hold fibre, or none where the sub-cell is air.
    ///
    /// `sub_cell` must lie within [`Octree::dims`] of [`Octree::outline_level`]. At level 0 it
    /// is [`Octree::mixture`].
    pub fn outlined_mixture(&self, level: u8, sub_cell: UVec3) -> Mixture {
        let finer = self.outline_level(level);
        let depth = level - finer;
        if depth == 0 {
            return self.mixture(level, sub_cell);
        }
        let mask = self.outline(level, self.stored(finer, sub_cell));
        if !mask.holds_own {
            return Mixture::EMPTY;
        }
        let denser = mask.inverse_share(depth);
        let mut mixture = Mixture::EMPTY;
        for c in self.mixture(level, sub_cell >> u32::from(depth)).iter() {
            mixture.push(FibrePopulation {
                length_density_per_mm2: denser * c.length_density_per_mm2,
                ..*c
            });
        }
        mixture
    }

    /// Which sub-cells of a cell of `level` hold fibre, in the order of [`sub_cell_bit`], and all
    /// sub-cells over those: both 1 at level 0, where a cell is its own sub-cell, fibre or none.
    pub fn sub_cells(&self, level: u8, cell: UVec3) -> (u64, f32) {
        let finer = self.outline_level(level);
        let depth = level - finer;
        if depth == 0 {
            return (1, 1.0);
        }
        let low = self.stored(finer, cell << u32::from(depth));
        let bricks = self.brick(finer, low >> 2u32);
        let occupied = bricks.map_or(0, |(_, brick)| brick.masks[0]);
        let mut mask = 0;
        for place in 0..1u32 << (3 * depth) {
            let edge = (1u32 << depth) - 1;
            let within = UVec3::new(place, place >> depth, place >> (2 * depth)) & edge;
            mask |= (occupied >> bit_of(low + within) & 1) << place;
        }
        let holding = mask.count_ones().max(1);
        (mask, (1u32 << (3 * depth)) as f32 / holding as f32)
    }

    /// Bound of the extinction toward any direction in the sub-cells of a cell, 1/mm: that of
    /// the cell's own populations, over the share of sub-cells that hold fibre.
    pub fn outlined_majorant_per_mm(&self, level: u8, cell: UVec3) -> f32 {
        let own = self.broadside_per_mm(level, cell);
        let finer = self.outline_level(level);
        let depth = level - finer;
        if depth == 0 || own == 0.0 {
            return own;
        }
        let low = self.stored(finer, cell << u32::from(depth));
        // A sum in another order must not exceed it.
        own * self.outline(level, low).inverse_share(depth) * (1.0 + 1e-6)
    }

    /// The outline of the cell of `level` around a stored sub-cell.
    fn outline(&self, level: u8, sub_cell: UVec3) -> Outline {
        let finer = self.outline_level(level);
        let bricks = self.brick(finer, sub_cell >> 2u32);
        let occupied = bricks.map_or(0, |(_, brick)| brick.masks[0]);
        let of_cell = if level - finer == OUTLINE_LEVELS {
            u64::MAX
        } else {
            OCTANT << bit_of(sub_cell & !1)
        };
        Outline {
            holds_own: occupied >> bit_of(sub_cell) & 1 == 1,
            count: (occupied & of_cell).count_ones(),
        }
    }
}

/// Where in a cell fibre lies, as seen from one of its sub-cells.
struct Outline {
    /// Whether this sub-cell holds any.
    holds_own: bool,
    /// How many do.
    count: u32,
}

impl Outline {
    /// All sub-cells over those that hold fibre; `depth` is the levels between.
    fn inverse_share(&self, depth: u8) -> f32 {
        (1u32 << (3 * depth)) as f32 / self.count as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MixtureGrid, MixtureSource, octree_of_mixtures};
    use glam::{DVec3, Vec3};
    use organza_basis::{PathRng, unwatched};

    /// Voxels of a cube, each with fibre or without.
    struct Cube(Vec<bool>);

    const EDGE: u32 = 16;

    impl MixtureSource for Cube {
        fn grid(&self) -> MixtureGrid {
            MixtureGrid {
                min_mm: DVec3::ZERO,
                voxel_mm: DVec3::splat(0.01),
                dims: UVec3::splat(EDGE),
                repeats: true,
            }
        }

        fn material_count(&self) -> usize {
            1
        }

        fn mixture(&self, cell: UVec3) -> Mixture {
            let mut mixture = Mixture::EMPTY;
            if self.0[((cell.z * EDGE + cell.y) * EDGE + cell.x) as usize] {
                mixture.push(FibrePopulation {
                    length_density_per_mm2: 100.0 + cell.x as f32,
                    axis: Vec3::Y,
                    spread_rad: 0.0,
                    radius_mm: 0.002,
                    material: 0,
                    yarn: 0,
                });
            }
            mixture
        }
    }

    fn cells(across: UVec3) -> impl Iterator<Item = UVec3> {
        let of = move |i: u32| {
            let row = i / across.x;
            UVec3::new(i % across.x, row % across.y, row / across.y)
        };
        (0..across.element_product()).map(of)
    }

    #[test]
    fn sub_cells_hold_the_fibre_of_their_cell_where_finer_cells_hold_any() {
        let mut rng = PathRng::from_seed(29);
        let cube = Cube((0..EDGE.pow(3)).map(|_| rng.below(20) == 0).collect());
        let octree = octree_of_mixtures(&cube, Some(4), None, &unwatched).unwrap();
        for level in 1..4u8 {
            let depth = level.min(2);
            let edge = 1u32 << depth;
            for cell in cells(octree.dims(level)) {
                let (mask, denser) = octree.sub_cells(level, cell);
                let own = octree.mixture(level, cell);
                let (mut holding, mut sum) = (0, 0.0);
                for within in cells(UVec3::splat(edge)) {
                    let place = within.x + edge * (within.y + edge * within.z);
                    let at = cell * edge + within;
                    let is_held = !octree.mixture(level - depth, at).is_empty();
                    assert_eq!(mask >> place & 1 == 1, is_held, "level {level}, {at}");
                    let outlined = octree.outlined_mixture(level, at);
                    assert_eq!(!outlined.is_empty(), is_held, "level {level}, {at}");
                    holding += u32::from(is_held);
                    sum += outlined.broadside_per_mm();
                }
                let places = edge.pow(3) as f32;
                assert_eq!(denser, places / holding.max(1) as f32);
                // A sum of 64 numbers in single precision.
                let (mean, want) = (sum / places, own.broadside_per_mm());
                let is_near = (mean - want).abs() <= 8.0 * f32::EPSILON * want;
                assert!(is_near, "level {level}, {cell}: {mean} {want}");
            }
        }
    }
}
