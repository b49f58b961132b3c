//! Maps from uniform numbers to distributions on disks and spheres, each
//! beside its density (per unit area or solid angle).

use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, TAU};

/// Uniform direction on the sphere.
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (4.0 * u.x * (1.0 - u.x)).max(0.0).sqrt();
    let (sin, cos) = (TAU * u.y).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// Density of [`uniform_sphere`].
pub const UNIFORM_SPHERE_PDF: f32 = 0.25 * FRAC_1_PI;

/// Area-preserving map of the unit square onto the unit disk that keeps
/// concentric squares concentric [Shirley1997]; the layout of incident
/// directions in [Irawan2008] uses it too.
#[inline]
pub fn concentric_disk(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, phi) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * (p.y / p.x))
    } else {
        (p.y, FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y))
    };
    let (sin, cos) = phi.sin_cos();
    Vec2::new(r * cos, r * sin)
}

/// Direction in the upper hemisphere with density cos(theta)/pi.
#[inline]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = concentric_disk(u);
    d.extend((1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Density of [`cosine_hemisphere`]; zero below the horizon.
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// A direction from polar angle and azimuth: theta from +z, phi from +x.
pub fn direction_from_angles(theta_rad: f32, phi_rad: f32) -> Vec3 {
    let (st, ct) = theta_rad.sin_cos();
    let (sp, cp) = phi_rad.sin_cos();
    Vec3::new(st * cp, st * sp, ct)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PathRng;

    #[test]
    fn second_moments_of_the_maps_are_their_closed_forms() {
        // Sphere: E z^2 = 1/3 (variance 4/45). Cosine hemisphere: E z = 2/3
        // (variance 1/18). Disk: E x^2 = 1/4.
        let n = 200_000;
        let mut rng = PathRng::from_seed(11);
        let (mut z2, mut z, mut x2) = (0.0f64, 0.0f64, 0.0f64);
        for _ in 0..n {
            z2 += f64::from(uniform_sphere(rng.unit2()).z).powi(2);
            z += f64::from(cosine_hemisphere(rng.unit2()).z);
            x2 += f64::from(concentric_disk(rng.unit2()).x).powi(2);
        }
        let n = f64::from(n);
        let four_sigma = |variance: f64| 4.0 * (variance / n).sqrt();
        assert!(
            (z2 / n - 1.0 / 3.0).abs() < four_sigma(4.0 / 45.0),
            "seed 11"
        );
        assert!(
            (z / n - 2.0 / 3.0).abs() < four_sigma(1.0 / 18.0),
            "seed 11"
        );
        assert!((x2 / n - 0.25).abs() < four_sigma(1.0 / 16.0), "seed 11");
    }

    #[test]
    fn angles_round_trip() {
        for i in 1..180 {
            for j in -17..18 {
                let (theta, phi) = ((i as f32).to_radians(), (j as f32 * 10.0).to_radians());
                let d = direction_from_angles(theta, phi);
                let (a, b) = (d.truncate().length().atan2(d.z), d.y.atan2(d.x));
                assert!((a - theta).abs() < 1e-5 && (b - phi).abs() < 2e-4);
            }
        }
    }
}
