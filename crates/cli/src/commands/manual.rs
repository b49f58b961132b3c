//! `organza completions` and `organza man`: both from the definition of the
//! command line.

use crate::flags::{self, CompletionsArgs, ManArgs};
use crate::{error::input, output, read};
use anyhow::{Context, Result};

/// Prints the completions of a shell.
pub fn completions(args: &CompletionsArgs) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut flags::command(), "organza", &mut script);
    std::io::Write::write_all(&mut std::io::stdout(), &script).context("cannot print")
}

/// Writes a page for the program and for each command.
pub fn pages(args: &ManArgs) -> Result<()> {
    let folder = &args.outfile;
    if folder.exists() && !folder.is_dir() {
        return Err(input(format!(
            "{}: is a file; expected a folder",
            folder.display()
        )));
    }
    std::fs::create_dir_all(folder)
        .map_err(|e| input(format!("{}: {}", folder.display(), read::io_words(&e))))?;
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
