//! One place that turns errors into words and exit codes.

use crate::output::note;
use std::fmt;
use std::process::ExitCode;

/// The user's input or command line is wrong: exit status 2.
#[derive(Debug)]
pub struct InputError(pub String);

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for InputError {}

/// An [`InputError`] as the error of any command.
pub fn input(message: impl Into<String>) -> anyhow::Error {
    anyhow::Error::new(InputError(message.into()))
}

/// 2 when the input was wrong, 1 when running failed.
pub fn exit_code(e: &anyhow::Error) -> ExitCode {
    let wrong_input = e.chain().any(|cause| cause.is::<InputError>());
    ExitCode::from(if wrong_input { 2 } else { 1 })
}

/// Says what went wrong, causes in one line. Many an error tells its cause
/// itself; none is told twice.
pub fn print(e: &anyhow::Error) {
    let words = e.chain().fold(String::new(), |told, cause| {
        match (cause.to_string(), told.as_str()) {
            (cause, "") => cause,
            (cause, _) if told.ends_with(&cause) => told,
            (cause, _) => told + ": " + &cause,
        }
    });
    note!("organza: {words}");
}
