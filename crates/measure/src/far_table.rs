//! The matrix of a [`FarTable`](organza_surface::table::FarTable), measured by paths of light
//! through a patch.
//!
//! From every node `a`, paths start in directions that are drawn in proportion to the node's
//! hat `B_a` times the cosine. Each exit is divided among the hats of its direction. The mean
//! is
//!
//! ```text
//! m_ab = integral of B_a(w_i) B_b(w_o) f(w_i, w_o) cos cos / (W_a W_b)
//! ```
//!
//! with the weights `W` of the hats. It is symmetric because `f` is, so the estimates of `m_ab`
//! and `m_ba` are joined: this makes the table reciprocal and its noise smaller. Each path
//! serves all exitant nodes, where a measurement of pairs of directions needs paths for each.
//!
//! The means are smoother than the values that a table should have at its nodes. For values `M`
//! at the nodes the means would be `K M K`, where `K` holds the overlaps of the hats. The
//! iteration of [Richardson1972] and [Lucy1974] finds positive values with the measured means.
//! Too many steps fit the noise of the means. The two estimates of each mean show how large that
//! noise is, and by the discrepancy principle [Morozov1966] the iteration ends as soon as the
//! means of the values differ from the measured ones by no more ([`Sharpening::ToNoise`]).

use crate::{Exit, MeasureError, PatchResponse, PathNames};
use organza_basis::PathRng;
use organza_surface::table::{MeasuredMatrix, Rings};
use organza_transport::Stats;
use rayon::prelude::*;

/// What paths from one node found: sums over paths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeSums {
    /// Paths.
    pub paths: f64,
    /// Paths that met nothing.
    pub straight: f64,
    /// Light that left the cloth, straight or scattered, for each channel.
    pub escaped: [f64; 3],
    /// Scattered light for each node of the sphere and channel.
    pub scattered: Vec<[f64; 3]>,
}

impl NodeSums {
    /// The sums as a list, as journals keep them.
    pub fn to_list(&self) -> Vec<f64> {
        let head = [self.paths, self.straight].into_iter().chain(self.escaped);
        head.chain(self.scattered.iter().flatten().copied())
            .collect()
    }

    /// Length of the list for a number of nodes of the sphere.
    pub fn list_length(nodes: usize) -> usize {
        5 + 3 * nodes
    }

    /// The sums of a list; `None` for a list of another length.
    pub fn from_list(list: &[f64], nodes: usize) -> Option<NodeSums> {
        let [paths, straight, r, g, b, rest @ ..] = list else {
            return None;
        };
        (rest.len() == 3 * nodes).then(|| NodeSums {
            paths: *paths,
            straight: *straight,
            escaped: [*r, *g, *b],
            scattered: rest.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect(),
        })
    }

    /// Adds the sums of other paths from the same node.
    pub fn merge(&mut self, other: &NodeSums) {
        self.paths += other.paths;
        self.straight += other.straight;
        self.scattered.resize(other.scattered.len(), [0.0; 3]);
        let add = |a: &mut [f64; 3], b: &[f64; 3]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        add(&mut self.escaped, &other.escaped);
        for (a, b) in self.scattered.iter_mut().zip(&other.scattered) {
            add(a, b);
        }
    }
}

/// Streams of random numbers that belong to nodes of tables.
const NODE_STREAMS: u64 = 1 << 58;

/// Paths that are traced together, which bounds memory.
const AT_ONCE: u64 = 1 << 14;

/// Traces paths from a node.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_node(
    patch: &impl PatchResponse,
    rings: &Rings,
    node: usize,
    paths: std::ops::Range<u64>,
    seed: u64,
) -> Result<(NodeSums, Stats), MeasureError> {
    let mut sums = NodeSums {
        paths: (paths.end - paths.start) as f64,
        scattered: vec![[0.0; 3]; rings.sphere()],
        ..NodeSums::default()
    };
    let (mut stats, mut rejected) = (Stats::default(), 0);
    let way = |rng: &mut PathRng| rings.draw(node, rng);
    let mut found = |exit: Exit| {
        let Some((to, weight)) = exit.escape else {
            return;
        };
        if !weight.0.is_finite() {
            rejected += 1;
            return;
        }
        let channels = weight.0.to_array().map(f64::from);
        for (sum, v) in sums.escaped.iter_mut().zip(channels) {
            *sum += v;
        }
        if exit.is_straight {
            sums.straight += 1.0;
            return;
        }
        let hats = rings.hats(to);
        for (at, share) in hats.nodes.iter().zip(hats.values) {
            if let Some(slot) = sums.scattered.get_mut(*at as usize) {
                for (sum, v) in slot.iter_mut().zip(channels) {
                    *sum += v * f64::from(share);
                }
            }
        }
    };
    for first in paths.clone().step_by(AT_ONCE as usize) {
        let names = PathNames {
            seed,
            stream: NODE_STREAMS + node as u64,
            paths: first..(first + AT_ONCE).min(paths.end),
        };
        patch.each_exit(&way, &names, &mut stats, &mut found);
    }
    stats.rejected += rejected;
    MeasureError::check(&stats)?;
    Ok((sums, stats))
}

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

/// A square matrix, row by row.
struct Square {
    n: usize,
    values: Vec<f64>,
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
struct Means {
    /// The means of all pairs of nodes.
    found: Square,
    /// Variance of a mean of one from an exposure of one. As every path counts for itself, that
    /// of a mean `m` from an exposure `x` is this times `m / x`.
    noise: f64,
}

impl Means {
    /// The means of a channel. An estimate from few paths into a node of small weight is noisier:
    /// both estimates of a mean count by the light that they stand for, their [`exposure`].
    fn new(nodes: &[NodeSums], weights: &[f64], channel: usize) -> Means {
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
fn sharpened_pairs(
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

/// The matrix of a table from the sums of all nodes, without the smoothing of the hats, and where
/// the iteration that undoes it ended.
///
/// `None` unless there are sums with paths for every node of the sphere.
pub fn far_matrix(
    rings: &Rings,
    nodes: &[NodeSums],
    sharpening: Sharpening,
) -> Option<(MeasuredMatrix, Sharpened)> {
    let (n, half) = (rings.sphere(), rings.hemisphere());
    let complete = |s: &NodeSums| s.paths > 0.0 && s.scattered.len() == n;
    if nodes.len() != n || !nodes.iter().all(complete) {
        return None;
    }
    let overlaps = rings.overlaps();
    let weights: Vec<f64> = (0..n).map(|k| rings.weight(k)).collect();
    // Light straight through takes the same way back.
    let straight = |a: usize| nodes[a].straight / nodes[a].paths;
    let passing: Vec<f64> = (0..half)
        .map(|a| 0.5 * (straight(a) + straight(rings.opposite(a))))
        .collect();
    let both: Vec<f64> = (0..n)
        .map(|a| passing[if a < half { a } else { rings.opposite(a) }])
        .collect();
    let gaps = sharpened(&both, &overlaps);
    let gaps: Vec<f64> = gaps.iter().map(|g| g.clamp(0.0, 1.0)).collect();
    let gap_at = |a: usize| gaps[if a < half { a } else { rings.opposite(a) }];
    let mut shares = vec![[0.0; 3]; n];
    for c in [0, 1, 2] {
        let escaped: Vec<f64> = nodes.iter().map(|s| s.escaped[c] / s.paths).collect();
        for (a, total) in sharpened(&escaped, &overlaps).into_iter().enumerate() {
            shares[a][c] = (total.min(1.0) - gap_at(a)).max(0.0);
        }
    }
    let means = [0, 1, 2].map(|c| Means::new(nodes, &weights, c));
    let (channels, ended) = sharpened_pairs(&means, nodes, &weights, &overlaps, sharpening);
    let mut values = Vec::with_capacity(n * (n + 1) / 2);
    for a in 0..n {
        for b in 0..=a {
            let both = |m: &Square| 0.5 * (m.values[a * n + b] + m.values[b * n + a]);
            values.push(std::array::from_fn(|c| channels.get(c).map_or(0.0, both)));
        }
    }
    let matrix = MeasuredMatrix {
        rings: rings.clone(),
        values,
        shares,
        gaps: gaps[..half].to_vec(),
    };
    Some((matrix, ended))
}

/// Values at nodes whose means over the hats are the given ones, by a few steps that leave a
/// constant as it is.
fn sharpened(means: &[f64], overlaps: &[Vec<(u32, f64)>]) -> Vec<f64> {
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
    use crate::SurfacePatch;
    use glam::Vec3;
    use organza_scatter::{Footprint, Surface};
    use organza_surface::diffuse::{DiffuseSheet, DiffuseSpec};
    use organza_surface::table::{FarTable, balance};

    fn rings() -> Rings {
        let degrees = [
            (0.0, 1),
            (20.0, 8),
            (40.0, 12),
            (60.0, 16),
            (78.0, 16),
            (90.0, 8),
        ];
        Rings::new(&degrees.map(|(t, n): (f32, u32)| (t.to_radians(), n))).unwrap()
    }

    fn table_of(patch: &impl PatchResponse, rings: &Rings, paths: u64) -> FarTable {
        let nodes: Vec<NodeSums> = (0..rings.sphere())
            .into_par_iter()
            .map(|node| measure_node(patch, rings, node, 0..paths, 3).unwrap().0)
            .collect();
        let matrix = far_matrix(rings, &nodes, Sharpening::ToNoise).unwrap().0;
        FarTable::new(balance(&matrix).parts).unwrap()
    }

    #[test]
    fn a_diffuse_sheet_is_found_again() {
        let spec = DiffuseSpec {
            reflectance: organza_basis::Rgb::new(0.5, 0.3, 0.1),
            transmittance: organza_basis::Rgb::new(0.2, 0.3, 0.05),
            openness: 0.25,
        };
        let patch = SurfacePatch(DiffuseSheet::new(&spec).unwrap());
        let rings = rings();
        let table = table_of(&patch, &rings, 8192);
        let mut rng = PathRng::from_seed(9);
        let (mut off, mut all) = (0.0, 0.0);
        for _ in 0..500 {
            let [a, b] = [0, 1].map(|_| organza_basis::warp::uniform_sphere(rng.unit2()));
            let found = table.eval(a, b, Footprint::FAR).0;
            let truth = patch.0.eval(a, b, Footprint::FAR).0;
            off += f64::from((found - truth).length_squared());
            all += f64::from(truth.length_squared());
            assert!((table.gap(a) - 0.25).abs() < 0.03, "seed 9");
            let scattered = table.albedo(a).0;
            assert!((scattered - Vec3::new(0.7, 0.6, 0.15)).abs().max_element() < 0.03);
        }
        // 50 paths a node, from both ends, and four pairs of nodes a value, sharpened.
        assert!((off / all).sqrt() < 0.12, "seed 9: {}", (off / all).sqrt());
    }

    /// The misfit is one for what lies under the noise, and shows what lies elsewhere.
    #[test]
    fn the_noise_of_means_is_known_from_their_two_estimates() {
        let spec = DiffuseSpec {
            reflectance: organza_basis::Rgb::new(0.5, 0.3, 0.1),
            transmittance: organza_basis::Rgb::new(0.2, 0.3, 0.05),
            openness: 0.25,
        };
        let patch = SurfacePatch(DiffuseSheet::new(&spec).unwrap());
        let rings = rings();
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

    #[test]
    fn lists_keep_sums() {
        let sums = NodeSums {
            paths: 8.0,
            straight: 2.0,
            escaped: [7.0, 6.0, 5.0],
            scattered: vec![[1.0, 2.0, 3.0]; 4],
        };
        let list = sums.to_list();
        assert_eq!(list.len(), NodeSums::list_length(4));
        assert_eq!(NodeSums::from_list(&list, 4), Some(sums));
        assert_eq!(NodeSums::from_list(&list, 5), None);
    }
}
