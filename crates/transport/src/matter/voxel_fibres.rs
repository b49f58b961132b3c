//! The fibres of one octree level, decoded once.
//!
//! A walk looks fibres up at every tentative collision that their bound lets pass,
//! twice where they are packed. An octree keeps twelve bytes of a population, which
//! take a square root to read; here are all of them as they are used, behind one
//! table.

use glam::{IVec3, UVec3};
use organza_basis::FibrePopulation;
use organza_volume::{BlockLayout, Octree};
use rayon::prelude::*;
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
    pub fn new(
        octree: &Octree,
        level: u8,
        dense: impl Fn(&FibrePopulation) -> f32 + Sync,
    ) -> VoxelFibres {
        let blocks = octree.blocks().map(|blocks| (Arc::clone(blocks), level));
        let dims = match &blocks {
            None => octree.dims(level),
            Some((blocks, _)) => blocks.stack_dims(level),
        };
        let layers: Vec<(Vec<u32>, Vec<FibrePopulation>)> = (0..dims.z)
            .into_par_iter()
            .map(|z| {
                let mut ends = Vec::with_capacity(dims.x as usize * dims.y as usize);
                let mut populations: Vec<FibrePopulation> = Vec::new();
                for y in 0..dims.y {
                    for x in 0..dims.x {
                        let cell = UVec3::new(x, y, z);
                        let shown = blocks.as_ref().map_or(cell, |(b, _)| b.shown(level, cell));
                        let stored = octree.mixture(level, shown);
                        populations.extend(stored.iter().map(|c| FibrePopulation {
                            length_density_per_mm2: dense(c) * c.length_density_per_mm2,
                            ..*c
                        }));
                        ends.push(populations.len() as u32);
                    }
                }
                (ends, populations)
            })
            .collect();
        let count = layers.iter().map(|(_, populations)| populations.len());
        let mut populations = Vec::with_capacity(count.sum());
        let mut starts = Vec::with_capacity(dims.as_usizevec3().element_product() + 1);
        starts.push(0);
        for (ends, of_layer) in layers {
            let before = populations.len() as u32;
            starts.extend(ends.into_iter().map(|end| before + end));
            populations.extend(of_layer);
        }
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

    /// Visits the populations of every voxel that holds any, from `low` up to before `high`,
    /// rows of x first. Rows without any cost a look-up or two. Not for a cloth of blocks.
    pub fn for_each(&self, low: IVec3, high: IVec3, mut visit: impl FnMut(&[FibrePopulation])) {
        let dims = self.dims.as_ivec3();
        let wrapped = |at: i32, axis: usize| match self.repeats && axis < 2 {
            true => Some(at.rem_euclid(dims[axis])),
            false => (0..dims[axis]).contains(&at).then_some(at),
        };
        for z in low.z..high.z {
            let Some(z) = wrapped(z, 2) else { continue };
            for y in low.y..high.y {
                let Some(y) = wrapped(y, 1) else { continue };
                let row = (z as usize * dims.y as usize + y as usize) * dims.x as usize;
                let mut x = low.x;
                while x < high.x {
                    // As far as the row goes on in memory.
                    let Some(first) = wrapped(x, 0) else {
                        x += 1;
                        continue;
                    };
                    let count = (high.x - x).min(dims.x - first);
                    x += count;
                    let voxels = &self.starts[row + first as usize..][..=count as usize];
                    if voxels[0] == voxels[count as usize] {
                        continue;
                    }
                    for ends in voxels.windows(2).filter(|ends| ends[0] < ends[1]) {
                        visit(self.at(&(ends[0]..ends[1])));
                    }
                }
            }
        }
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
