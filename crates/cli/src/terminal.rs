//! What a person at a terminal sees: results on the standard output; warnings, notes and progress on
//! the standard error, as a bar with rate and time left on a terminal, as a line now and then elsewhere.

use crate::display_server::{self, Address, DisplayServer};
use crate::interrupt;
use anyhow::{Context as _, Result};
use glam::UVec2;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use organza_film::Film;
use organza_work::Listener;
use std::io::{IsTerminal, Write};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Writes to the standard output. A reader that is gone has seen enough.
///
/// # Errors
/// Whatever else the output refuses: a full disk.
pub fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write to the standard output"),
    }
}

/// Prints a value as JSON.
///
/// # Errors
/// Those of [`print`].
pub fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// A line on the standard error; a reader that is gone is no error.
macro_rules! note {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($words)*);
        $crate::terminal::printed();
    }};
}
pub(crate) use note;

/// When the last line was printed.
static LAST_LINE: Mutex<Option<Instant>> = Mutex::new(None);

/// Remembers that something was printed just now.
pub fn printed() {
    *locked(&LAST_LINE) = Some(Instant::now());
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether nothing was printed for so long, since the first who asked: whoever hears so prints.
fn ends_silence(time: Duration) -> bool {
    // Another thread that asks prints for all.
    let Ok(mut last) = LAST_LINE.try_lock() else {
        return false;
    };
    let now = Instant::now();
    let is_silent = now - *last.get_or_insert(now) >= time;
    if is_silent {
        *last = Some(now);
    }
    is_silent
}

/// So long nothing is printed before a line takes the place of a bar.
const SILENCE: Duration = Duration::from_secs(3);

/// The same of a task whose end is not known, which has less to say.
const LONG_SILENCE: Duration = Duration::from_secs(4);

/// The terminal of a command.
#[derive(Default)]
pub struct Terminal {
    is_quiet: bool,
    tasks: Mutex<Vec<Task>>,
    shown: Mutex<Shown>,
}

/// Where a render is shown while it goes on.
#[derive(Default)]
struct Shown {
    /// The server, and the name of the picture there.
    at: Option<(Address, String)>,
    server: Option<DisplayServer>,
}

/// A running task.
struct Task {
    label: String,
    started: Instant,
    kind: Kind,
}

enum Kind {
    Bar(ProgressBar),
    Lines,
    /// Ends when it is dropped.
    Waiting {
        _lines: Waiting,
    },
}

impl Terminal {
    /// One that shows errors alone, or more.
    pub fn new(is_quiet: bool) -> Terminal {
        Terminal {
            is_quiet,
            ..Terminal::default()
        }
    }

    /// Shows pictures under a name by a server.
    pub fn showing(mut self, address: Address, name: String) -> Terminal {
        self.shown = Mutex::new(Shown {
            at: Some((address, name)),
            server: None,
        });
        self
    }

    /// Shows the last picture.
    pub fn finish(&self, film: &Film) {
        if let Some(server) = locked(&self.shown).server.take() {
            server.finish(film);
        }
    }
}

impl Listener for Terminal {
    fn warn(&self, warning: &str) {
        if !self.is_quiet {
            note!("organza: warning: {warning}");
        }
    }

    fn alert(&self, failure: &str) {
        note!("organza: warning: {failure}");
    }

    fn note(&self, line: &str) {
        if !self.is_quiet {
            note!("{line}");
        }
    }

    fn begin(&self, task: &str, total: Option<u64>) {
        if self.is_quiet {
            return;
        }
        let kind = match total {
            None => Kind::Waiting {
                _lines: Waiting::new(task, LONG_SILENCE),
            },
            Some(total) if std::io::stderr().is_terminal() => {
                let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
                let template = "{msg:>10} {wide_bar} {percent:>3}% {per_sec}, {eta} left";
                if let Ok(style) = ProgressStyle::with_template(template) {
                    bar.set_style(style);
                }
                bar.set_message(task.to_owned());
                Kind::Bar(bar)
            }
            Some(_) => Kind::Lines,
        };
        locked(&self.tasks).push(Task {
            label: task.to_owned(),
            started: Instant::now(),
            kind,
        });
    }

    fn progress(&self, task: &str, done: u64, total: u64) {
        let tasks = locked(&self.tasks);
        let Some(task) = tasks.iter().rev().find(|t| t.label == task) else {
            return;
        };
        match &task.kind {
            Kind::Bar(bar) => {
                // Threads report out of order; the bar only moves on.
                if done > bar.position() {
                    bar.set_position(done);
                }
                printed();
            }
            Kind::Lines if ends_silence(SILENCE) => {
                let share = done as f64 / total.max(1) as f64;
                let left = task.started.elapsed().as_secs_f64() * (1.0 / share.max(1e-9) - 1.0);
                let left = match share {
                    // Too early to know.
                    s if s < 0.01 => String::new(),
                    _ => format!(", about {left:.0} s left"),
                };
                note!("{}: {:.0} %{left}", task.label, 100.0 * share);
            }
            _ => {}
        }
    }

    fn picture(&self, film: &Film) {
        // What is built is lost in any case; from here on the first interrupt keeps the picture.
        interrupt::watch();
        let mut shown = locked(&self.shown);
        if let (None, Some((address, name))) = (&shown.server, &shown.at) {
            let server = DisplayServer::start(address, name, film.size(), self.is_quiet);
            shown.server = Some(server);
        } else if let Some(server) = &shown.server {
            server.show(film);
        }
    }

    fn picture_bytes(&self, width: u32, height: u32) -> u64 {
        let is_shown = locked(&self.shown).at.is_some();
        if is_shown {
            display_server::memory_bytes(UVec2::new(width, height))
        } else {
            0
        }
    }

    fn end(&self, task: &str) {
        let mut tasks = locked(&self.tasks);
        if let Some(at) = tasks.iter().rposition(|t| t.label == task) {
            let task = tasks.remove(at);
            drop(tasks);
            if let Kind::Bar(bar) = &task.kind {
                bar.finish_and_clear();
            }
        }
    }
}

/// A thread that says now and then that work goes on, unless others print.
struct Waiting {
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Waiting {
    fn new(label: &str, silence: Duration) -> Waiting {
        let (end, ended) = channel();
        let (started, label) = (Instant::now(), label.to_owned());
        let lines = move || {
            while ended.recv_timeout(silence / 8) == Err(RecvTimeoutError::Timeout) {
                if ends_silence(silence) {
                    note!("{label}: {:.0} s so far", started.elapsed().as_secs_f64());
                }
            }
        };
        Waiting {
            end: Some(end),
            // Without a thread the work goes on in silence.
            thread: std::thread::Builder::new().spawn(lines).ok(),
        }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.end = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_ends_after_a_while() {
        let silence = Duration::from_millis(20);
        let began = Instant::now();
        let waiting = Waiting::new("test", silence);
        let was_printed = || locked(&LAST_LINE).is_some_and(|last| last > began);
        while !was_printed() {
            assert!(
                began.elapsed() < Duration::from_secs(60),
                "nothing was printed"
            );
            std::thread::sleep(silence);
        }
        drop(waiting);
    }
}
