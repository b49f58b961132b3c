//! Requests that run while Python waits, listens for Ctrl-C and shows progress.

use crate::array::buffer;
use crate::errors::{exception, in_keywords};
use organza_requests::{Context, Error, ErrorKind, Listener, Results, StopFlag, run_table};
use organza_scene::GivenFiles;
use organza_work::values::parse_bytes;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::collections::HashMap;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Time between two looks at signals and progress.
const LOOK: Duration = Duration::from_millis(50);

/// Stack of the thread that runs a request: that of a process's first thread on Linux.
const STACK_BYTES: usize = 8 << 20;

/// A step that a request is at.
#[derive(Clone, Debug, PartialEq)]
struct Step {
    task: String,
    done: u64,
    total: u64,
}

/// What a request and the interpreter tell each other.
#[derive(Default)]
struct Exchange {
    step: Mutex<Option<Step>>,
    warnings: Mutex<Vec<String>>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Listener for Exchange {
    fn warn(&self, warning: &str) {
        locked(&self.warnings).push(in_keywords(warning));
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

/// Runs the request of a name, which a text states as TOML; `files` stand for the files at their
/// paths. `about` has the threads, the most memory and the cache of the context, and how the
/// request was asked for. `progress(task, share)` and `warn(message)` are called in this thread,
/// about twenty times a second at most; what they raise stops the request, as Ctrl-C does.
///
/// Returns a dictionary with `arrays` (name: type, shape, bytes), `figures` (name: JSON text)
/// and `files` (name: bytes).
pub fn call<'py>(
    py: Python<'py>,
    (name, request): (String, String),
    files: HashMap<PathBuf, Vec<u8>>,
    about: (Option<u16>, Option<String>, Option<OsString>, String),
    warn: Bound<'py, PyAny>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let exchange = Arc::new(Exchange::default());
    let stop = StopFlag::default();
    let mut reporter = Reporter {
        progress,
        warn,
        shown: None,
    };
    let (threads, memory, cache, command) = about;
    let wrong = |why| exception(py, &organza_work::of_option("max_memory", why).into());
    let memory = memory.map(|text| parse_bytes(&text).map_err(wrong));
    let context = Context {
        threads,
        max_memory_bytes: memory.transpose()?,
        cache,
        given: Arc::new(files.into_iter().collect::<GivenFiles>()),
        listener: exchange.clone(),
        stop: stop.clone(),
        command,
        ..Context::default()
    };
    let (send, receive) = channel();
    let work = move || -> Result<Results, Error> {
        let table = toml::from_str(&request).map_err(anyhow::Error::from)?;
        run_table(&name, table, &context)
    };
    let worker = thread::Builder::new()
        .name("organza".into())
        .stack_size(STACK_BYTES)
        .spawn(move || {
            // A panic is a defect of organza, and no reason to end the interpreter. Nobody waits
            // any more if the result cannot be sent.
            let result = catch_unwind(AssertUnwindSafe(work));
            let _ = send.send(result.unwrap_or_else(|payload| {
                let text = payload.downcast_ref::<String>().map(String::as_str);
                let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
                let text = format!("a defect of organza: {}", text.unwrap_or("no message"));
                Err(Error::new(ErrorKind::Work, text))
            }));
        })
        .map_err(|e| PyRuntimeError::new_err(format!("cannot start a thread: {e}")))?;
    let mut raised = None;
    let receive = Mutex::new(receive);
    let finished = loop {
        match py.detach(|| locked(&receive).recv_timeout(LOOK)) {
            Ok(finished) => break finished,
            Err(RecvTimeoutError::Disconnected) => {
                let text = "a defect of organza: the request did not end";
                break Err(Error::new(ErrorKind::Work, text));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let looked = py.check_signals().and_then(|()| match raised {
            None => reporter.report(&exchange),
            Some(_) => Ok(()),
        });
        if let Err(e) = looked {
            stop.ask();
            raised = Some(e);
        }
    };
    let _ = py.detach(|| worker.join());
    if let Some(e) = raised {
        return Err(e);
    }
    reporter.report(&exchange)?;
    let results = finished.map_err(|error| exception(py, &error))?;
    let (arrays, figures, bytes) = (PyDict::new(py), PyDict::new(py), PyDict::new(py));
    for (name, array) in &results.arrays {
        arrays.set_item(name, buffer(py, array)?)?;
    }
    for (name, figure) in &results.figures {
        figures.set_item(name, figure.to_string())?;
    }
    for (name, file) in &results.files {
        bytes.set_item(name, PyBytes::new(py, file))?;
    }
    let found = PyDict::new(py);
    found.set_item("arrays", arrays)?;
    found.set_item("figures", figures)?;
    found.set_item("files", bytes)?;
    Ok(found)
}
