//! The function with which a report writes its files; the caller supplies it.

use std::path::Path;

/// Why a file could not be written.
pub type WriteError = Box<dyn std::error::Error + Send + Sync>;

/// Writes a file that appears under its name only when complete.
pub type WriteFile<'a> = &'a dyn Fn(&Path, &[u8]) -> Result<(), WriteError>;
