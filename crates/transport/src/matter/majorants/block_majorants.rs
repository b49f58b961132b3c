//! Majorants of the blocks of a cell grid, for trackers to step by.

use glam::UVec3;
use organza_basis::{CellGrid, CellSpan, LocalRay};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Majorants of the blocks of a cell grid, 1/mm.
pub struct BlockMajorants {
    /// Cells along the edge of a block.
    edge: u32,
    /// Blocks along each axis.
    dims: UVec3,
    majorants_per_mm: Vec<f32>,
}

impl BlockMajorants {
    /// `majorant_per_mm` of every block of `edge` cells of a grid.
    pub fn new(
        grid: &CellGrid,
        edge: u32,
        majorant_per_mm: impl Fn(UVec3) -> f32 + Sync + Send,
    ) -> BlockMajorants {
        let bounds_per_mm = blocks_of(grid, edge).map(majorant_per_mm).collect();
        BlockMajorants::of(grid, edge, bounds_per_mm)
    }

    /// Those of every block, in the order of [`blocks_of`].
    pub fn of(grid: &CellGrid, edge: u32, majorants_per_mm: Vec<f32>) -> BlockMajorants {
        BlockMajorants {
            edge,
            dims: grid.cell_dims(edge),
            majorants_per_mm,
        }
    }

    /// Visits the blocks along a ray that hold anything, each with its majorant, until
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
            let bound = self.majorants_per_mm[place as usize];
            if bound > 0.0 {
                visit(&span, bound)?;
            }
        }
        ControlFlow::Continue(())
    }
}

/// The blocks of `edge` cells of a grid, x fastest.
pub fn blocks_of(grid: &CellGrid, edge: u32) -> impl IndexedParallelIterator<Item = UVec3> {
    let dims = grid.cell_dims(edge);
    let blocks = (0..dims.element_product()).into_par_iter();
    blocks.map(move |i| UVec3::new(i, i / dims.x, i / (dims.x * dims.y)) % dims)
}
