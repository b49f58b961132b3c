//! Drafts, yarn centrelines, plies and fibres: cloth as a stream of curve
//! segments.
//!
//! A [`FabricGeometry`] (the geometry part of a fabric file) becomes a
//! [`Cloth`], and a cloth is an [`organza_basis::SegmentSource`]: warp yarns
//! run along y, weft yarns along x, the face is up. Nothing here opens files
//! or prints.
//!
//! ```
//! use organza_basis::SegmentSource;
//! use organza_weave::{Cloth, FabricGeometry};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let geometry: FabricGeometry = toml::from_str(
//!     r#"
//!     draft = { weave = "twill-3-1-z" }
//!     warp = { yarn = "cotton", per_cm = 24.0 }
//!     weft = { yarn = "cotton", per_cm = 18.0 }
//!     yarn.cotton = { preset = "cotton", tex = 30.0 }
//!     "#,
//! )?;
//! // Nothing to load: the draft is named, and no file of curves is.
//! let no_files = |_: &str| Err(std::io::ErrorKind::NotFound.into());
//! let cloth = Cloth::build(&geometry, &no_files, 1)?;
//! println!("{}", cloth.draft().unwrap().drawdown());
//!
//! let mut length_mm = 0.0;
//! for batch in 0..cloth.batch_count() {
//!     cloth.for_each_in_batch(batch, &mut |segment| length_mm += segment.length_mm());
//! }
//! assert!(length_mm > 0.0 && cloth.tile().repeats);
//! # Ok(())
//! # }
//! ```

pub mod blend;
mod closure;
mod cloth;
mod clump;
pub mod colour_list;
mod crimp;
pub mod curve_file;
pub mod draft;
mod drawn_curve;
mod dye;
mod error;
mod evenness;
mod felt;
mod fit;
mod hairs;
mod ini;
mod knit;
mod layers;
mod lockstitch;
mod named;
mod neps;
mod openings;
mod openwork;
mod palette;
mod path;
mod picture;
mod pile;
pub mod preset;
mod protruding;
mod push_apart;
mod random_curve;
mod relax;
mod runs;
mod section;
mod separate;
mod sett;
pub mod spec;
pub mod spinning;
mod spline;
mod strand;
mod sway;
pub mod synthesis;
mod wander;
mod web;
mod wif;
mod yarn;

pub use cloth::{
    BorderGaps, Cloth, CurveLevel, Curves, Figures, Irregularity, Loader, Material,
    NonwovenFigures, OpenworkFigures, PileFigures, PillSpec, Plies, PlyStrand, PrintImage,
    PrintMode, PrintSide, PrintSpec, SystemFigures, SystemIrregularity, ThreadSystem, Unravelled,
    WearSpec,
};
pub use draft::{Draft, Thread};
pub use error::Error;
pub use lockstitch::{Lockstitch, LockstitchSpec};
pub use openwork::OpenworkKind;
pub use picture::Picture;
pub use sett::{Sett, SettYarn};
pub use spec::FabricGeometry;
pub use synthesis::{Exemplar, Synthesis, SynthesisFigures, SynthesisSpec, YarnHeights};
pub use yarn::{Hairs, Loops, Yarn};
