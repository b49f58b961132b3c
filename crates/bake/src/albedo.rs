//! Directional albedos of lobes, tabulated: what a layer leaves to the layers below it.

use crate::lobe::{ggx, schlick, sheen};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Nodes along the cosine, and along the width of a lobe.
const NODES: usize = 16;
/// Directions of the light along either angle.
const SAMPLES: usize = 48;

/// Albedos over the cosine of the eye and the width of the lobe.
#[derive(Clone, Debug)]
pub struct Albedos {
    /// Microfacets: factors of the Fresnel values at normal and at grazing incidence
    /// [Karis2013].
    facets: Vec<Vec2>,
    sheen: Vec<f32>,
}

/// Place of a node: cosines and widths from a little above 0 to 1.
fn node(k: usize) -> f32 {
    (k as f32 / (NODES - 1) as f32).max(0.02)
}

impl Default for Albedos {
    fn default() -> Albedos {
        Albedos::new()
    }
}

impl Albedos {
    /// Integrates both lobes.
    pub fn new() -> Albedos {
        let (mut facets, mut fuzz) = (Vec::new(), Vec::new());
        for a in 0..NODES {
            for c in 0..NODES {
                facets.push(facet_albedo(node(c), node(a)));
                fuzz.push(sheen_albedo(node(c), node(a)));
            }
        }
        Albedos {
            facets,
            sheen: fuzz,
        }
    }

    /// The share of light that microfacets of width `alpha` reflect, by the Fresnel values at
    /// normal and at grazing incidence.
    pub fn facets(&self, cos: f32, alpha: f32, f0: f32, f90: f32) -> f32 {
        let value = |k: usize| self.facets.get(k).copied().unwrap_or_default();
        let v = bilinear(cos, alpha, value);
        (f0 * v.x + f90 * v.y).min(1.0)
    }

    /// The share of light that the sheen of width `alpha` reflects.
    pub fn sheen(&self, cos: f32, alpha: f32) -> f32 {
        let value = |k: usize| self.sheen.get(k).copied().unwrap_or_default();
        bilinear(cos, alpha, value).min(1.0)
    }
}

fn bilinear<T>(cos: f32, alpha: f32, value: impl Fn(usize) -> T) -> T
where
    T: std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    let place = |x: f32| {
        let x = x.clamp(0.0, 1.0) * (NODES - 1) as f32;
        let low = (x as usize).min(NODES - 2);
        (low, x - low as f32)
    };
    let ((c, x), (a, y)) = (place(cos), place(alpha));
    let at = |a: usize, c: usize| value(a * NODES + c);
    (at(a, c) * (1.0 - x) + at(a, c + 1) * x) * (1.0 - y)
        + (at(a + 1, c) * (1.0 - x) + at(a + 1, c + 1) * x) * y
}

/// Microfacets by light at the visible half vectors of a polar grid about the normal: the
/// half vector is drawn by the distribution, which leaves smooth weights.
fn facet_albedo(cos: f32, alpha: f32) -> Vec2 {
    let out = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = Vec2::ZERO;
    for i in 0..SAMPLES {
        for j in 0..SAMPLES {
            let u = (i as f32 + 0.5) / SAMPLES as f32;
            let phi = 2.0 * PI * (j as f32 + 0.5) / SAMPLES as f32;
            let tan2 = alpha * alpha * u / (1.0 - u);
            let cos_h = 1.0 / (1.0 + tan2).sqrt();
            let sin_h = (1.0 - cos_h * cos_h).max(0.0).sqrt();
            let h = Vec3::new(sin_h * phi.cos(), sin_h * phi.sin(), cos_h);
            let oh = out.dot(h);
            let w = 2.0 * oh * h - out;
            if oh <= 0.0 || w.z <= 0.0 {
                continue;
            }
            // f cos / pdf with pdf = D cos_h / (4 o.h) and f = D G / (4 cos cos).
            let q = (sin_h / alpha).powi(2) + cos_h * cos_h;
            let d = 1.0 / (PI * alpha * alpha * q * q);
            let weight = ggx((alpha, alpha), w, out) * w.z * 4.0 * oh / (d * cos_h);
            let grazing = schlick(0.0, 1.0, oh);
            sum += Vec2::new(1.0 - grazing, grazing) * weight;
        }
    }
    sum / (SAMPLES * SAMPLES) as f32
}

fn sheen_albedo(cos: f32, alpha: f32) -> f32 {
    let out = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = 0.0;
    for i in 0..SAMPLES {
        for j in 0..SAMPLES {
            let z = (i as f32 + 0.5) / SAMPLES as f32;
            let phi = 2.0 * PI * (j as f32 + 0.5) / SAMPLES as f32;
            let sin = (1.0 - z * z).sqrt();
            let w = Vec3::new(sin * phi.cos(), sin * phi.sin(), z);
            let h = (w + out).normalize_or_zero();
            sum += sheen(alpha, h.z, z, cos) * z;
        }
    }
    sum * 2.0 * PI / (SAMPLES * SAMPLES) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn albedos_are_shares_and_smooth_facets_lose_nothing() {
        let albedos = Albedos::new();
        for k in 0..20 {
            let cos = 0.05 + 0.05 * k as f32;
            let white = albedos.facets(cos, 0.1, 1.0, 1.0);
            assert!(white > 0.85 && white <= 1.0, "{cos}: {white}");
            let rough = albedos.facets(cos, 1.0, 1.0, 1.0);
            assert!(rough > 0.3 && rough < white, "{cos}: {rough}");
            let sheen = albedos.sheen(cos, 0.3);
            assert!((0.0..=1.0).contains(&sheen), "{cos}: {sheen}");
        }
        // Sheen grows towards grazing angles; a known value by another rule.
        assert!(albedos.sheen(0.1, 0.3) > 2.0 * albedos.sheen(0.9, 0.3));
        let rule = organza_basis::quadrature::gauss_legendre(60);
        let mut exact = 0.0;
        for &(z, wz) in &rule {
            for k in 0..90 {
                let (z, phi) = (
                    0.5 * (z + 1.0),
                    2.0 * std::f64::consts::PI * f64::from(k) / 90.0,
                );
                let sin = (1.0 - z * z).sqrt();
                let w = Vec3::new((sin * phi.cos()) as f32, (sin * phi.sin()) as f32, z as f32);
                let out = Vec3::new(0.6, 0.0, 0.8);
                let h = (w + out).normalize();
                let f = f64::from(sheen(0.4, h.z, w.z, 0.8));
                exact += f * z * 0.5 * wz * 2.0 * std::f64::consts::PI / 90.0;
            }
        }
        let table = f64::from(albedos.sheen(0.8, 0.4));
        assert!((table - exact).abs() < 0.02 * exact, "{table} {exact}");
        // The twin: the albedo of a wider sheen.
        let wider = f64::from(albedos.sheen(0.8, 0.6));
        assert!((wider - exact).abs() > 0.02 * exact);
    }
}
