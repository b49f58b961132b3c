//! A cloth with a weft and a warp whose BSDF is a closed form.

use glam::{DVec2, DVec3, Vec3};
use organza_basis::{PathRng, Rgb, warp};
use organza_measure::{Exit, PatchResponse};
use organza_transport::Stats;
use std::f64::consts::PI;

/// A reciprocal BSDF with a weft and a warp, and a tint: a broad base, a ridge askew
/// to the weft, and scattered transmission that is stronger near the warp.
pub struct Planted;

impl Planted {
    /// The value, 1/sr.
    pub fn bsdf(a: DVec3, b: DVec3) -> [f64; 3] {
        if a.z * b.z > 0.0 {
            let half = (a + b).normalize();
            let across = half.x - 0.4 * half.y;
            let ridge = 0.25 * (-5.0 * across * across - 0.8 * half.y * half.y).exp();
            // The back is darker.
            let side = if a.z > 0.0 { 1.0 } else { 0.5 };
            [0.1, 0.05, 0.02].map(|base| side * (base + ridge))
        } else {
            let tilt = (a.x + b.x).powi(2);
            [0.02, 0.04, 0.05].map(|base| base / (1.0 + 4.0 * tilt))
        }
    }

    fn colour(a: Vec3, b: Vec3) -> Rgb {
        let [r, g, b] = Planted::bsdf(a.as_dvec3(), b.as_dvec3());
        Rgb::new(r as f32, g as f32, b as f32)
    }

    /// The share of light from a direction that is scattered to one side, by quadrature.
    pub fn share(w: DVec3, crosses: bool) -> [f64; 3] {
        let n = 200;
        let mut sum = [0.0; 3];
        for k in 0..n * n {
            let cell = DVec2::new((k % n) as f64, (k / n) as f64) + 0.5;
            let mut to = warp::cosine_hemisphere((cell / n as f64).as_vec2()).as_dvec3();
            to.z *= if crosses { -w.z } else { w.z }.signum();
            for (s, v) in sum.iter_mut().zip(Planted::bsdf(w, to)) {
                *s += v * PI / (n * n) as f64;
            }
        }
        sum
    }
}

impl PatchResponse for Planted {
    fn estimate_bsdf(&self, a: Vec3, b: Vec3, _: &mut PathRng, _: &mut Stats) -> Rgb {
        Planted::colour(a, b)
    }

    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, _: &mut Stats) -> Exit {
        let mut to = warp::cosine_hemisphere(rng.unit2());
        let crosses = rng.unit() < 0.5;
        to.z *= if crosses { -w.z } else { w.z }.signum();
        let weight = Planted::colour(w, to) * (2.0 * std::f32::consts::PI);
        Exit {
            escape: Some((to, weight)),
            is_straight: false,
            absorbed: Rgb::WHITE - weight,
        }
    }

    fn is_exact(&self) -> bool {
        true
    }
}

/// A direction of the upper hemisphere, uniform over solid angle, above a cosine.
pub fn random_direction(rng: &mut PathRng, least_cosine: f64) -> DVec3 {
    let z = least_cosine + (1.0 - least_cosine) * f64::from(rng.unit());
    let ring = DVec2::from_angle(2.0 * PI * f64::from(rng.unit())) * (1.0 - z * z).sqrt();
    ring.extend(z)
}
