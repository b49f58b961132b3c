//! Turns errors into messages and exit codes, in one place.

use crate::output::note;
pub use organza_scene::InputError;

/// An [`InputError`] as the error of any command: exit status 2.
pub fn input(message: impl Into<String>) -> anyhow::Error {
    anyhow::Error::new(InputError(message.into()))
}

/// 2 when the input was wrong, 1 when running failed.
pub fn exit_code(e: &anyhow::Error) -> u8 {
    let wrong_input = e.chain().any(|cause| cause.is::<InputError>());
    if wrong_input { 2 } else { 1 }
}

/// Prints [`message`].
pub fn print(e: &anyhow::Error) {
    note!("organza: {}", message(e));
}

/// The message with its causes in one line. Many errors include their cause; none is
/// repeated.
pub fn message(e: &anyhow::Error) -> String {
    e.chain().fold(String::new(), |text, cause| {
        match (cause.to_string(), text.as_str()) {
            (cause, "") => cause,
            (cause, _) if text.ends_with(&cause) => text,
            (cause, _) => text + ": " + &cause,
        }
    })
}
