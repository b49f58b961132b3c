//! Tasks that somebody follows.

use crate::context::Context;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// A running task of a known size.
pub struct Progress {
    context: Context,
    task: &'static str,
    total: u64,
    done: AtomicU64,
    has_ended: AtomicBool,
    started: Instant,
}

impl Progress {
    /// Starts a task of `total` units (paths, segments).
    pub fn new(task: &'static str, total: u64, context: &Context) -> Progress {
        context.listener.begin(task, Some(total));
        Progress {
            context: context.clone(),
            task,
            total,
            done: AtomicU64::new(0),
            has_ended: AtomicBool::new(false),
            started: Instant::now(),
        }
    }

    /// Reports that so many units are done, and hears whether to go on.
    pub fn at(&self, done: u64) -> ControlFlow<()> {
        let done = done.min(self.total);
        self.context.listener.progress(self.task, done, self.total);
        self.context.flow()
    }

    /// Reports that so many units more are done, and hears whether to go on.
    pub fn add(&self, more: u64) -> ControlFlow<()> {
        self.at(self.done.fetch_add(more, Ordering::Relaxed) + more)
    }

    /// Ends the task and says how long it took, seconds.
    pub fn finish(&self) -> f64 {
        if !self.has_ended.swap(true, Ordering::Relaxed) {
            self.context.listener.end(self.task);
        }
        self.started.elapsed().as_secs_f64()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}

/// A running task whose end is not known; it ends when this is dropped.
pub struct Waiting {
    context: Context,
    task: String,
}

impl Waiting {
    /// Starts a task.
    pub fn new(task: impl Into<String>, context: &Context) -> Waiting {
        let task = task.into();
        context.listener.begin(&task, None);
        Waiting {
            context: context.clone(),
            task,
        }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.context.listener.end(&self.task);
    }
}
