//! Differences between two lists of measured pairs, each figure with an interval.
//!
//! Intervals come from the bootstrap [Efron1993]: pairs are drawn with replacement, and each
//! value is perturbed once more by its standard error, so that the intervals include both the
//! choice of directions and the noise of the values.

use crate::{Measured, PairValue};
use organza_basis::PathRng;

/// A figure with the ends of its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Figure {
    /// The figure.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Figure {
    /// Whether the figure is below a limit; `None` where the interval contains the limit.
    pub fn is_below(&self, limit: f64) -> Option<bool> {
        if self.high < limit {
            Some(true)
        } else if self.low > limit {
            Some(false)
        } else {
            None
        }
    }
}

/// The difference between two lists. Relative errors are those of all channels of all pairs
/// against the reference, as in [Irawan2008].
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Median relative error.
    pub median: Figure,
    /// 80th percentile of the relative error.
    pub percentile_80: Figure,
    /// Root mean square of the error times the cosine of the exitant
    /// direction, as a share of the reference's own.
    pub cosine_rmse: Figure,
    /// The median relative error that noise alone would show if both were
    /// equal: smaller differences are ignored.
    pub noise_median: f64,
    /// Mean of the values over the mean of the reference, less one.
    pub bias: Figure,
    /// Index of the pair with the largest error in standard errors, or in
    /// share of the value where there is no noise.
    pub worst: Option<usize>,
    /// Its relative error.
    pub worst_relative: f64,
    /// Channels of pairs that were compared.
    pub count: usize,
}

/// Draws of the bootstrap.
const DRAWS: u64 = 200;

/// Compares values against a reference over the same pairs. Channels where the reference is
/// zero, or its error exceeds its value, have no relative error and are excluded from it.
pub fn difference(values: &[PairValue], reference: &[PairValue], seed: u64) -> Difference {
    let samples: Vec<Sample> = values
        .iter()
        .zip(reference)
        .enumerate()
        .flat_map(|(index, (v, r))| Sample::of(index, v, r))
        .collect();
    let plain = Statistics::of(&samples);
    let mut noise = Vec::new();
    let mut drawn: [Vec<f64>; 4] = Default::default();
    for draw in 0..DRAWS {
        let mut rng = PathRng::new(seed, 1 << 59, draw);
        let mut again = Vec::with_capacity(samples.len());
        let mut null = Vec::with_capacity(samples.len());
        for _ in 0..samples.len() {
            let pick = rng.below(samples.len().try_into().unwrap_or(u32::MAX));
            let Some(s) = samples.get(pick as usize) else {
                continue;
            };
            let kick = rng.normal2().as_dvec2();
            again.push(Sample {
                value: s.value + kick.x * s.se,
                ..*s
            });
            if s.is_known() {
                let kicked = s.reference + kick.x * s.se_reference;
                null.push(kick.y.mul_add(s.se, kick.x * s.se_reference).abs() / kicked.abs());
            }
        }
        let s = Statistics::of(&again);
        for (list, v) in drawn.iter_mut().zip([s.median, s.p80, s.rmse, s.bias]) {
            list.push(v);
        }
        noise.push(quantile(&mut null, 0.5));
    }
    let mut figures = drawn
        .into_iter()
        .zip([plain.median, plain.p80, plain.rmse, plain.bias])
        .map(|(mut list, value)| {
            // Perturbing values once more increases the errors; the width of the interval is
            // right, and its middle is moved to the figure.
            let middle = quantile(&mut list, 0.5);
            Figure {
                value,
                low: value + quantile(&mut list, 0.025) - middle,
                high: value + quantile(&mut list, 0.975) - middle,
            }
        });
    let mut next = || {
        figures.next().unwrap_or(Figure {
            value: f64::NAN,
            low: f64::NAN,
            high: f64::NAN,
        })
    };
    let worst = samples
        .iter()
        .max_by(|a, b| a.surprise().total_cmp(&b.surprise()));
    Difference {
        median: next(),
        percentile_80: next(),
        cosine_rmse: next(),
        bias: next(),
        noise_median: quantile(&mut noise, 0.5),
        worst: worst.map(|s| s.index),
        worst_relative: worst.map_or(f64::NAN, Sample::relative),
        count: samples.len(),
    }
}

/// Largest departure from reciprocity: pairs and their reverses, in standard
/// errors of their difference; `None` without such pairs.
pub fn reciprocity(forward: &[PairValue], reverse: &[PairValue]) -> Option<f64> {
    forward
        .iter()
        .zip(reverse)
        .flat_map(|(f, r)| (0..3).map(move |c| distance(&f.bsdf, &r.bsdf, c)))
        .filter(|d| d.is_finite())
        .max_by(f64::total_cmp)
}

/// Distance of one channel in standard errors; without noise, in ten-thousandths of the value.
fn distance(a: &Measured, b: &Measured, channel: usize) -> f64 {
    let get = |list: &[f64; 3]| list.get(channel).copied().unwrap_or(0.0);
    let (x, y) = (get(&a.mean), get(&b.mean));
    let se = get(&a.se).hypot(get(&b.se));
    (x - y).abs()
        / if se > 0.0 {
            se
        } else {
            1e-4 * x.abs().max(y.abs())
        }
}

#[derive(Clone, Copy)]
struct Sample {
    index: usize,
    value: f64,
    se: f64,
    reference: f64,
    se_reference: f64,
    cosine: f64,
}

impl Sample {
    fn of(index: usize, v: &PairValue, r: &PairValue) -> [Sample; 3] {
        let cosine = v.pair.exitant.theta_deg.to_radians().cos().abs();
        std::array::from_fn(|c| Sample {
            index,
            value: v.bsdf.mean[c],
            se: v.bsdf.se[c],
            reference: r.bsdf.mean[c],
            se_reference: r.bsdf.se[c],
            cosine,
        })
    }

    fn is_known(&self) -> bool {
        self.reference > 0.0 && self.se_reference < self.reference
    }

    fn relative(&self) -> f64 {
        (self.value - self.reference).abs() / self.reference
    }

    fn surprise(&self) -> f64 {
        let se = self.se.hypot(self.se_reference);
        let error = (self.value - self.reference).abs();
        error
            / if se > 0.0 {
                se
            } else {
                self.reference.abs().max(1e-12)
            }
    }
}

struct Statistics {
    median: f64,
    p80: f64,
    rmse: f64,
    bias: f64,
}

impl Statistics {
    fn of(samples: &[Sample]) -> Statistics {
        let known = samples.iter().filter(|s| s.is_known());
        let mut relative: Vec<f64> = known.map(Sample::relative).collect();
        let sum = |f: &dyn Fn(&Sample) -> f64| samples.iter().map(f).sum::<f64>();
        let square = sum(&|s| ((s.value - s.reference) * s.cosine).powi(2));
        let own = sum(&|s| (s.reference * s.cosine).powi(2));
        Statistics {
            median: quantile(&mut relative, 0.5),
            p80: quantile(&mut relative, 0.8),
            rmse: (square / own).sqrt(),
            bias: sum(&|s| s.value) / sum(&|s| s.reference) - 1.0,
        }
    }
}

/// The quantile of a list, which is sorted in place; NaN for an empty one.
fn quantile(list: &mut [f64], share: f64) -> f64 {
    list.sort_by(f64::total_cmp);
    let at = share * (list.len() as f64 - 1.0);
    let low = at.floor().max(0.0) as usize;
    match (list.get(low), list.get(low + 1)) {
        (Some(a), Some(b)) => a + (b - a) * (at - low as f64),
        (Some(a), None) => *a,
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Angles, Pair, in_plane_layout};

    fn list(seed: u64, factor: f64, noise: f64) -> Vec<PairValue> {
        let mut rng = PathRng::from_seed(seed);
        let pairs = in_plane_layout(30.0);
        let value = |pair: &Pair| {
            let Angles { theta_deg, .. } = pair.exitant;
            let truth = 0.1 + 0.05 * theta_deg.to_radians().cos();
            let mean = std::array::from_fn(|_| {
                factor * truth * (1.0 + noise * f64::from(rng.normal2().x))
            });
            PairValue {
                pair: *pair,
                bsdf: Measured::new(mean, [factor * truth * noise; 3]),
                paths: 1,
            }
        };
        pairs.iter().map(value).collect()
    }

    #[test]
    fn a_known_difference_is_found_and_noise_alone_is_none() {
        let reference = list(1, 1.0, 0.0);
        let d = difference(&list(2, 1.2, 0.0), &reference, 3);
        assert!((d.median.value - 0.2).abs() < 1e-9 && d.noise_median == 0.0);
        assert!((d.bias.value - 0.2).abs() < 1e-9 && (d.cosine_rmse.value - 0.2).abs() < 1e-9);
        assert_eq!(d.median.is_below(0.15), Some(false));
        assert_eq!(d.median.is_below(0.25), Some(true));
        // Noise of 5 % in one list: a median of 0.67 times that.
        let d = difference(&list(4, 1.0, 0.05), &reference, 5);
        assert!((d.noise_median - 0.0337).abs() < 0.004, "{d:?}");
        assert!(d.median.low < 0.0337 && 0.0337 < d.median.high, "{d:?}");
        assert!(d.bias.low < 0.0 && 0.0 < d.bias.high, "{d:?}");
    }

    #[test]
    fn reciprocity_is_given_in_standard_errors() {
        let (a, b) = (list(6, 1.0, 0.02), list(7, 1.0, 0.02));
        let most = reciprocity(&a, &b).unwrap();
        assert!(most < 4.5, "{most}");
        assert!(reciprocity(&a, &list(8, 1.3, 0.02)).unwrap() > 6.0);
        assert_eq!(reciprocity(&[], &[]), None);
    }
}
