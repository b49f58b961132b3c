//! Flags of rendering and of putting renders together.

use super::values::{parse_crop, parse_duration, parse_positive, parse_seed, parse_share, whole};
use super::{CommonArgs, MemoryArgs};
use crate::sample_ranges::parse_range;
use clap::Args;
use organza_transport::Crop;
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

/// `organza render`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza render scenes/first_light.toml -o first_light.exr --spp 256 --stats"
)]
pub struct RenderArgs {
    /// Scene file (TOML)
    pub scene: PathBuf,
    /// Picture to write: .exr or .png
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Samples per pixel, at least 1; the most of them with --target-error or --time-limit [default: the scene's]
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1..=u64::from(u32::MAX)))]
    pub spp: Option<u32>,
    /// Seed of all random numbers [default: the scene's]
    #[arg(long, value_name = "N", value_parser = parse_seed)]
    pub seed: Option<u64>,
    /// Render only these pixels: left, top, right, bottom (right and bottom outside), counted from the upper left
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true, value_parser = parse_crop)]
    pub crop: Option<Crop>,
    /// Take only these samples of every pixel; parts (.exr) are put together by `organza merge`
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = parse_range, conflicts_with = "spp")]
    pub samples: Option<Range<u64>>,
    /// Stop when this time has passed since the start, e.g. 60s, 5m, 2h; a bare number is seconds
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = parse_duration)]
    pub time_limit: Option<Duration>,
    /// Stop when the standard error of the pixels (root mean square) is at most this fraction of the picture's mean, e.g. 0.02
    #[arg(long, value_name = "FRACTION", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Stop when half the pixels that met matter have a standard error of at most this fraction of their own value, e.g. 0.01; with --target-error, when both are reached
    #[arg(long, value_name = "FRACTION", value_parser = parse_share)]
    pub target_median_error: Option<f64>,
    /// Darken single samples above this radiance, which biases the picture; --stats tells how much light that takes away [default: the scene's, or no limit]
    #[arg(long, value_name = "RADIANCE", value_parser = parse_positive)]
    pub clamp: Option<f64>,
    /// Save what was gathered to this file now and then, when interrupted and at the end
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Time between two checkpoints
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = parse_duration, default_value = "60s", requires = "checkpoint")]
    pub checkpoint_every: Duration,
    /// Go on from the checkpoint
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,
    /// What walks the paths; auto takes the widest vectors there are where the scene allows it, else the general walk
    #[arg(long, value_enum, default_value = "auto")]
    pub backend: BackendName,
    /// Print counts of collisions, shadow steps and rejected samples, fireflies and memory
    #[arg(long)]
    pub stats: bool,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// What walks the paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BackendName {
    /// The widest kernel there is where the scene allows it, else the walk
    Auto,
    /// The general walk, which can do every scene
    Walk,
    /// The kernel, one path at a time
    Scalar,
    /// The kernel, 16 paths at a time
    Avx2,
    /// The kernel, 32 paths at a time
    Avx512,
}

/// `organza merge`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza render scenes/first_light.toml --samples 0..128 -o a.exr\n  organza render scenes/first_light.toml --samples 128..256 -o b.exr\n  organza merge a.exr b.exr -o all.exr"
)]
pub struct MergeArgs {
    /// Pictures of one scene and seed (.exr), with no sample in common
    #[arg(required = true)]
    pub parts: Vec<PathBuf>,
    /// Picture to write (.exr)
    #[arg(short, long)]
    pub outfile: PathBuf,
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// Say nothing but errors
    #[arg(long)]
    pub quiet: bool,
}
