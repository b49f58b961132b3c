//! `organza weave`

use super::{Command, run_to};
use crate::flags::CommonArgs;
use crate::terminal;
use anyhow::Result;
use clap::Args;
use organza_requests::Weave;
use std::path::PathBuf;

/// `organza weave`
#[derive(Debug, Args)]
#[command(
    about = "Draw a draft or a fabric's weave",
    after_help = "Examples:\n  organza weave satin-8-3 -o satin.png\n  organza weave draft.wif -o draft.toml\n  organza weave draft.wif --json"
)]
pub struct WeaveArgs {
    #[command(flatten)]
    pub weave: Weave,
    /// What to write: the drawdown or the curves as a picture (.png), a fabric file for the draft (.toml), the curves as polylines (.obj), text (.txt) or .bcc [default: print the drawdown]
    #[arg(short, long)]
    pub outfile: Option<PathBuf>,
    /// Print repeat, floats and cover as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for WeaveArgs {
    const NAME: &'static str = "weave";

    fn run(&self) -> Result<()> {
        let woven = run_to(&self.weave, self.outfile.as_deref(), self.common.context())?;
        if self.json {
            terminal::print_json(&woven.json())?;
        } else if self.outfile.is_none() {
            terminal::print(&woven.drawdown()?)?;
        }
        Ok(())
    }
}
