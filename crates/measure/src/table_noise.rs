//! How exact a far-field table is: the noise of the paths that it was made of, and its error at
//! held-out pairs. Whatever is measured of the table has these errors beside its own.

use crate::sharpening::sharpened;
use crate::{Albedo, Angles, HeldOutError, HeldOutKind, Measured, NodeSums, PairValue};
use organza_basis::PathRng;
use organza_surface::table::Rings;
use serde::{Deserialize, Serialize};

/// Standard errors of shares of the light at the nodes of a ring, on both sides, root mean
/// square.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RingNoise {
    /// Polar angle of the ring.
    pub theta_deg: f64,
    /// Of scattered light.
    pub scattered: [f64; 3],
    /// Of light that meets nothing.
    pub straight: f64,
    /// Of absorbed light.
    pub absorbed: [f64; 3],
}

/// Trials by which noise is followed through the sharpening: known to 9 %.
const TRIALS: u64 = 64;

/// The noise of a table's shares, ring by ring from the normal, before bytes round them.
pub fn ring_noise(rings: &Rings, nodes: &[NodeSums]) -> Vec<RingNoise> {
    let overlaps = rings.overlaps();
    // Variances of the means of what `of` gives: the sums of a value of paths and its square.
    let variances = |of: &dyn Fn(&NodeSums) -> [f64; 2]| -> Vec<f64> {
        let of_node = |node: &NodeSums| {
            let [mean, square] = of(node).map(|sum| sum / node.paths);
            (square - mean * mean).max(0.0) / node.paths
        };
        nodes.iter().map(of_node).collect()
    };
    let sharp = |list: Vec<f64>| sharpened_variances(&list, &overlaps);
    // Light straight through is the mean over both ways, and scattered light is what else escapes.
    let half_straight = variances(&|n| [0.5 * n.straight, 0.25 * n.straight]);
    let with_back = |list: &[f64]| -> Vec<f64> {
        let both = list.iter().enumerate();
        both.map(|(a, v)| v + half_straight[rings.opposite(a)])
            .collect()
    };
    let straight = sharp(with_back(&half_straight));
    let of_channel = |c: usize| {
        let own = variances(&|n| {
            let squares = n.escaped_squares[c] - 0.75 * n.straight;
            [n.escaped[c] - 0.5 * n.straight, squares]
        });
        let escaped = variances(&|n| [n.escaped[c], n.escaped_squares[c]]);
        [sharp(with_back(&own)), sharp(escaped)]
    };
    let channels = [0, 1, 2].map(of_channel);
    let mut first = 0;
    let ring = |(theta, count): (f32, u32)| {
        let front = first..first + count as usize;
        first = front.end;
        let root_mean = |list: &[f64]| {
            let both = front.clone().flat_map(|a| [a, rings.opposite(a)]);
            let sum: f64 = both.map(|a| list[a]).sum();
            (sum / (2.0 * f64::from(count))).sqrt()
        };
        RingNoise {
            theta_deg: f64::from(theta).to_degrees(),
            scattered: channels.each_ref().map(|c| root_mean(&c[0])),
            straight: root_mean(&straight),
            absorbed: channels.each_ref().map(|c| root_mean(&c[1])),
        }
    };
    rings.list().map(ring).collect()
}

/// Variances of sharpened means whose own variances are these.
fn sharpened_variances(variances: &[f64], overlaps: &[Vec<(u32, f64)>]) -> Vec<f64> {
    let errors: Vec<f64> = variances.iter().map(|v| v.sqrt()).collect();
    let mut squares = vec![0.0; errors.len()];
    for trial in 0..TRIALS {
        let mut rng = PathRng::new(0, 1 << 56, trial);
        let noise = errors
            .iter()
            .map(|e| if rng.unit() < 0.5 { -e } else { *e });
        let noise = sharpened(&noise.collect::<Vec<_>>(), overlaps);
        for (sum, x) in squares.iter_mut().zip(noise) {
            *sum += x * x / TRIALS as f64;
        }
    }
    squares
}

/// What the description of a table says about its errors.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct TableErrors {
    /// Noise of the shares.
    #[serde(default)]
    pub noise: Vec<RingNoise>,
    /// Errors at held-out pairs.
    #[serde(default)]
    pub errors: Vec<HeldOutError>,
}

impl TableErrors {
    /// The noise of a direction: that of the noisier of the two rings beside it.
    fn at(&self, w: &Angles) -> Option<RingNoise> {
        let theta_deg = w.theta_deg.min(180.0 - w.theta_deg);
        let next = self.noise.iter().position(|r| r.theta_deg >= theta_deg)?;
        let [a, b] = [next.saturating_sub(1), next].map(|k| self.noise[k]);
        Some(if a.absorbed[1] > b.absorbed[1] { a } else { b })
    }

    /// Adds the noise of the table to the standard errors of shares; false where it is not known.
    pub fn widen_albedos(&self, list: &mut [Albedo]) -> bool {
        list.iter_mut().all(|albedo| {
            let Some(noise) = self.at(&albedo.incident) else {
                return false;
            };
            for c in [0, 1, 2] {
                let parts = [albedo.reflected.mean[c], albedo.transmitted.mean[c]];
                let scattered = (parts[0] + parts[1]).max(f64::MIN_POSITIVE);
                let widen = |value: &mut Measured, by: f64| value.se[c] = value.se[c].hypot(by);
                widen(
                    &mut albedo.reflected,
                    noise.scattered[c] * parts[0] / scattered,
                );
                widen(
                    &mut albedo.transmitted,
                    noise.scattered[c] * parts[1] / scattered,
                );
                widen(&mut albedo.direct, noise.straight);
                widen(&mut albedo.absorbed, noise.absorbed[c]);
            }
            true
        })
    }

    /// Adds the error of the table at held-out pairs of the same kind, as a share of each value;
    /// false where it is not known.
    pub fn widen_pairs(&self, list: &mut [PairValue]) -> bool {
        list.iter_mut().all(|value| {
            let kind = HeldOutKind::of(&value.pair);
            let Some(error) = self.errors.iter().find(|e| e.kind == kind) else {
                return false;
            };
            for (se, mean) in value.bsdf.se.iter_mut().zip(value.bsdf.mean) {
                *se = se.hypot(error.rms * mean);
            }
            true
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::far_table::tests::{SHEET, small_rings};
    use crate::{Sharpening, SurfacePatch, far_matrix, measure_node};
    use organza_surface::diffuse::DiffuseSheet;

    /// Shares of a known sheet are off by as much as is said; half or twice as much is rejected.
    #[test]
    fn shares_are_as_noisy_as_is_said() {
        let patch = SurfacePatch(DiffuseSheet::new(&SHEET).unwrap());
        let rings = small_rings();
        let nodes: Vec<NodeSums> = (0..rings.sphere())
            .map(|node| measure_node(&patch, &rings, node, 0..2048, 11).unwrap().0)
            .collect();
        let (matrix, _) = far_matrix(&rings, &nodes, Sharpening::Steps(0)).unwrap();
        let noise = ring_noise(&rings, &nodes);
        let (mut squares, mut count) = (0.0, 0.0);
        let mut first = 0;
        for ((_, of_ring), noise) in rings.list().zip(&noise) {
            for a in first..first + of_ring as usize {
                for c in [0, 1, 2] {
                    let truth = f64::from(SHEET.reflectance.0[c] + SHEET.transmittance.0[c]);
                    squares += ((matrix.shares[a][c] - truth) / noise.scattered[c]).powi(2);
                    count += 1.0;
                }
            }
            first += of_ring as usize;
        }
        // About 60 nodes, which share paths with their neighbours, and one sample of events in
        // all channels.
        let ratio: f64 = squares / count;
        assert!((0.5..2.0).contains(&ratio), "seed 11: {ratio}");
    }
}
