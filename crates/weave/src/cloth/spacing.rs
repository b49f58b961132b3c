//! The distances that threads take up.

use crate::spec::ThreadSetSpec;
use crate::{Error, Thread};
use organza_basis::PathRng;

/// Families of random numbers of the distances between threads.
pub(super) const WARP_SPACING: u64 = 5 << 40;
pub(super) const WEFT_SPACING: u64 = 6 << 40;
/// Distances vary by at most so many standard deviations, and are at least this share of the
/// mean.
const MAX_SPACING_DEVIATIONS: f64 = 2.5;
const MIN_SPACING: f64 = 0.5;

/// The spacing of thread `index`: from the fabric, otherwise from the draft.
pub(super) fn spacing_mm(
    name: &str,
    spec: &ThreadSetSpec,
    drafted: Option<f32>,
    index: usize,
) -> Result<f64, Error> {
    let spacing = match (spec.per_cm, spec.spacing_mm) {
        (None, None) => drafted.map(f64::from),
        (Some(n), None) if (0.01..=1e4).contains(&n) => Some(10.0 / n),
        (Some(n), None) => {
            let message = format!("expected 0.01 to 10000 threads per cm, found {n}");
            return Err(Error::spec(format!("{name}.per_cm"), message));
        }
        (None, Some(s)) => Some(s),
        _ => return Err(Error::spec(name, "expected per_cm or spacing_mm, not both")),
    };
    let spacing = spacing.ok_or_else(|| {
        let message = format!(
            "thread {} has no spacing; give per_cm or spacing_mm",
            index + 1
        );
        Error::spec(name, message)
    })?;
    if !(1e-3..=1e3).contains(&spacing) {
        let message = format!("expected a spacing from 0.001 to 1000 mm, found {spacing} mm");
        return Err(Error::spec(format!("{name}.spacing_mm"), message));
    }
    Ok(spacing)
}

/// The distances that the threads of a system take up. Where they vary, their sum does not.
pub(super) fn spacings_mm(
    name: &'static str,
    threads: &[Thread],
    spec: &ThreadSetSpec,
    seed: u64,
    family: u64,
) -> Result<Vec<f64>, Error> {
    let spacings = threads.iter().enumerate();
    let spacings = spacings.map(|(i, t)| spacing_mm(name, spec, t.spacing_mm, i));
    let mut spacings: Vec<f64> = spacings.collect::<Result<_, _>>()?;
    let cv_percent = spec.spacing_cv_percent.unwrap_or(0.0);
    if !(0.0..=30.0).contains(&cv_percent) {
        let message = format!("expected a number from 0 to 30, found {cv_percent}");
        return Err(Error::spec(format!("{name}.spacing_cv_percent"), message));
    }
    if cv_percent > 0.0 {
        let sum: f64 = spacings.iter().sum();
        let mut rng = PathRng::new(seed, 0, family);
        for spacing in &mut spacings {
            let deviate = f64::from(rng.normal2().x);
            let deviate = deviate.clamp(-MAX_SPACING_DEVIATIONS, MAX_SPACING_DEVIATIONS);
            *spacing *= (1.0 + 0.01 * cv_percent * deviate).max(MIN_SPACING);
        }
        let scale = sum / spacings.iter().sum::<f64>();
        spacings.iter_mut().for_each(|s| *s *= scale);
    }
    Ok(spacings)
}
