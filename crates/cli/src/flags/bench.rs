//! Flags of measuring speed against error.

use super::values::whole;
use super::{CommonArgs, MemoryArgs};
use clap::Args;
use std::path::PathBuf;

/// `organza bench`
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  organza bench -o report --quick\n  organza bench denim my_fabric.toml -o report\n\nResults are kept in the folder as they come: the same command goes on where it was broken off."
)]
pub struct BenchArgs {
    /// Fabrics: denim, charmeuse, organza, or fabric files (.toml) [default: those three]
    pub fabrics: Vec<String>,
    /// Folder to write: report.html, report.json, choices.csv and all pictures
    #[arg(short, long, visible_alias = "outdir")]
    pub outfile: PathBuf,
    /// Fewer choices, distances and samples: some minutes instead of an hour or more
    #[arg(long)]
    pub quick: bool,
    /// Also measure how cost grows with size [default: unless --quick]
    #[arg(long)]
    pub scaling: bool,
    /// Error of a pixel, as a share of the picture's mean (0.05 is 5 %), within which recommendations are made (repeatable)
    #[arg(long, value_name = "SHARE", value_parser = super::values::parse_share, value_delimiter = ',', default_value = "0.02,0.05,0.1,0.2")]
    pub within: Vec<f64>,
    /// Pixels along an edge of the pictures, 4 to 1024
    #[arg(long, value_name = "N", value_parser = whole::<u32>(4..=1024), default_value_t = 16)]
    pub resolution: u32,
    /// Samples per pixel of every choice, at least 2 [default: 512, quick 192]
    #[arg(long, value_name = "N", value_parser = whole::<u64>(2..=1_000_000))]
    pub spp: Option<u64>,
    /// Samples per pixel of the truth, at least 2 [default: 4096, quick 512]
    #[arg(long, value_name = "N", value_parser = whole::<u64>(2..=1_000_000))]
    pub truth_spp: Option<u64>,
    /// Pictures of another program, as benches/peers/mitsuba_bench.py writes them (.json)
    #[arg(long, value_name = "FILE")]
    pub peer: Option<PathBuf>,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}
