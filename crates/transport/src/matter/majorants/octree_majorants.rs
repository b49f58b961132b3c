//! Majorants that an octree keeps for its nodes.

use organza_basis::{CellGrid, CellSpan, LocalRay};
use organza_volume::Octree;
use std::ops::ControlFlow;

/// Levels between a voxel and the node of an octree whose majorant a stretch uses: 4
/// voxels along an edge, because the density of cloth varies inside yarns.
const NODE_LEVELS: u8 = 2;

/// Visits the nodes of an octree along a ray that hold anything, each with the majorant
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
