//! Errors as Python exceptions, which the package defines in `organza/errors.py`.

use organza_requests::{Error, ErrorKind};
use organza_scene::InputError;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

/// The exception of an error. Fields of requests are keywords here, not flags.
pub fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let class = match error.kind {
        ErrorKind::Input if error.is_missing => "MissingFileError",
        ErrorKind::Input => "InputError",
        ErrorKind::Work => "RunError",
        ErrorKind::Stopped => return PyKeyboardInterrupt::new_err(()),
    };
    let made = py
        .import("organza.errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| {
            class.call1((
                in_keywords(&error.to_string()),
                error.file.as_ref().map(|file| file.display().to_string()),
                error.line,
                error.column,
                error.key.as_deref(),
                in_keywords(&error.message),
            ))
        });
    made.map_or_else(|e| e, PyErr::from_value)
}

/// The exception of wrong input.
pub fn input(py: Python<'_>, error: &InputError) -> PyErr {
    exception(py, &anyhow::Error::new(error.clone()).into())
}

/// A message in which `--voxel-um` is `voxel_um`; names of files keep their dashes.
pub fn in_keywords(message: &str) -> String {
    let mut text = String::new();
    let mut rest = message;
    while let Some(at) = rest.find("--") {
        let (before, flag) = rest.split_at(at);
        text += before;
        let begins_word = text.chars().last().is_none_or(|c| " (`,".contains(c));
        let is_letter = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let end = flag.find(|c| !is_letter(c)).unwrap_or(flag.len());
        let (flag, after) = flag.split_at(end);
        match begins_word && flag.len() > 2 {
            true => text += &flag[2..].replace('-', "_"),
            false => text += flag,
        }
        rest = after;
    }
    text + rest
}
