//! A search whose places are simulated: what ends it, and how its differences are taken.

use super::FitJob;
use anyhow::Result;
use organza_basis::Stopped;
use organza_measure::fit::{Bound, Patience, search};
use organza_work::number_journal::JournalError;
use organza_work::{Progress, of_file};

/// Step of difference quotients as a share of the range: simulations with the same random numbers
/// still jump a little.
const STRIDE: f64 = 0.05;

/// Whether a place failed for a reason that ends the search: a journal that fails, or a stop.
pub fn is_final(args: &FitJob, e: &anyhow::Error) -> bool {
    e.is::<JournalError>() || args.context.flow().is_break()
}

/// The place of the least squares, and their sum; `known` is tried after the search, which starts
/// beside the ends of ranges. `usual` is the patience where none is asked for.
///
/// # Errors
/// One that [`is_final`]; that of the last place, where none has an answer.
pub fn nearest(
    args: &FitJob,
    bounds: &[Bound],
    usual: [u32; 2],
    known: Option<&[f64]>,
    residuals: &mut dyn FnMut(&[f64]) -> Result<Vec<f64>>,
) -> Result<(Vec<f64>, f64)> {
    let [scan, steps] = args.patience.unwrap_or(usual);
    let descents = if scan > 0 { 4 } else { 1 };
    let most = u64::from(scan) + descents * u64::from(steps);
    let progress = Progress::new("fitting", most, &args.context);
    let (mut count, mut ended, mut failure) = (0, None, None);
    // After its end no place has a value, which ends the search at once.
    let mut tried = |place: &[f64]| {
        if ended.is_some() {
            return None;
        }
        count += 1;
        Stopped::check(progress.at(count)).ok()?;
        match residuals(place) {
            Ok(found) => return Some(found),
            Err(e) if is_final(args, &e) => ended = Some(e),
            // What cannot be made is no answer; reported when there is no other.
            Err(e) => failure = Some(e),
        }
        None
    };
    let patience = Patience {
        scan,
        steps,
        stride: STRIDE,
    };
    let (mut place, mut least) = search(bounds, &patience, &mut tried);
    if let Some(known) = known
        && let Some(found) = tried(known)
    {
        let square = found.iter().map(|r| r * r).sum::<f64>();
        if square <= least {
            (place, least) = (known.to_vec(), square);
        }
    }
    progress.finish();
    if let Some(e) = ended {
        return Err(e);
    }
    Stopped::check(args.context.flow())?;
    if !least.is_finite() {
        let none = || of_file(args.fabric_path(), "no answer");
        return Err(failure.unwrap_or_else(none));
    }
    Ok((place, least))
}

/// The place with one of its values moved within its range, and by how much.
pub fn moved(place: &[f64], bounds: &[Bound], k: usize) -> (Vec<f64>, f64) {
    let range = &bounds[k];
    let step = STRIDE * (range.high - range.low);
    let step = if place[k] + step > range.high {
        -step
    } else {
        step
    };
    let mut moved = place.to_vec();
    moved[k] += step;
    (moved, step)
}
