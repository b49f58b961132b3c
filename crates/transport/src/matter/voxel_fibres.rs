//! The fibres of one octree level, decoded once.
//!
//! A walk looks fibres up at every tentative collision that their bound lets pass,
//! twice where they are packed. An octree keeps twelve bytes of a population, which
//! take a square root to read; here are all of them as they are used, behind one
//! table.

use glam::{IVec3, UVec3};
use organza_basis::FibrePopulation;
use organza_volume::{BlockLayout, Octree};
use std::ops::Range;
use std::sync::Arc;

/// Populations of every voxel of a level; of a cloth of blocks once for each block.
pub struct VoxelFibres {
    dims: UVec3,
    /// The blocks and the level.
    blocks: Option<(Arc<BlockLayout>, u8)>,
    repeats: bool,
    /// First population of every voxel, x fastest, and the number of all.
    starts: Vec<u32>,
    populations: Vec<FibrePopulation>,
}

impl VoxelFibres {
    /// Those of a level, each with its length per volume multiplied by `dense`.
    pub fn new(octree: &Octree, level: u8, dense: impl Fn(&FibrePopulation) -> f32) -> VoxelFibres {
        let blocks = octree.blocks().map(|blocks| (Arc::clone(blocks), level));
        let dims = match &blocks {
            None => octree.dims(level),
            Some((blocks, _)) => blocks.stack_dims(level),
        };
        let mut starts = vec![0];
        let mut populations: Vec<FibrePopulation> = Vec::new();
        for z in 0..dims.z {
            for y in 0..dims.y {
                for x in 0..dims.x {
                    let cell = UVec3::new(x, y, z);
                    let shown = blocks.as_ref().map_or(cell, |(b, _)| b.shown(level, cell));
                    let stored = octree.mixture(level, shown);
                    populations.extend(stored.iter().map(|c| FibrePopulation {
                        length_density_per_mm2: dense(c) * c.length_density_per_mm2,
                        ..*c
                    }));
                    starts.push(populations.len() as u32);
                }
            }
        }
        populations.shrink_to_fit();
        VoxelFibres {
            dims: octree.dims(level),
            blocks,
            repeats: octree.repeats(),
            starts,
            populations,
        }
    }

    /// Radii of all populations, mm.
    pub fn radii_mm(&self) -> impl Iterator<Item = f32> {
        self.populations.iter().map(|c| c.radius_mm)
    }

    /// Places of the populations in a voxel, none beyond the box.
    #[inline]
    pub fn places(&self, mut cell: IVec3) -> Range<u32> {
        let dims = self.dims.as_ivec3();
        let beyond = |c: IVec3| c.cmplt(IVec3::ZERO).any() || c.cmpge(dims).any();
        if beyond(cell) {
            if self.repeats {
                cell.x = cell.x.rem_euclid(dims.x);
                cell.y = cell.y.rem_euclid(dims.y);
            }
            if beyond(cell) {
                return 0..0;
            }
        }
        let (mut c, mut dims) = (cell.as_uvec3(), self.dims);
        if let Some((blocks, level)) = &self.blocks {
            (c, dims) = (blocks.stored(*level, c), blocks.block_cells(*level));
        }
        let row = c.z as usize * dims.y as usize + c.y as usize;
        let voxel = row * dims.x as usize + c.x as usize;
        self.starts[voxel]..self.starts[voxel + 1]
    }

    /// Populations at some [`VoxelFibres::places`].
    #[inline]
    pub fn at(&self, places: &Range<u32>) -> &[FibrePopulation] {
        &self.populations[places.start as usize..places.end as usize]
    }

    /// Populations in a voxel, none beyond the box.
    #[inline]
    pub fn of(&self, cell: IVec3) -> &[FibrePopulation] {
        self.at(&self.places(cell))
    }
}
