//! Flags of fitting.

use super::values::parse_patience;
use super::{CommonArgs, MemoryArgs, PatchModel, VoxelArgs};
use clap::Args;
use std::path::PathBuf;

/// `organza fit`
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  organza fit scenes/fabrics/denim.toml -o fitted.toml\n  organza fit scenes/fabrics/denim.toml --what fibres --data measured.xml -o fitted.toml"
)]
pub struct FitArgs {
    /// Fabric file (TOML): where the search begins
    pub fabric: PathBuf,
    /// Fabric file to write, with the fitted values
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// What to fit
    #[arg(long, value_enum, default_value = "surface")]
    pub what: FitWhat,
    /// Measured values to fit to: CSV with r,g,b or a WINDOW file (.xml) [default for a surface: the fabric's volume]
    #[arg(long, value_name = "FILE", required_if_eq("what", "fibres"))]
    pub data: Option<PathBuf>,
    /// What stands for the volume
    #[arg(long, value_enum, default_value = "volume")]
    pub model: PatchModel,
    /// Paths per pair of the volume
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u64).range(2..))]
    pub spp: u64,
    /// Places of the search: looked at all over, then steps of each descent
    #[arg(long, value_name = "SCAN,STEPS", value_parser = parse_patience, default_value = "60,300")]
    pub patience: [u32; 2],
    /// Remember what was computed in this file, and go on from it
    #[arg(long, value_name = "FILE")]
    pub journal: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    #[command(flatten)]
    pub voxel: VoxelArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// What to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FitWhat {
    /// The [surface] section
    Surface,
    /// Colour, roughness and density of the fibres
    Fibres,
}
