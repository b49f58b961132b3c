//! Free flight and transmittance through one medium.

use crate::{Medium, Stats};
use organza_basis::LocalRay;
use organza_basis::PathRng;
use std::ops::ControlFlow;

/// Room for rounding when an extinction is held against its bound.
const MAJORANT_SLACK: f32 = 1.0 + 1e-5;

/// Below this transmittance a shadow ray lives on with probability
/// `T / SHADOW_ROULETTE`, so that it ends after a few look-ups in dense cloth.
const SHADOW_ROULETTE: f32 = 0.1;

/// Draws the first collision along a ray by delta tracking [Woodcock1965]
/// [Novak2018]: the local distance and what is there, or `None` when the ray
/// leaves the medium.
///
/// One exponential number is spent across the spans of different majorants,
/// which is exact because optical depth adds.
pub fn sample_collision<M: Medium>(
    medium: &M,
    ray: &LocalRay,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> Option<(f32, M::Site)> {
    let mut depth = rng.exponential();
    let found = medium.for_each_span(ray, |span, majorant| {
        let mut t = span.t0;
        loop {
            let span_depth = (span.t1 - t) * majorant;
            if depth >= span_depth {
                depth -= span_depth;
                return ControlFlow::Continue(());
            }
            t += depth / majorant;
            depth = rng.exponential();
            stats.tentative += 1;
            let p = span.point(ray, t);
            let least = rng.unit() * majorant;
            let bound = medium.bound_at(p);
            if least >= bound {
                continue;
            }
            let site = medium.meet(p, ray.direction, rng);
            let sigma = medium.sigma_t(&site, ray.direction);
            if sigma > majorant.min(bound) * MAJORANT_SLACK {
                stats.majorant_violations += 1;
            }
            if least < sigma {
                stats.collisions += 1;
                return ControlFlow::Break((t, site));
            }
        }
    });
    match found {
        ControlFlow::Break(hit) => Some(hit),
        ControlFlow::Continue(()) => None,
    }
}

/// Estimates the transmittance along a ray by ratio tracking [Novak2014]
/// with Russian roulette on small values.
pub fn transmittance<M: Medium>(
    medium: &M,
    ray: &LocalRay,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> f32 {
    let mut transmitted = 1.0f32;
    let mut depth = rng.exponential();
    let _ = medium.for_each_span(ray, |span, majorant| {
        let mut t = span.t0;
        loop {
            let span_depth = (span.t1 - t) * majorant;
            if depth >= span_depth {
                depth -= span_depth;
                return ControlFlow::Continue(());
            }
            t += depth / majorant;
            depth = rng.exponential();
            stats.shadow_steps += 1;
            // Thinned to the events of a bound that is nearer the truth.
            let p = span.point(ray, t);
            let bound = medium.bound_at(p).min(majorant);
            if bound < majorant && rng.unit() * majorant >= bound {
                continue;
            }
            let site = medium.meet(p, ray.direction, rng);
            let sigma = medium.sigma_t(&site, ray.direction);
            if sigma > bound * MAJORANT_SLACK {
                stats.majorant_violations += 1;
            }
            transmitted *= (1.0 - sigma / bound).max(0.0);
            if transmitted < SHADOW_ROULETTE {
                if rng.unit() * SHADOW_ROULETTE >= transmitted {
                    transmitted = 0.0;
                    return ControlFlow::Break(());
                }
                transmitted = SHADOW_ROULETTE;
            }
        }
    });
    transmitted
}

/// Draws the first collision by stepping exactly through constant voxels: the
/// distance is the closed-form inverse of the optical depth.
///
/// Only for media that [`Medium::is_piecewise_constant`].
pub fn sample_collision_exactly<M: Medium>(
    medium: &M,
    ray: &LocalRay,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> Option<(f32, M::Site)> {
    let mut depth = rng.exponential();
    let found = medium.for_each_voxel(ray, |t0, t1, site| {
        stats.tentative += 1;
        let sigma = medium.sigma_t(&site, ray.direction);
        let voxel_depth = (t1 - t0) * sigma;
        if depth < voxel_depth {
            stats.collisions += 1;
            return ControlFlow::Break((t0 + depth / sigma, site));
        }
        depth -= voxel_depth;
        ControlFlow::Continue(())
    });
    match found {
        ControlFlow::Break(hit) => Some(hit),
        ControlFlow::Continue(()) => None,
    }
}

/// The transmittance along a ray through constant voxels, in closed form.
pub fn exact_transmittance<M: Medium>(medium: &M, ray: &LocalRay, stats: &mut Stats) -> f32 {
    // e^-88 is the smallest f32 worth carrying on for.
    (-optical_depth(medium, ray, 88.0, stats)).exp()
}

/// Estimates the same without bias and with fewer steps: what falls below a
/// tenth ends by Russian roulette, for which one number is drawn ahead, as a
/// depth at which to stop.
pub fn stopped_transmittance<M: Medium>(
    medium: &M,
    ray: &LocalRay,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> f32 {
    let stop = rng.exponential() - SHADOW_ROULETTE.ln();
    let depth = optical_depth(medium, ray, stop, stats);
    if depth > stop {
        0.0
    } else {
        (-depth).exp().max(SHADOW_ROULETTE)
    }
}

/// Optical depth along a ray through constant voxels, or any number above
/// `stop` where it is above that.
fn optical_depth<M: Medium>(medium: &M, ray: &LocalRay, stop: f32, stats: &mut Stats) -> f32 {
    let mut depth = 0.0f32;
    let _ = medium.for_each_voxel(ray, |t0, t1, site| {
        stats.shadow_steps += 1;
        depth += (t1 - t0) * medium.sigma_t(&site, ray.direction);
        if depth > stop {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    depth
}
