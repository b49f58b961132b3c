//! What is started for renders in processes of their own.

use anyhow::Result;
use organza_report::bench::Program;
use std::sync::{Mutex, PoisonError};

/// The program on the disk, where it is not the process's own.
static STARTED: Mutex<Option<Program>> = Mutex::new(None);

/// Remembers what was started.
pub fn set(program: Option<Program>) {
    *STARTED.lock().unwrap_or_else(PoisonError::into_inner) = program;
}

/// What is started.
///
/// # Errors
/// The process cannot find its own file.
pub fn started() -> Result<Program> {
    let started = STARTED.lock().unwrap_or_else(PoisonError::into_inner);
    Ok(match &*started {
        Some(program) => program.clone(),
        None => Program::this()?,
    })
}
