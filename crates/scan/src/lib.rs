//! From micro-CT volumes to cloth: a stack of grey slices becomes a field of fibre density,
//! orientation and spread, and the field an octree `[Zhao2011]`.
//!
//! - [`ScannedField`] is what the stages of this crate hand on: voxels with fibre, in bricks.
//!   An [`organza_volume::Octree`] is made of it by [`ScannedField::octree`].
//!
//! No file is opened here: slices come from bytes and from `Read + Seek`.

mod field;

pub use field::{BRICK, ScannedField, ScannedVoxel, ScannedYarn};
