//! `organza man`

use super::Command;
use anyhow::{Context, Result};
use clap::Args;
use organza_work::{of_file, of_io, output};
use std::path::{Path, PathBuf};

/// `organza man`
#[derive(Debug, Args)]
#[command(
    about = "Write the manual pages",
    after_help = "Example:\n  organza man -o ~/.local/share/man/man1"
)]
pub struct ManArgs {
    /// Folder for one page per command, organza.1 and so on; created if missing
    #[arg(short, long, value_name = "DIR")]
    pub outfile: PathBuf,
}

impl Command for ManArgs {
    const NAME: &'static str = "man";

    /// Writes a page for the program and for each command.
    fn run(&self) -> Result<()> {
        let folder = &self.outfile;
        if folder.exists() && !folder.is_dir() {
            return Err(of_file(folder, "is a file; expected a folder"));
        }
        std::fs::create_dir_all(folder).map_err(|e| of_io(folder, &e))?;
        output::check_writable(&folder.join("organza.1"))?;
        let mut program = super::definition();
        // Gives the commands the names under which they are called.
        program.build();
        write(folder, &program)
    }
}

/// Writes the pages of a command and of those below it.
fn write(folder: &Path, command: &clap::Command) -> Result<()> {
    let is_page = |c: &&clap::Command| !c.is_hide_set() && c.get_name() != "help";
    for below in command.get_subcommands().filter(is_page) {
        write(folder, below)?;
    }
    let page = clap_mangen::Man::new(command.clone());
    let path = folder.join(page.get_filename());
    output::write_file(&path, |out| {
        page.render(out).context("cannot lay out the page")
    })
}
