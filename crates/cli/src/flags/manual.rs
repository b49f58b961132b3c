//! Flags of completions and manual pages.

use clap::Args;
use std::path::PathBuf;

/// `organza completions`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza completions bash > ~/.local/share/bash-completion/completions/organza"
)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: clap_complete::Shell,
}

/// `organza man`
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  organza man -o ~/.local/share/man/man1")]
pub struct ManArgs {
    /// Folder for one page a command, organza.1 and so on; made if there is none
    #[arg(short, long, value_name = "DIR")]
    pub outfile: PathBuf,
}
