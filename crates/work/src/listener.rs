//! Who follows a piece of work.

use organza_film::Film;

/// Hears what happens while something runs. Its functions are called from any thread, and do nothing
/// unless they are written.
pub trait Listener: Send + Sync {
    /// Something is odd but no mistake.
    fn warn(&self, warning: &str) {
        let _ = warning;
    }

    /// Something fails, and the work goes on.
    fn alert(&self, failure: &str) {
        self.warn(failure);
    }

    /// A line about what was found or chosen, for whoever looks on.
    fn note(&self, line: &str) {
        let _ = line;
    }

    /// A task begins: of so many units, or one whose end is not known. Tasks may lie within others.
    fn begin(&self, task: &str, total: Option<u64>) {
        let _ = (task, total);
    }

    /// So many units of a task are done. Threads report out of order.
    fn progress(&self, task: &str, done: u64, total: u64) {
        let _ = (task, done, total);
    }

    /// The picture so far, between two passes.
    fn picture(&self, film: &Film) {
        let _ = film;
    }

    /// Memory that it takes to follow a picture of so many pixels, bytes.
    fn picture_bytes(&self, width: u32, height: u32) -> u64 {
        let _ = (width, height);
        0
    }

    /// A task has ended, well or not.
    fn end(&self, task: &str) {
        let _ = task;
    }
}

/// Hears nothing.
#[derive(Clone, Copy, Debug)]
pub struct Silent;

impl Listener for Silent {}
