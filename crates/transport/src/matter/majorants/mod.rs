//! Majorants: bounds of the extinction in 1/mm, over all directions. Trackers step by the
//! majorants of blocks of cells and look those of single voxels up before they look up
//! matter.
//!
//! Every medium makes its majorants here: the grids from their samples
//! ([`grid_majorants`]), octrees of micro-flakes from what the octree keeps for its nodes
//! ([`octree_majorants`]), virtual fibres from all fibres within reach
//! ([`fibres_in_reach`]). Draping changes none of them, because cloth over a mesh keeps
//! its extinction per mm.

mod block_majorants;
pub mod fibres_in_reach;
pub mod grid_majorants;
pub mod octree_majorants;
mod voxel_majorants;

pub use block_majorants::{BlockMajorants, blocks_of};
pub use voxel_majorants::VoxelMajorants;
