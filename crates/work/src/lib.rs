//! What every piece of work needs, whoever asks for it: a [`Context`] to run in and the [`Error`] that
//! it may end with; progress; journals and checkpoints, from which it resumes; files that appear when
//! they are complete.
//!
//! Nothing here prints: a [`Listener`] hears warnings, notes and progress.
#![allow(clippy::disallowed_methods)] // reads and writes files

pub mod building;
pub mod checkpoint;
mod context;
pub mod denoising;
mod error;
pub mod identity;
mod job;
pub mod journal;
pub mod kept_light;
pub mod keys;
mod listener;
mod locked_file;
pub mod measured_values;
pub mod number_journal;
pub mod output;
pub mod output_folder;
pub mod patch_model;
pub mod picture;
pub mod process_usage;
mod progress;
mod request;
pub mod result_cache;
mod results;
pub mod sample_ranges;
pub mod schedule;
pub mod values;
pub mod version;

pub use context::{Context, StopFlag};
pub use error::{
    Error, ErrorKind, InputError, Stopped, after_option, input, of_file, of_io, of_key, of_option,
};
pub use job::Job;
pub use listener::{Listener, Silent};
pub use progress::{Progress, Waiting};
pub use request::{Output, Place, PlaceKind, Request};
pub use results::{Array, Numbers, Results};
