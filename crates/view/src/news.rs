//! What a page receives about the render: its state, what it costs, what went wrong.

use serde::Serialize;
use serde_json::Value;

/// What the render is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Nothing yet.
    #[default]
    Waiting,
    /// Files are read, and fibres become what is traced.
    Building,
    /// Samples are taken.
    Rendering,
    /// All samples are taken.
    Done,
    /// The document cannot be shown; the picture is that of an earlier one.
    Failed,
}

/// What a setting costs, of a picture at its full size.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Samples of a pixel so far.
    pub samples: u64,
    /// Seconds until the first sample: files, voxels, tables.
    pub build_s: f64,
    /// Seconds of tracing so far.
    pub render_s: f64,
    /// Standard error of a pixel, root mean square, over the picture's mean. `None` of one
    /// sample.
    pub noise: Option<f64>,
    /// Standard error of the median pixel that shows cloth, over its own value.
    pub median_noise: Option<f64>,
    /// Seconds of tracing until that of the median pixel is 5 %, from what was measured so far.
    pub seconds_to_5_percent: Option<f64>,
    /// Paths per second.
    pub paths_per_s: f64,
    /// What traced the paths: an engine, or `walk`.
    pub engine: String,
    /// Why the general walk traced them, where nobody asked for it.
    pub why_walk: Option<String>,
}

/// What a cloth is shown as.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shown {
    /// Which of the scene's objects.
    pub object: usize,
    /// The representation, in words.
    pub what: String,
    /// Why, where `auto` chose it.
    pub why: Option<String>,
}

/// The state of the render.
#[derive(Clone, Debug, Default, Serialize)]
pub struct News {
    /// The revision of the document that this is about.
    pub revision: u64,
    /// What is being done.
    pub phase: Phase,
    /// The step of building that takes time, in words.
    pub task: Option<String>,
    /// The share of it that is done.
    pub share: Option<f32>,
    /// Why the document cannot be shown.
    pub error: Option<String>,
    /// What is odd about it.
    pub warnings: Vec<String>,
    /// The number of the picture, 0 if there is none.
    pub picture: u64,
    /// The revision that the picture shows.
    pub picture_revision: u64,
    /// Its columns and rows.
    pub size: [u32; 2],
    /// One in so many columns and rows of the full picture: 1 when it is not coarse.
    pub coarseness: u32,
    /// Stops of exposure that the picture has, where the scene leaves them to it.
    pub exposure_stops: Option<f32>,
    /// Samples that the picture will have.
    pub spp: u64,
    /// What the picture costs.
    pub cost: Cost,
    /// What the last picture before a change of settings had cost.
    pub previous: Option<Cost>,
    /// What the cloths are shown as.
    pub shown: Vec<Shown>,
    /// Textile figures of each fabric, where they are known.
    pub figures: Vec<Value>,
    /// Memory of the process, bytes.
    pub memory_bytes: Option<u64>,
}
