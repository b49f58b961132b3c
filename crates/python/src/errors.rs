//! Failures as Python exceptions, which the package defines in `organza/errors.py`.

use organza_cli::{Failure, FailureKind};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

/// The exception of a failure.
pub fn exception(py: Python<'_>, failure: &Failure) -> PyErr {
    let class = match failure.kind {
        FailureKind::Input => "InputError",
        FailureKind::Running => "RunError",
        FailureKind::Stopped => return PyKeyboardInterrupt::new_err(()),
    };
    let made = py
        .import("organza.errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| {
            class.call1((
                failure.text.as_str(),
                failure.file.as_deref(),
                failure.line,
                failure.column,
                failure.key.as_deref(),
                failure.message.as_str(),
            ))
        });
    made.map_or_else(|e| e, PyErr::from_value)
}

/// The exception of a message about wrong input.
pub fn input(py: Python<'_>, text: impl Into<String>) -> PyErr {
    exception(py, &Failure::new(FailureKind::Input, text.into()))
}
