//! Threads that are missing from a weave: ends that broke, picks that did not arrive.

use super::spacing::spacing_mm;
use crate::spec::{FabricGeometry, ThreadSetSpec};
use crate::{Draft, Error, Thread};
use std::collections::BTreeSet;

/// Refuses missing threads where there is no weave that they could miss from.
pub(super) fn check(fabric: &FabricGeometry) -> Result<(), Error> {
    let draft = &fabric.draft;
    let is_woven = draft.weave.is_some() || draft.wif.is_some() || draft.drawdown.is_some();
    for (name, spec) in [("warp", &fabric.warp), ("weft", &fabric.weft)] {
        let message = match spec.missing.is_empty() {
            false if !is_woven => "belongs to a weave (draft.weave, draft.wif or draft.drawdown)",
            false if fabric.pile.is_some() => "does not go with [pile]",
            _ => continue,
        };
        return Err(Error::spec(format!("{name}.missing"), message));
    }
    Ok(())
}

/// The fabric and the draft of its tile without the missing threads; `None` if all are there.
/// Their neighbours divide the room.
///
/// # Errors
/// A thread that the tile does not have, or fewer than two that are left.
pub(super) fn without_missing(
    fabric: &FabricGeometry,
    draft: &Draft,
) -> Result<Option<(FabricGeometry, Draft)>, Error> {
    if fabric.warp.missing.is_empty() && fabric.weft.missing.is_empty() {
        return Ok(None);
    }
    let mut fabric = fabric.clone();
    let (ends, warp) = left("warp", &mut fabric.warp, &draft.warp)?;
    let (picks, weft) = left("weft", &mut fabric.weft, &draft.weft)?;
    let rest = Draft::from_fn(ends.len(), picks.len(), |e, p| {
        draft.warp_up(ends[e], picks[p])
    });
    let mut rest = rest.map_err(|why| Error::spec("draft", why.to_string()))?;
    rest.title = draft.title.clone();
    rest.warnings = draft.warnings.clone();
    (rest.warp, rest.weft) = (warp, weft);
    Ok(Some((fabric, rest)))
}

/// Which threads of a system are left, and they themselves with their spacings and colours.
/// Their yarns become those of the specification.
fn left(
    name: &'static str,
    spec: &mut ThreadSetSpec,
    threads: &[Thread],
) -> Result<(Vec<usize>, Vec<Thread>), Error> {
    let count = threads.len();
    let missing: BTreeSet<u32> = std::mem::take(&mut spec.missing).into_iter().collect();
    let fail = |message: String| Error::spec(format!("{name}.missing"), message);
    if let Some(beyond) = missing.iter().find(|i| **i as usize >= count) {
        let message = format!("expected numbers from 0 to {}, found {beyond}", count - 1);
        return Err(fail(message));
    }
    let is_missing = |i: usize| missing.contains(&(i as u32));
    let kept: Vec<usize> = (0..count).filter(|i| !is_missing(*i)).collect();
    if kept.len() < 2 {
        let message = format!(
            "leaves {} of {count} threads; expected at least 2",
            kept.len()
        );
        return Err(fail(message));
    }
    let mut rooms_mm = Vec::with_capacity(count);
    for (i, thread) in threads.iter().enumerate() {
        rooms_mm.push(spacing_mm(name, spec, thread.spacing_mm, i)?);
    }
    let mut spaced = Vec::with_capacity(kept.len());
    for (k, &i) in kept.iter().enumerate() {
        let [before, after] = [
            kept[(k + kept.len() - 1) % kept.len()],
            kept[(k + 1) % kept.len()],
        ];
        let gap_mm = |from: usize, to: usize| {
            let between = (1..count).map(|n| (from + n) % count);
            let between = between.take_while(|n| *n != to);
            between.map(|n| rooms_mm[n]).sum::<f64>()
        };
        let room_mm = rooms_mm[i] + 0.5 * (gap_mm(before, i) + gap_mm(i, after));
        spaced.push(Thread {
            spacing_mm: Some(room_mm as f32),
            ..threads[i]
        });
    }
    if spec.yarn.len() > 1 {
        spec.yarn = kept
            .iter()
            .map(|i| spec.yarn[i % spec.yarn.len()].clone())
            .collect();
    }
    (spec.per_cm, spec.spacing_mm) = (None, None);
    Ok((kept, spaced))
}
