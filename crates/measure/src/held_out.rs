//! The error of a table: its values at pairs of directions that were measured apart from it.

use crate::{Angles, Pair, PairValue};
use organza_basis::PathRng;

/// Pairs that are no more oblique than this, degrees from a normal, are apart from those that
/// are.
pub const OBLIQUE_DEG: f64 = 80.0;
/// Oblique pairs end here.
const LIMIT_DEG: f64 = 89.0;

/// The kind of a held-out pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HeldOutKind {
    /// Both directions on one side, at most 80 degrees from its normal.
    Reflected,
    /// On opposite sides, at most 80 degrees from the normals.
    Transmitted,
    /// On one side, one direction more oblique than 80 degrees.
    ReflectedGrazing,
    /// On opposite sides, one direction more oblique than 80 degrees.
    TransmittedGrazing,
}

impl HeldOutKind {
    /// All kinds.
    pub const ALL: [HeldOutKind; 4] = [
        HeldOutKind::Reflected,
        HeldOutKind::Transmitted,
        HeldOutKind::ReflectedGrazing,
        HeldOutKind::TransmittedGrazing,
    ];

    /// The kind of a pair.
    pub fn of(pair: &Pair) -> HeldOutKind {
        let angle = |a: Angles| a.theta_deg.min(180.0 - a.theta_deg);
        let grazing = angle(pair.incident).max(angle(pair.exitant)) > OBLIQUE_DEG;
        let same = (pair.incident.theta_deg < 90.0) == (pair.exitant.theta_deg < 90.0);
        match (same, grazing) {
            (true, false) => HeldOutKind::Reflected,
            (false, false) => HeldOutKind::Transmitted,
            (true, true) => HeldOutKind::ReflectedGrazing,
            (false, true) => HeldOutKind::TransmittedGrazing,
        }
    }
}

/// Random pairs: of every eight, three reflect and three transmit at up to 80 degrees, one
/// reflects and one transmits with a more oblique direction. Polar angles and azimuths are
/// uniform; the light is on either side.
pub fn held_out_pairs(count: usize, seed: u64) -> Vec<Pair> {
    (0..count)
        .map(|k| {
            let mut rng = PathRng::new(seed, 1 << 57, k as u64);
            let mut unit = || f64::from(rng.unit());
            let reflects = k % 2 == 0;
            let back = unit() < 0.5;
            let mut direction = |back: bool, low: f64, high: f64| {
                let theta = low + (high - low) * unit();
                Angles::new(if back { 180.0 - theta } else { theta }, 360.0 * unit())
            };
            let incident = direction(back, 0.0, OBLIQUE_DEG);
            let (low, high) = match k % 8 {
                6 | 7 => (OBLIQUE_DEG, LIMIT_DEG),
                _ => (0.0, OBLIQUE_DEG),
            };
            Pair::new(incident, direction(back == reflects, low, high))
        })
        .collect()
}

/// How far values are from the truth over pairs of one kind.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct HeldOutError {
    /// Which pairs.
    pub kind: HeldOutKind,
    /// How many.
    pub pairs: usize,
    /// Root mean square of the difference over pairs and channels, as a share of the root mean
    /// square value, without what the noise of the truth explains.
    pub rms: f64,
    /// The part of the difference that the noise of the truth explains.
    pub noise: f64,
    /// The largest difference of the mean over the channels at one pair, beyond two standard
    /// errors, as a share of the value there.
    pub worst: f64,
    /// Sum of the values over the sum of the truth, less one.
    pub bias: f64,
}

/// The errors of values against the truth at the same pairs, for the kinds that occur.
pub fn held_out_errors(values: &[[f64; 3]], truth: &[PairValue]) -> Vec<HeldOutError> {
    let one = |kind: HeldOutKind| {
        let of_kind = || {
            let both = values.iter().zip(truth);
            both.filter(move |(_, t)| HeldOutKind::of(&t.pair) == kind)
        };
        let pairs = of_kind().count();
        let (mut apart, mut noise, mut all) = (0.0, 0.0, 0.0);
        let (mut sum, mut true_sum, mut worst) = (0.0, 0.0, 0.0f64);
        for (value, truth) in of_kind() {
            let (mean, se) = (truth.bsdf.mean, truth.bsdf.se);
            for ((v, m), s) in value.iter().zip(mean).zip(se) {
                apart += (v - m).powi(2);
                noise += s * s;
                all += m * m;
                sum += v;
                true_sum += m;
            }
            let grey = |x: [f64; 3]| x.iter().sum::<f64>() / 3.0;
            let beyond = (grey(*value) - grey(mean)).abs() - 2.0 * grey(se);
            if grey(mean) > 0.0 {
                worst = worst.max(beyond / grey(mean));
            }
        }
        let truth = (all - noise).max(f64::MIN_POSITIVE);
        (pairs > 0).then(|| HeldOutError {
            kind,
            pairs,
            rms: ((apart - noise).max(0.0) / truth).sqrt(),
            noise: (noise / truth).sqrt(),
            worst,
            bias: sum / true_sum - 1.0,
        })
    };
    HeldOutKind::ALL.into_iter().filter_map(one).collect()
}

/// An upper end of the root mean square of the difference over all pairs up to 80 degrees and
/// their channels, as a share of the root mean square value: without what the noise of the truth
/// explains, and with two deviations of that noise over so many pairs, whose channels are taken
/// to have one noise. `None` without pairs, or where the truth is all noise.
pub fn held_out_bound(values: &[[f64; 3]], truth: &[PairValue]) -> Option<f64> {
    let (mut apart, mut noise, mut all, mut pairs) = (0.0, 0.0, 0.0, 0.0);
    for (value, truth) in values.iter().zip(truth) {
        let kind = HeldOutKind::of(&truth.pair);
        if !matches!(kind, HeldOutKind::Reflected | HeldOutKind::Transmitted) {
            continue;
        }
        pairs += 1.0;
        for ((v, m), s) in value.iter().zip(truth.bsdf.mean).zip(truth.bsdf.se) {
            apart += (v - m).powi(2) - s * s;
            noise += s * s;
            all += m * m - s * s;
        }
    }
    let square = apart.max(0.0) + 2.0 * (2.0f64 / pairs).sqrt() * noise;
    (pairs > 0.0 && all > 0.0).then(|| (square / all).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Measured;

    #[test]
    fn known_errors_are_found_under_noise() {
        let pairs = held_out_pairs(800, 4);
        let mut rng = PathRng::from_seed(8);
        let mut values = Vec::new();
        let mut truth = Vec::new();
        for pair in pairs {
            let value = 0.1 + 0.4 * f64::from(rng.unit());
            let kick = rng.normal2().as_dvec2();
            values.push([value * (1.0 + 0.1 * kick.x.signum()); 3]);
            truth.push(PairValue {
                pair,
                bsdf: Measured::new([value + 0.03 * kick.y; 3], [0.03; 3]),
                paths: 1,
            });
        }
        let errors = held_out_errors(&values, &truth);
        let pairs: Vec<_> = errors.iter().map(|e| e.pairs).collect();
        assert_eq!(pairs, [300, 300, 100, 100]);
        for error in &errors {
            // The noise is a tenth, too; three channels share one kick.
            assert!((error.rms - 0.1).abs() < 0.03, "seed 8: {error:?}");
        }
        let bound = held_out_bound(&values, &truth).unwrap();
        assert!((0.1..0.13).contains(&bound), "seed 8: {bound}");
        // Few pairs bound it less closely, and none do not.
        let few = held_out_bound(
            &truth[..6].iter().map(|t| t.bsdf.mean).collect::<Vec<_>>(),
            &truth[..6],
        );
        assert!(few.unwrap() > 0.05, "seed 8: {few:?}");
        assert_eq!(held_out_bound(&[], &[]), None);
        // Left in, the noise is noticed.
        let raw = errors[0].rms.hypot(errors[0].noise);
        assert!(raw > 0.12, "{raw}");
    }
}
