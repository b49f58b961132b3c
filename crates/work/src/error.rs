//! Why a piece of work failed.

pub use organza_basis::Stopped;
pub use organza_scene::InputError;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// The kinds of failures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// A file, a key or an option is wrong.
    Input,
    /// Something failed while running.
    Work,
    /// Somebody asked for a stop.
    Stopped,
}

/// Why a request failed, and where if that is known. Its text has all parts:
/// `FILE:LINE:COLUMN: KEY: MESSAGE`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text}")]
pub struct Error {
    /// What kind of failure it is.
    pub kind: ErrorKind,
    /// The file at fault.
    pub file: Option<PathBuf>,
    /// Line in it, from 1.
    pub line: Option<u32>,
    /// Column in it, in characters from 1.
    pub column: Option<u32>,
    /// The key of the file, or the field of the request.
    pub key: Option<String>,
    /// What is wrong, and what was expected.
    pub message: String,
    /// Whether the file is not there.
    pub is_missing: bool,
    text: String,
}

impl Error {
    /// One that has no place.
    pub fn new(kind: ErrorKind, text: impl Into<String>) -> Error {
        let text = text.into();
        Error {
            kind,
            file: None,
            line: None,
            column: None,
            key: None,
            message: text.clone(),
            is_missing: false,
            text,
        }
    }

    /// Of work that was to stop, whatever it ended with.
    pub(crate) fn stopped(ended_with: &anyhow::Error) -> Error {
        Error::new(ErrorKind::Stopped, message(ended_with))
    }
}

impl From<anyhow::Error> for Error {
    fn from(e: anyhow::Error) -> Error {
        let e = match e.downcast::<Error>() {
            Ok(known) => return known,
            Err(e) => e,
        };
        let text = message(&e);
        if e.chain().any(|cause| cause.is::<Stopped>()) {
            return Error::new(ErrorKind::Stopped, text);
        }
        let found = e
            .chain()
            .find_map(|cause| cause.downcast_ref::<InputError>());
        let Some(wrong) = found else {
            return Error::new(ErrorKind::Work, text);
        };
        Error {
            file: wrong.file.clone(),
            line: wrong.line,
            column: wrong.column,
            key: wrong.option.clone().or_else(|| wrong.key.clone()),
            message: wrong.message.clone(),
            is_missing: wrong.is_missing,
            ..Error::new(ErrorKind::Input, text)
        }
    }
}

/// An [`InputError`] as the error of any work.
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

/// The message with its causes in one line. Many errors include their cause; none is
/// repeated.
fn message(e: &anyhow::Error) -> String {
    e.chain().fold(String::new(), |text, cause| {
        match (cause.to_string(), text.as_str()) {
            (cause, "") => cause,
            (cause, _) if text.ends_with(&cause) => text,
            (cause, _) => text + ": " + &cause,
        }
    })
}
