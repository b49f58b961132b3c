//! Reflection over a parameterisation that follows the cloth [Dupuy2018]: the table is finest
//! where the cloth reflects most.
//!
//! The reflectance towards the light gives a distribution of microfacet normals. For every
//! incident direction, the normals that are visible from it, reflected, cover the exitant
//! directions with a density; the unit square is mapped to them by that density. The table
//! holds, at the nodes of a grid on the square, the BRDF times the exitant cosine over that
//! density. The normals only place the nodes: at the nodes the table has the measured values,
//! whatever the distribution.
//!
//! Directions are (sqrt(2 theta / pi), (phi + pi) / 2 pi) on the unit square.

use crate::bilinear_warp::{BilinearWarp, piece};
use crate::goniometer::gather_pairs;
use crate::{Angles, Effort, MeasureError, Measured, Pair, PairValue, PatchResponse};
use glam::{DVec2, DVec3};
use organza_basis::Watch;
use organza_transport::Stats;
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// Numbers of directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AdaptiveGrid {
    /// Polar angles of incident directions, evenly spaced from the normal to
    /// [`AdaptiveGrid::MAX_THETA_DEG`]; at least 2.
    pub polar: u32,
    /// Azimuths of incident directions around the circle; at least 3.
    pub azimuths: u32,
    /// Nodes along each side of the square of exitant directions; at least 4.
    pub side: u32,
}

impl AdaptiveGrid {
    /// The steepest incident direction.
    pub const MAX_THETA_DEG: f64 = 88.0;

    /// Nodes of the whole table.
    fn nodes(self) -> u64 {
        let incident = u64::from(self.polar) * (u64::from(self.azimuths) + 1);
        incident.saturating_mul(u64::from(self.side).pow(2))
    }

    /// Memory of the table, upper bound.
    pub fn memory_bytes(self) -> u64 {
        // Three channels, luminance and visible normals in 32 bits, while the lists grow, and
        // the measured pairs.
        let node = 2 * 5 * 4 + 2 * size_of::<PairValue>() as u64;
        self.nodes().saturating_mul(node)
    }

    /// Incident directions that are measured: the normal once, and no azimuth twice.
    pub fn incident_count(self) -> usize {
        1 + (self.polar as usize - 1) * self.azimuths as usize
    }

    /// Pairs to expect of a measurement, for its progress: about half of the nodes are below
    /// the horizon at grazing incidence.
    pub fn pairs(self) -> u64 {
        let square = u64::from(self.side).pow(2);
        (self.incident_count() as u64 + RETRO_EFFORT).saturating_mul(square)
    }
}

/// The retroreflectance shapes the whole table, so it is measured with this many times the
/// paths of a pair.
const RETRO_EFFORT: u64 = 8;

/// Cosine of the flattest directions that are measured; flatter ones take their values.
const LEAST_COSINE: f64 = 0.02;

/// The least density of normals, as a share of the mean: the table reaches every direction.
const LEAST_NORMALS: f64 = 0.05;

/// Turns of the power iteration; the second eigenvalue is far below the first.
const TURNS: usize = 32;

/// Streams of random numbers of these pairs.
const ADAPTIVE_STREAMS: u64 = 3 << 60;

/// The table.
#[derive(Clone, Debug, PartialEq)]
pub struct AdaptiveBrdf {
    /// Numbers of directions.
    pub grid: AdaptiveGrid,
    /// Polar angles of incident directions, radians.
    pub theta_rad: Vec<f32>,
    /// Azimuths of incident directions, radians, from -pi to pi.
    pub phi_rad: Vec<f32>,
    /// Distribution of normals on the square of directions, rows of equal azimuth, 1/sr.
    pub normals: Vec<f32>,
    /// Projected area of the normals on the same square.
    pub projected_area: Vec<f32>,
    /// Density of visible normals on the square, with an integral of one, for every azimuth and
    /// within it every polar angle of the light.
    pub visible_normals: Vec<f32>,
    /// The table, in the same order: for every incident direction three channels of a square.
    pub rgb: Vec<f32>,
    /// Mean of the channels, for sampling, with an integral of one for each incident direction.
    pub luminance: Vec<f32>,
}

/// A measured table, and what is known of its errors.
#[derive(Clone, Debug, PartialEq)]
pub struct AdaptiveResult {
    /// The table.
    pub brdf: AdaptiveBrdf,
    /// Every measured pair at the nodes.
    pub pairs: Vec<PairValue>,
    /// Counts of the trackers.
    pub stats: Stats,
}

impl AdaptiveBrdf {
    /// The directional-hemispherical reflectance of a measured incident direction.
    pub fn reflectance(&self, azimuth: usize, polar: usize) -> [f64; 3] {
        let side = self.grid.side as usize;
        let slice = (azimuth * self.grid.polar as usize + polar) * 3 * side * side;
        std::array::from_fn(|c| {
            let square = self.rgb.iter().skip(slice + c * side * side);
            mean_of_square(side, square.map(|&v| f64::from(v)))
        })
    }
}

/// Mean of bilinear values over the unit square.
fn mean_of_square(side: usize, nodes: impl Iterator<Item = f64>) -> f64 {
    let weight = |k: usize| if k == 0 || k == side - 1 { 0.5 } else { 1.0 };
    let nodes = nodes.take(side * side).enumerate();
    let sum: f64 = nodes
        .map(|(k, v)| v * weight(k % side) * weight(k / side))
        .sum();
    sum / ((side - 1) * (side - 1)) as f64
}

/// A unit vector from the unit square of directions.
fn direction(u: DVec2) -> DVec3 {
    let (sin, cos) = (0.5 * PI * u.x * u.x).sin_cos();
    let (y, x) = ((2.0 * u.y - 1.0) * PI).sin_cos();
    DVec3::new(sin * x, sin * y, cos)
}

/// Solid angle over area of the unit square of directions.
fn solid_angle(u: DVec2) -> f64 {
    TAU * PI * u.x * (0.5 * PI * u.x * u.x).sin()
}

/// Angles of a direction of the upper hemisphere, lifted to [`LEAST_COSINE`].
fn lifted(w: DVec3) -> Angles {
    Angles::new(
        w.z.clamp(LEAST_COSINE, 1.0).acos().to_degrees(),
        w.y.atan2(w.x).to_degrees(),
    )
}

/// The nodes of a square, row by row.
fn nodes(side: usize) -> impl Iterator<Item = DVec2> {
    let steps = (side - 1) as f64;
    (0..side * side).map(move |k| DVec2::new((k % side) as f64, (k / side) as f64) / steps)
}

/// The bilinear value at a point of the square.
fn bilinear(side: usize, values: &[f32], u: DVec2) -> f64 {
    let ((x, s), (y, t)) = (piece(u.x, side), piece(u.y, side));
    let at = |x: usize, y: usize| values.get(y * side + x).map_or(0.0, |&v| f64::from(v));
    let row = |y: usize| at(x, y) + s * (at(x + 1, y) - at(x, y));
    row(y) + t * (row(y + 1) - row(y))
}

/// The distribution of normals of a cloth, its projected area, and the directions in which
/// they are given: the nodes of a square.
struct Normals {
    side: usize,
    directions: Vec<DVec3>,
    /// Solid angle that belongs to each node.
    sr: Vec<f64>,
    density: Vec<f64>,
}

impl Normals {
    /// The distribution whose microfacets would reflect as much light back to where it comes
    /// from as was measured, up to a factor: the reflectance is proportional to the density
    /// over the cosine and the projected area, so the density is the first eigenvector of a
    /// positive operator.
    fn of_retroreflectance(side: usize, retro: &[f64]) -> Normals {
        let steps = (side - 1) as f64;
        let weight = |k: usize| if k == 0 || k == side - 1 { 0.5 } else { 1.0 } / steps;
        let sr = nodes(side)
            .enumerate()
            .map(|(k, u)| solid_angle(u) * weight(k % side) * weight(k / side));
        let mut normals = Normals {
            side,
            directions: nodes(side).map(direction).collect(),
            sr: sr.collect(),
            density: vec![1.0; side * side],
        };
        let factors: Vec<f64> = smoothed(side, retro)
            .iter()
            .zip(&normals.directions)
            .map(|(r, w)| r * w.z.max(LEAST_COSINE))
            .collect();
        for _ in 0..TURNS {
            let areas = normals.projected_areas();
            normals.density = factors.iter().zip(areas).map(|(f, a)| f * a).collect();
            normals.normalise();
        }
        // The mean over solid angle of a distribution with a projected area of one along the
        // normal is between 1 / (2 pi) and more; of a uniform one it is 1 / pi.
        let least = LEAST_NORMALS / PI;
        normals.density.iter_mut().for_each(|d| *d = d.max(least));
        normals.normalise();
        normals
    }

    /// Scales the density to a projected area of one along the normal; a uniform one if there
    /// is no light.
    fn normalise(&mut self) {
        let area = self.projected_area(DVec3::Z);
        if area > 0.0 && area.is_finite() {
            self.density.iter_mut().for_each(|d| *d /= area);
        } else {
            self.density.fill(1.0 / PI);
        }
    }

    /// Area of all microfacets that face a direction, projected along it.
    fn projected_area(&self, w: DVec3) -> f64 {
        let facets = self.directions.iter().zip(&self.sr).zip(&self.density);
        facets.map(|((m, sr), d)| m.dot(w).max(0.0) * sr * d).sum()
    }

    fn projected_areas(&self) -> Vec<f64> {
        let areas = self.directions.iter().map(|&w| self.projected_area(w));
        areas.collect()
    }

    /// Density of the normals that are visible from a direction, on the square.
    fn visible(&self, w: DVec3) -> BilinearWarp {
        let directions = self.directions.iter().zip(nodes(self.side));
        let facets = directions.zip(&self.density);
        let density = |((m, u), d): ((&DVec3, DVec2), &f64)| {
            let value = m.dot(w).max(0.0) * d * solid_angle(u);
            // As the file rounds it.
            f64::from(value as f32)
        };
        BilinearWarp::new(self.side, &facets.map(density).collect::<Vec<f64>>())
    }
}

/// Values of a square averaged with their neighbours, which takes the noise of single nodes
/// off the shape of the table. Azimuths repeat; the first and the last row are the same.
fn smoothed(side: usize, values: &[f64]) -> Vec<f64> {
    let at = |x: usize, y: usize| values.get(y * side + x).copied().unwrap_or(0.0);
    let around = |x: usize, y: usize| {
        let before = if y == 0 { side - 2 } else { y - 1 };
        let after = if y == side - 1 { 1 } else { y + 1 };
        0.25 * at(x, before) + 0.5 * at(x, y) + 0.25 * at(x, after)
    };
    let all = (0..side * side).map(|k| {
        let (x, y) = (k % side, k / side);
        let (before, after) = (x.saturating_sub(1), (x + 1).min(side - 1));
        0.25 * around(before, y) + 0.5 * around(x, y) + 0.25 * around(after, y)
    });
    all.collect()
}

/// Measures the reflection of the face. Light comes from the incident direction of a pair.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_adaptive(
    patch: &impl PatchResponse,
    grid: AdaptiveGrid,
    effort: &Effort,
    watch: Watch<'_>,
) -> Result<AdaptiveResult, MeasureError> {
    let side = grid.side as usize;
    let mut stats = Stats::default();
    let mut streams = ADAPTIVE_STREAMS;
    let mut measured = |pairs: &[Pair], effort: &Effort| -> Result<Vec<PairValue>, MeasureError> {
        let results = gather_pairs(patch, pairs, streams, effort, watch)?;
        streams += pairs.len() as u64;
        stats.merge(&results.stats);
        Ok(results.list)
    };

    let retro: Vec<DVec3> = nodes(side).map(direction).collect();
    let back = |&w: &DVec3| Pair::new(lifted(w), lifted(w));
    let more = Effort {
        paths: effort.paths.saturating_mul(RETRO_EFFORT),
        ..*effort
    };
    let list = once_each(&retro.iter().map(back).collect::<Vec<_>>(), |p| {
        measured(p, &more)
    })?;
    let grey = |v: &Measured| v.mean.iter().sum::<f64>() / 3.0;
    let retro: Vec<f64> = list.iter().map(|v| grey(&v.bsdf)).collect();
    let normals = Normals::of_retroreflectance(side, &retro);
    let as_f32 = |list: &[f64]| list.iter().map(|&v| v as f32).collect::<Vec<f32>>();

    let steps = |k: u32, n: u32| f64::from(k) / f64::from(n);
    let theta = |k| AdaptiveGrid::MAX_THETA_DEG.to_radians() * steps(k, grid.polar - 1);
    let phi = |k| TAU * steps(k, grid.azimuths) - PI;
    let mut brdf = AdaptiveBrdf {
        grid,
        theta_rad: (0..grid.polar).map(|k| theta(k) as f32).collect(),
        phi_rad: (0..=grid.azimuths).map(|k| phi(k) as f32).collect(),
        normals: as_f32(&normals.density),
        projected_area: as_f32(&normals.projected_areas()),
        visible_normals: Vec::new(),
        rgb: Vec::new(),
        luminance: Vec::new(),
    };
    let mut all_pairs = Vec::new();
    let slice = |k: u32| k as usize * side * side;
    for azimuth in 0..=grid.azimuths {
        for polar in 0..grid.polar {
            // The normal has one azimuth, and the last azimuth is the first.
            let copied = match (azimuth, polar) {
                (0, _) => None,
                (_, 0) => Some(0),
                (a, p) if a == grid.azimuths => Some(p),
                _ => None,
            };
            if let Some(slot) = copied {
                let (from, to) = (slice(slot), slice(slot + 1));
                brdf.visible_normals.extend_from_within(from..to);
                brdf.luminance.extend_from_within(from..to);
                brdf.rgb.extend_from_within(3 * from..3 * to);
                continue;
            }
            let (theta, phi) = (theta(polar), phi(azimuth));
            let u = DVec2::new((theta * 2.0 / PI).sqrt(), (phi + PI) / TAU);
            let w_in = direction(u);
            let warp = normals.visible(w_in);
            let area = bilinear(side, &brdf.projected_area, u);
            let nodes: Vec<Node> = nodes(side).map(|s| Node::at(&warp, s, w_in)).collect();
            let lit = lit_nodes(side, &nodes);
            let pair = |&k: &usize| Pair::new(lifted(w_in), lifted(nodes[k].w_out));
            let pairs: Vec<Pair> = lit.iter().map(pair).collect();
            let list = once_each(&pairs, |p| measured(p, effort))?;
            let mut square = vec![[0.0f64; 3]; side * side];
            for (&k, value) in lit.iter().zip(&list) {
                let density = bilinear(side, &brdf.normals, nodes[k].normal) / (4.0 * area);
                let cos = value.pair.exitant.theta_deg.to_radians().cos();
                square[k] = value.bsdf.mean.map(|v| v * cos / density);
            }
            all_pairs.extend(list);
            let grey: Vec<f64> = square.iter().map(|v| v.iter().sum::<f64>() / 3.0).collect();
            brdf.visible_normals.extend(as_f32(warp.nodes()));
            brdf.luminance
                .extend(as_f32(BilinearWarp::new(side, &grey).nodes()));
            for channel in 0..3 {
                brdf.rgb.extend(square.iter().map(|v| v[channel] as f32));
            }
        }
    }
    Ok(AdaptiveResult {
        brdf,
        pairs: all_pairs,
        stats,
    })
}

/// A node of the square of exitant directions.
struct Node {
    /// The normal that reflects the light, on the square of directions.
    normal: DVec2,
    /// Where it is reflected to, perhaps into the cloth.
    w_out: DVec3,
}

impl Node {
    fn at(warp: &BilinearWarp, sample: DVec2, w_in: DVec3) -> Node {
        let normal = warp.sample(sample);
        let m = direction(normal);
        Node {
            normal,
            w_out: (2.0 * m.dot(w_in) * m - w_in).normalize(),
        }
    }
}

/// The nodes whose light leaves the cloth, and their neighbours, from which values at the
/// horizon are interpolated.
fn lit_nodes(side: usize, nodes: &[Node]) -> Vec<usize> {
    let leaves = |x: usize, y: usize| nodes.get(y * side + x).is_some_and(|n| n.w_out.z > 0.0);
    let near = |k: usize| k.saturating_sub(1)..=(k + 1).min(side - 1);
    let beside = |&k: &usize| {
        let (x, y) = (k % side, k / side);
        near(y).any(|y| near(x).any(|x| leaves(x, y)))
    };
    (0..side * side).filter(beside).collect()
}

/// Measures every pair once, however often it is in the list.
fn once_each(
    pairs: &[Pair],
    measure: impl FnOnce(&[Pair]) -> Result<Vec<PairValue>, MeasureError>,
) -> Result<Vec<PairValue>, MeasureError> {
    // Rounding separates directions that are the same: at the normal, any azimuth.
    let key = |a: &Angles| {
        let w = a.direction() * 1e5;
        [w.x, w.y, w.z].map(|x| x.round() as i64)
    };
    let mut distinct = Vec::new();
    let mut index = HashMap::new();
    let numbers: Vec<usize> = pairs
        .iter()
        .map(|p| {
            *index
                .entry([key(&p.incident), key(&p.exitant)])
                .or_insert_with(|| {
                    distinct.push(*p);
                    distinct.len() - 1
                })
        })
        .collect();
    let list = measure(&distinct)?;
    let values = numbers.iter().filter_map(|&k| list.get(k).copied());
    Ok(values.collect())
}
