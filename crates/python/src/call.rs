//! Commands that run while Python waits, listens for Ctrl-C and shows progress.

use crate::array::buffer;
use crate::errors::exception;
use organza_cli::{Caller, Failure, FailureKind, Results};
use organza_scene::GivenFiles;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::collections::HashMap;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Time between two looks at signals and progress.
const LOOK: Duration = Duration::from_millis(50);

/// Stack of the thread that runs a command: that of a process's first thread on Linux.
const STACK_BYTES: usize = 8 << 20;

/// A step that a command is at.
#[derive(Clone, Debug, PartialEq)]
struct Step {
    task: String,
    done: u64,
    total: u64,
}

/// What a command and the interpreter tell each other.
#[derive(Default)]
struct Exchange {
    given: Arc<GivenFiles>,
    is_stopped: AtomicBool,
    step: Mutex<Option<Step>>,
    warnings: Mutex<Vec<String>>,
    results: Mutex<Vec<Results>>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Caller for Exchange {
    fn given(&self) -> Arc<GivenFiles> {
        Arc::clone(&self.given)
    }

    fn warn(&self, warning: &str) {
        locked(&self.warnings).push(warning.to_owned());
    }

    fn progress(&self, task: &str, done: u64, total: u64) {
        let mut step = locked(&self.step);
        match &mut *step {
            Some(step) if step.task == task && step.total == total => {
                step.done = step.done.max(done);
            }
            _ => {
                let task = task.to_owned();
                *step = Some(Step { task, done, total });
            }
        }
    }

    fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    fn take(&self, results: Results) {
        locked(&self.results).push(results);
    }
}

/// Calls back into Python for what has happened since the last look.
struct Reporter<'py> {
    progress: Option<Bound<'py, PyAny>>,
    warn: Bound<'py, PyAny>,
    shown: Option<Step>,
}

impl Reporter<'_> {
    fn report(&mut self, exchange: &Exchange) -> PyResult<()> {
        let warnings = std::mem::take(&mut *locked(&exchange.warnings));
        for warning in warnings {
            self.warn.call1((warning,))?;
        }
        let Some(progress) = &self.progress else {
            return Ok(());
        };
        let step = locked(&exchange.step).clone();
        if let Some(step) = step
            && self.shown.as_ref() != Some(&step)
        {
            let share = step.done as f64 / step.total.max(1) as f64;
            progress.call1((step.task.as_str(), share))?;
            self.shown = Some(step);
        }
        Ok(())
    }
}

/// Runs a command: `arguments` are the words after `organza`, `files` stand for the files at
/// their paths. `progress(task, share)` and `warn(message)` are called in this thread, about
/// twenty times a second at most; what they raise stops the command, as Ctrl-C does.
///
/// Returns a dictionary with `arrays` (name: type, shape, bytes), `figures` (name: JSON text)
/// and `files` (name: bytes).
pub fn call<'py>(
    py: Python<'py>,
    arguments: Vec<OsString>,
    files: HashMap<PathBuf, Vec<u8>>,
    warn: Bound<'py, PyAny>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let exchange = Arc::new(Exchange {
        given: Arc::new(files.into_iter().collect()),
        ..Exchange::default()
    });
    let mut reporter = Reporter {
        progress,
        warn,
        shown: None,
    };
    let (send, receive) = channel();
    let caller = Arc::clone(&exchange);
    let worker = thread::Builder::new()
        .name("organza".into())
        .stack_size(STACK_BYTES)
        .spawn(move || {
            // Nobody waits any more if this fails.
            let _ = send.send(organza_cli::call(&arguments, caller));
        })
        .map_err(|e| PyRuntimeError::new_err(format!("cannot start a thread: {e}")))?;
    let mut raised = None;
    let receive = Mutex::new(receive);
    let finished = loop {
        match py.detach(|| locked(&receive).recv_timeout(LOOK)) {
            Ok(finished) => break finished,
            Err(RecvTimeoutError::Disconnected) => {
                let text = "a defect of organza: the command did not end".to_owned();
                break Err(Failure::new(FailureKind::Running, text));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let looked = py.check_signals().and_then(|()| match raised {
            None => reporter.report(&exchange),
            Some(_) => Ok(()),
        });
        if let Err(e) = looked {
            exchange.is_stopped.store(true, Ordering::Relaxed);
            raised = Some(e);
        }
    };
    let _ = py.detach(|| worker.join());
    if let Some(e) = raised {
        return Err(e);
    }
    reporter.report(&exchange)?;
    finished.map_err(|failure| exception(py, &failure))?;
    let (arrays, figures, bytes) = (PyDict::new(py), PyDict::new(py), PyDict::new(py));
    for results in std::mem::take(&mut *locked(&exchange.results)) {
        for (name, array) in &results.arrays {
            arrays.set_item(name, buffer(py, array)?)?;
        }
        for (name, figure) in &results.figures {
            figures.set_item(name, figure.to_string())?;
        }
        for (name, file) in &results.files {
            bytes.set_item(name, PyBytes::new(py, file))?;
        }
    }
    let found = PyDict::new(py);
    found.set_item("arrays", arrays)?;
    found.set_item("figures", figures)?;
    found.set_item("files", bytes)?;
    Ok(found)
}
