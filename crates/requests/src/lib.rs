//! What organza does, as requests and results.
//!
//! A request is a plain struct, whose fields are also the flags of the command of its name and the keys
//! of a table; [`Request::run`] does the work in a [`Context`], and the [`Output`] holds what was found.
//! Files are written in a second step, [`Output::write`].
//!
//! ```
//! use organza_requests::{Context, Output, Render, Request};
//!
//! # fn main() -> Result<(), organza_requests::Error> {
//! let render = Render { scene: "plain".into(), spp: Some(2), set: vec!["camera.resolution=[8,8]".into()], ..Render::default() };
//! let picture = render.run(&Context::default())?;
//! assert_eq!(picture.film.size().x, 8);
//! # Ok(())
//! # }
//! ```
#![allow(clippy::disallowed_methods)] // reads data files, and writes what was found

pub mod bake;
mod bench;
pub mod compare;
pub mod measure;
pub mod render;
mod request;
pub mod scan;
mod studio;
pub mod table;
pub mod voxelize;
pub mod weave;

pub use bake::Bake;
pub use bench::Bench;
pub use compare::Compare;
pub use measure::Measure;
pub use organza_fit::Fit;
pub use organza_work::{
    Array, Context, Error, ErrorKind, Listener, Numbers, Output, Request, Results, Silent, StopFlag,
};
pub use render::{Picture, Render};
pub use request::{Stated, run_table};
pub use scan::Scan;
pub use table::Table;
pub use voxelize::{Volume, Voxelize};
pub use weave::Weave;

/// What requests find, and the values of their fields.
pub mod requests {
    pub use crate::bake::Baking;
    pub use crate::bench::{Program, Trackers};
    pub use crate::compare::Compared;
    pub use crate::measure::{BandName, KlemsBasisName, LayoutName, Measurement, Values};
    pub use crate::render::{EngineName, Picture, StudioName};
    pub use crate::scan::{Denoise, RawType, ScannedVolume};
    pub use crate::table::MadeTable;
    pub use crate::voxelize::{FootprintName, Volume};
    pub use crate::weave::{CurveLevelName, Woven};
    pub use organza_fit::{Fitted, NamedRegion, TARGETS, Target, TargetName};
}
