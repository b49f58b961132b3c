//! The voxelizer, the sparse octree of fibre mixtures, and volume files.
//!
//! In: curve segments ([`organza_basis::SegmentSource`]). Out: an [`Octree`]
//! that says, for any point and any level of detail, which fibre populations
//! are there ([`organza_basis::Mixture`]) and how much they can block at most.
//!
//! - [`voxelize()`] clips segments to voxels exactly and conserves their length.
//! - [`Octree`] holds all levels, quantised; each level is a regular grid.
//! - [`ovox`] keeps the whole octree in a file.
//! - [`vol`] reads and writes Mitsuba's `.vol` grids, [`vdb`] OpenVDB files;
//!   [`export`] says what of an octree goes into them.

mod block;
mod clip;
mod cluster;
mod error;
pub mod export;
mod fold;
mod lattice;
pub mod octree;
pub mod ovox;
mod record;
mod route;
pub mod vdb;
pub mod vol;
pub mod voxelize;

pub use error::Error;
pub use octree::Octree;
pub use vol::VolGrid;
pub use voxelize::{Footprint, Plan, VoxelizeOptions, voxelize};
