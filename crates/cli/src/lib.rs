//! The command line: the only crate that prints.
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

mod btf_file;
mod building;
mod call;
mod checkpoint;
mod commands;
mod data_sheet;
mod denoising;
mod display_server;
mod error;
mod flags;
mod host;
mod identity;
mod interrupt;
mod journal;
mod kept_light;
mod locked_file;
mod number_journal;
mod output;
mod output_folder;
mod picture;
mod process_usage;
mod progress;
mod result_cache;
mod results;
mod sample_ranges;
mod schedule;
mod version;
mod waiting;

pub use call::{Failure, FailureKind, call};
pub use commands::definition as command;
pub use host::Caller;
pub use journal::{Journal, Record, Work};
pub use number_journal::NumberJournal;
pub use organza_report::bench::Program;
pub use results::{Array, Numbers, Results};

use clap::error::ErrorKind;
use host::Host;
use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the program on its arguments (the first is the program's name).
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    ExitCode::from(status(arguments, None))
}

/// The same; returns the exit status as a number. `program` is what was started, where it is
/// not the process's own file: a script that an interpreter runs.
pub fn status(arguments: impl IntoIterator<Item = OsString>, program: Option<Program>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let matches = match command().try_get_matches_from(&arguments) {
        Ok(m) => m,
        Err(e) if e.kind() == ErrorKind::DisplayVersion && commands::is_verbose(&arguments) => {
            return match output::print(&version::description()) {
                Ok(()) => 0,
                Err(e) => {
                    error::print(&e);
                    error::exit_code(&e)
                }
            };
        }
        Err(e) => return print_usage_error(&e),
    };
    let outcome = match commands::run_for(&matches, Host::terminal(program)) {
        Ok(outcome) => outcome,
        Err(e) => return print_usage_error(&e),
    };
    match outcome {
        Ok(()) => 0,
        Err(e) => {
            error::print(&e);
            error::exit_code(&e)
        }
    }
}

fn print_usage_error(e: &clap::Error) -> u8 {
    // Help and version come this way too, with status 0.
    let code = u8::try_from(e.exit_code()).unwrap_or(2);
    let _ = e.print();
    code
}
