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
//! The means are smoother than the values that a table should have at its nodes;
//! the module `sharpening` undoes that.

use crate::sharpening::{Means, Sharpened, Sharpening, Square, sharpened, sharpened_pairs};
use crate::{Exit, MeasureError, PatchResponse, PathNames, PathRun};
use organza_basis::PathRng;
use organza_surface::table::{MeasuredMatrix, Rings};
use organza_transport::Stats;

/// What paths from one node found: sums over paths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeSums {
    /// Paths.
    pub paths: f64,
    /// Paths that met nothing.
    pub straight: f64,
    /// Light that left the cloth, straight or scattered, for each channel.
    pub escaped: [f64; 3],
    /// Squares of the same.
    pub escaped_squares: [f64; 3],
    /// Scattered light for each node of the sphere and channel.
    pub scattered: Vec<[f64; 3]>,
}

impl NodeSums {
    /// The sums as a list, as journals keep them.
    pub fn to_list(&self) -> Vec<f64> {
        let head = [self.paths, self.straight].into_iter();
        let head = head.chain(self.escaped).chain(self.escaped_squares);
        head.chain(self.scattered.iter().flatten().copied())
            .collect()
    }

    /// Length of the list for a number of nodes of the sphere.
    pub fn list_length(nodes: usize) -> usize {
        8 + 3 * nodes
    }

    /// The sums of a list; `None` for a list of another length.
    pub fn from_list(list: &[f64], nodes: usize) -> Option<NodeSums> {
        let [paths, straight, r, g, b, rr, gg, bb, rest @ ..] = list else {
            return None;
        };
        (rest.len() == 3 * nodes).then(|| NodeSums {
            paths: *paths,
            straight: *straight,
            escaped: [*r, *g, *b],
            escaped_squares: [*rr, *gg, *bb],
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
        add(&mut self.escaped_squares, &other.escaped_squares);
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
    let draw = |rng: &mut PathRng| rings.draw(node, rng);
    let mut found = |exit: Exit| {
        let Some((to, weight)) = exit.finite(&mut rejected) else {
            return;
        };
        let channels = weight.0.to_array().map(f64::from);
        let escaped = sums.escaped.iter_mut().zip(&mut sums.escaped_squares);
        for ((sum, square), v) in escaped.zip(channels) {
            *sum += v;
            *square += v * v;
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
        let names = PathNames::new(
            seed,
            NODE_STREAMS + node as u64,
            first..(first + AT_ONCE).min(paths.end),
        );
        patch.each_exit(&draw, PathRun::new(&names, &mut stats, &mut found));
    }
    stats.rejected += rejected;
    MeasureError::check(&stats)?;
    Ok((sums, stats))
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

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::SurfacePatch;
    use glam::Vec3;
    use organza_scatter::{Footprint, Surface};
    use organza_surface::diffuse::{DiffuseSheet, DiffuseSpec};
    use organza_surface::table::{FarTable, balance};
    use rayon::prelude::*;

    /// A sheet with gaps that reflects and transmits.
    pub const SHEET: DiffuseSpec = DiffuseSpec {
        reflectance: organza_basis::Rgb::new(0.5, 0.3, 0.1),
        transmittance: organza_basis::Rgb::new(0.2, 0.3, 0.05),
        openness: 0.25,
    };

    /// Few rings, for few paths.
    pub fn small_rings() -> Rings {
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
        let patch = SurfacePatch(DiffuseSheet::new(&SHEET).unwrap());
        let rings = small_rings();
        let table = table_of(&patch, &rings, 8192);
        let mut rng = PathRng::from_seed(9);
        let (mut off, mut all) = (0.0, 0.0);
        for _ in 0..500 {
            let [a, b] = [0, 1].map(|_| organza_basis::warp::uniform_sphere(rng.unit2()));
            let found = table.eval(a, b, Footprint::FAR).0;
            let truth = patch.0.eval(a, b, Footprint::FAR).0;
            off += f64::from((found - truth).length_squared());
            all += f64::from(truth.length_squared());
            assert!((table.gap(a, Footprint::FAR) - 0.25).abs() < 0.03, "seed 9");
            let scattered = table.albedo(a).0;
            assert!((scattered - Vec3::new(0.7, 0.6, 0.15)).abs().max_element() < 0.03);
        }
        // 50 paths a node, from both ends, and four pairs of nodes a value, sharpened.
        assert!((off / all).sqrt() < 0.12, "seed 9: {}", (off / all).sqrt());
    }

    #[test]
    fn lists_keep_sums() {
        let sums = NodeSums {
            paths: 8.0,
            straight: 2.0,
            escaped: [7.0, 6.0, 5.0],
            escaped_squares: [6.5, 5.5, 4.5],
            scattered: vec![[1.0, 2.0, 3.0]; 4],
        };
        let list = sums.to_list();
        assert_eq!(list.len(), NodeSums::list_length(4));
        assert_eq!(NodeSums::from_list(&list, 4), Some(sums));
        assert_eq!(NodeSums::from_list(&list, 5), None);
    }
}
