//! The loop of a render: samples in passes, and checkpoints between them.

use super::{RenderArgs, targets};
use crate::checkpoint;
use crate::display_server::DisplayServer;
use crate::identity::Identity;
use crate::interrupt;
use crate::output::note;
use crate::progress::Progress;
use crate::schedule::{Next, Schedule, Stop};
use anyhow::Result;
use organza_basis::Stopped;
use organza_transport::Rendering;
use std::time::Instant;

/// Takes samples until the schedule or the user says stop, and shows them on the way. A checkpoint that
/// cannot be saved on the way is reported and tried again at the next time.
///
/// # Errors
/// Those of the paths.
pub fn trace<'a>(
    args: &RenderArgs,
    identity: &Identity,
    mut rendering: Rendering<'a>,
    started: Instant,
    display: Option<&DisplayServer>,
) -> Result<(Rendering<'a>, Stop)> {
    let targets = targets(args);
    let mut schedule = Schedule::new(args.time_limit, targets);
    let film_size = rendering.film().size();
    let samples = rendering.left() + rendering.taken().end - rendering.taken().start;
    let paths = samples * u64::from(film_size.x) * u64::from(film_size.y);
    let progress = Progress::new("rendering", paths, &args.common);
    let mut saved = Instant::now();
    let (mut is_reported, mut is_loss_reported) = (false, false);
    let stop = loop {
        let pass = match schedule.next(&rendering, started.elapsed(), interrupt::came()) {
            Next::Stop(stop) => break stop,
            Next::Take(samples) => samples,
        };
        let pass_started = Instant::now();
        rendering = rendering.take(pass, &|news| match targets.are_given() {
            true => args.common.host.goes_on(),
            false => progress.at(news.paths_done),
        })?;
        if targets.are_given() && rendering.taken().end - rendering.taken().start > 1 {
            let share_done = targets.share_done(&rendering);
            Stopped::check(progress.at((share_done * paths as f64) as u64))?;
        }
        schedule.took(pass, pass_started.elapsed());
        if let Some(display) = display {
            display.show(rendering.film());
        }
        if let Some(engine) = rendering.engine()
            && let Some(loss) = engine.loss()
            && !std::mem::replace(&mut is_loss_reported, true)
        {
            note!(
                "organza: warning: {loss}; rendering goes on by the processor ({})",
                engine.name()
            );
        }
        if let Some(path) = &args.checkpoint
            && saved.elapsed() >= args.checkpoint_every
            && rendering.left() > 0
        {
            if let Err(e) = checkpoint::save(path, identity, &rendering)
                && !std::mem::replace(&mut is_reported, true)
            {
                note!(
                    "organza: warning: {e:#}; rendering continues, and the next checkpoint is tried"
                );
            }
            saved = Instant::now();
        }
    };
    progress.finish();
    Ok((rendering, stop))
}
