//! Turns errors into messages and exit codes, in one place.

use crate::output::note;
pub use organza_scene::InputError;
use std::fmt::Display;
use std::path::Path;

/// An [`InputError`] as the error of any command: exit status 2.
pub fn input(message: impl Display) -> anyhow::Error {
    InputError::new(message).into()
}

/// The same of a file.
pub fn of_file(path: impl AsRef<Path>, message: impl Display) -> anyhow::Error {
    InputError::of_file(path, message).into()
}

/// The same of a key of a file.
pub fn of_key(
    path: impl AsRef<Path>,
    key: impl Into<String>,
    message: impl Display,
) -> anyhow::Error {
    InputError::of_key(path, key, message).into()
}

/// The same of a file that cannot be read, listed or made.
pub fn of_io(path: impl AsRef<Path>, e: &std::io::Error) -> anyhow::Error {
    InputError::of_io(path, e).into()
}

/// The same of an option: `--OPTION: MESSAGE`.
pub fn of_option(name: &str, message: impl Display) -> anyhow::Error {
    InputError::of_option(name, message).into()
}

/// The same where the message runs on from the option: `--level 9: the octree has 6`.
pub fn after_option(name: &str, message: impl Display) -> anyhow::Error {
    InputError::after_option(name, message).into()
}

/// The wrong input that an error is about, if it is about one.
pub fn wrong_input(e: &anyhow::Error) -> Option<&InputError> {
    e.chain().find_map(|cause| cause.downcast_ref())
}

/// 2 when the input was wrong, 1 when running failed.
pub fn exit_code(e: &anyhow::Error) -> u8 {
    if wrong_input(e).is_some() { 2 } else { 1 }
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
