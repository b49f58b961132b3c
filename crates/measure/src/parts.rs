//! Measurements in parts, on all threads.

use crate::MeasureError;
use organza_basis::Stopped;
use organza_transport::Stats;
use rayon::prelude::*;

/// Measures so many parts, each with its counts, in any order; returns them in order, with the sum of
/// the counts.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_parts<T: Send>(
    count: usize,
    measure: impl Fn(usize) -> Result<(T, Stats), Stopped> + Sync,
) -> Result<(Vec<T>, Stats), MeasureError> {
    let found = (0..count).into_par_iter().map(&measure);
    let found: Vec<_> = found.collect::<Result<_, Stopped>>()?;
    let mut stats = Stats::default();
    let mut parts = Vec::with_capacity(count);
    for (part, counts) in found {
        stats.merge(&counts);
        parts.push(part);
    }
    MeasureError::check(&stats)?;
    Ok((parts, stats))
}
