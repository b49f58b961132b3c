//! The voxelizer, the sparse octree of fibre mixtures, and volume files.
//!
//! The input is a stream of curve segments ([`organza_basis::SegmentSource`]), the output an
//! [`Octree`]. It gives, for any point and level of detail, the fibre populations there
//! ([`organza_basis::Mixture`]) and a bound of their extinction.
//!
//! - [`voxelize()`] clips segments to voxels exactly and conserves their length.
//! - [`octree_of_mixtures`] takes voxels whose mixtures are known already, such as a scan's.
//! - [`Octree`] holds all levels, quantised; each level is a regular grid.
//! - [`format`] holds the file formats, one file each: [`ovox`] keeps the whole
//!   octree, [`vol`] is Mitsuba's grids, [`vdb`] OpenVDB.
//! - [`GridSet`] holds dense grids, the contents of formats of other programs.
//!
//! ```
//! use glam::Vec3;
//! use organza_basis::{Aabb, Budget, unwatched};
//! use organza_basis::curve::{Segment, SegmentList};
//! use organza_volume::{FibreFootprint, VoxelizeOptions, ovox, voxelize};
//!
//! # fn main() -> Result<(), organza_volume::Error> {
//! // One fibre of 10 um across a tile of 0.1 mm.
//! let ends = [Vec3::new(0.0, 0.05, 0.02), Vec3::new(0.1, 0.05, 0.02)];
//! let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::new(0.1, 0.1, 0.04));
//! let segments = vec![Segment::straight(ends[0], ends[1], 0.005)];
//! let source = SegmentList::new(bounds_mm, true, segments);
//! let options = VoxelizeOptions {
//!     voxel_mm: 0.02,
//!     levels: None,
//!     footprint: FibreFootprint::Axis,
//!     max_memory_bytes: Some(1 << 30),
//! };
//! let octree = voxelize(&source, &options, &unwatched)?;
//! assert!((octree.fibre_length_mm(0) - 0.1).abs() < 1e-3);
//! let here = octree.mixture_at(0, Vec3::new(0.05, 0.05, 0.02));
//! assert!(here.as_slice()[0].axis.x.abs() > 0.99);
//!
//! let mut file = Vec::new();
//! ovox::write(&octree, &[], &mut file)?;
//! let again = ovox::read(&mut &file[..], &mut Budget::new(1 << 30))?;
//! assert_eq!(again.octree.occupied_voxels(), octree.occupied_voxels());
//! # Ok(())
//! # }
//! ```

mod block;
mod block_layout;
mod clip;
mod cluster;
mod division;
mod error;
mod fold;
mod footprint;
pub mod format;
mod known_mixtures;
mod lattice;
pub mod octree;
mod packing;
mod parts;
mod record;
mod route;
pub mod voxelize;

pub use block_layout::BlockLayout;
pub use error::Error;
pub use footprint::FibreFootprint;
pub use format::grid_set::GridSet;
pub use format::vol::VolGrid;
pub use format::{ovox, vdb, vol};
pub use known_mixtures::{MixtureGrid, MixtureSource, octree_of_mixtures};
pub use octree::{BlockCut, Octree, sub_cell_bit};
pub use packing::{MaterialPacking, MeasuredPacking, PackingFactor};
pub use parts::Parts;
pub use voxelize::{VoxelizeOptions, VoxelizePlan, voxelize};
