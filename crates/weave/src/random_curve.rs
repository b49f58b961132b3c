//! Smooth random curves, step by step: of fibres that are free, or led by what is around them.
//!
//! The curvature is a stationary Gaussian process with a finite correlation length, so that the
//! curves have no kinks.

use glam::DVec3;
use organza_basis::PathRng;

/// The bends of a curve of equal steps.
pub(crate) struct RandomCurve {
    step_mm: f64,
    /// Share of the curvature that is left after a step, and what is added to it.
    kept: f64,
    kick: f64,
    curvature: DVec3,
}

impl RandomCurve {
    /// A curve that begins straight and curls to a radius, root mean square.
    pub fn new(curl_mm: f64, step_mm: f64) -> RandomCurve {
        // The two components across the curve together have the root mean square 1 / curl, and
        // the curvature forgets itself over half a radius of curl.
        let kept = (-2.0 * step_mm / curl_mm).exp();
        RandomCurve {
            step_mm,
            kept,
            kick: (1.0 - kept * kept).sqrt() / (2f64.sqrt() * curl_mm),
            curvature: DVec3::ZERO,
        }
    }

    /// The curvature of the next step, per millimetre.
    pub fn bend(&mut self, rng: &mut PathRng) -> DVec3 {
        let [a, b] = [rng.normal2(), rng.normal2()];
        let random = DVec3::new(f64::from(a.x), f64::from(a.y), f64::from(b.x));
        self.curvature = self.kept * self.curvature + self.kick * random;
        self.curvature
    }

    /// The direction after a step of a curvature, of which only what lies across the curve counts.
    pub fn turned(&self, heading: DVec3, bend: DVec3) -> DVec3 {
        let turned = heading + self.step_mm * (bend - bend.dot(heading) * heading);
        turned.normalize_or(heading)
    }
}
