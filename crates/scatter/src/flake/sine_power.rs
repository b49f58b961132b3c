//! `flake = "sin-power"`: mirrors with a power of the sine of the angle to the
//! fibre \[Jakob2010].

use super::band::{BandProfile, MIN_GAMMA, band_area, truncated_normal};
use super::catalogue::FlakeRecord;
use super::distribution::{Bands, Mirrors};
use crate::cone_table::ConeTable;
use organza_basis::PathRng;
use std::f32::consts::PI;
use std::f64::consts::FRAC_2_PI as FRAC_2_PI_64;
use std::sync::{Arc, LazyLock};

pub(super) const FAMILY: FlakeRecord = FlakeRecord {
    name: "sin-power",
    about: "mirrors with a power of the sine of the angle to the fibre",
    scattering: |_| Arc::new(Mirrors(Bands::<SineBand>::new())),
};

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

/// The sine power whose band has the curvature of a Gaussian one at its top:
/// `1 / gamma^2`. Areas then differ by at most 4 % of the broadside one for
/// gamma up to 0.3 (tested), more for wider bands, where the two families
/// themselves differ.
pub fn sine_power_from_gamma(gamma: f32) -> f32 {
    1.0 / (gamma * gamma)
}
