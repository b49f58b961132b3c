//! `organza table`

use super::{Command, run_to};
use crate::flags::WorkArgs;
use crate::terminal;
use anyhow::Result;
use clap::Args;
use organza_requests::Table;
use std::path::PathBuf;

/// `organza table`
#[derive(Debug, Args)]
#[command(
    about = "Make the far-field table of a fabric, which model = \"table\" shows",
    after_help = "Examples:\n  organza table scenes/fabrics/denim.toml -o scenes/fabrics/denim.bsdf\n  organza table scenes/fabrics/organza.toml -o organza.bsdf --target-error 0.05 --journal organza.journal"
)]
pub struct TableArgs {
    #[command(flatten)]
    pub table: Table,
    /// Table to write, a name that ends in .bsdf; model = "table" finds it beside the fabric under the fabric's name
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

impl Command for TableArgs {
    const NAME: &'static str = "table";

    fn run(&self) -> Result<()> {
        let made = run_to(&self.table, Some(&self.outfile), self.work.context())?;
        if self.json {
            terminal::print_json(&made.json(&self.outfile))?;
        }
        self.work.note(made.lines(&self.outfile));
        Ok(())
    }
}
