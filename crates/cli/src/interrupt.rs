//! Ctrl-C, SIGTERM and SIGHUP: the first stops the run in order, the second ends
//! it at once.

use anyhow::{Context, Result};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

static CAME: AtomicBool = AtomicBool::new(false);

/// Exit status of a program that a second Ctrl-C ended, as shells have it.
const INTERRUPTED: i32 = 130;

/// From now on an interrupt is noted instead of ending the program.
///
/// # Errors
/// The system does not allow it.
pub fn watch() -> Result<()> {
    ctrlc::set_handler(|| {
        if CAME.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED);
        }
    })
    .context("cannot watch for interrupts")
}

/// True once the user has asked to stop.
pub fn came() -> bool {
    CAME.load(Ordering::Relaxed)
}

/// A writer that fails once the user has asked to stop.
pub struct Interruptible<W>(pub W);

impl<W: Write> Write for Interruptible<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if came() {
            return Err(std::io::Error::other("interrupted"));
        }
        self.0.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}
