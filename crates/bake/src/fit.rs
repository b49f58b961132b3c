//! Parameters of a model that match a measurement, by least squares.

use crate::albedo::Albedos;
use crate::layout::{PlannedPair, Side};
use crate::model::{Parameters, Surface, Target};
use crate::texel::Texel;
use organza_basis::Stopped;
use organza_measure::fit::{Determined, Patience, determine, search};
use organza_measure::{Pair, PairValue};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Share of the own value, beside the root mean square of the side, in what residuals are
/// divided by: highlights do not outweigh all else.
const RELATIVE: f64 = 0.5;

/// Weight of the texels under a bright sky, of which the mean of squares counts as much as
/// that of pairs where it is one.
pub const SKY_WEIGHT: f64 = 0.5;

/// A fitted model.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Its parameters.
    pub parameters: Parameters,
    /// The free ones with their uncertainty.
    pub determined: Vec<Determined>,
    /// The model's BSDF at every pair of the plan, 1/sr.
    pub values: Vec<[f64; 3]>,
}

/// The values of a model at pairs, 1/sr, over sampled texels.
pub fn model_values(
    target: &Target,
    parameters: &Parameters,
    texels: &[Texel],
    albedos: &Albedos,
    pairs: &[Pair],
) -> Vec<[f64; 3]> {
    let inputs: Vec<(Texel, Surface)> = texels
        .iter()
        .map(|t| (*t, target.surface(parameters, t)))
        .collect();
    let relief = parameters.relief as f32;
    pairs
        .par_iter()
        .map(|pair| target.patch_bsdf(&inputs, relief, albedos, pair))
        .collect()
}

/// How far a texel under a bright sky, seen along the cloth's normal, is from what was
/// measured there. It keeps the pattern of the threads in the base colour: pairs of the whole
/// patch do not say which threads are bright.
fn sky_error(
    target: &Target,
    parameters: &Parameters,
    texel: &Texel,
    albedos: &Albedos,
) -> [f32; 3] {
    let surface = target.surface(parameters, texel);
    let cos = texel.normal(parameters.relief as f32).z;
    let error = target.albedo(&surface, albedos, cos) - texel.reflected;
    (texel.coverage * error).to_array()
}

/// Fits a model to the pairs of the plan that are not held out: those of the face, and those
/// through the cloth if the model transmits. Residuals are differences times the cosine of
/// the eye, as shares of the mean of the own value and the root mean square of the side. The
/// texels under a bright sky count with `sky_weight`, usually [`SKY_WEIGHT`]. `roughening` is fitted where none is given. Deterministic. `watch` is called before every evaluation.
///
/// # Errors
/// When `watch` broke.
pub fn fit_target(
    target: &Target,
    texels: &[Texel],
    plan: &[PlannedPair],
    measured: &[PairValue],
    albedos: &Albedos,
    sky_weight: f64,
    roughening: Option<f64>,
    patience: &Patience,
    watch: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Fitted, Stopped> {
    let cosine = |v: &PairValue| f64::from(v.pair.exitant.direction().z.abs());
    let is_used = |p: &PlannedPair| {
        !p.is_held_out && (p.side == Side::Face || (p.side == Side::Through && target.transmits))
    };
    let used: Vec<(&PlannedPair, &PairValue)> = plan
        .iter()
        .zip(measured)
        .filter(|(p, _)| is_used(p))
        .collect();
    let scale = |side: Side| {
        let of_side = used.iter().filter(|(p, _)| p.side == side);
        let squares = of_side.flat_map(|(_, v)| v.bsdf.mean.map(|m| (m * cosine(v)).powi(2)));
        let (sum, count) = squares.fold((0.0, 0), |(s, n), x| (s + x, n + 1));
        1.0 / (sum / f64::from(count.max(1))).sqrt().max(1e-12)
    };
    let (face, through) = (scale(Side::Face), scale(Side::Through));
    let pairs: Vec<Pair> = used.iter().map(|(p, _)| p.pair).collect();
    let weights: Vec<f64> = used
        .iter()
        .map(|(p, v)| {
            let scale = if p.side == Side::Face { face } else { through };
            let own = v.bsdf.mean.iter().sum::<f64>() / 3.0 * cosine(v) * scale;
            cosine(v) * scale / (1.0 - RELATIVE + RELATIVE * own)
        })
        .collect();
    let bounds = target.bounds(roughening);
    let mean = texels
        .iter()
        .map(|t| t.coverage * t.reflected)
        .sum::<glam::Vec3>();
    let mean = f64::from((mean / texels.len().max(1) as f32).element_sum() / 3.0).max(1e-4);
    let texel_weight = sky_weight / mean * (pairs.len() as f64 / texels.len().max(1) as f64).sqrt();
    // After a stop no place has a value, which ends the search at once.
    let mut flow = ControlFlow::Continue(());
    let mut residuals = |place: &[f64]| {
        Stopped::check(flow).ok()?;
        flow = watch();
        Stopped::check(flow).ok()?;
        let parameters = target.parameters(place, roughening);
        let values = model_values(target, &parameters, texels, albedos, &pairs);
        let data = used.iter().zip(&weights);
        let mut list: Vec<f64> = values
            .iter()
            .zip(data)
            .flat_map(|(m, ((_, v), w))| {
                let mean = v.bsdf.mean;
                [0, 1, 2].map(|c| (m[c] - mean[c]) * w)
            })
            .collect();
        for texel in texels {
            let error = sky_error(target, &parameters, texel, albedos);
            list.extend(error.map(|e| f64::from(e) * texel_weight));
        }
        list.iter().all(|r| r.is_finite()).then_some(list)
    };
    let (best, cost) = search(&bounds, patience, &mut residuals);
    let base = residuals(&best).unwrap_or_default();
    let columns: Vec<Vec<f64>> = bounds
        .iter()
        .enumerate()
        .map(|(k, b)| {
            let stride = patience.stride * (b.high - b.low);
            let mut moved = best.clone();
            let step = if best[k] < 0.5 * (b.low + b.high) {
                stride
            } else {
                -stride
            };
            moved[k] += step;
            let there = residuals(&moved).unwrap_or_else(|| base.clone());
            there
                .iter()
                .zip(&base)
                .map(|(t, b)| (t - b) / step)
                .collect()
        })
        .collect();
    let spare = base.len().saturating_sub(bounds.len()).max(1);
    Stopped::check(flow)?;
    let determined = determine(&bounds, &best, &columns, (cost / spare as f64).max(1e-12));
    let parameters = target.parameters(&best, roughening);
    let all: Vec<Pair> = plan.iter().map(|p| p.pair).collect();
    Ok(Fitted {
        parameters,
        determined,
        values: model_values(target, &parameters, texels, albedos, &all),
    })
}

#[cfg(test)]
mod tests;
