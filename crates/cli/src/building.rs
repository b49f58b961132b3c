//! Messages and progress while fabrics and scenes are loaded and built.

use crate::flags::CacheArgs;
use crate::host::{Host, Watch};
use crate::output::note;
use crate::progress::Progress;
use crate::result_cache;
use crate::waiting::Waiting;
use anyhow::Result;
use organza_scene::loader::{Event, Loader, Task};
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

/// Units of a bar of shares.
const UNITS: f32 = 1000.0;

/// Runs `work` with a loader whose progress and warnings go to the standard error, unless
/// `watch` is quiet, or to the program that runs the command, and whose cache is the one that
/// flags or the environment name. A line says now and then that other work goes on, such as
/// weaving.
///
/// # Errors
/// Those of `work`; a cache that cannot be used.
pub fn watched<'w, T>(
    watch: impl Into<Watch<'w>>,
    cache: &CacheArgs,
    work: impl FnOnce(&Loader<'_>) -> Result<T>,
) -> Result<T> {
    let watch = watch.into();
    let _waiting = Waiting::new("setting up", watch);
    let caller = watch.host.and_then(Host::caller);
    let cache = result_cache::in_use(cache)?;
    let bar: Mutex<Option<Progress>> = Mutex::new(None);
    let on_event = |event: Event<'_>| {
        let mut bar = bar.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            Event::Warning(warning) if caller.is_some() => {
                caller.iter().for_each(|c| c.warn(&warning.to_string()));
            }
            Event::Warning(_) if watch.is_quiet => {}
            Event::Warning(warning) => note!("organza: warning: {warning}"),
            Event::Begin(task) => *bar = Some(begin(task, watch)),
            Event::Done(share) => {
                if let Some(bar) = bar.as_ref() {
                    return bar.at((share * UNITS) as u64);
                }
            }
            Event::End => {
                if let Some(bar) = bar.take() {
                    bar.finish();
                }
            }
        }
        ControlFlow::Continue(())
    };
    let loader = Loader::watched(&on_event).with_cache(cache);
    let loader = match watch.host {
        Some(host) => host.with_given(loader),
        None => loader,
    };
    let result = work(&loader)?;
    if !watch.is_quiet && caller.is_none() {
        for fabric in loader.reused() {
            note!("{}: its volume is from the cache", fabric.display());
        }
    }
    Ok(result)
}

fn begin(task: &Task, watch: Watch<'_>) -> Progress {
    let label = match task {
        Task::Voxelizing {
            fabric,
            memory_bytes,
        } => {
            if !watch.is_quiet {
                note!(
                    "{}: voxelizing takes about {} MiB of memory",
                    fabric.display(),
                    memory_bytes.div_ceil(1 << 20)
                );
            }
            "voxelizing"
        }
        Task::GatheringFibres { .. } => "gathering fibres",
        Task::MeasuringPacking { .. } => "measuring packing",
    };
    Progress::new(label, UNITS as u64, watch)
}
