//! Failures as Python exceptions, which the package defines in `organza/errors.py`.

use organza_cli::{Failure, FailureKind};
use organza_scene::InputError;
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
                failure.key.as_deref().or(failure.option.as_deref()),
                failure.message.as_str(),
            ))
        });
    made.map_or_else(|e| e, PyErr::from_value)
}

/// The exception of wrong input.
pub fn input(py: Python<'_>, e: &InputError) -> PyErr {
    exception(py, &Failure::from(e))
}
