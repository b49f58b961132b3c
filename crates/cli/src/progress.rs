//! Progress on stderr: a bar with rate and time left on a terminal, silence
//! elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Instant;

/// A running task that a person may be watching.
pub struct Progress {
    bar: ProgressBar,
    started: Instant,
}

impl Progress {
    /// Starts a task of `total` units (paths, segments).
    pub fn new(label: &'static str, total: u64, quiet: bool) -> Progress {
        let shown = !quiet && std::io::stderr().is_terminal();
        let target = if shown {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        let bar = ProgressBar::with_draw_target(Some(total), target);
        let template = "{msg:>10} {wide_bar} {percent:>3}% {per_sec}, {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(label);
        Progress {
            bar,
            started: Instant::now(),
        }
    }

    /// Reports the progress.
    pub fn at(&self, done: u64) {
        // Threads report out of order; the bar only moves on.
        if done > self.bar.position() {
            self.bar.set_position(done);
        }
    }

    /// Ends the task and says how long it took, seconds.
    pub fn finish(&self) -> f64 {
        self.bar.finish_and_clear();
        self.started.elapsed().as_secs_f64()
    }
}
