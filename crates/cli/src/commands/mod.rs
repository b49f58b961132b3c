//! One file per command.

pub mod bench;
pub mod compare;
pub mod export;
pub mod fit;
pub mod info;
pub mod manual;
pub mod measure;
pub mod merge;
pub mod render;
pub mod voxelize;
pub mod weave;

use crate::flags::CommonArgs;
use anyhow::{Context, Result};

/// Runs `work` on the number of threads asked for.
pub fn with_threads<T: Send>(
    common: &CommonArgs,
    work: impl FnOnce() -> Result<T> + Send,
) -> Result<T> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(common.threads.map_or(0, usize::from))
        .build()
        .context("cannot start the threads")?
        .install(work)
}
