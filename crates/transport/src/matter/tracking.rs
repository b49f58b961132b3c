//! Free flight and transmittance through one medium.

use crate::{Medium, Stats};
use organza_basis::{CellSpan, LocalRay, PathRng};
use std::ops::ControlFlow;

/// How distances and transmittances are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Delta tracking for collisions; for shadow rays exact stepping that stops
    /// early where voxels are constant, ratio tracking elsewhere.
    #[default]
    Woodcock,
    /// Exact stepping through constant voxels, with closed-form transmittance
    /// (Algorithm 6 of [Schroeder2012], corrected).
    Regular,
}

/// Room for rounding when an extinction is held against its bound.
const MAJORANT_SLACK: f32 = 1.0 + 1e-5;

/// Below this transmittance a shadow ray lives on with probability
/// `T / SHADOW_ROULETTE`, so that it ends after a few look-ups in dense cloth.
const SHADOW_ROULETTE: f32 = 0.1;

/// Optical depth of a span at its majorant above which it is stepped through instead of
/// tracked: far above what cloth has, and where one thin voxel beside a dense one would
/// cost as many look-ups as the dense one has mean free paths in the span.
const MAX_SPAN_DEPTH: f32 = 1024.0;

/// Steps through such a span where voxels are not constant.
const STEPS: u32 = 1024;

/// Optical depth behind which `f32` sees nothing.
const MIN_SEEN_DEPTH: f32 = 88.0;

fn is_very_dense(span: &CellSpan, majorant: f32) -> bool {
    (span.t1 - span.t0) * majorant > MAX_SPAN_DEPTH
}

/// Visits a span of a ray in order, `[t0, t1]` and what is there: voxel by voxel where
/// they are constant, and otherwise in even steps, each as what is in its middle.
fn step_through<M: Medium, B>(
    medium: &M,
    ray: &LocalRay,
    span: &CellSpan,
    rng: &mut PathRng,
    mut visit: impl FnMut(f32, f32, M::Site) -> ControlFlow<B>,
) -> ControlFlow<B> {
    if medium.is_piecewise_constant() {
        let within = LocalRay {
            origin: span.point(ray, span.t0),
            length: span.t1 - span.t0,
            ..*ray
        };
        return medium.for_each_voxel(&within, |t0, t1, site| {
            visit(span.t0 + t0, span.t0 + t1, site)
        });
    }
    let step = (span.t1 - span.t0) / STEPS as f32;
    for i in 0..STEPS {
        let t0 = span.t0 + i as f32 * step;
        let site = medium.meet(span.point(ray, t0 + 0.5 * step), ray, rng);
        visit(t0, t0 + step, site)?;
    }
    ControlFlow::Continue(())
}

/// Moves `t` to the next tentative collision, `depth` of optical depth away, and draws the
/// depth to the one after it. False if the span ends at `end` before that; then its optical
/// depth is spent.
#[inline]
fn advance(depth: &mut f32, t: &mut f32, end: f32, majorant: f32, rng: &mut PathRng) -> bool {
    let span_depth = (end - *t) * majorant;
    if *depth >= span_depth {
        *depth -= span_depth;
        return false;
    }
    *t += *depth / majorant;
    *depth = rng.exponential();
    true
}

/// Spends optical depth on a stretch from `t0` to `t1` of constant extinction `sigma`. The
/// distance at which none is left, if that is on the stretch.
#[inline]
fn spend(depth: &mut f32, (t0, t1): (f32, f32), sigma: f32) -> Option<f32> {
    let stretch_depth = (t1 - t0) * sigma;
    if *depth < stretch_depth {
        return Some(t0 + *depth / sigma);
    }
    *depth -= stretch_depth;
    None
}

/// Ends a sum of optical depths at the first that is above `stop`.
#[inline]
fn break_above(depth: f32, stop: f32) -> ControlFlow<()> {
    if depth > stop {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}

/// Draws the first collision along a ray by delta tracking [Woodcock1965]
/// [Novak2018]: the local distance and what is there, or `None` when the ray
/// leaves the medium.
///
/// One exponential number is spent across the spans of different majorants,
/// which is exact because optical depth adds. Spans that are very dense somewhere are
/// stepped through.
pub fn sample_collision<M: Medium>(
    medium: &M,
    ray: &LocalRay,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> Option<(f32, M::Site)> {
    let mut depth = rng.exponential();
    let found = medium.for_each_span(ray, |span, majorant| {
        if is_very_dense(span, majorant) {
            return step_through(medium, ray, span, rng, |t0, t1, site| {
                stats.tentative += 1;
                let sigma = medium.sigma_t(&site, ray.direction);
                match spend(&mut depth, (t0, t1), sigma) {
                    Some(t) => {
                        stats.collisions += 1;
                        ControlFlow::Break((t, site))
                    }
                    None => ControlFlow::Continue(()),
                }
            });
        }
        let mut t = span.t0;
        while advance(&mut depth, &mut t, span.t1, majorant, rng) {
            stats.tentative += 1;
            let p = span.point(ray, t);
            let least = rng.unit() * majorant;
            let bound = medium.majorant_at(p);
            if least >= bound {
                continue;
            }
            let site = medium.meet(p, ray, rng);
            let sigma = medium.sigma_t(&site, ray.direction);
            if sigma > majorant.min(bound) * MAJORANT_SLACK {
                stats.majorant_violations += 1;
            }
            if least < sigma {
                stats.collisions += 1;
                return ControlFlow::Break((t, site));
            }
        }
        ControlFlow::Continue(())
    });
    found.break_value()
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
        if is_very_dense(span, majorant) {
            let mut span_depth = 0.0f32;
            let _ = step_through(medium, ray, span, rng, |t0, t1, site| {
                stats.shadow_steps += 1;
                span_depth += (t1 - t0) * medium.sigma_t(&site, ray.direction);
                break_above(span_depth, MIN_SEEN_DEPTH)
            });
            transmitted *= (-span_depth).exp();
            return if span_depth > MIN_SEEN_DEPTH {
                transmitted = 0.0;
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            };
        }
        let mut t = span.t0;
        while advance(&mut depth, &mut t, span.t1, majorant, rng) {
            stats.shadow_steps += 1;
            // Thinned to the events of a bound that is nearer the truth.
            let p = span.point(ray, t);
            let bound = medium.majorant_at(p).min(majorant);
            if bound < majorant && rng.unit() * majorant >= bound {
                continue;
            }
            let site = medium.meet(p, ray, rng);
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
        ControlFlow::Continue(())
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
        match spend(&mut depth, (t0, t1), sigma) {
            Some(t) => {
                stats.collisions += 1;
                ControlFlow::Break((t, site))
            }
            None => ControlFlow::Continue(()),
        }
    });
    found.break_value()
}

/// The transmittance along a ray through constant voxels, in closed form.
pub fn exact_transmittance<M: Medium>(medium: &M, ray: &LocalRay, stats: &mut Stats) -> f32 {
    (-optical_depth(medium, ray, MIN_SEEN_DEPTH, stats)).exp()
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
        break_above(depth, stop)
    });
    depth
}
