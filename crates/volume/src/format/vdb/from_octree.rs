//! The grids of a .vdb file from an octree.

use super::{Cells, Data, Grid, Leaf, Value, mm_from_cell};
use crate::Octree;
use crate::lattice::{brick_at, brick_index};
use crate::octree::EMPTY;
use glam::{IVec3, UVec3};
use organza_basis::{MergedFlakes, Mixture};
use std::collections::BTreeMap;

/// The grids of one level: `density` (extinction broadside to the mean fibre,
/// 1/mm), `orientation` (unit mean axis of the population that blocks most),
/// `spread` (radians, of the same), `sggx_diag` (xx, yy, zz) and
/// `sggx_offdiag` (xy, xz, yz) of the whole mixture at unit density, `albedo` (red,
/// green, blue), `yarn`. `merge` turns a mixture into one population.
///
/// Cells without fibre are not active and read zero (`yarn`: -1). With `half`
/// the floats are stored in 16 bits. `level` must be below the octree's count.
pub fn grids_from_octree(
    octree: &Octree,
    level: u8,
    half: bool,
    merge: &dyn Fn(&Mixture) -> MergedFlakes,
) -> Vec<Grid> {
    let mut density = Builder::new(0.0);
    let mut orientation = Builder::new([0.0; 3]);
    let mut spread = Builder::new(0.0);
    let mut diagonal = Builder::new([0.0; 3]);
    let mut off_diagonal = Builder::new([0.0; 3]);
    let mut albedo = Builder::new([0.0; 3]);
    let mut yarn = Builder::new(-1);
    octree.for_each_occupied(level, |cell| {
        let s = merge(&octree.mixture(level, cell));
        density.set(cell, s.density_per_mm);
        orientation.set(cell, s.axis.to_array());
        spread.set(cell, s.spread_rad);
        diagonal.set(cell, s.sggx.diagonal.to_array());
        off_diagonal.set(cell, s.sggx.off_diagonal.to_array());
        albedo.set(cell, s.albedo.0.to_array());
        yarn.set(cell, i32::try_from(s.yarn).unwrap_or(i32::MAX));
    });
    let lattice = octree.lattice;
    let map = mm_from_cell(lattice.min_mm, lattice.voxel_at(level));
    let grid = |name: &str, data: Data| Grid {
        name: name.into(),
        mm_from_cell: map,
        extent: Some((IVec3::ZERO, octree.dims(level).as_ivec3() - 1)),
        half,
        data,
    };
    vec![
        grid("density", Data::Float(density.finish())),
        grid("orientation", Data::Vec3(orientation.finish())),
        grid("spread", Data::Float(spread.finish())),
        grid("sggx_diag", Data::Vec3(diagonal.finish())),
        grid("sggx_offdiag", Data::Vec3(off_diagonal.finish())),
        grid("albedo", Data::Vec3(albedo.finish())),
        grid("yarn", Data::Int(yarn.finish())),
    ]
}

/// Bytes of a leaf in every grid: 15 values in each of 512 cells, the masks and the places in
/// their map; and 6 values more in each cell while a grid of vectors is encoded.
const BYTES_PER_LEAF: u64 = 512 * 4 * (15 + 6) + 7 * 160;

/// Bytes that [`grids_from_octree`] takes and that writing its grids takes then, at most.
pub(super) fn memory_bytes(octree: &Octree, level: u8) -> u64 {
    let across = octree.dims(level).map(|n| n.div_ceil(8));
    let in_box = across.as_u64vec3().to_array();
    let in_box = in_box.into_iter().fold(1, u64::saturating_mul);
    let leaves = match octree.blocks() {
        // Each crossing shows a block, and blocks hold fibre nearly everywhere.
        Some(_) => in_box,
        None => {
            let mut is_leaf = vec![false; in_box as usize];
            let l = &octree.levels[usize::from(level)];
            for (at, _) in (0..).zip(&l.brick_of).filter(|(_, brick)| **brick != EMPTY) {
                is_leaf[brick_index(brick_at(at, l.grid) >> 1u32, across) as usize] = true;
            }
            is_leaf.into_iter().filter(|leaf| *leaf).count() as u64
        }
    };
    leaves.saturating_mul(BYTES_PER_LEAF)
}

/// Collects cells into leaves.
struct Builder<T> {
    background: T,
    leaves: BTreeMap<[i32; 3], Leaf<T>>,
}

impl<T: Value> Builder<T> {
    fn new(background: T) -> Builder<T> {
        Builder {
            background,
            leaves: BTreeMap::new(),
        }
    }

    fn set(&mut self, cell: UVec3, value: T) {
        let origin: IVec3 = (cell & !7).as_ivec3();
        let leaf = self
            .leaves
            .entry(origin.to_array())
            .or_insert_with(|| Leaf {
                origin,
                mask: [0; 8],
                values: vec![self.background; 512],
            });
        let c = cell & 7;
        let i = (64 * c.x + 8 * c.y + c.z) as usize;
        leaf.mask[i / 64] |= 1 << (i % 64);
        leaf.values[i] = value;
    }

    fn finish(self) -> Cells<T> {
        Cells {
            background: self.background,
            leaves: self.leaves.into_values().collect(),
            cubes: Vec::new(),
        }
    }
}
