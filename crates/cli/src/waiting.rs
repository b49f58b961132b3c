//! Lines on stderr while work goes on whose end is not known.

use crate::host::{Host, Watch};
use crate::output::{ends_silence, note};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// So long nothing else is printed before a line is: longer than [`crate::progress`] waits, which
/// has more to say.
const SILENCE: Duration = Duration::from_secs(4);

/// Work that somebody may be waiting for. While it lives, a line says now and then that it goes
/// on, unless others are printed.
pub struct Waiting {
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Waiting {
    /// Begins; nothing is printed where `watch` is quiet, or for a program.
    pub fn new<'w>(label: impl Into<String>, watch: impl Into<Watch<'w>>) -> Waiting {
        Waiting::every(SILENCE, label.into(), watch.into())
    }

    fn every(silence: Duration, label: String, watch: Watch<'_>) -> Waiting {
        let mut waiting = Waiting {
            end: None,
            thread: None,
        };
        if watch.is_quiet || watch.host.and_then(Host::caller).is_some() {
            return waiting;
        }
        let (end, ended) = channel();
        let started = Instant::now();
        let lines = move || {
            while ended.recv_timeout(silence / 8) == Err(RecvTimeoutError::Timeout) {
                if ends_silence(silence) {
                    note!("{label}: {:.0} s so far", started.elapsed().as_secs_f64());
                }
            }
        };
        let thread = std::thread::Builder::new().spawn(lines);
        // Without a thread the work goes on in silence.
        waiting.thread = thread.ok();
        waiting.end = Some(end);
        waiting
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
    use crate::output::was_printed_since;

    #[test]
    fn silence_ends_after_a_while_unless_it_is_wanted() {
        let silence = Duration::from_millis(20);
        assert!(
            Waiting::every(silence, "quiet".into(), true.into())
                .thread
                .is_none()
        );
        let began = Instant::now();
        let waiting = Waiting::every(silence, "test".into(), false.into());
        while !was_printed_since(began) {
            assert!(
                began.elapsed() < Duration::from_secs(60),
                "nothing was printed"
            );
            std::thread::sleep(silence);
        }
        drop(waiting);
    }
}
