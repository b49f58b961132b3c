//! `organza measure`

use super::{Command, run_to};
use crate::flags::WorkArgs;
use crate::terminal;
use anyhow::Result;
use clap::Args;
use organza_requests::Measure;
use std::path::PathBuf;

/// `organza measure`
#[derive(Debug, Args)]
#[command(
    about = "Measure reflection and transmission of a patch of cloth",
    after_help = "Examples:\n  organza measure scenes/fabrics/organza.toml --pairs pairs.csv -o out.csv --target-error 0.02\n  organza measure scenes/fabrics/organza.toml --layout irawan --albedo --json"
)]
pub struct MeasureArgs {
    #[command(flatten)]
    pub measure: Measure,
    /// Table to write: .csv (the angles with r,g,b and their standard errors), .json, .xml (WINDOW and Radiance, with --layout klems or tensor-tree), .bsdf (Mitsuba, with --layout rgl), .ptm (with --layout ptm), .exr (one picture of the tile per pair)
    #[arg(short, long, required_unless_present = "json")]
    pub outfile: Option<PathBuf>,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub work: WorkArgs,
}

impl Command for MeasureArgs {
    const NAME: &'static str = "measure";

    fn run(&self) -> Result<()> {
        let measure = Measure {
            lists_json: self.json,
            ..self.measure.clone()
        };
        let context = self.work.context();
        let measured = run_to(&measure, self.outfile.as_deref(), context.clone())?;
        if self.json {
            terminal::print_json(&measured.json())?;
        }
        self.work.note(measured.lines());
        if let Some(warning) = measured.warning() {
            context.warn(warning);
        }
        self.work.note(measured.dark_line());
        Ok(())
    }
}
