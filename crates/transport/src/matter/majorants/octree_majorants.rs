//! Majorants that an octree keeps for its nodes.

use organza_basis::{CellGrid, CellSpan, LocalRay};
use organza_volume::Octree;
use std::ops::ControlFlow;

/// Levels between a voxel and the node of an octree whose majorant a stretch uses: 4
/// voxels along an edge, because the density of cloth varies inside yarns.
const NODE_LEVELS: u8 = 2;

/// Visits the nodes of an octree along a ray that hold anything, each with the majorant
/// that the octree keeps of it, until `visit` breaks. `outline` is the level of the grid's
/// cells, which keep the outline of the matter of `level`.
///
/// Where a node is one cell of `level`, its majorant is that of its own matter, which is all
/// alike, and nearer than that of the finest voxels inside.
pub fn for_each_octree_span<B>(
    octree: &Octree,
    (level, outline): (u8, u8),
    grid: &CellGrid,
    ray: &LocalRay,
    mut visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
) -> ControlFlow<B> {
    let top = octree.level_count() - 1;
    let node_level = (outline + NODE_LEVELS).min(top);
    let edge = 1 << (node_level - outline);
    let is_one_cell = outline < level && node_level == level;
    for span in grid.cells(ray, edge) {
        let bound = if is_one_cell {
            octree.outlined_majorant_per_mm(level, span.cell)
        } else {
            octree.majorant_per_mm(node_level, span.cell)
        };
        if bound > 0.0 {
            visit(&span, bound)?;
        }
    }
    ControlFlow::Continue(())
}
