//! The loop of a render: samples in passes, and checkpoints between them.

use super::RenderJob;
use anyhow::Result;
use organza_transport::Rendering;
use organza_work::identity::Identity;
use organza_work::schedule::{Next, Schedule, Stop};
use organza_work::{Progress, checkpoint};
use std::ops::ControlFlow;
use std::time::Instant;

/// Takes samples until the schedule or the user says stop, and shows them on the way. A checkpoint that
/// cannot be saved on the way is reported and tried again at the next time.
///
/// # Errors
/// Those of the paths.
pub fn trace<'a>(
    args: &RenderJob,
    identity: &Identity,
    mut rendering: Rendering<'a>,
    started: Instant,
) -> Result<(Rendering<'a>, Stop)> {
    let targets = args.targets();
    let mut schedule = Schedule::new(args.time_limit, targets);
    let film_size = rendering.film().size();
    let samples = rendering.left() + rendering.taken().end - rendering.taken().start;
    let paths = samples * u64::from(film_size.x) * u64::from(film_size.y);
    let progress = Progress::new("rendering", paths, &args.context);
    let mut saved = Instant::now();
    let keeps_samples = args.context.keeps_stopped || args.checkpoint.is_some();
    let (mut is_reported, mut is_loss_reported) = (false, false);
    let stop = loop {
        let pass = match schedule.next(&rendering, started.elapsed(), args.context.stop.is_asked())
        {
            Next::Stop(stop) => break stop,
            Next::Take(samples) => samples,
        };
        let pass_started = Instant::now();
        rendering = rendering.take(pass, &|news| {
            let flow = match targets.are_given() {
                true => args.context.flow(),
                false => progress.at(news.paths_done),
            };
            // A pass is finished where its samples are kept.
            if keeps_samples {
                return ControlFlow::Continue(());
            }
            flow
        })?;
        if targets.are_given() && rendering.taken().end - rendering.taken().start > 1 {
            let _ = progress.at((targets.share_done(&rendering) * paths as f64) as u64);
        }
        schedule.took(pass, pass_started.elapsed());
        args.context.listener.picture(rendering.film());
        if let Some(engine) = rendering.engine()
            && let Some(loss) = engine.loss()
            && !std::mem::replace(&mut is_loss_reported, true)
        {
            args.context.alert(format!(
                "{loss}; rendering goes on by the processor ({})",
                engine.name()
            ));
        }
        if let Some(path) = &args.checkpoint
            && saved.elapsed() >= args.checkpoint_every
            && rendering.left() > 0
        {
            if let Err(e) = checkpoint::save(path, identity, &rendering)
                && !std::mem::replace(&mut is_reported, true)
            {
                let on = "rendering continues, and the next checkpoint is tried";
                args.context.alert(format!("{e:#}; {on}"));
            }
            saved = Instant::now();
        }
    };
    progress.finish();
    Ok((rendering, stop))
}
