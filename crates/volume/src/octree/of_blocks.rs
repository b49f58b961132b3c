//! The octree of a cloth of blocks, cut from the octree of exemplars.

use super::{EMPTY, Group, Octree, OctreeLevel, broadside};
use crate::Error;
use crate::block_layout::BlockLayout;
use crate::lattice::{Lattice, brick_at, brick_index, bricks_across, cell_of_bit, octant};
use crate::record::{Brick, StoredPopulation, decode_group};
use glam::UVec3;
use std::collections::HashMap;

/// Bits of the group in a population's word.
const GROUP_BITS: u32 = 0xf_ffff;

/// Where a block is cut from an exemplar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockCut {
    /// Its least finest voxel along x and y; the block is as high as the exemplar.
    pub low: glam::UVec2,
}

impl Octree {
    /// A cloth of blocks that are cut from an exemplar: `cuts[i]` is block `i` of the layout.
    /// `material` gives the material in the cloth of a block's population from its yarn and
    /// material in the exemplar.
    ///
    /// Voxels are copied at every level, so that a block holds exactly what the exemplar holds
    /// there.
    ///
    /// # Errors
    /// When a block does not consist of whole cells of the coarsest level or lies outside the
    /// exemplar, or all blocks together are more than an octree can address.
    pub fn of_blocks(
        exemplar: &Octree,
        cuts: &[BlockCut],
        layout: BlockLayout,
        material: &dyn Fn(u32, u32, u16) -> u16,
    ) -> Result<Octree, Error> {
        let wrong = |why: &str| Error::Options(format!("blocks of a cloth: {why}"));
        let cells = layout.block_cells(0);
        let whole = (1u32 << (exemplar.level_count() - 1)) - 1;
        let is_whole = |v: u32| v & whole == 0;
        if exemplar.blocks.is_some() || layout.count() as usize != cuts.len() {
            return Err(wrong(
                "an exemplar is one volume, with a cut for each block",
            ));
        }
        if cells.z != exemplar.dims(0).z || !cells.to_array().into_iter().all(is_whole) {
            return Err(wrong("a block is whole cells of the coarsest level"));
        }
        let inside = |cut: &BlockCut| {
            is_whole(cut.low.x)
                && is_whole(cut.low.y)
                && (cut.low + cells.truncate())
                    .cmple(exemplar.dims(0).truncate())
                    .all()
        };
        if !cuts.iter().all(inside) {
            return Err(wrong("a cut lies outside the exemplar"));
        }
        let stacked = u64::from(cells.z) * cuts.len() as u64;
        let lattice = Lattice {
            dims: cells.with_z(u32::try_from(stacked).unwrap_or(0)),
            repeats: true,
            ..exemplar.lattice
        };
        if stacked > u64::from(u32::MAX) || !lattice.is_sound() {
            return Err(wrong(
                "more voxels than an octree can address; use larger voxels or fewer blocks",
            ));
        }
        let mut groups = Groups {
            numbers: HashMap::new(),
            groups: Vec::new(),
        };
        let mut levels: Vec<OctreeLevel> = Vec::new();
        for level in 0..exemplar.level_count() {
            let built = copy_level(exemplar, cuts, &layout, &lattice, level, |block, r| {
                let group = exemplar.groups[decode_group(r.population)];
                let group = Group {
                    yarn: group.yarn,
                    material: material(block, group.yarn, group.material),
                };
                let number = groups.number(group);
                StoredPopulation {
                    population: r.population & !GROUP_BITS | number,
                    ..*r
                }
            });
            let built = built.ok_or_else(|| wrong("more populations than can be addressed"))?;
            levels.push(with_majorants(built, levels.last(), exemplar));
        }
        let mut octree = Octree::assemble(
            lattice,
            levels,
            groups.groups,
            exemplar.radii,
            exemplar.quantum_mm,
            exemplar.material_count,
        );
        octree.footprint = exemplar.footprint;
        octree.packing = exemplar.packing.clone();
        octree
            .with_blocks(layout)
            .ok_or_else(|| wrong("they do not fit"))
    }
}

/// Numbers of groups in the order in which they occur.
struct Groups {
    numbers: HashMap<(u32, u16), u32>,
    groups: Vec<Group>,
}

impl Groups {
    fn number(&mut self, group: Group) -> u32 {
        let key = (group.yarn, group.material);
        *self.numbers.entry(key).or_insert_with(|| {
            self.groups.push(group);
            self.groups.len() as u32 - 1
        })
    }
}

/// A level of all blocks, without majorants. `None` when there are too many populations.
fn copy_level(
    exemplar: &Octree,
    cuts: &[BlockCut],
    layout: &BlockLayout,
    lattice: &Lattice,
    level: u8,
    mut copied: impl FnMut(u32, &StoredPopulation) -> StoredPopulation,
) -> Option<OctreeLevel> {
    let dims = lattice.dims_at(level);
    let block = layout.block_cells(level);
    let grid = bricks_across(dims);
    let mut built = OctreeLevel {
        grid,
        brick_of: vec![EMPTY; grid.as_u64vec3().element_product() as usize],
        bricks: Vec::new(),
        records: Vec::new(),
        density_per_quantum: exemplar.levels[usize::from(level)].density_per_quantum,
    };
    for at in 0..built.brick_of.len() as u32 {
        let low = brick_at(at, grid) << 2u32;
        let mut brick = Brick {
            first: u32::try_from(built.records.len()).ok()?,
            ..Brick::default()
        };
        for bit in 0..64 {
            let cell = low + cell_of_bit(bit);
            if cell.cmpge(dims).any() {
                continue;
            }
            let number = cell.z / block.z;
            let corner = cuts[number as usize].low >> u32::from(level);
            let z = cell.z - number * block.z;
            let source = UVec3::new(cell.x + corner.x, cell.y + corner.y, z);
            let (_, records) = exemplar.records(level, source);
            for (mask, record) in brick.masks.iter_mut().zip(records) {
                *mask |= 1 << bit;
                built.records.push(copied(number, record));
            }
        }
        if brick.masks[0] != 0 {
            built.brick_of[at as usize] = built.bricks.len() as u32;
            built.bricks.push(brick);
        }
    }
    built.bricks.shrink_to_fit();
    built.records.shrink_to_fit();
    Some(built)
}

/// A level with the majorants of its bricks, from its voxels or from the level below.
fn with_majorants(
    mut level: OctreeLevel,
    finer: Option<&OctreeLevel>,
    exemplar: &Octree,
) -> OctreeLevel {
    for at in 0..level.brick_of.len() as u32 {
        let index = level.brick_of[at as usize];
        if index == EMPTY {
            continue;
        }
        let place = brick_at(at, level.grid);
        let brick = &level.bricks[index as usize];
        let of_voxel = |bit: u32| {
            let records = &level.records[brick.records_of(bit)];
            broadside(records, level.density_per_quantum, &exemplar.radii)
        };
        let majorant_per_mm = match finer {
            // A sum in another order must not exceed it.
            None => (0..64).map(of_voxel).fold(0.0, f32::max) * (1.0 + 1e-6),
            Some(finer) => (0..8)
                .map(|i| (place << 1u32) + octant(i))
                .filter(|child| child.cmplt(finer.grid).all())
                .map(|child| finer.brick_of[brick_index(child, finer.grid) as usize])
                .filter(|&child| child != EMPTY)
                .map(|child| finer.bricks[child as usize].majorant_per_mm)
                .fold(0.0, f32::max),
        };
        level.bricks[index as usize].majorant_per_mm = majorant_per_mm;
    }
    level
}
