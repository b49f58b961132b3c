//! The general walk: scenes, paths through them, and the pictures that paths make.

mod render;
mod scene;
mod trace;

pub(crate) use render::add_samples;

pub use render::{Crop, Pass, RenderError, RenderSettings, Rendering, Watch, render};
pub use scene::Scene;
pub use trace::{MAX_EVENTS, trace_from, trace_path};
