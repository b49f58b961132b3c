//! The command line: the only crate that opens paths or prints.
//!
//! [`run`] is the whole program. Errors of the user (a wrong flag, a wrong
//! file) end with exit status 2, failures while running with 1.
//!
//! ```
//! // The drawdown of a weave on standard output, as `organza weave twill-3-1-s`.
//! let code = organza_cli::run(["organza", "weave", "twill-3-1-s"].map(Into::into));
//! assert_eq!(code, std::process::ExitCode::SUCCESS);
//! ```

mod auto_model;
mod bench;
mod btf_file;
mod checkpoint;
mod cloth_levels;
mod cloth_object;
mod commands;
mod drape;
mod environment_file;
mod error;
mod fabric_file;
mod fibre_optics;
mod file_kind;
mod flags;
mod identity;
mod interrupt;
mod journal;
mod mitsuba;
mod optics;
mod output;
mod patches;
mod picture;
mod process_usage;
mod progress;
mod read;
mod report;
mod sample_ranges;
mod scattering;
mod scene_build;
mod scene_file;
mod schedule;
mod toml_words;
mod volume_file;

pub use commands::definition as command;

use std::ffi::OsString;
use std::process::ExitCode;

/// Runs the program on its arguments (the first is the program's name).
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let matches = match command().try_get_matches_from(arguments) {
        Ok(m) => m,
        Err(e) => return print_usage_error(&e),
    };
    let outcome = match commands::run(&matches) {
        Ok(outcome) => outcome,
        Err(e) => return print_usage_error(&e),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            error::print(&e);
            error::exit_code(&e)
        }
    }
}

fn print_usage_error(e: &clap::Error) -> ExitCode {
    // Help and version come this way too, with status 0.
    let code = u8::try_from(e.exit_code()).unwrap_or(2);
    let _ = e.print();
    ExitCode::from(code)
}
