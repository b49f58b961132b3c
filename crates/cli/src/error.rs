//! Turns errors into messages and exit codes, in one place.

use crate::output::note;
pub use organza_scene::InputError;
use std::process::ExitCode;

/// An [`InputError`] as the error of any command: exit status 2.
pub fn input(message: impl Into<String>) -> anyhow::Error {
    anyhow::Error::new(InputError(message.into()))
}

/// 2 when the input was wrong, 1 when running failed.
pub fn exit_code(e: &anyhow::Error) -> ExitCode {
    let wrong_input = e.chain().any(|cause| cause.is::<InputError>());
    ExitCode::from(if wrong_input { 2 } else { 1 })
}

/// The message with its causes in one line. Many errors include their cause; none is
/// printed twice.
pub fn print(e: &anyhow::Error) {
    let words = e.chain().fold(String::new(), |text, cause| {
        match (cause.to_string(), text.as_str()) {
            (cause, "") => cause,
            (cause, _) if text.ends_with(&cause) => text,
            (cause, _) => text + ": " + &cause,
        }
    });
    note!("organza: {words}");
}
