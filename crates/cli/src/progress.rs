//! Progress on stderr: a bar with rate and time left on a terminal, a line at intervals
//! elsewhere.

use crate::host::{Host, Watch};
use crate::output::{note, printed};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Time before the first line of a task that no terminal shows, and between two.
const BETWEEN_LINES: Duration = Duration::from_secs(4);

/// A running task that a person may be watching.
pub struct Progress {
    bar: ProgressBar,
    label: &'static str,
    host: Host,
    started: Instant,
    /// When the last line was printed, or the task began, where lines take the place of a bar.
    line: Option<Mutex<Instant>>,
}

impl Progress {
    /// Starts a task of `total` units (paths, segments).
    pub fn new<'w>(label: &'static str, total: u64, watch: impl Into<Watch<'w>>) -> Progress {
        let watch = watch.into();
        let host = watch.host.cloned().unwrap_or_default();
        let is_program = host.caller().is_some();
        let shown = !watch.is_quiet && !is_program && std::io::stderr().is_terminal();
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
            label,
            host,
            started: Instant::now(),
            line: (!shown && !watch.is_quiet && !is_program).then(|| Mutex::new(Instant::now())),
        }
    }

    /// Reports the progress. A program that runs the command may end it here, see
    /// [`Host::stop_if_asked`].
    pub fn at(&self, done: u64) {
        if let Some(caller) = self.host.caller() {
            let total = self.bar.length().unwrap_or(0);
            caller.progress(self.label, done.min(total), total);
            self.host.stop_if_asked();
        }
        // Threads report out of order; the bar only moves on.
        if done > self.bar.position() {
            self.bar.set_position(done);
        }
        if !self.bar.is_hidden() {
            printed();
        }
        // Another thread that prints the line does it for all.
        if let Some(line) = &self.line
            && let Ok(mut last) = line.try_lock()
            && last.elapsed() >= BETWEEN_LINES
        {
            *last = Instant::now();
            self.print_line();
        }
    }

    fn print_line(&self) {
        let total = self.bar.length().unwrap_or(0).max(1);
        let share = self.bar.position() as f64 / total as f64;
        let left = self.started.elapsed().as_secs_f64() * (1.0 / share.max(1e-9) - 1.0);
        let left = match share {
            // Too early to know.
            s if s < 0.01 => String::new(),
            _ => format!(", about {left:.0} s left"),
        };
        note!("{}: {:.0} %{left}", self.label, 100.0 * share);
    }

    /// Ends the task and says how long it took, seconds.
    pub fn finish(&self) -> f64 {
        self.bar.finish_and_clear();
        self.started.elapsed().as_secs_f64()
    }
}
