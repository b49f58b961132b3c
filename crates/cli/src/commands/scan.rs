//! `organza scan`

use super::{Command, run_to};
use crate::flags::{CommonArgs, MemoryArgs};
use anyhow::Result;
use clap::Args;
use organza_requests::Scan;
use organza_work::Context;
use std::path::PathBuf;

/// `organza scan`
#[derive(Debug, Args)]
#[command(
    about = "Turn a micro-CT volume of a cloth into a volume file",
    after_help = "Examples:\n  organza scan CT.tif --voxel-um 1.5 -o cloth.ovox\n  organza scan slices/ --voxel-um 2 --colour 0.6,0.1,0.1 -o cloth.ovox\n  organza scan CT.raw --raw-size 512,512,400 --raw-type u16 --voxel-um 1 -o cloth.ovox\n  organza scan CT.tif --voxel-um 1.5 --flatten --yarns --tile -o tile.ovox"
)]
pub struct ScanArgs {
    #[command(flatten)]
    pub scan: Scan,
    /// Volume to write (.ovox)
    #[arg(short, long)]
    pub outfile: PathBuf,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for ScanArgs {
    const NAME: &'static str = "scan";

    fn run(&self) -> Result<()> {
        let context = Context {
            max_memory_bytes: self.memory.max_memory,
            ..self.common.context()
        };
        let volume = run_to(&self.scan, Some(&self.outfile), context)?;
        self.common.note([volume.line(&self.outfile)]);
        Ok(())
    }
}
