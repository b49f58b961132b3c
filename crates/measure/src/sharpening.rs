//! Values at the nodes of a far-field table from means over their hats.
//!
//! The means are smoother than the values that a table should have at its nodes. For values `M`
//! at the nodes the means would be `K M K`, where `K` holds the overlaps of the hats. The
//! iteration of [Richardson1972] and [Lucy1974] finds positive values with the measured means.
//! Too many steps fit the noise of the means. The two estimates of each mean show how large that
//! noise is, and by the discrepancy principle [Morozov1966] the iteration ends as soon as the
//! means of the values differ from the measured ones by no more ([`Sharpening::ToNoise`]).

use crate::NodeSums;
use rayon::prelude::*;

/// How far the smoothing of the hats is undone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Sharpening {
    /// Until the means of the values are as near to the measured means as their noise lets them
    /// be, at most [`MOST_STEPS`].
    #[default]
    ToNoise,
    /// So many steps.
    Steps(u32),
}

/// Most steps of the iteration.
pub const MOST_STEPS: u32 = 100;

/// Where the iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Sharpened {
    /// Steps.
    pub steps: u32,
    /// Integral of the squared difference between the means of the values and the measured ones,
    /// as a multiple of what noise alone makes of it.
    pub misfit: f64,
}

/// A square matrix.
pub(crate) struct Square {
    pub(crate) n: usize,
    /// Row by row.
    pub(crate) values: Vec<f64>,
}

impl Square {
    fn rows(&self) -> impl IndexedParallelIterator<Item = &[f64]> {
        self.values.par_chunks_exact(self.n)
    }

    /// `K M K` transposed: for a symmetric matrix, what its values look like through the hats.
    fn smoothed(&self, overlaps: &[Vec<(u32, f64)>]) -> Square {
        let n = self.n;
        let mut across = vec![0.0; n * n];
        across
            .par_chunks_exact_mut(n)
            .zip(self.rows())
            .for_each(|(to, from)| {
                for (value, list) in to.iter_mut().zip(overlaps) {
                    *value = list.iter().map(|&(b, k)| k * from[b as usize]).sum();
                }
            });
        let mut values = vec![0.0; n * n];
        values
            .par_chunks_exact_mut(n)
            .zip(overlaps)
            .for_each(|(to, list)| {
                for &(a, k) in list {
                    let from = &across[a as usize * n..(a as usize + 1) * n];
                    to.iter_mut().zip(from).for_each(|(t, f)| *t += k * f);
                }
            });
        Square { n, values }
    }
}

/// The measured means of one channel, and how noisy they are.
pub(crate) struct Means {
    /// The means of all pairs of nodes.
    found: Square,
    /// Every path counts for itself, so the variance of a mean `m` from an exposure `x` is this
    /// factor times `m / x`.
    noise: f64,
}

impl Means {
    /// The means of a channel. An estimate from few paths into a node of small weight is noisier:
    /// both estimates of a mean count by the light that they stand for, their [`exposure`].
    pub(crate) fn new(nodes: &[NodeSums], weights: &[f64], channel: usize) -> Means {
        let n = nodes.len();
        let scattered = |a: usize, b: usize| nodes[a].scattered[b][channel];
        let mut values = vec![0.0; n * n];
        let rows = values.par_chunks_exact_mut(n).enumerate();
        let sums: Vec<[f64; 2]> = rows
            .map(|(a, row)| {
                let mut sums = [0.0; 2];
                for (b, v) in row.iter_mut().enumerate() {
                    let [x, y] = [
                        exposure(nodes, weights, a, b),
                        exposure(nodes, weights, b, a),
                    ];
                    *v = (scattered(a, b) + scattered(b, a)) / (x + y);
                    if a < b {
                        let apart = scattered(a, b) / x - scattered(b, a) / y;
                        sums[0] += apart * apart / (1.0 / x + 1.0 / y);
                        sums[1] += *v;
                    }
                }
                sums
            })
            .collect();
        let total = |k: usize| sums.iter().map(|s| s[k]).sum::<f64>();
        Means {
            found: Square { n, values },
            noise: if total(1) > 0.0 {
                total(0) / total(1)
            } else {
                0.0
            },
        }
    }

    /// Integrals over both directions of the squared difference from other means, of what noise
    /// makes of it, and the sum of the squares of the latter.
    fn misfit(&self, nodes: &[NodeSums], weights: &[f64], seen: &Square) -> [f64; 3] {
        let rows = self.found.rows().zip(seen.rows()).enumerate();
        let sums: Vec<[f64; 3]> = rows
            .map(|(a, (found, seen))| {
                let mut sums = [0.0; 3];
                for b in 0..=a {
                    let exposed = exposure(nodes, weights, a, b) + exposure(nodes, weights, b, a);
                    let pair = weights[a] * weights[b];
                    let noise = pair * self.noise * seen[b] / exposed;
                    sums[0] += pair * (found[b] - seen[b]).powi(2);
                    sums[1] += noise;
                    sums[2] += noise * noise;
                }
                sums
            })
            .collect();
        [0, 1, 2].map(|k| sums.iter().map(|s| s[k]).sum())
    }
}

/// The light that the estimate of a pair of nodes from paths of the first stands for: paths times
/// the weight of the second, sr.
fn exposure(nodes: &[NodeSums], weights: &[f64], from: usize, to: usize) -> f64 {
    nodes[from].paths * weights[to]
}

/// Values at pairs of nodes whose means over the hats are the measured ones, channel by channel,
/// and where the iteration ended.
pub(crate) fn sharpened_pairs(
    means: &[Means],
    nodes: &[NodeSums],
    weights: &[f64],
    overlaps: &[Vec<(u32, f64)>],
    sharpening: Sharpening,
) -> (Vec<Square>, Sharpened) {
    let most = match sharpening {
        Sharpening::Steps(steps) => steps,
        Sharpening::ToNoise => MOST_STEPS,
    };
    let copy = |m: &Means| Square {
        n: m.found.n,
        values: m.found.values.clone(),
    };
    let mut values: Vec<Square> = means.iter().map(copy).collect();
    let mut steps = 0;
    loop {
        let seen: Vec<Square> = values.iter().map(|v| v.smoothed(overlaps)).collect();
        let misfits = means.iter().zip(&seen);
        let sums = misfits.map(|(m, s)| m.misfit(nodes, weights, s));
        let [apart, noise] = sums.fold([0.0; 2], |t, s| [t[0] + s[0], t[1] + s[1]]);
        let misfit = if noise > 0.0 { apart / noise } else { 0.0 };
        let is_enough = sharpening == Sharpening::ToNoise && misfit <= 1.0;
        if steps == most || is_enough {
            return (values, Sharpened { steps, misfit });
        }
        for ((values, mut ratio), mean) in values.iter_mut().zip(seen).zip(means) {
            for (r, m) in ratio.values.iter_mut().zip(&mean.found.values) {
                *r = if *r > 0.0 { m / *r } else { 0.0 };
            }
            let ratio = ratio.smoothed(overlaps);
            for (v, r) in values.values.iter_mut().zip(&ratio.values) {
                *v *= r;
            }
        }
        steps += 1;
    }
}

/// Values at nodes whose means over the hats are the given ones, by a few steps that leave a
/// constant as it is.
pub(crate) fn sharpened(means: &[f64], overlaps: &[Vec<(u32, f64)>]) -> Vec<f64> {
    const STEPS: usize = 4;
    let mut values = means.to_vec();
    for _ in 0..STEPS {
        let seen: Vec<f64> = overlaps
            .iter()
            .map(|list| list.iter().map(|&(b, k)| k * values[b as usize]).sum())
            .collect();
        for ((v, m), s) in values.iter_mut().zip(means).zip(seen) {
            *v += m - s;
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::far_table::tests::{SHEET, small_rings};
    use crate::{SurfacePatch, measure_node};
    use organza_surface::diffuse::DiffuseSheet;

    /// The misfit is one for what lies under the noise, and shows what lies elsewhere.
    #[test]
    fn the_noise_of_means_is_known_from_their_two_estimates() {
        let spec = SHEET;
        let patch = SurfacePatch(DiffuseSheet::new(&spec).unwrap());
        let rings = small_rings();
        let (n, half) = (rings.sphere(), rings.hemisphere());
        let nodes: Vec<NodeSums> = (0..n)
            .into_par_iter()
            .map(|node| measure_node(&patch, &rings, node, 0..8192, 5).unwrap().0)
            .collect();
        let weights: Vec<f64> = (0..n).map(|k| rings.weight(k)).collect();
        let misfit = |channel: usize, factor: f64| {
            let [r, t] = [spec.reflectance, spec.transmittance].map(|v| f64::from(v.0[channel]));
            let share = |a: usize, b: usize| if (a < half) == (b < half) { r } else { t };
            let pair = |k: usize| factor * share(k / n, k % n) / std::f64::consts::PI;
            let truth = Square {
                n,
                values: (0..n * n).map(pair).collect(),
            };
            let means = Means::new(&nodes, &weights, channel);
            let [apart, noise, squares] = means.misfit(&nodes, &weights, &truth);
            // Pairs of nodes beside each other share paths; a variance of three for each covers
            // that.
            let deviation = (3.0 * 2.0 * squares).sqrt();
            ((apart - noise) / deviation, apart / noise)
        };
        for channel in [0, 1, 2] {
            let (deviations, value) = misfit(channel, 1.0);
            assert!(deviations.abs() < 4.0, "seed 5, channel {channel}: {value}");
            let (deviations, value) = misfit(channel, 0.9);
            assert!(
                deviations > 8.0,
                "seed 5, channel {channel}, a tenth too dark: {value}"
            );
        }
        // The smooth means of a diffuse sheet need no sharpening, and get none.
        let overlaps = rings.overlaps();
        let means = [0, 1, 2].map(|c| Means::new(&nodes, &weights, c));
        let (_, ended) = sharpened_pairs(&means, &nodes, &weights, &overlaps, Sharpening::ToNoise);
        assert!(ended.steps == 0 && ended.misfit < 1.0, "seed 5: {ended:?}");
        let (_, ended) = sharpened_pairs(&means, &nodes, &weights, &overlaps, Sharpening::Steps(4));
        assert!(ended.steps == 4 && ended.misfit < 1.0, "seed 5: {ended:?}");
    }
}
