//! The crate from outside. Each module describes itself.
#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::disallowed_methods)] // helpers outside test functions

mod blended_fibres;
mod blocks;
mod cloth_patch; // helper of several
mod fibres_in_cells;
mod flat_cloth;
mod lit_sheet;
mod packed_fabrics;
mod packed_memory;
mod packed_voxel_size;
mod pile_sheen;
mod sameness;
mod shipped_fabrics;
mod transmitting_flakes;
