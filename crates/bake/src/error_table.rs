//! Errors of a fitted model against the measurement, by side and part.

use crate::layout::{Part, PlannedPair, Side};
use organza_measure::PairValue;

/// The error of a model over some pairs.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ErrorRow {
    /// Which way the light goes.
    pub side: Side,
    /// Which part of the material; all of the side if none.
    pub part: Option<Part>,
    /// Root mean square of the error times the cosine of the eye, noise subtracted, as a share
    /// of that of the measurement.
    pub rms: f64,
    /// The model's sum of values times cosine over the measurement's, less one.
    pub bias: f64,
    /// The part of `rms` that was subtracted as noise of the measurement.
    pub noise: f64,
    /// Pairs.
    pub pairs: usize,
}

/// Fewer pairs than this make no row.
const MIN_PAIRS: usize = 3;

/// Errors over the pairs that were held out, or over those that were fitted, one row per side
/// and per part of a side that has enough pairs.
pub fn error_rows(
    plan: &[PlannedPair],
    model: &[[f64; 3]],
    measured: &[PairValue],
    held_out: bool,
) -> Vec<ErrorRow> {
    const PARTS: [Option<Part>; 6] = [
        None,
        Some(Part::Highlight),
        Some(Part::Diffuse),
        Some(Part::Grazing),
        Some(Part::Forward),
        Some(Part::Spread),
    ];
    let mut rows = Vec::new();
    for side in [Side::Face, Side::Through, Side::Back] {
        for part in PARTS {
            let chosen: Vec<_> = plan
                .iter()
                .zip(model)
                .zip(measured)
                .filter(|((p, _), _)| p.side == side && part.is_none_or(|part| p.part == part))
                // The back is never fitted, so that all of it judges.
                .filter(|((p, _), _)| p.is_held_out == held_out || side == Side::Back)
                .collect();
            if chosen.len() < MIN_PAIRS {
                continue;
            }
            let (mut error, mut noise, mut own) = (0.0, 0.0, 0.0);
            let (mut sum_model, mut sum_measured) = (0.0, 0.0);
            for ((_, model), measured) in &chosen {
                let cos = f64::from(measured.pair.exitant.direction().z.abs());
                let bsdf = &measured.bsdf;
                for ((m, v), se) in model.iter().zip(bsdf.mean).zip(bsdf.se) {
                    error += ((m - v) * cos).powi(2);
                    noise += (se * cos).powi(2);
                    own += (v * cos).powi(2);
                    sum_model += m * cos;
                    sum_measured += v * cos;
                }
            }
            let own = (own - noise).max(1e-30);
            rows.push(ErrorRow {
                side,
                part,
                rms: ((error - noise).max(0.0) / own).sqrt(),
                bias: sum_model / sum_measured.max(1e-30) - 1.0,
                noise: (noise / own).sqrt(),
                pairs: chosen.len(),
            });
        }
    }
    rows
}
