//! Progress on stderr: a bar with rate and time left on a terminal, a line at intervals
//! elsewhere.

use crate::host::{Host, Watch};
use crate::output::{ends_silence, note, printed};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// So long nothing is printed before a line takes the place of a bar.
const SILENCE: Duration = Duration::from_secs(3);

/// A running task that a person may be watching.
pub struct Progress {
    bar: ProgressBar,
    label: &'static str,
    host: Host,
    started: Instant,
    /// Lines take the place of a bar.
    has_lines: bool,
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
            has_lines: !shown && !watch.is_quiet && !is_program,
        }
    }

    /// Reports the progress. Breaks once a program that runs the command asked it to stop.
    pub fn at(&self, done: u64) -> ControlFlow<()> {
        if let Some(caller) = self.host.caller() {
            let total = self.bar.length().unwrap_or(0);
            caller.progress(self.label, done.min(total), total);
        }
        // Threads report out of order; the bar only moves on.
        if done > self.bar.position() {
            self.bar.set_position(done);
        }
        if !self.bar.is_hidden() {
            printed();
        }
        if self.has_lines && ends_silence(SILENCE) {
            self.print_line();
        }
        self.host.goes_on()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::Caller;
    use crate::results::Results;
    use organza_scene::GivenFiles;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// Asks for a stop once half of a task is done.
    #[derive(Default)]
    struct Impatient(AtomicU64);

    impl Caller for Impatient {
        fn given(&self) -> Arc<GivenFiles> {
            Arc::default()
        }
        fn warn(&self, _: &str) {}
        fn progress(&self, _: &str, done: u64, total: u64) {
            self.0.store(2 * done / total, Ordering::Relaxed);
        }
        fn is_stopped(&self) -> bool {
            self.0.load(Ordering::Relaxed) > 0
        }
        fn take(&self, _: Results) {}
    }

    #[test]
    fn progress_breaks_once_the_caller_asks_for_a_stop() {
        let host = Host::program(Arc::new(Impatient::default()), String::new(), false);
        let watch = Watch {
            is_quiet: true,
            host: Some(&host),
        };
        let progress = Progress::new("testing", 10, watch);
        assert!(progress.at(4).is_continue());
        assert!(progress.at(5).is_break());
        let alone = Progress::new("testing", 10, true);
        assert!(alone.at(10).is_continue());
    }
}
