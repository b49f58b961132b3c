//! The account of what is read and built: input files, warnings, progress.

use crate::error::{InputError, Result};
use crate::file_kind::Wanted;
use crate::given_files::GivenFiles;
use crate::read;
use crate::volume_cache::ResultCache;
use organza_basis::Watch;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};
use std::fmt;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// Where it was read from.
    pub path: PathBuf,
    /// SHA-256 of its bytes.
    pub digest: [u8; 32],
}

/// Something odd about a file that is no mistake.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Warning {
    /// The file.
    pub file: PathBuf,
    /// What is odd about it.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.file.display(), self.message)
    }
}

/// A step of building that takes long enough to be watched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Task {
    /// Fibres become voxels.
    Voxelizing {
        /// The fabric file.
        fabric: PathBuf,
        /// Estimated need of memory.
        memory_bytes: u64,
    },
    /// Fibres become pieces that rays are traced against.
    GatheringFibres {
        /// The fabric file.
        fabric: PathBuf,
    },
    /// Walks through the fibres measure the packing factors of voxels.
    MeasuringPacking {
        /// The fabric file.
        fabric: PathBuf,
    },
}

/// What happens while a scene is loaded and built. Tasks follow each other; none
/// runs within another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event<'a> {
    /// A warning, which [`Loader::warnings`] keeps as well.
    Warning(&'a Warning),
    /// A task begins.
    Begin(&'a Task),
    /// The share of the task that is done, 0 to 1. Threads report out of order.
    Done(f32),
    /// The task has ended, well or not.
    End,
}

/// Receives events as they happen. By breaking it stops the task that runs, and all that follow:
/// their computations end with an error as soon as they report how far they are.
pub type OnEvent<'p> = &'p (dyn Fn(Event<'_>) -> ControlFlow<()> + Sync);

/// Reads the files that scenes and fabrics name. It records each of them, collects
/// warnings and passes progress on; it prints nothing.
#[derive(Default)]
pub struct Loader<'p> {
    on_event: Option<OnEvent<'p>>,
    is_stopped: AtomicBool,
    given: Arc<GivenFiles>,
    inputs: Mutex<Vec<Input>>,
    warnings: Mutex<Vec<Warning>>,
    cache: Option<ResultCache>,
    reused: Mutex<Vec<PathBuf>>,
}

impl fmt::Debug for Loader<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Loader")
            .field("inputs", &self.inputs)
            .field("warnings", &self.warnings)
            .field("cache", &self.cache)
            .finish_non_exhaustive()
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<'p> Loader<'p> {
    /// A loader that reports to nobody.
    pub fn new() -> Loader<'p> {
        Loader::default()
    }

    /// A loader that reports events as they happen.
    pub fn watched(on_event: OnEvent<'p>) -> Loader<'p> {
        Loader {
            on_event: Some(on_event),
            ..Loader::default()
        }
    }

    /// A loader that knows the same files in memory and reports to nobody.
    pub(crate) fn silent(&self) -> Loader<'static> {
        Loader::new().with_given(Arc::clone(&self.given))
    }

    /// From now on a file of this path has these bytes, whatever is on the disk. The path is
    /// compared as scenes and fabrics make it: the folder of the file that names it, joined
    /// with the name.
    pub fn give(&mut self, path: impl Into<PathBuf>, bytes: impl Into<Vec<u8>>) {
        Arc::make_mut(&mut self.given).insert(path.into(), bytes.into());
    }

    /// The loader with files that are given all at once, as by [`Loader::give`].
    pub fn with_given(self, given: Arc<GivenFiles>) -> Loader<'p> {
        Loader { given, ..self }
    }

    /// Why a file that is named somewhere cannot be read, if that is known without
    /// reading it.
    pub fn unreachable(&self, path: &Path) -> Option<InputError> {
        match self.given.get(path) {
            Some(_) => None,
            None => read::unreachable(path),
        }
    }

    /// The same loader with a cache for what it builds.
    pub fn with_cache(self, cache: Option<ResultCache>) -> Loader<'p> {
        Loader { cache, ..self }
    }

    /// The cache for what it builds, if there is one.
    pub fn cache(&self) -> Option<&ResultCache> {
        self.cache.as_ref()
    }

    /// The fabrics whose volumes came from the cache, in order.
    pub fn reused(&self) -> Vec<PathBuf> {
        locked(&self.reused).clone()
    }

    /// Records that the volume of a fabric came from the cache.
    pub(crate) fn note_reused(&self, fabric: &Path) {
        locked(&self.reused).push(fabric.to_owned());
    }

    /// Length of a file, bytes; `None` where there is none.
    pub fn file_bytes(&self, path: &Path) -> Option<u64> {
        if let Some(bytes) = self.given.get(path) {
            return Some(bytes.len() as u64);
        }
        let about = std::fs::metadata(path).ok()?;
        // A folder or a device is refused by whoever reads it.
        Some(if about.is_file() { about.len() } else { 0 })
    }

    /// The files read so far, in order.
    pub fn inputs(&self) -> Vec<Input> {
        locked(&self.inputs).clone()
    }

    /// The warnings so far, in order, each of them once.
    pub fn warnings(&self) -> Vec<Warning> {
        locked(&self.warnings).clone()
    }

    /// Adds a warning, unless it was given before.
    pub fn warn(&self, file: &Path, message: impl Into<String>) {
        let warning = Warning {
            file: file.to_owned(),
            message: message.into(),
        };
        let mut warnings = locked(&self.warnings);
        if !warnings.contains(&warning) {
            let _ = self.report(Event::Warning(&warning));
            warnings.push(warning);
        }
    }

    /// Runs a task that reports the share that is done.
    pub(crate) fn run<T>(&self, task: &Task, work: impl FnOnce(Watch<'_, f32>) -> T) -> T {
        let _ = self.report(Event::Begin(task));
        let result = work(&|share| self.report(Event::Done(share)));
        let _ = self.report(Event::End);
        result
    }

    /// Whether whoever receives the events has stopped what is done.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    fn report(&self, event: Event<'_>) -> ControlFlow<()> {
        if self.on_event.is_some_and(|tell| tell(event).is_break()) {
            self.is_stopped.store(true, Ordering::Relaxed);
        }
        match self.is_stopped() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// The bytes of a file.
    ///
    /// # Errors
    /// Names the file.
    pub fn bytes(&self, path: &Path) -> Result<Vec<u8>> {
        self.bytes_or_why(path)
            .map_err(|e| InputError::of_io(path, &e))
    }

    /// The bytes of a file, for callers that word the error themselves.
    ///
    /// # Errors
    /// As [`read::bytes_or_why`].
    pub fn bytes_or_why(&self, path: &Path) -> std::io::Result<Vec<u8>> {
        let bytes = match self.given.get(path) {
            Some(bytes) => bytes.to_vec(),
            None => read::bytes_or_why(path)?,
        };
        self.record(path, &bytes);
        Ok(bytes)
    }

    /// The text of a file that should be of a kind.
    ///
    /// # Errors
    /// As [`read::text_of`].
    pub fn text_of(&self, path: &Path, wanted: Wanted) -> Result<String> {
        let text = match self.given.get(path) {
            Some(bytes) => read::text_in(path, bytes.to_vec(), wanted)?,
            None => read::text_of(path, wanted)?,
        };
        self.record(path, text.as_bytes());
        Ok(text)
    }

    fn record(&self, path: &Path, bytes: &[u8]) {
        locked(&self.inputs).push(Input {
            path: path.to_owned(),
            digest: Sha256::digest(bytes).into(),
        });
    }

    /// Reads a TOML file that should be of a kind, with `key.path=value` overrides.
    ///
    /// # Errors
    /// As [`read::toml_changed`].
    pub fn toml_of<T: DeserializeOwned>(
        &self,
        path: &Path,
        overrides: &[String],
        wanted: Wanted,
    ) -> Result<T, InputError> {
        self.toml_changed(path, &[], overrides, wanted)
    }

    /// The same without some keys, `key.path` each, which are removed after the
    /// overrides are set; one that is not there is no mistake.
    ///
    /// # Errors
    /// As [`read::toml_changed`].
    pub fn toml_changed<T: DeserializeOwned>(
        &self,
        path: &Path,
        removed: &[String],
        overrides: &[String],
        wanted: Wanted,
    ) -> Result<T, InputError> {
        let source = self.text_of(path, wanted)?;
        self.parse_changed(path, &source, removed, overrides, wanted)
    }

    /// The same for text that [`Loader::text_of`] returned. Messages about files that are
    /// given in memory name no line, for nobody has seen their lines.
    ///
    /// # Errors
    /// As [`read::toml_changed`].
    pub(crate) fn parse_changed<T: DeserializeOwned>(
        &self,
        path: &Path,
        source: &str,
        removed: &[String],
        overrides: &[String],
        wanted: Wanted,
    ) -> Result<T, InputError> {
        let parsed = read::toml_changed(path, source, removed, overrides, wanted);
        match self.given.get(path) {
            Some(_) => parsed.map_err(read::without_line),
            None => parsed,
        }
    }
}
