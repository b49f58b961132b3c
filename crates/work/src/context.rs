//! What a piece of work runs in: threads, memory, cache, files in memory, and who follows it.

use crate::error::Error;
use crate::listener::{Listener, Silent};
use crate::{output, result_cache};
use anyhow::Result;
use organza_scene::GivenFiles;
use organza_scene::loader::Loader;
use organza_scene::memory::free_memory_bytes;
use organza_scene::patches::PatchOptions;
use std::ffi::OsString;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A wish to stop, which its clones share.
#[derive(Clone, Debug, Default)]
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Asks for it, from any thread.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether somebody has asked; the first to hear it with `true` hears it alone.
    pub fn ask_again(&self) -> bool {
        self.0.swap(true, Ordering::Relaxed)
    }

    /// Whether somebody has asked.
    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// What requests run in. What they compute does not depend on it, but for the engine that `auto`
/// chooses by the memory.
///
/// ```
/// use organza_work::Context;
///
/// let context = Context { threads: Some(2), ..Context::default() };
/// assert!(!context.stop.is_asked());
/// ```
#[derive(Clone)]
pub struct Context {
    /// Threads to use; all cores if none.
    pub threads: Option<u16>,
    /// Bytes that may be used; what is free if none.
    pub max_memory_bytes: Option<u64>,
    /// Where built volumes are kept: a folder, `auto` or `off`. The variable `ORGANZA_CACHE` if none.
    pub cache: Option<OsString>,
    /// Files in memory, which stand for those at their paths.
    pub given: Arc<GivenFiles>,
    /// Who follows the work.
    pub listener: Arc<dyn Listener>,
    /// Ends the work soon.
    pub stop: StopFlag,
    /// Whether a render that is stopped returns the samples that it has, in place of
    /// [`ErrorKind::Stopped`](crate::ErrorKind::Stopped), unless a checkpoint holds them.
    pub keeps_stopped: bool,
    /// Files that will be written: work that reads one of them is refused.
    pub outputs: Vec<PathBuf>,
    /// Folders that will be there when the work begins.
    pub coming_folders: Vec<PathBuf>,
    /// How the work was asked for, for files that record how they were made.
    pub command: String,
}

impl Default for Context {
    fn default() -> Context {
        Context {
            threads: None,
            max_memory_bytes: None,
            cache: None,
            given: Arc::default(),
            listener: Arc::new(Silent),
            stop: StopFlag::default(),
            keeps_stopped: false,
            outputs: Vec::new(),
            coming_folders: Vec::new(),
            command: "organza".to_owned(),
        }
    }
}

impl std::fmt::Debug for Context {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Context")
            .field("threads", &self.threads)
            .field("max_memory_bytes", &self.max_memory_bytes)
            .field("cache", &self.cache)
            .finish_non_exhaustive()
    }
}

impl Context {
    /// Runs work on the threads of the context.
    ///
    /// # Errors
    /// Those of the work; [`ErrorKind::Stopped`](crate::ErrorKind::Stopped) if it failed after a stop
    /// was asked for.
    pub fn run<T: Send>(&self, work: impl FnOnce() -> Result<T> + Send) -> Result<T, Error> {
        let threads = rayon::ThreadPoolBuilder::new()
            .num_threads(self.threads.map_or(0, usize::from))
            .build();
        let result = match threads {
            Ok(threads) => threads.install(work),
            Err(e) => Err(anyhow::Error::new(e).context("cannot start the threads")),
        };
        result.map_err(|e| match self.stop.is_asked() {
            true => Error::stopped(&e),
            false => Error::from(e),
        })
    }

    /// Bytes that may be used.
    pub fn memory_bytes(&self) -> u64 {
        self.max_memory_bytes.unwrap_or_else(free_memory_bytes)
    }

    /// Something is odd but no mistake.
    pub fn warn(&self, warning: impl AsRef<str>) {
        self.listener.warn(warning.as_ref());
    }

    /// Something fails, and the work goes on.
    pub fn alert(&self, failure: impl AsRef<str>) {
        self.listener.alert(failure.as_ref());
    }

    /// A line for whoever looks on.
    pub fn note(&self, line: impl AsRef<str>) {
        self.listener.note(line.as_ref());
    }

    /// Whether to go on.
    pub fn flow(&self) -> ControlFlow<()> {
        match self.stop.is_asked() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// A loader that knows the files in memory and reports to nobody.
    pub fn loader(&self) -> Loader<'static> {
        self.with_given(Loader::new())
    }

    /// The loader with the files in memory.
    pub fn with_given<'p>(&self, loader: Loader<'p>) -> Loader<'p> {
        loader.with_given(Arc::clone(&self.given))
    }

    /// The same context with further files in memory.
    pub fn with_made(&self, made: GivenFiles) -> Context {
        let mut all = GivenFiles::clone(&self.given);
        all.extend(made);
        Context {
            given: Arc::new(all),
            ..self.clone()
        }
    }

    /// How a patch of cloth is built: its finest voxels, if not the fabric's, and its level.
    pub fn patch_options<'a>(
        &self,
        loader: &'a Loader<'a>,
        voxel_um: Option<f32>,
        level: u8,
    ) -> PatchOptions<'a> {
        PatchOptions {
            loader,
            voxel_um,
            level,
            max_memory_bytes: self.max_memory_bytes,
        }
    }

    /// The cache that is in use.
    ///
    /// # Errors
    /// See [`result_cache::in_use`].
    pub fn result_cache(&self) -> Result<Option<organza_scene::ResultCache>> {
        result_cache::in_use(self.cache.as_deref())
    }

    /// Refuses early what could not be written in the end; what lies in a folder that is still to come
    /// is taken to be writable.
    ///
    /// # Errors
    /// Those of [`output::check_writable`].
    pub fn check_writable(&self, path: &Path) -> Result<()> {
        let folder = output::folder_of(path);
        let comes = || {
            // With a folder, those that it lies in are made.
            let mut made = self.coming_folders.iter().flat_map(|f| f.ancestors());
            made.any(|made| output::is_same_file(made, folder))
        };
        if !folder.exists() && comes() {
            return Ok(());
        }
        output::check_writable(path)
    }

    /// Refuses outputs that are among the files read.
    ///
    /// # Errors
    /// Names the file.
    pub fn check_outputs(&self, loader: &Loader<'_>) -> Result<()> {
        let read = loader.inputs();
        for path in &self.outputs {
            output::check_not_an_input(path, read.iter().map(|i| &i.path))?;
        }
        Ok(())
    }
}
