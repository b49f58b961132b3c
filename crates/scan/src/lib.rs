//! From micro-CT volumes to cloth: a stack of grey slices becomes a field of fibre density,
//! orientation and spread, and the field an octree `[Zhao2011]`.
//!
//! - [`ScannedField`] is what the stages of this crate hand on: voxels with fibre, in bricks.
//!   An [`organza_volume::Octree`] is made of it by [`ScannedField::octree`].
//! - [`made_cloth`] turns a field into the frame of its cloth, makes it flat, tells warp and weft
//!   apart and cuts a tile that repeats.
//! - [`input`] reads slices of TIFF, `.vti` and raw volumes.
//! - [`Scan`] looks at the whole volume first (grey levels, fibre radius, noise: [`Survey`]) and
//!   then finds density, orientation and spread slab by slab, in bounded memory.
//!
//! No file is opened here: slices come from bytes and from `Read + Seek`.

mod cloth_frame;
mod disk;
mod error;
mod field;
mod flatten;
pub mod input;
mod interior;
mod levels;
mod noise;
mod orientation;
mod periodic;
pub mod phantom;
mod plane_means;
mod rays;
mod resample;
mod scan;
mod sections;
mod segment;
mod settings;
mod sheet;
mod smooth;

mod window;
#[cfg(test)]
mod woven;

pub use cloth_frame::{ClothFrame, cloth_frame};
pub use error::ScanError;
pub use field::{BRICK, ScannedField, ScannedVoxel, ScannedYarn};
pub use flatten::{FlatSheet, FlattenError, MAX_DEGREE, flattened};
pub use levels::Levels;
pub use periodic::{Jump, PeriodicCut, TooSmall, made_periodic};
pub use scan::{Scan, Slab, Stage, Survey, Watch};
pub use segment::{SYSTEMS, SegmentError, Segmented, segment_yarns};
pub use settings::{DEFAULT_DENOISE, Denoise, GRADIENT_RADII, ScanSettings, TENSOR_RADII};
pub use sheet::{SheetError, SheetFindings, SheetStages, made_cloth};
