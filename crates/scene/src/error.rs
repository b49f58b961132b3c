//! The error of wrong input.

/// A file, or a value of the command line, is wrong. The message names the file,
/// the place and the key, and what was expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct InputError(pub String);

/// What everything here returns: only input can be wrong.
pub type Result<T, E = InputError> = std::result::Result<T, E>;

/// An [`InputError`] of a message.
pub(crate) fn input(message: impl Into<String>) -> InputError {
    InputError(message.into())
}
