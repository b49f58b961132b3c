//! Flags of comparing models.

use super::values::{parse_level, parse_paths, parse_seed, parse_share, whole};
use super::{CommonArgs, MemoryArgs, PatchModel, VoxelArgs};
use clap::Args;
use std::path::PathBuf;

/// `organza compare`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza compare scenes/fabrics/organza.toml -o report --spp 256"
)]
pub struct CompareArgs {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// Folder to write: report.html, report.json, pairs.csv
    #[arg(short, long, visible_alias = "outfile")]
    pub outdir: PathBuf,
    /// What to compare; the first is the reference unless --data is
    /// [default: fibres if memory allows, volume, surface if the fabric has one]
    #[arg(long, value_enum, value_delimiter = ',')]
    pub models: Vec<PatchModel>,
    /// Measured values to compare with, as the reference: CSV with r,g,b or a WINDOW file (.xml)
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// Paths per pair, at least 2
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = parse_paths)]
    pub spp: u64,
    /// Stop a pair when the standard error of every channel is below this share of the value (0.05 is 5 %)
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Texels of the longer side of the pictures, 8 to 4096
    #[arg(long, value_name = "N", default_value_t = 96, value_parser = whole::<u32>(8..=4096))]
    pub texels: u32,
    /// Paths per texel of the pictures, at least 2
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = parse_paths)]
    pub texel_spp: u64,
    /// Median relative error below which models are said to agree (0.15 is 15 %)
    #[arg(long, value_name = "SHARE", default_value_t = 0.15, value_parser = parse_share)]
    pub limit: f64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_seed)]
    pub seed: u64,
    /// Level of detail of the volumes; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_level)]
    pub level: u8,
    #[command(flatten)]
    pub voxel: VoxelArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}
