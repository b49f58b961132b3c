//! `flake = "gaussian"`: mirrors with a truncated Gaussian profile \[Schroeder2012].

use super::band::{BandProfile, MIN_GAMMA, band_area, truncated_normal};
use super::catalogue::FlakeRecord;
use super::distribution::{Bands, Mirrors};
use crate::cone_table::ConeTable;
use organza_basis::PathRng;
use std::f64::consts::FRAC_2_PI as FRAC_2_PI_64;
use std::sync::{Arc, LazyLock};

pub(super) const FAMILY: FlakeRecord = FlakeRecord {
    name: "gaussian",
    about: "mirrors with a truncated Gaussian about the fibre's cross-section",
    scattering: |_| Arc::new(Mirrors(Bands::<GaussianBand>::new())),
};

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
