//! Flags of voxelizing.

use super::values::{parse_level, whole};
use super::{CommonArgs, MemoryArgs, VoxelArgs};
use clap::Args;
use std::path::PathBuf;

/// `organza voxelize`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza voxelize scenes/fabrics/organza.toml -o organza.ovox --voxel-um 10"
)]
pub struct VoxelizeArgs {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// Volume to write: .ovox (the whole octree), .vdb (OpenVDB) or .vol (Mitsuba: three files, .sigma_t.vol, .sggx.vol and .albedo.vol)
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Level of detail that .vdb and .vol hold (an .ovox holds all); 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_level)]
    pub level: u8,
    /// Store 16-bit floats (.vdb)
    #[arg(long)]
    pub half: bool,
    /// Do not compress (.vdb)
    #[arg(long)]
    pub raw: bool,
    #[command(flatten)]
    pub voxel: VoxelArgs,
    /// Number of levels of detail, 1 to 8 [default: as many as fit, at most 6]
    #[arg(long, value_name = "N", value_parser = whole::<u8>(1..=8))]
    pub levels: Option<u8>,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}
