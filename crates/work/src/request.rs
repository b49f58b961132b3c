//! What all requests have in common.

use crate::context::Context;
use crate::error::{Error, InputError};
use crate::job::Job;
use crate::output;
use crate::results::Results;
use organza_scene::file_kind::Wanted;
use organza_scene::read;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// What is written at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaceKind {
    /// A file, which replaces an older one.
    File,
    /// A folder, which is made with those that it lies in.
    Folder,
    /// A file that a later request may continue, such as a journal.
    Continued,
}

/// A place where a request writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file or folder.
    pub path: PathBuf,
    /// What is written there.
    pub kind: PlaceKind,
}

impl Place {
    /// The place of a key, if it is given.
    pub fn of_key(path: Option<&PathBuf>, kind: PlaceKind) -> Option<Place> {
        let path = path?.clone();
        Some(Place { path, kind })
    }
}

/// A piece of work with all that decides its result.
pub trait Request: Clone + DeserializeOwned + Send + Sync {
    /// Its name, which is that of the command.
    const NAME: &'static str;

    /// What is found.
    type Output: Output + Send;

    /// Whether its output is a file or a folder.
    const OUTPUT: PlaceKind = PlaceKind::File;

    /// Adapts to output at this path: the ending of a file decides what it must hold. Returns what
    /// will be written there, for [`Context::outputs`].
    ///
    /// # Errors
    /// A name whose ending does not fit.
    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        Ok(vec![path.to_owned()])
    }

    /// Prepares for output at this path, as [`Request::adapt_to`], and refuses a file that cannot be
    /// written.
    ///
    /// # Errors
    /// A name whose ending does not fit, or that cannot be written.
    fn prepare_for(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        let written = self.adapt_to(path)?;
        if Self::OUTPUT == PlaceKind::File {
            for file in &written {
                output::check_writable(file)?;
            }
        }
        Ok(written)
    }

    /// What it writes beside its output, where its keys say.
    fn further_places(&self) -> Vec<Place> {
        Vec::new()
    }

    /// Refuses what is wrong whatever its input files hold: values out of range, keys that contradict
    /// each other, files that would be lost. It reads none of these files, which an earlier request may
    /// still have to write.
    ///
    /// # Errors
    /// Names the key or the file.
    fn check(&self, context: &Context) -> anyhow::Result<()>;

    /// Does the work of a request that was checked.
    ///
    /// # Errors
    /// Wrong input, work that fails, or a stop.
    fn work(job: &Job<Self>) -> anyhow::Result<Self::Output>;

    /// Checks the request and does its work, on the threads of the context.
    ///
    /// # Errors
    /// Wrong input, work that fails, or a stop.
    fn run(&self, context: &Context) -> Result<Self::Output, Error> {
        self.check(context)?;
        Job::run(self, context, Self::work)
    }

    /// Reads a request from a table, whose keys are the fields of the request.
    ///
    /// # Errors
    /// Names the key.
    fn from_table(table: toml::Table) -> Result<Self, Error> {
        let text = toml::to_string(&table).map_err(anyhow::Error::from)?;
        // As a text, mistakes have keys.
        let read = read::toml_changed(Path::new("<request>"), &text, &[], &[], Wanted::Text);
        read.map_err(|e| {
            let e = InputError {
                option: e.key.clone(),
                ..InputError::new(e.message)
            };
            Error::from(anyhow::Error::new(e))
        })
    }
}

/// What a request found.
pub trait Output {
    /// Its numbers as arrays, its figures, and its files in memory.
    ///
    /// # Errors
    /// A file that cannot be encoded.
    fn results(&self) -> Result<Results, Error>;

    /// Why it is less than what was asked for, such as an interrupt; it can be written still.
    fn failure(&self) -> Option<Error> {
        None
    }

    /// Decides what depends on the file that is written: numbers in place of `auto`.
    fn settle(&mut self, path: &Path) {
        let _ = path;
    }

    /// Writes its files, to this path or into this folder, and returns their names.
    ///
    /// # Errors
    /// A file that cannot be written; then the old ones stay.
    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error>;
}
