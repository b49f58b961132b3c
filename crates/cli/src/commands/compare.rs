//! `organza compare`

use super::{Command, run_to};
use crate::flags::WorkArgs;
use anyhow::Result;
use clap::Args;
use organza_requests::Compare;
use std::path::PathBuf;

/// `organza compare`
#[derive(Debug, Args)]
#[command(
    about = "Compare the models of a fabric with each other or with measured values",
    after_help = "Example:\n  organza compare scenes/fabrics/organza.toml -o report --spp 256"
)]
pub struct CompareArgs {
    #[command(flatten)]
    pub compare: Compare,
    /// Folder to write: report.html, report.json, pairs.csv
    #[arg(short, long, visible_alias = "outfile")]
    pub outdir: PathBuf,
    #[command(flatten)]
    pub work: WorkArgs,
}

impl Command for CompareArgs {
    const NAME: &'static str = "compare";

    fn run(&self) -> Result<()> {
        let comparison = run_to(&self.compare, Some(&self.outdir), self.work.context())?;
        self.work.note(comparison.0.summary());
        Ok(())
    }
}
