//! Who runs a command: a person at a terminal, or another program.
//!
//! A command that a person runs reads files, prints its progress and writes files. Another
//! program gives files in memory, follows the progress, may stop the command, and takes the
//! results as arrays; the computation between is the same.

use crate::results::Results;
use anyhow::Result;
use organza_report::bench::Program;
use organza_scene::GivenFiles;
use organza_scene::loader::Loader;
use std::ops::ControlFlow;
use std::sync::Arc;

/// A program that runs a command. Its functions are called from any thread.
pub trait Caller: Send + Sync {
    /// Files that it gives in memory.
    fn given(&self) -> Arc<GivenFiles>;

    /// Something is odd but no mistake.
    fn warn(&self, warning: &str);

    /// So many units of a task are done. Threads report out of order.
    fn progress(&self, task: &str, done: u64, total: u64);

    /// Whether the command is to stop as soon as it can.
    fn is_stopped(&self) -> bool;

    /// Takes what the command found.
    fn take(&self, results: Results);
}

/// Who runs a command; by default a person at a terminal.
#[derive(Clone, Default)]
pub struct Host {
    caller: Option<Arc<dyn Caller>>,
    /// The command line that a program gave.
    command_line: String,
    /// Whether it names an output.
    has_output: bool,
    /// The program on the disk, where it is not the process's own.
    renderer: Option<Program>,
    /// Files that the command itself made in memory, with those of the caller.
    made: Option<Arc<GivenFiles>>,
}

impl std::fmt::Debug for Host {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Host")
            .field("is_program", &self.caller.is_some())
            .field("has_output", &self.has_output)
            .finish()
    }
}

impl Host {
    /// A program that runs `command_line`, which names an output or not.
    pub fn program(caller: Arc<dyn Caller>, command_line: String, has_output: bool) -> Host {
        Host {
            caller: Some(caller),
            command_line,
            has_output,
            renderer: None,
            made: None,
        }
    }

    /// A person at a terminal who started `renderer`.
    pub fn terminal(renderer: Option<Program>) -> Host {
        Host {
            renderer,
            ..Host::default()
        }
    }

    /// What is started for renders in processes of their own.
    ///
    /// # Errors
    /// The process cannot find its own file.
    pub fn renderer(&self) -> Result<Program> {
        Ok(match &self.renderer {
            Some(program) => program.clone(),
            None => Program::this()?,
        })
    }

    /// The command line, for files that record how they were made.
    pub fn command_line(&self) -> String {
        match self.caller {
            Some(_) => self.command_line.clone(),
            None => std::env::args().collect::<Vec<_>>().join(" "),
        }
    }

    /// Whether output files are written: always but for programs that name none.
    pub fn writes(&self) -> bool {
        self.caller.is_none() || self.has_output
    }

    /// Gives the results to a program that wants them.
    pub fn give(&self, results: impl FnOnce() -> Results) {
        if let Some(caller) = &self.caller {
            caller.take(results());
        }
    }

    /// The same for results that may fail.
    ///
    /// # Errors
    /// Those of `results`.
    pub fn try_give(&self, results: impl FnOnce() -> Result<Results>) -> Result<()> {
        if let Some(caller) = &self.caller {
            caller.take(results()?);
        }
        Ok(())
    }

    /// A loader that knows the files of the caller and reports to nobody.
    pub fn loader(&self) -> Loader<'static> {
        self.with_given(Loader::new())
    }

    /// The loader with the files of the caller, and those that the command made.
    pub fn with_given<'p>(&self, loader: Loader<'p>) -> Loader<'p> {
        match (&self.made, &self.caller) {
            (Some(made), _) => loader.with_given(Arc::clone(made)),
            (None, Some(caller)) => loader.with_given(caller.given()),
            (None, None) => loader,
        }
    }

    /// The same host with files that the command made in memory.
    pub fn with_made(&self, made: GivenFiles) -> Host {
        let given = self.caller.as_ref().map(|c| c.given());
        let mut all = given.map_or_else(GivenFiles::default, Arc::unwrap_or_clone);
        all.extend(made);
        Host {
            made: Some(Arc::new(all)),
            ..self.clone()
        }
    }

    /// The program, if it is one.
    pub fn caller(&self) -> Option<&Arc<dyn Caller>> {
        self.caller.as_ref()
    }

    /// Breaks once the caller asked the command to stop.
    pub fn goes_on(&self) -> ControlFlow<()> {
        match self.caller.as_ref().is_some_and(|c| c.is_stopped()) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

/// Where messages and progress go.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// Whether a terminal shows errors alone.
    pub is_quiet: bool,
    /// Who runs the command; a person at a terminal if none.
    pub host: Option<&'a Host>,
}

impl From<bool> for Watch<'_> {
    fn from(is_quiet: bool) -> Self {
        Watch {
            is_quiet,
            host: None,
        }
    }
}
