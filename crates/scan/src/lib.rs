//! From micro-CT volumes to cloth: a stack of grey slices becomes a field of fibre density,
//! orientation and spread, and the field an octree `[Zhao2011]`.
//!
//! - [`ScannedField`] is what the stages of this crate hand on: voxels with fibre, in bricks.
//!   An [`organza_volume::Octree`] is made of it by [`ScannedField::octree`].
//! - [`made_cloth`] turns a field into the frame of its cloth, makes it flat, tells warp and weft
//!   apart and cuts a tile that repeats.
//!
//! No file is opened here: slices come from bytes and from `Read + Seek`.

mod cloth_frame;
mod field;
mod flatten;
mod periodic;
mod resample;
mod segment;
mod sheet;
#[cfg(test)]
mod woven;

pub use cloth_frame::{ClothFrame, cloth_frame};
pub use field::{BRICK, ScannedField, ScannedVoxel, ScannedYarn};
pub use flatten::{FlatSheet, FlattenError, MAX_DEGREE, flattened};
pub use periodic::{Jump, PeriodicCut, TooSmall, made_periodic};
pub use segment::{SYSTEMS, SegmentError, Segmented, segment_yarns};
pub use sheet::{SheetError, SheetFindings, SheetStages, made_cloth};
