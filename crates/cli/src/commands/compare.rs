//! `organza compare`

use super::Command;
use crate::flags::WorkArgs;
use anyhow::Result;
use clap::Args;
use organza_requests::{Compare, Output, Request};
use organza_work::Context;
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
        let mut compare = self.compare.clone();
        let context = Context {
            outputs: compare.prepare_for(&self.outdir)?,
            ..self.work.context()
        };
        let comparison = compare.run(&context)?;
        comparison.write(&self.outdir)?;
        self.work.note(comparison.0.summary());
        Ok(())
    }
}
