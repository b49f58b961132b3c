//! The command line: the only crate that prints. It turns flags into requests, and what they find into
//! files and lines.
//!
//! [`run`] is the whole program. Errors of the user (a wrong flag, a wrong
//! file) end with exit status 2, failures while running with 1.
//!
//! ```
//! // The drawdown of a weave on standard output, as `organza weave twill-3-1-s`.
//! let code = organza_cli::run(["organza", "weave", "twill-3-1-s"].map(Into::into));
//! assert_eq!(code, std::process::ExitCode::SUCCESS);
//! ```
#![allow(clippy::disallowed_methods)] // reads and writes files, and prints

mod commands;
mod data_sheet;
mod display_server;
mod flags;
mod interrupt;
mod program;
mod terminal;

pub use commands::definition as command;
pub use organza_report::bench::Program;

use clap::error::ErrorKind;
use organza_work::Error;
use std::ffi::OsString;
use std::process::ExitCode;
use terminal::note;

/// Runs the program on its arguments (the first is the program's name).
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    ExitCode::from(status(arguments, None))
}

/// The same; returns the exit status as a number. `program` is what was started, where it is
/// not the process's own file: a script that an interpreter runs.
pub fn status(arguments: impl IntoIterator<Item = OsString>, program: Option<Program>) -> u8 {
    program::set(program);
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let matches = match command().try_get_matches_from(&arguments) {
        Ok(m) => m,
        Err(e) if e.kind() == ErrorKind::DisplayVersion && commands::is_verbose(&arguments) => {
            let printed = terminal::print(&organza_work::version::description());
            return of_result(printed);
        }
        Err(e) => return print_usage_error(&e),
    };
    match commands::run(&matches) {
        Ok(result) => of_result(result),
        Err(e) => print_usage_error(&e),
    }
}

/// The exit status of a result; prints its error.
fn of_result(result: anyhow::Result<()>) -> u8 {
    let Err(e) = result else {
        return 0;
    };
    let e = Error::from(e);
    note!("organza: {e}");
    match e.kind {
        organza_work::ErrorKind::Input => 2,
        _ => 1,
    }
}

fn print_usage_error(e: &clap::Error) -> u8 {
    // Help and version come this way too, with status 0.
    let code = u8::try_from(e.exit_code()).unwrap_or(2);
    let _ = e.print();
    code
}
