//! Transmission through the cloth: gaps between yarns, and light that yarns transmit. The
//! thesis has neither. [`MeasuredTransmission`](crate::MeasuredTransmission) fits the
//! parameters to measurements of a real cloth or a volume.
//!
//! Transmitted light is symmetric in its two directions except for rounding (2e-4 of the value,
//! tested over all presets), as reflected light is; gaps are equally transparent in both
//! directions. Reflected, transmitted and straight light together never exceed the arriving
//! light: tested to 89 degrees on both sides of all presets, with and without transmission.

use glam::Vec3;
use organza_basis::{PathRng, Rgb, quadrature, warp};
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// Gaps by cover factor, a diffuse lobe and a lobe about straight on.
#[derive(Clone, Debug)]
pub struct Transmission {
    warp_cover: f32,
    weft_cover: f32,
    diffuse: Rgb,
    forward: Rgb,
    concentration: f32,
    /// Integral of the forward lobe times the cosine over the far hemisphere,
    /// at equal steps of the cosine of the light from 0 to 1.
    forward_integral: Vec<f32>,
}

/// Steps of the tabulated integral: linear interpolation errs below 1e-3 at
/// concentrations up to 100.
const STEPS: usize = 128;

impl Transmission {
    /// `warp_cover` and `weft_cover` are diameter over spacing of the yarns, in `[0, 1]`; the
    /// cover factor of the cloth is 1 - (1 - K1)(1 - K2) \[Peirce1937]. `diffuse` and `forward`
    /// are the shares of the light on the yarns that each lobe transmits; `concentration` is
    /// that of the forward lobe, a von Mises-Fisher density, in `[0, 1000]`.
    pub fn new(
        warp_cover: f32,
        weft_cover: f32,
        diffuse: Rgb,
        forward: Rgb,
        concentration: f32,
    ) -> Transmission {
        let integral = |step: usize| {
            let cos = step as f64 / STEPS as f64;
            forward_integral(cos, f64::from(concentration)) as f32
        };
        Transmission {
            warp_cover,
            weft_cover,
            diffuse,
            forward,
            concentration,
            forward_integral: if forward.is_black() {
                vec![1.0; STEPS + 1]
            } else {
                (0..=STEPS).map(integral).collect()
            },
        }
    }

    /// Share of the cloth that a ray along `w` passes without touching yarn.
    ///
    /// Exact for two layers of parallel cylinders: along a direction that makes
    /// the angle a with the layer's normal, in the plane across the yarns, the
    /// spacing shrinks by cos a and the diameter does not.
    pub fn gap(&self, w: Vec3) -> f32 {
        let open = |across: f32, cover: f32| {
            let cos = w.z.abs() / across.hypot(w.z);
            // Negated, so that a direction without a plane counts as closed.
            if cos > cover { 1.0 - cover / cos } else { 0.0 }
        };
        open(w.x, self.warp_cover) * open(w.y, self.weft_cover)
    }

    /// Share of the cloth that is yarn for both directions. The lit yarn and the visible yarn
    /// are assumed to coincide as far as possible.
    #[inline]
    pub fn covered(&self, w_in: Vec3, w_out: Vec3) -> f32 {
        1.0 - self.gap(w_in).max(self.gap(w_out))
    }

    /// The transmitted lobes per unit of light on the yarns, 1/sr, for
    /// directions on opposite sides; symmetric in them.
    pub fn eval(&self, w_in: Vec3, w_out: Vec3) -> Rgb {
        if self.forward.is_black() {
            return self.diffuse * FRAC_1_PI;
        }
        let [diffuse, forward] = self.lobes(w_in, w_out);
        self.diffuse * diffuse + self.forward * forward
    }

    /// The diffuse and the forward lobe for colours of one.
    pub fn lobes(&self, w_in: Vec3, w_out: Vec3) -> [f32; 2] {
        let norm = self.norm(w_in.z).max(self.norm(w_out.z));
        let forward = if norm > 0.0 {
            self.forward_density(w_in, w_out) / norm
        } else {
            0.0
        };
        [FRAC_1_PI, forward]
    }

    /// The same gaps and lobes with other colours.
    pub fn with_colours(&self, both: Rgb) -> Transmission {
        let (warp, weft) = (self.warp_cover, self.weft_cover);
        Transmission::new(warp, weft, both, both, self.concentration)
    }

    /// Colour of the diffuse lobe.
    pub fn diffuse(&self) -> Rgb {
        self.diffuse
    }

    /// Colour of the forward lobe.
    pub fn forward(&self) -> Rgb {
        self.forward
    }

    /// Mean transmitted share.
    pub fn albedo(&self) -> Rgb {
        self.diffuse + self.forward
    }

    /// The probability of sampling the forward lobe instead of the diffuse one.
    fn forward_share(&self) -> f32 {
        let (d, f) = (self.diffuse.mean(), self.forward.mean());
        if f > 0.0 { f / (d + f) } else { 0.0 }
    }

    /// A direction on the other side of the cloth from `w_out`, or on the same side, with no
    /// value, when the forward lobe reaches over the horizon.
    pub fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Vec3 {
        if rng.unit() < self.forward_share() {
            let u = rng.unit2();
            // Inverse of the von Mises-Fisher distribution's cosine.
            let k = self.concentration;
            let cos = if k < 1e-3 {
                1.0 - 2.0 * u.x
            } else {
                1.0 + (u.x + (1.0 - u.x) * (-2.0 * k).exp()).ln() / k
            };
            let sin = (1.0 - cos * cos).max(0.0).sqrt();
            let (s, c) = (TAU * u.y).sin_cos();
            let frame = organza_basis::Frame::from_normal(-w_out);
            frame.world_from_frame(Vec3::new(sin * c, sin * s, cos))
        } else {
            let w = warp::cosine_hemisphere(rng.unit2());
            w * Vec3::new(1.0, 1.0, -w_out.z.signum())
        }
    }

    /// Density of [`sample`](Self::sample) for a direction on the other side.
    pub fn pdf(&self, w_in: Vec3, w_out: Vec3) -> f32 {
        let forward = self.forward_share();
        (1.0 - forward) * w_in.z.abs() * FRAC_1_PI + forward * self.forward_density(w_in, w_out)
    }

    /// Von Mises-Fisher density about straight on, 1/sr.
    fn forward_density(&self, w_in: Vec3, w_out: Vec3) -> f32 {
        let k = self.concentration;
        let norm = if k < 1e-3 {
            1.0 / (4.0 * PI)
        } else {
            k / (TAU * (1.0 - (-2.0 * k).exp()))
        };
        // |w_in + w_out|^2 / 2 = 1 + cos keeps its precision near the straight direction.
        norm * (-0.5 * k * (w_in + w_out).length_squared()).exp()
    }

    fn norm(&self, cos: f32) -> f32 {
        let x = cos.abs().min(1.0) * STEPS as f32;
        let i = (x as usize).min(STEPS - 1);
        let (a, b) = (self.forward_integral[i], self.forward_integral[i + 1]);
        a + (b - a) * (x - i as f32)
    }
}

/// Integral of a von Mises-Fisher density times the cosine over a hemisphere
/// in which its axis has the given cosine.
fn forward_integral(cos_axis: f64, k: f64) -> f64 {
    let sin_axis = (1.0 - cos_axis * cos_axis).max(0.0).sqrt();
    let norm = if k < 1e-3 {
        1.0 / (4.0 * std::f64::consts::PI)
    } else {
        k / (std::f64::consts::TAU * (1.0 - (-2.0 * k).exp()))
    };
    // Around the normal the azimuth integrates to a Bessel function.
    quadrature::integrate(0.0, std::f64::consts::FRAC_PI_2, 1e-6, |theta| {
        let (sin, cos) = theta.sin_cos();
        let b = k * sin * sin_axis;
        let peak = k * (cos * cos_axis - 1.0) + b;
        std::f64::consts::TAU * norm * peak.exp() * pxfm::f_i0e(b) * sin * cos
    })
}
