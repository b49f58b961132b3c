//! `organza completions`

use super::Command;
use crate::terminal;
use anyhow::Result;
use clap::Args;

/// `organza completions`
#[derive(Debug, Args)]
#[command(
    about = "Print the completions of a shell",
    after_help = "Example:\n  organza completions bash > ~/.local/share/bash-completion/completions/organza"
)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: clap_complete::Shell,
}

impl Command for CompletionsArgs {
    const NAME: &'static str = "completions";

    fn run(&self) -> Result<()> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut super::definition(), "organza", &mut script);
        terminal::print(&String::from_utf8(script)?)
    }
}
