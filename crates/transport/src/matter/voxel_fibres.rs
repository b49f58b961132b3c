//! The fibres of one octree level, decoded once.
//!
//! A walk looks fibres up at every tentative collision that their bound lets pass,
//! twice where they are packed. An octree keeps twelve bytes of a population, which
//! take a square root to read; here are all of them as they are used, behind one
//! table.
//!
//! Coarse voxels keep the outline of their matter, see [`Octree::outlined_mixture`]: the cells
//! are their sub-cells, and a cell without fibre is air.

use glam::{IVec3, UVec3};
use organza_basis::FibrePopulation;
use organza_volume::{BlockLayout, Octree, sub_cell_bit};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Populations of every voxel of a level; of a cloth of blocks once for each block.
pub struct VoxelFibres {
    /// Cells: the sub-cells of the voxels.
    dims: UVec3,
    /// Voxels along x and y; of a cloth of blocks those of a block.
    voxels: [u32; 2],
    /// The blocks, and the level of the cells.
    blocks: Option<(Arc<BlockLayout>, u8)>,
    repeats: bool,
    /// Levels from the cells to the voxels.
    depth: u8,
    /// The cells of every voxel that hold fibre, see [`Octree::sub_cells`]; empty where cells
    /// are voxels.
    outlines: Vec<u64>,
    /// First population of every voxel, x fastest, and the number of all.
    starts: Vec<u32>,
    populations: Vec<FibrePopulation>,
}

/// What is in a layer of voxels.
#[derive(Default)]
struct Layer {
    /// Populations up to each voxel's last.
    ends: Vec<u32>,
    populations: Vec<FibrePopulation>,
    outlines: Vec<u64>,
}

impl VoxelFibres {
    /// Those of a level, each with its length per volume multiplied by `dense`.
    pub fn new(
        octree: &Octree,
        level: u8,
        dense: impl Fn(&FibrePopulation) -> f32 + Sync,
    ) -> VoxelFibres {
        let cell_level = octree.outline_level(level);
        let depth = level - cell_level;
        let blocks = octree.blocks().map(Arc::clone);
        let (dims, in_row) = match &blocks {
            None => (octree.dims(level), octree.dims(level)),
            Some(blocks) => (blocks.stack_dims(level), blocks.block_cells(level)),
        };
        let layers: Vec<Layer> = (0..dims.z)
            .into_par_iter()
            .map(|z| {
                let mut layer = Layer {
                    ends: Vec::with_capacity(dims.x as usize * dims.y as usize),
                    ..Layer::default()
                };
                for y in 0..dims.y {
                    for x in 0..dims.x {
                        let voxel = UVec3::new(x, y, z);
                        let shown = blocks.as_ref().map_or(voxel, |b| b.shown(level, voxel));
                        let (outline, denser) = octree.sub_cells(level, shown);
                        let stored = octree.mixture(level, shown);
                        layer
                            .populations
                            .extend(stored.iter().map(|c| FibrePopulation {
                                length_density_per_mm2: denser
                                    * dense(c)
                                    * c.length_density_per_mm2,
                                ..*c
                            }));
                        layer.ends.push(layer.populations.len() as u32);
                        if depth > 0 {
                            layer.outlines.push(outline);
                        }
                    }
                }
                layer
            })
            .collect();
        let count = layers.iter().map(|layer| layer.populations.len());
        let mut populations = Vec::with_capacity(count.sum());
        let voxel_count = dims.as_usizevec3().element_product();
        let mut starts = Vec::with_capacity(voxel_count + 1);
        let mut outlines = Vec::with_capacity(if depth > 0 { voxel_count } else { 0 });
        starts.push(0);
        for layer in layers {
            let before = populations.len() as u32;
            starts.extend(layer.ends.into_iter().map(|end| before + end));
            populations.extend(layer.populations);
            outlines.extend(layer.outlines);
        }
        VoxelFibres {
            dims: octree.dims(cell_level),
            voxels: [in_row.x, in_row.y],
            blocks: blocks.map(|blocks| (blocks, cell_level)),
            repeats: octree.repeats(),
            depth,
            outlines,
            starts,
            populations,
        }
    }

    /// Radii of all populations, mm.
    pub fn radii_mm(&self) -> impl Iterator<Item = f32> {
        self.populations.iter().map(|c| c.radius_mm)
    }

    /// Places of the populations in a cell, none beyond the box.
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
        let mut c = cell.as_uvec3();
        if let Some((blocks, level)) = &self.blocks {
            c = blocks.stored(*level, c);
        }
        let voxel = self.voxel(c >> u32::from(self.depth));
        if let Some(outline) = self.outlines.get(voxel)
            && outline >> sub_cell_bit(c, self.depth) & 1 == 0
        {
            return 0..0;
        }
        self.starts[voxel]..self.starts[voxel + 1]
    }

    /// Place of a voxel in the tables.
    fn voxel(&self, voxel: UVec3) -> usize {
        let [x, y] = self.voxels;
        let row = voxel.z as usize * y as usize + voxel.y as usize;
        row * x as usize + voxel.x as usize
    }

    /// Visits the populations of every voxel that holds any, with cells from `low` up to before
    /// `high`, rows of x first. Rows without any cost a look-up or two. Not for a cloth of
    /// blocks.
    pub fn for_each(&self, low: IVec3, high: IVec3, mut visit: impl FnMut(&[FibrePopulation])) {
        let dims = self.dims.as_ivec3();
        let wrapped = |at: i32, axis: usize| match self.repeats && axis < 2 {
            true => Some(at.rem_euclid(dims[axis])),
            false => (0..dims[axis]).contains(&at).then_some(at),
        };
        let edge = 1 << self.depth;
        // The first cell, and those in which a voxel begins.
        let voxels_of = |axis: usize| {
            let (low, high) = (low[axis], high[axis]);
            (low..high).filter(move |at| *at == low || at % edge == 0)
        };
        for z in voxels_of(2) {
            let Some(z) = wrapped(z, 2) else { continue };
            for y in voxels_of(1) {
                let Some(y) = wrapped(y, 1) else { continue };
                let mut x = low.x;
                while x < high.x {
                    // As far as the row goes on in memory.
                    let Some(first) = wrapped(x, 0) else {
                        x += 1;
                        continue;
                    };
                    let count = (high.x - x).min(dims.x - first);
                    x += count;
                    let at = |x: i32| self.voxel(IVec3::new(x, y, z).as_uvec3() / edge as u32);
                    let voxels = &self.starts[at(first)..=at(first + count - 1) + 1];
                    if voxels.first() == voxels.last() {
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

    /// Populations in a cell, none beyond the box.
    #[inline]
    pub fn of(&self, cell: IVec3) -> &[FibrePopulation] {
        self.at(&self.places(cell))
    }
}
