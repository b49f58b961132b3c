//! Bounds of the extinction, over all directions: of stretches of a ray, for
//! trackers to step by, and of single voxels, to look up before matter is.
//!
//! Every medium keeps its bounds in one of these. What lies in a voxel is bounded
//! where it is made: by the octree's bricks, by a grid's samples, by the fibres
//! within reach.

mod voxel_bounds;

pub use voxel_bounds::VoxelBounds;

use glam::UVec3;
use organza_basis::{CellGrid, CellSpan, LocalRay};
use organza_volume::Octree;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Levels between a voxel and the node of an octree whose bound a stretch uses: 4
/// voxels along an edge, because the density of cloth varies inside yarns.
const NODE_LEVELS: u8 = 2;

/// Bounds of the blocks of a cell grid, 1/mm.
pub struct NodeBounds {
    /// Cells along the edge of a block.
    edge: u32,
    /// Blocks along each axis.
    dims: UVec3,
    bounds_per_mm: Vec<f32>,
}

impl NodeBounds {
    /// `bound_per_mm` of every block of `edge` cells of a grid.
    pub fn new(
        grid: &CellGrid,
        edge: u32,
        bound_per_mm: impl Fn(UVec3) -> f32 + Sync,
    ) -> NodeBounds {
        let dims = grid.cell_dims(edge);
        let blocks = (0..dims.element_product()).into_par_iter();
        let block = |i: u32| UVec3::new(i, i / dims.x, i / (dims.x * dims.y)) % dims;
        NodeBounds {
            edge,
            dims,
            bounds_per_mm: blocks.map(|i| bound_per_mm(block(i))).collect(),
        }
    }

    /// Visits the blocks along a ray that hold anything, each with its bound, until
    /// `visit` breaks.
    pub fn for_each_span<B>(
        &self,
        grid: &CellGrid,
        ray: &LocalRay,
        mut visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for span in grid.cells(ray, self.edge) {
            let c = span.cell;
            let place = c.x + self.dims.x * (c.y + self.dims.y * c.z);
            let bound = self.bounds_per_mm[place as usize];
            if bound > 0.0 {
                visit(&span, bound)?;
            }
        }
        ControlFlow::Continue(())
    }
}

/// Visits the nodes of an octree along a ray that hold anything, each with the bound
/// that the octree keeps of it, until `visit` breaks. `level` is that of the grid's
/// cells.
pub fn for_each_octree_span<B>(
    octree: &Octree,
    level: u8,
    grid: &CellGrid,
    ray: &LocalRay,
    mut visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
) -> ControlFlow<B> {
    let top = octree.level_count() - 1;
    let node_level = (level + NODE_LEVELS).min(top);
    let edge = 1 << (node_level - level);
    for span in grid.cells(ray, edge) {
        let bound = octree.majorant_per_mm(node_level, span.cell);
        if bound > 0.0 {
            visit(&span, bound)?;
        }
    }
    ControlFlow::Continue(())
}
