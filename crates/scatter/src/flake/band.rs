//! Flakes of a fibre whose normals crowd about the great circle across its
//! axis: the truncated Gaussian and the power of the sine [Schroeder2012].
//!
//! With x the cosine between normal and fibre, both are a density g(x) on
//! `[-1, 1]` at uniform azimuth. **Normalisation**: unit flake area, so that the
//! projected area is `integral |w . m| D(m) dm` for a D of unit integral:
//! `(2 / pi) sin(angle)` for a smooth fibre, one half for isotropic flakes.
//! ([`MicroFlake::ndf`] counts both faces and is therefore 2 D.)

use super::MicroFlake;
use glam::Vec3;
use organza_basis::quadrature::integrate;
use organza_basis::{Frame, PathRng};
use std::f32::consts::{FRAC_1_PI, FRAC_2_PI, TAU};
use std::f64::consts::FRAC_2_PI as FRAC_2_PI_64;

/// Least width of a [`GaussianBand`](crate::GaussianBand) in single precision; smaller ones are
/// raised to it.
pub const MIN_GAMMA: f32 = 1e-4;

/// A profile g(x) over the cosine x between normal and fibre axis.
pub trait BandProfile: Sized {
    /// The profile of a width: the deviation of a Gaussian with its curvature at the
    /// top.
    fn of_width(gamma: f32) -> Self;
    /// g(x), with unit integral over `[-1, 1]`.
    fn density(&self, x: f32) -> f32;
    /// Mean of |x|: the projected area end-on.
    fn mean_abs(&self) -> f32;
    /// Draws x in `[-1, 1]` with density g.
    fn draw(&self, rng: &mut PathRng) -> f32;
    /// Draws x in `[0, 1]` with density proportional to `x g(x)`.
    fn draw_weighted(&self, rng: &mut PathRng) -> f32;
    /// Mean of `g(amplitude cos(phi))` over all phi, for an amplitude in `[0, 1]`.
    fn mean_over_circle(&self, amplitude: f32) -> f32;
    /// Projected area of unit flake area for the sine of the angle to the axis.
    fn projected_area(&self, sine: f32) -> f32;

    /// Ratio of the end-on to the broadside area, which names a width in every
    /// family of flakes.
    fn end_on_ratio(&self) -> f32 {
        self.mean_abs() / self.projected_area(1.0)
    }

    /// The profile whose [`BandProfile::end_on_ratio`] is this, to 1e-4.
    fn with_end_on_ratio(ratio: f32) -> Self {
        // The ratio rises with the width; halve on its logarithm.
        let (mut low, mut high) = (MIN_GAMMA.ln(), 1e4f32.ln());
        for _ in 0..40 {
            let mid = 0.5 * (low + high);
            if Self::of_width(mid.exp()).end_on_ratio() < ratio {
                low = mid;
            } else {
                high = mid;
            }
        }
        Self::of_width((0.5 * (low + high)).exp())
    }
}

/// Normal of deviation `gamma` cut to `[-1, 1]`; about seven of ten tries hit at worst.
pub(super) fn truncated_normal(gamma: f32, rng: &mut PathRng) -> f32 {
    loop {
        if gamma < 0.7 {
            let pair = gamma * rng.normal2();
            if pair.x.abs() <= 1.0 {
                return pair.x;
            }
        } else {
            let x = 2.0 * rng.unit() - 1.0;
            let y = x / gamma;
            if rng.unit() < (-0.5 * y * y).exp() {
                return x;
            }
        }
    }
}

/// Projected area of the profile `g` (of any integral, even, nothing beyond
/// `reach`), by quadrature.
///
/// Flakes at one x form a ring, whose mean |w . m| has a closed form with a kink
/// where the ring begins to turn its back: at x = sine.
pub(super) fn band_area(sine: f64, reach: f64, g: impl Fn(f64) -> f64) -> f64 {
    let cosine = (1.0 - sine * sine).max(0.0).sqrt();
    let ring = |x: f64| {
        let (a, b) = (cosine * x, sine * (1.0 - x * x).max(0.0).sqrt());
        if a >= b {
            a
        } else {
            FRAC_2_PI_64 * ((b * b - a * a).sqrt() + a * (a / b).asin())
        }
    };
    let kink = sine.min(reach);
    let over = |f: &dyn Fn(f64) -> f64| {
        let tolerance = 1e-7 * reach * reach;
        integrate(0.0, kink, tolerance, f) + integrate(kink, reach, tolerance, f)
    };
    over(&|x| g(x) * ring(x)) / over(&g)
}

/// Flakes of a band profile about a fibre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandFlakes<P> {
    axis: Vec3,
    profile: P,
}

impl<P: BandProfile> BandFlakes<P> {
    /// A profile about a unit axis, whose sign does not matter.
    pub fn new(axis: Vec3, profile: P) -> BandFlakes<P> {
        BandFlakes { axis, profile }
    }
}

impl<P: BandProfile> MicroFlake for BandFlakes<P> {
    fn projected_area(&self, w: Vec3) -> f32 {
        self.profile
            .projected_area(self.axis.cross(w).length().min(1.0))
    }

    fn ndf(&self, m: Vec3) -> f32 {
        FRAC_1_PI * self.profile.density(self.axis.dot(m))
    }

    fn ndf_mean_across(&self, w: Vec3) -> f32 {
        let sine = self.axis.cross(w).length().min(1.0);
        FRAC_1_PI * self.profile.mean_over_circle(sine)
    }

    /// Exact, at any width, with at most 1.7 tries on average: |w . m| is at most
    /// `|cos| |x| + sin |cos(phi)|`, and both terms times g can be drawn.
    fn visible_direction_sample(&self, w: Vec3, rng: &mut PathRng) -> Vec3 {
        let across = w - self.axis * self.axis.dot(w);
        let sine = self.axis.cross(w).length().min(1.0);
        let cosine = self.axis.dot(w);
        let toward = if sine > 1e-6 {
            // Once more across: rounding has tilted a short vector along the axis,
            // by more than narrow bands are wide.
            let toward = across / across.length().max(f32::MIN_POSITIVE);
            (toward - self.axis * self.axis.dot(toward))
                .normalize_or(Frame::from_normal(self.axis).s)
        } else {
            Frame::from_normal(self.axis).s
        };
        let aside = self.axis.cross(toward);
        let along_weight = cosine.abs() * self.profile.mean_abs();
        let across_weight = FRAC_2_PI * sine;
        loop {
            let pick = rng.unit() * (along_weight + across_weight);
            let (x, sin_phi, cos_phi) = if pick < along_weight {
                let (s, c) = (TAU * rng.unit()).sin_cos();
                (self.profile.draw_weighted(rng), s, c)
            } else {
                // Density |cos(phi)| / 4: the sine is uniform, both sides alike.
                let s = 2.0 * rng.unit() - 1.0;
                let c = (1.0 - s * s).sqrt();
                (self.profile.draw(rng), s, c)
            };
            let ring = (1.0 - x * x).max(0.0).sqrt();
            let facing = cosine * x + sine * ring * cos_phi;
            let bound = (cosine * x).abs() + sine * cos_phi.abs();
            if rng.unit() * bound < facing.abs() {
                let m = self.axis * x + (toward * cos_phi + aside * sin_phi) * ring;
                return if facing < 0.0 { -m } else { m };
            }
        }
    }
}

#[cfg(test)]
#[path = "band_tests.rs"]
mod tests;
