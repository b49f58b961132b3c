//! Warnings and progress while fabrics and scenes are loaded and built.

use crate::context::Context;
use crate::progress::{Progress, Waiting};
use anyhow::Result;
use organza_scene::loader::{Event, Loader, Task};
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

/// Units of a task that reports shares.
const UNITS: f32 = 1000.0;

/// Runs `work` with a loader that knows the files and the cache of the context, and whose progress and
/// warnings go to its listener.
///
/// # Errors
/// Those of `work`; a cache that cannot be used.
pub fn watched<T>(context: &Context, work: impl FnOnce(&Loader<'_>) -> Result<T>) -> Result<T> {
    let _waiting = Waiting::new("setting up", context);
    let cache = context.result_cache()?;
    let progress: Mutex<Option<Progress>> = Mutex::new(None);
    let on_event = |event: Event<'_>| {
        let mut progress = progress.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            Event::Warning(warning) => context.warn(warning.to_string()),
            Event::Begin(task) => *progress = Some(begin(task, context)),
            Event::Done(share) => {
                if let Some(progress) = progress.as_ref() {
                    return progress.at((share * UNITS) as u64);
                }
            }
            Event::End => drop(progress.take()),
        }
        ControlFlow::Continue(())
    };
    let loader = Loader::watched(&on_event).with_cache(cache);
    let loader = context.with_given(loader);
    let result = work(&loader)?;
    for fabric in loader.reused() {
        context.note(format!(
            "{}: its volume is from the cache",
            fabric.display()
        ));
    }
    Ok(result)
}

fn begin(task: &Task, context: &Context) -> Progress {
    let label = match task {
        Task::Voxelizing {
            fabric,
            memory_bytes,
        } => {
            context.note(format!(
                "{}: voxelizing takes about {} MiB of memory",
                fabric.display(),
                memory_bytes.div_ceil(1 << 20)
            ));
            "voxelizing"
        }
        Task::GatheringFibres { .. } => "gathering fibres",
        Task::MeasuringPacking { .. } => "measuring packing",
    };
    Progress::new(label, UNITS as u64, context)
}
