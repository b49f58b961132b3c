//! Flakes of a fibre whose normals crowd about the great circle across its
//! axis: the truncated Gaussian and the power of the sine [Schroeder2012].
//!
//! With x the cosine between normal and fibre, both are a density g(x) on
//! `[-1, 1]` at uniform azimuth. **Normalisation**: unit flake area, so that the
//! projected area is `integral |w . m| D(m) dm` for a D of unit integral:
//! `(2 / pi) sin(angle)` for a smooth fibre, one half for isotropic flakes.
//! ([`MicroFlake::ndf`] counts both faces and is therefore 2 D.)

use crate::cone_table::ConeTable;
use crate::flake::MicroFlake;
use crate::sggx::AxialFlake;
use glam::Vec3;
use organza_basis::quadrature::integrate;
use organza_basis::{Frame, PathRng};
use std::f32::consts::{FRAC_1_PI, FRAC_2_PI, PI, TAU};
use std::f64::consts::FRAC_2_PI as FRAC_2_PI_64;
use std::sync::LazyLock;

/// Least width of a [`GaussianBand`] in single precision; smaller ones are
/// raised to it.
pub const MIN_GAMMA: f32 = 1e-4;

/// A profile g(x) over the cosine x between normal and fibre axis.
pub trait BandProfile: Sized {
    /// The profile of a width: [`GaussianBand::new`] of gamma, and the sine power
    /// with its curvature at the top.
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

/// `D = exp(-x^2 / (2 gamma^2))`, normalised: gamma is the deviation of x, small
/// for smooth fibres, isotropic when large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaussianBand {
    gamma: f32,
    peak: f32,
    mean_abs: f32,
}

impl GaussianBand {
    /// A width, raised to [`MIN_GAMMA`]; not finite stands for isotropic.
    pub fn new(gamma: f32) -> GaussianBand {
        let gamma = if gamma.is_finite() { gamma } else { 1e4 };
        let gamma = gamma.clamp(MIN_GAMMA, 1e4);
        let g = f64::from(gamma);
        let inside = pxfm::f_erf(std::f64::consts::FRAC_1_SQRT_2 / g);
        let peak = 1.0 / ((2.0 * std::f64::consts::PI).sqrt() * g * inside);
        GaussianBand {
            gamma,
            peak: peak as f32,
            mean_abs: (-2.0 * peak * g * g * (-0.5 / (g * g)).exp_m1()) as f32,
        }
    }

    /// The deviation of the cosine between normal and axis.
    pub fn gamma(&self) -> f32 {
        self.gamma
    }
}

impl BandProfile for GaussianBand {
    fn of_width(gamma: f32) -> GaussianBand {
        GaussianBand::new(gamma)
    }

    fn density(&self, x: f32) -> f32 {
        let y = x / self.gamma;
        self.peak * (-0.5 * y * y).exp()
    }

    fn mean_abs(&self) -> f32 {
        self.mean_abs
    }

    fn draw(&self, rng: &mut PathRng) -> f32 {
        truncated_normal(self.gamma, rng)
    }

    fn draw_weighted(&self, rng: &mut PathRng) -> f32 {
        // x^2 / (2 gamma^2) is exponential, cut where x = 1.
        let inside = -(-0.5 / (self.gamma * self.gamma)).exp_m1();
        let squared = -2.0 * (-rng.unit() * inside).ln_1p();
        (self.gamma * squared.sqrt()).min(1.0)
    }

    fn mean_over_circle(&self, amplitude: f32) -> f32 {
        let y = 0.5 * amplitude / self.gamma;
        self.peak * pxfm::f_i0ef(y * y)
    }

    fn projected_area(&self, sine: f32) -> f32 {
        static TABLE: LazyLock<ConeTable> = LazyLock::new(|| {
            ConeTable::build(FRAC_2_PI_64, 0.3, |sine, gamma| {
                let g = |x: f64| (-0.5 * (x / gamma).powi(2)).exp();
                band_area(sine, (10.0 * gamma).min(1.0), g)
            })
        });
        TABLE.area(sine, self.gamma)
    }
}

/// `D = sin^p(angle to the fibre)`, normalised: p is zero for isotropic flakes
/// and large for smooth fibres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SineBand {
    power: f32,
    /// Width of the Gaussian with the same curvature at its top.
    gamma: f32,
    peak: f32,
    mean_abs: f32,
}

impl SineBand {
    /// A power, cut to `[0, 1 / MIN_GAMMA^2]`; NaN stands for zero.
    pub fn new(power: f32) -> SineBand {
        let power = if power.is_nan() { 0.0 } else { power };
        let power = power.clamp(0.0, 1.0 / (MIN_GAMMA * MIN_GAMMA));
        let p = f64::from(power);
        let ln_beta = pxfm::f_lgamma(0.5 * p + 1.0) - pxfm::f_lgamma(0.5 * p + 1.5);
        let peak = 1.0 / (std::f64::consts::PI.sqrt() * ln_beta.exp());
        SineBand {
            power,
            gamma: (1.0 / p.max(1e-8).sqrt()) as f32,
            peak: peak as f32,
            mean_abs: (2.0 * peak / (p + 2.0)) as f32,
        }
    }

    /// The exponent.
    pub fn power(&self) -> f32 {
        self.power
    }
}

impl BandProfile for SineBand {
    fn of_width(gamma: f32) -> SineBand {
        SineBand::new(sine_power_from_gamma(gamma))
    }

    fn density(&self, x: f32) -> f32 {
        // ln_1p keeps (1 - x^2)^(p/2) accurate where p is large and x small.
        self.peak * (0.5 * self.power * (-x * x).max(-0.999_999_9).ln_1p()).exp()
    }

    fn mean_abs(&self) -> f32 {
        self.mean_abs
    }

    fn draw(&self, rng: &mut PathRng) -> f32 {
        // (1 - x^2)^(p/2) <= exp(-p x^2 / 2): at least 8 of 10 are accepted.
        loop {
            let x = truncated_normal(self.gamma, rng);
            let y = x * x;
            let ratio = (0.5 * self.power * ((-y).ln_1p() + y)).exp();
            if rng.unit() < ratio || self.power == 0.0 {
                return x;
            }
        }
    }

    fn draw_weighted(&self, rng: &mut PathRng) -> f32 {
        // 1 - x^2 is distributed as the power 2 / (p + 2) of a uniform number.
        let ln_cosine_squared = 2.0 / (self.power + 2.0) * rng.positive_unit().ln();
        (-ln_cosine_squared.exp_m1()).sqrt()
    }

    fn mean_over_circle(&self, amplitude: f32) -> f32 {
        if self.power > 400.0 {
            // Within one part in p of the Gaussian of equal curvature.
            let y = 0.25 * self.power * amplitude * amplitude;
            return self.peak * pxfm::f_i0ef(y);
        }
        // The trapezoidal rule converges exponentially on a period; 64 nodes
        // resolve the narrowest peak that gets here.
        let sum: f32 = (0..64)
            .map(|i| self.density(amplitude * ((i as f32 + 0.5) / 64.0 * PI).cos()))
            .sum();
        sum / 64.0
    }

    fn projected_area(&self, sine: f32) -> f32 {
        static TABLE: LazyLock<ConeTable> = LazyLock::new(|| {
            ConeTable::build(FRAC_2_PI_64, 0.3, |sine, gamma| {
                let p = 1.0 / (gamma * gamma);
                let g = |x: f64| (0.5 * p * (-x * x).max(-1.0 + 1e-300).ln_1p()).exp();
                band_area(sine, (10.0 * gamma).min(1.0), g)
            })
        });
        TABLE.area(sine, self.gamma)
    }
}

/// Normal of deviation `gamma` cut to `[-1, 1]`; about seven of ten tries hit at worst.
fn truncated_normal(gamma: f32, rng: &mut PathRng) -> f32 {
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
fn band_area(sine: f64, reach: f64, g: impl Fn(f64) -> f64) -> f64 {
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

    /// The profile.
    pub fn profile(&self) -> &P {
        &self.profile
    }

    /// SGGX flakes about the same axis with the same ratio of end-on to
    /// broadside area; multiply the density by the returned factor to keep the
    /// broadside extinction.
    ///
    /// Over all angles the extinction then differs by at most 1.5 % of the
    /// broadside one for Gaussian bands and 2 % for sine powers (tested).
    pub fn to_sggx(&self) -> (AxialFlake, f32) {
        let broadside = self.profile.projected_area(1.0);
        (
            AxialFlake::new(self.axis, self.profile.end_on_ratio()),
            broadside,
        )
    }
}

impl BandFlakes<GaussianBand> {
    /// The Gaussian band whose ratio of end-on to broadside area is that of the
    /// SGGX flakes, to 1e-4.
    pub fn from_sggx(flakes: &AxialFlake) -> BandFlakes<GaussianBand> {
        let axis = flakes.scaled_axis().normalize_or(Vec3::Z);
        BandFlakes::new(axis, GaussianBand::with_end_on_ratio(flakes.end_on()))
    }
}

/// The sine power whose band has the curvature of a Gaussian one at its top:
/// `1 / gamma^2`. Areas then differ by at most 4 % of the broadside one for
/// gamma up to 0.3 (tested), more for wider bands, where the two families
/// themselves differ.
pub fn sine_power_from_gamma(gamma: f32) -> f32 {
    1.0 / (gamma * gamma)
}

/// The inverse of [`sine_power_from_gamma`].
pub fn gamma_from_sine_power(power: f32) -> f32 {
    1.0 / power.sqrt()
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
mod tests;
