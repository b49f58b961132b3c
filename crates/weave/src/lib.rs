//! Drafts, yarn centrelines, plies and fibres: cloth as a stream of curve
//! segments.
//!
//! A [`FabricGeometry`] (the geometry part of a fabric file) becomes a
//! [`Cloth`], and a cloth is an [`organza_basis::SegmentSource`]: warp yarns
//! run along y, weft yarns along x, the face is up. Nothing here opens files
//! or prints.

mod cloth;
pub mod curve_file;
pub mod draft;
mod error;
mod fit;
mod ini;
mod knit;
mod named;
mod path;
mod picture;
pub mod preset;
mod relax;
pub mod spec;
mod strand;
mod wif;
mod yarn;

pub use cloth::{Cloth, Curves, Figures, Level, Loader, Material, SystemFigures};
pub use draft::{Draft, Thread};
pub use error::Error;
pub use picture::Picture;
pub use spec::FabricGeometry;
pub use yarn::{Hairs, Loops, MAX_FIBRE_VOLUME_FRACTION, MAX_FIBRES_PER_PLY, Yarn};
