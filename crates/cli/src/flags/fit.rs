//! Flags of fitting.

use super::values::{parse_angles, parse_paths, parse_patience, parse_positive, parse_seed};
use super::{CommonArgs, MemoryArgs, PatchModel, VoxelArgs};
use clap::Args;
use std::path::PathBuf;

/// `organza fit`
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  organza fit scenes/fabrics/denim.toml -o fitted.toml\n  organza fit scenes/fabrics/denim.toml --what fibres --data measured.xml -o fitted.toml\n  organza fit scenes/fabrics/denim.toml --what picture --data photograph.exr --light 30,0 --width-mm 8 -o fitted.toml"
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
    /// Measured values to fit to: CSV with r,g,b, a WINDOW file (.xml) or, for a picture, an .exr, .hdr or .png [default for a surface: the fabric's volume]
    #[arg(long, value_name = "FILE", required_if_eq_any([("what", "fibres"), ("what", "picture")]))]
    pub data: Option<PathBuf>,
    /// What stands for the volume
    #[arg(long, value_enum, default_value = "volume")]
    pub model: PatchModel,
    /// Paths per pair of the volume, or per texel of a picture, at least 2
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = parse_paths)]
    pub spp: u64,
    /// Places of the search: looked at all over, then at most of each descent [default: 200,400 for a surface, 0,60 for fibres]
    #[arg(long, value_name = "SCAN,STEPS", allow_hyphen_values = true, value_parser = parse_patience)]
    pub patience: Option<[u32; 2]>,
    /// Direction toward the light of a picture, polar angle and azimuth from the weft, degrees
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles, default_value = "45,0")]
    pub light: [f64; 2],
    /// Direction toward the viewer of a picture
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles, default_value = "0,0")]
    pub view: [f64; 2],
    /// Width of the cloth in a picture, mm [default: the fabric's tile]
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub width_mm: Option<f64>,
    /// Value of a picture where white paper would lie
    #[arg(long, value_name = "VALUE", default_value_t = 1.0, value_parser = parse_positive)]
    pub white: f64,
    /// Remember what was computed in this file, and go on from it
    #[arg(long, value_name = "FILE")]
    pub journal: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_seed)]
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
    /// Colour and roughness of the fibres, from one picture of the cloth
    Picture,
}
