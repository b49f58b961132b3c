//! Flags of writing scenes for other renderers.

use super::values::parse_repeats;
use super::{CommonArgs, MemoryArgs};
use clap::{Args, Subcommand};
use glam::UVec2;
use std::path::PathBuf;

/// `organza export`
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Which renderer
    #[command(subcommand)]
    pub to: ExportTo,
}

/// The renderers that scenes are written for.
#[derive(Debug, Subcommand)]
pub enum ExportTo {
    /// Mitsuba 3: scene.xml with .vol grids
    Mitsuba(MitsubaArgs),
}

/// `organza export mitsuba`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza export mitsuba scenes/first_light.toml -o mitsuba --repeats 4,4\n  mitsuba -m scalar_rgb mitsuba/scene.xml\n\nMitsuba 3.9.1 draws directions of its sggx phase function in a wrong frame (its issue 1728): its pictures come out too dark. benches/peers/mitsuba_values.py loads a scene with the frame mended."
)]
pub struct MitsubaArgs {
    /// Scene file (TOML)
    pub scene: PathBuf,
    /// Folder to write to; made if there is none
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Periods in x and y to write of a cloth without end, around where the camera looks
    #[arg(long, value_name = "NX,NY", allow_hyphen_values = true, value_parser = parse_repeats)]
    pub repeats: Option<UVec2>,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}
