//! `organza completions` and `organza man`: both from the definition of the
//! command line.

use crate::flags::{self, CompletionsArgs, ManArgs};
use crate::{error::input, output};
use anyhow::{Context, Result};

/// Prints the completions of a shell.
pub fn completions(args: &CompletionsArgs) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut flags::command(), "organza", &mut script);
    std::io::Write::write_all(&mut std::io::stdout(), &script).context("cannot print")
}

/// Writes a page for the program and for each command.
pub fn pages(args: &ManArgs) -> Result<()> {
    if !args.outfile.is_dir() {
        return Err(input(format!(
            "{}: expected a folder that exists",
            args.outfile.display()
        )));
    }
    output::check_writable(&args.outfile.join("organza.1"))?;
    let mut program = flags::command();
    // Gives the commands the names under which they are called.
    program.build();
    let write = |command: clap::Command| -> Result<()> {
        let page = clap_mangen::Man::new(command);
        let path = args.outfile.join(page.get_filename());
        output::write_file(&path, |out| {
            page.render(out).context("cannot lay out the page")
        })
    };
    for command in program.get_subcommands().filter(|c| !c.is_hide_set()) {
        write(command.clone())?;
    }
    write(program)
}
