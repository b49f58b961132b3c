//! Packing factors, measured by short walks through the fibres that a volume stands for.
//!
//! Fibres of a yarn do not overlap and lie in an order of their own, so a ray that
//! leaves one of them meets the next sooner than it would among fibres strewn at random
//! with the same length per volume. The factor on the extinction that gives as many
//! collisions is the number of fibres met over the optical depth of the bare volume
//! along the same rays: the maximum-likelihood estimate of the rate of an exponential
//! law from free paths, of which those that leave the cloth are cut short.
//!
//! Three factors are kept for each material and level. A ray that leaves a fibre starts
//! among its neighbours, so what it meets of its own yarn differs from what it meets of
//! other yarns, which it enters from outside, as does a ray that comes from outside the
//! cloth. A ray that leaves a yarn contributes to two factors: with its collisions and
//! depth in its own yarn, and with those in all others.
//!
//! A ray starts where light leaves the fibre, not where it came in: the volume starts
//! there as well, and from the entry a ray would first cross its own fibre.

#[cfg(test)]
mod tests;

use crate::Stats;
use crate::matter::explicit_fibres::ExplicitFibres;
use crate::matter::medium::Medium;
use crate::matter::packing::PackingFactors;
use crate::matter::virtual_fibre_medium::{VirtualFibreEvent, VirtualFibreMedium};
use glam::Vec3;
use organza_basis::{CellGrid, PathRng, Ray, Rgb, Stopped, Watch, warp};
use organza_kernel::roulette::survivor;
use organza_scatter::Lobe;
use organza_volume::{MaterialPacking, MeasuredPacking, Octree, PackingFactor};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Fibres that a walk meets at most: what is met later carries little of the light.
const MAX_EVENTS: u32 = 16;

/// Length of the steps in which depth is summed, in radii of the thinnest fibres: each
/// is looked up at one random point.
const STEP_RADII: f32 = 0.5;

/// Steps of one stretch of a ray at most.
const MAX_STEPS: u32 = 64;

/// Walks that must meet a material in one of the three ways for a factor.
const MIN_WALKS: u32 = 100;

/// How a packing is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackingStudy {
    /// Number of walks.
    pub walks: u32,
    /// Seed of their random numbers.
    pub seed: u64,
}

impl Default for PackingStudy {
    /// 10,000 walks, which give factors of the shipped fabrics to about one per cent.
    fn default() -> PackingStudy {
        PackingStudy {
            walks: 10_000,
            seed: 0,
        }
    }
}

/// A straight part of a walk, from a fibre or from outside the cloth to the next fibre
/// or out of the cloth.
#[derive(Clone, Copy, Debug)]
struct Flight {
    ray: Ray,
    /// Infinite of one that leaves the cloth.
    length_mm: f64,
    /// Part of the light that the walk carries.
    weight: f32,
    /// Material and yarn of the fibre that ends it.
    met: Option<(u16, u32)>,
}

/// Collisions and optical depth of one kind of rays in one material.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    hits: f64,
    depth: f64,
}

/// Tallies of each material: own yarn, other yarn, outside.
type Tallies = Vec<[Tally; 3]>;

/// Measures the packing factors of every level of an octree by walks through the fibres
/// that it was made of. `progress` is called with the share of the work done.
///
/// The same seed gives the same factors, whatever the number of threads. `None` where
/// the fibres have fewer materials than the octree, or there is no walk.
///
/// # Errors
/// When `progress` broke.
pub fn measure_packing(
    fibres: &ExplicitFibres,
    octree: &Arc<Octree>,
    study: PackingStudy,
    progress: Watch<'_, f32>,
) -> Result<Option<MeasuredPacking>, Stopped> {
    if study.walks == 0 || fibres.fibres().len() < octree.material_count() {
        return Ok(None);
    }
    let levels = octree.level_count();
    let total = study.walks * (1 + u32::from(levels));
    let done = AtomicU32::new(0);
    let count = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        match done.is_multiple_of(256) {
            true => Stopped::check(progress(done as f32 / total as f32)),
            false => Ok(()),
        }
    };
    let walks = (0..study.walks)
        .into_par_iter()
        .map(|i| {
            count()?;
            let mut rng = PathRng::new(study.seed, 0, u64::from(i));
            Ok(walk(fibres, i.is_multiple_of(2), &mut rng))
        })
        .collect::<Result<Vec<Vec<Flight>>, Stopped>>()?;
    let of_level = |level: u8| {
        let Some(bare) = VirtualFibreMedium::with_factors(
            Arc::clone(octree),
            level,
            fibres.fibres().to_vec(),
            VirtualFibreEvent::Packed,
            |octree, _| vec![PackingFactors::NONE; octree.material_count()],
        ) else {
            return Ok(None);
        };
        let step_mm = STEP_RADII * bare.thinnest_mm();
        let tallies = walks
            .par_iter()
            .enumerate()
            .map(|(i, flights)| {
                count()?;
                let mut rng = PathRng::new(study.seed, 1 + u64::from(level), i as u64);
                Ok(tally(&bare, flights, step_mm, &mut rng))
            })
            .collect::<Result<Vec<Tallies>, Stopped>>()?;
        let materials = 0..octree.material_count();
        Ok(Some(materials.map(|m| packing_of(&tallies, m)).collect()))
    };
    let levels = (0..levels).map(of_level);
    let levels = levels.collect::<Result<Option<_>, Stopped>>()?;
    Stopped::check(progress(1.0))?;
    Ok(levels.map(|levels| MeasuredPacking {
        walks: study.walks,
        levels,
    }))
}

/// One walk, under even light on the face or on the back.
fn walk(fibres: &ExplicitFibres, on_face: bool, rng: &mut PathRng) -> Vec<Flight> {
    let grid = fibres.cell_grid();
    let mut ray = ray_from_outside(grid, on_face, rng);
    let (mut flights, mut stats) = (Vec::new(), Stats::default());
    let mut throughput = Rgb::WHITE;
    for _ in 0..MAX_EVENTS {
        let hit = fibres.first_hit(&ray, f64::INFINITY, &mut stats);
        let yarn_of = |hit| fibres.info(hit).yarn.unwrap_or_default();
        flights.push(Flight {
            ray,
            length_mm: hit.as_ref().map_or(f64::INFINITY, |h| h.0),
            weight: throughput.mean(),
            met: hit.as_ref().map(|h| (fibres.material(&h.1), yarn_of(&h.1))),
        });
        let Some((distance_mm, hit)) = hit else {
            break;
        };
        let w_out = -ray.direction;
        let Some(scatter) = fibres.near(&hit).sample(w_out, rng) else {
            break;
        };
        let Some(carried) = survivor(throughput * scatter.weight, rng) else {
            break;
        };
        throughput = carried;
        let exit_mm = fibres.exit_mm(&hit, scatter.w_in, rng);
        let start = ray.at(distance_mm) + exit_mm.as_dvec3();
        ray = Ray::new(start, scatter.w_in).leaving(Some(yarn_of(&hit)));
    }
    flights
}

/// A ray of even light from far away, where it enters the box of one tile.
fn ray_from_outside(grid: &CellGrid, on_face: bool, rng: &mut PathRng) -> Ray {
    let bounds_mm = grid.bounds_mm();
    let (u, v) = (rng.unit(), rng.unit());
    let mut at = bounds_mm.min + bounds_mm.size() * Vec3::new(u, v, 1.0);
    let mut direction = -warp::cosine_hemisphere(rng.unit2());
    if !on_face {
        at.z = bounds_mm.min.z;
        direction.z = -direction.z;
    }
    Ray::new(at, direction)
}

/// Collisions and optical depth of a walk, by material.
fn tally(
    bare: &VirtualFibreMedium,
    flights: &[Flight],
    step_mm: f32,
    rng: &mut PathRng,
) -> Tallies {
    let mut tallies = vec![[Tally::default(); 3]; bare.octree().material_count()];
    for flight in flights {
        let kind = |yarn: u32| match flight.ray.left_yarn {
            Some(left) if left == yarn => 0,
            Some(_) => 1,
            None => 2,
        };
        let weight = f64::from(flight.weight);
        if let Some((material, yarn)) = flight.met
            && let Some(of_material) = tallies.get_mut(usize::from(material))
        {
            of_material[kind(yarn)].hits += weight;
        }
        let Some(ray) = bare.cell_grid().clip(&flight.ray, flight.length_mm) else {
            continue;
        };
        let _ = bare.for_each_span(&ray, |span, _| {
            let length = span.t1 - span.t0;
            let steps = ((length / step_mm).ceil() as u32).clamp(1, MAX_STEPS);
            let step = length / steps as f32;
            for k in 0..steps {
                let p = span.point(&ray, span.t0 + (k as f32 + rng.unit()) * step);
                let site = bare.meet(p, &ray, rng);
                bare.for_each_extinction(&site, ray.direction, |c, sigma_per_mm| {
                    let of_material = &mut tallies[usize::from(c.material)];
                    of_material[kind(c.yarn)].depth += weight * f64::from(step * sigma_per_mm);
                });
            }
            ControlFlow::<()>::Continue(())
        });
    }
    tallies
}

/// The factors of a material from the tallies of all walks.
fn packing_of(tallies: &[Tallies], material: usize) -> MaterialPacking {
    let of_kind = |kind: usize| {
        let tallies = tallies.iter().map(|t| t[material][kind]);
        factor(tallies)
    };
    [0, 1, 2].map(of_kind).into()
}

/// Hits over depth, with the standard error of a ratio of sums over independent walks.
fn factor(tallies: impl Iterator<Item = Tally> + Clone) -> Option<PackingFactor> {
    let (mut hits, mut depth, mut walks) = (0.0, 0.0, 0);
    for t in tallies.clone() {
        hits += t.hits;
        depth += t.depth;
        walks += u32::from(t.hits > 0.0);
    }
    if walks < MIN_WALKS || depth <= 0.0 {
        return None;
    }
    let mean = hits / depth;
    let residual = |t: Tally| (t.hits - mean * t.depth).powi(2);
    let square: f64 = tallies.map(residual).sum();
    let found = PackingFactor {
        mean: mean as f32,
        standard_error: (square.sqrt() / depth) as f32,
    };
    (found.mean > 0.0 && found.mean.is_finite() && found.standard_error.is_finite())
        .then_some(found)
}
