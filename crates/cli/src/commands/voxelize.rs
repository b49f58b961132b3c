//! `organza voxelize`

use super::Command;
use crate::flags::WorkArgs;
use crate::interrupt;
use anyhow::Result;
use clap::Args;
use organza_requests::voxelize::formats_help;
use organza_requests::{Output, Request, Voxelize};
use organza_work::Context;
use std::path::PathBuf;

/// `organza voxelize`
#[derive(Debug, Args)]
#[command(
    about = "Turn one tile of a fabric into a volume file",
    after_help = "Example:\n  organza voxelize scenes/fabrics/organza.toml -o organza.ovox --voxel-um 10",
    mut_arg("outfile", |a| a.help(formats_help()))
)]
pub struct VoxelizeArgs {
    #[command(flatten)]
    pub voxelize: Voxelize,
    /// Volume to write
    #[arg(short, long)]
    pub outfile: PathBuf,
    #[command(flatten)]
    pub work: WorkArgs,
}

impl Command for VoxelizeArgs {
    const NAME: &'static str = "voxelize";

    fn run(&self) -> Result<()> {
        let mut voxelize = self.voxelize.clone();
        let context = Context {
            outputs: voxelize.prepare_for(&self.outfile)?,
            ..self.work.context()
        };
        let volume = voxelize.run(&context)?;
        interrupt::watch();
        let written = volume.write(&self.outfile)?;
        self.work.note(volume.lines(&written));
        Ok(())
    }
}
