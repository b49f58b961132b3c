//! `organza bake`

use super::{Command, run_to};
use crate::flags::WorkArgs;
use anyhow::Result;
use clap::Args;
use organza_requests::Bake;
use std::path::PathBuf;

/// `organza bake`
#[derive(Debug, Args)]
#[command(
    about = "Make textures and materials of a fabric for other programs: glTF, MaterialX, USD",
    after_help = "Example:\n  organza bake scenes/fabrics/denim.toml -o denim_material --resolution 1024"
)]
pub struct BakeArgs {
    #[command(flatten)]
    pub bake: Bake,
    /// Folder to write: material.glb, material.mtlx, material.usda, textures, and bake.json with all parameters and errors
    #[arg(short, long, visible_alias = "outfile")]
    pub outdir: PathBuf,
    #[command(flatten)]
    pub work: WorkArgs,
}

impl Command for BakeArgs {
    const NAME: &'static str = "bake";

    fn run(&self) -> Result<()> {
        let baking = run_to(&self.bake, Some(&self.outdir), self.work.context())?;
        self.work.note(&baking.lines);
        Ok(())
    }
}
