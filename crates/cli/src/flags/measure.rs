//! Flags of the virtual goniometer.

use super::values::{
    parse_grid, parse_level, parse_paths, parse_positive, parse_seed, parse_share, whole,
};
use super::{CommonArgs, MemoryArgs, VoxelArgs};
use clap::Args;
use organza_measure::KlemsBasis;
use std::path::PathBuf;

/// `organza measure`
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  organza measure scenes/fabrics/organza.toml --pairs pairs.csv -o out.csv --target-error 0.02\n  organza measure scenes/fabrics/organza.toml --layout irawan --albedo --json"
)]
pub struct MeasureArgs {
    /// A fabric file, or a scene file whose objects are measured (TOML)
    pub file: PathBuf,
    /// Directions to measure: CSV with the columns theta_i,phi_i,theta_o,phi_o in degrees, of directions that point away from the cloth, toward light and eye; theta from 0 to 180, above 90 behind the cloth
    #[arg(long, value_name = "FILE", required_unless_present = "layout")]
    pub pairs: Option<PathBuf>,
    /// Directions to measure by name
    #[arg(long, value_enum, conflicts_with = "pairs")]
    pub layout: Option<LayoutName>,
    /// Measure where light from each incident direction goes, reflected, transmitted, straight through and absorbed, instead of the BSDF of pairs; --pairs then needs only theta_i,phi_i
    #[arg(long)]
    pub albedo: bool,
    /// Table to write: .csv (the angles with r,g,b and their standard errors), .json, .xml (WINDOW, with --layout klems), .exr (one picture of the tile per pair)
    #[arg(short, long, required_unless_present = "json")]
    pub outfile: Option<PathBuf>,
    /// What stands for the cloth
    #[arg(long, value_enum, default_value = "volume")]
    pub model: PatchModel,
    /// Paths per pair, at least 2; the most of them with --target-error
    #[arg(long, value_name = "N", default_value_t = 16384, value_parser = parse_paths)]
    pub spp: u64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_seed)]
    pub seed: u64,
    /// Stop a pair when the standard error of every channel is below this share of the value, e.g. 0.02 for 2 % (with --albedo: of the incident light)
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Polar steps on each side and azimuths of --layout grid
    #[arg(long, value_name = "POLAR,AZIMUTHS", allow_hyphen_values = true, value_parser = parse_grid, default_value = "6,12")]
    pub grid: [u32; 2],
    /// Patches of --layout klems
    #[arg(long, value_enum, default_value = "full")]
    pub klems_basis: KlemsBasisName,
    /// Degrees between positions of the lamp of --layout sweep
    #[arg(long, value_name = "DEG", default_value_t = 5.0, value_parser = parse_positive)]
    pub step: f64,
    /// Texels of the longer side of pictures (.exr), 1 to 4096
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = whole::<u32>(1..=4096))]
    pub texels: u32,
    /// Level of detail of a fabric; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_level)]
    pub level: u8,
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

/// Layouts of directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum LayoutName {
    /// 225 incident directions out to 75 degrees times 7 exitant ones
    Irawan,
    /// A regular grid of directions, see --grid
    Grid,
    /// The four matrices of the Klems basis, one path for all exitant directions
    Klems,
    /// A linear light swung over face and back, seen along the normal
    Sweep,
}

/// Klems bases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum KlemsBasisName {
    /// 145 patches a side
    Full,
    /// 73
    Half,
    /// 41
    Quarter,
}

impl From<KlemsBasisName> for KlemsBasis {
    fn from(name: KlemsBasisName) -> KlemsBasis {
        match name {
            KlemsBasisName::Full => KlemsBasis::Full,
            KlemsBasisName::Half => KlemsBasis::Half,
            KlemsBasisName::Quarter => KlemsBasis::Quarter,
        }
    }
}

/// What stands for the cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PatchModel {
    /// Its fibres as the fabric's [scattering] says, micro-flakes if nothing
    Volume,
    /// Every fibre of the fabric, as it is: the ground truth of the others
    Fibres,
    /// Virtual scattering off fibres among others
    Packed,
    /// Virtual scattering off points, in the far field
    Plain,
    /// The reflectance model of the fabric's [surface] section
    Surface,
}

impl PatchModel {
    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            PatchModel::Volume => "volume",
            PatchModel::Fibres => "fibres",
            PatchModel::Packed => "packed",
            PatchModel::Plain => "plain",
            PatchModel::Surface => "surface",
        }
    }
}
