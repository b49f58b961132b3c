//! Ray optics of a smooth dielectric cylinder, after [Marschner2003].
//!
//! A ray at inclination theta (from the plane across the axis) meets the
//! cylinder at offset h in `[-1, 1]`. Seen along the axis it refracts with the
//! effective index `sqrt(eta^2 - sin^2 theta) / cos theta`; the Fresnel
//! reflectance is that of the true angle of incidence, whose cosine is
//! `cos(theta) sqrt(1 - h^2)`, with the true index.

use crate::fibre_frame::quick_atan2;
use organza_basis::Rgb;
use std::f32::consts::PI;

/// Lobes kept apart: R, TT, TRT and the sum of the rest.
pub const LOBES: usize = 4;

/// Least cosine of the inclination that angles are computed with.
pub(crate) const MIN_COS: f32 = 1e-4;

/// Unpolarised Fresnel reflectance for the cosine of the angle of incidence and
/// the index of refraction `eta >= 1` behind the interface.
pub fn fresnel(cos_i: f32, eta: f32) -> f32 {
    let cos_i = cos_i.clamp(0.0, 1.0);
    let cos_t = (1.0 - (1.0 - cos_i * cos_i) / (eta * eta)).max(0.0).sqrt();
    // Both sums vanish when a ray grazes an interface between equals.
    let across = (cos_i - eta * cos_t) / (cos_i + eta * cos_t).max(1e-12);
    let along = (eta * cos_i - cos_t) / (eta * cos_i + cos_t).max(1e-12);
    0.5 * (across * across + along * along)
}

/// How a ray passes the cylinder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Crossing {
    /// Angle of incidence seen along the axis, `asin(h)`.
    pub gamma_i_rad: f32,
    /// Angle of refraction seen along the axis.
    pub gamma_t_rad: f32,
    /// Reflectance at each surface.
    pub fresnel: f32,
    /// Length of one passage inside, in radii.
    pub path_radii: f32,
}

impl Crossing {
    /// For the index `eta`, the cosine of the inclination and the offset h.
    pub fn new(eta: f32, cos_theta: f32, h: f32) -> Crossing {
        Crossing::at_angle(eta, cos_theta, h, h.clamp(-1.0, 1.0).asin())
    }

    /// The same at another inclination.
    pub fn turned(&self, eta: f32, cos_theta: f32, h: f32) -> Crossing {
        Crossing::at_angle(eta, cos_theta, h, self.gamma_i_rad)
    }

    fn at_angle(eta: f32, cos_theta: f32, h: f32, gamma_i_rad: f32) -> Crossing {
        let cos_theta = cos_theta.clamp(MIN_COS, 1.0);
        let h = h.clamp(-1.0, 1.0);
        let sin_squared = 1.0 - cos_theta * cos_theta;
        // eta^2 - sin^2, which must not round to zero for an empty cylinder.
        let index = (eta * eta - 1.0 + cos_theta * cos_theta).sqrt() / cos_theta;
        let sin_gamma_t = (h / index).clamp(-1.0, 1.0);
        let cos_gamma_t = (1.0 - sin_gamma_t * sin_gamma_t).sqrt();
        let cos_gamma_i = (1.0 - h * h).max(0.0).sqrt();
        let cos_theta_t = (1.0 - sin_squared / (eta * eta)).max(0.0).sqrt();
        Crossing {
            gamma_i_rad,
            gamma_t_rad: quick_atan2(sin_gamma_t, cos_gamma_t),
            fresnel: fresnel(cos_theta * cos_gamma_i, eta),
            path_radii: 2.0 * cos_gamma_t / cos_theta_t.max(MIN_COS),
        }
    }

    /// Part of the light that leaves in each lobe, the last being the sum of the
    /// whole series after TRT. `absorption_radii` is absorption times radius.
    pub fn attenuations(&self, absorption_radii: Rgb) -> [Rgb; LOBES] {
        let f = self.fresnel;
        let t = (-absorption_radii.0 * self.path_radii).exp();
        let tt = (1.0 - f) * (1.0 - f) * t;
        let trt = f * t * tt;
        // Each further inner reflection multiplies by f t; f < 1 unless grazing,
        // where tt vanishes faster than 1 - f t.
        let rest = trt * f * t / (1.0 - f * t).max(glam::Vec3::splat(1e-6));
        [Rgb::splat(f), Rgb(tt), Rgb(trt), Rgb(rest)]
    }

    /// Angle of the surface normal where light of lobe `p` leaves, about the
    /// axis, from the ray's projected direction: see [`crate::fibre_frame`].
    pub fn exit_normal_rad(&self, p: usize) -> f32 {
        PI - self.gamma_i_rad - p as f32 * (PI - 2.0 * self.gamma_t_rad)
    }

    /// Azimuth into which lobe `p` leaves a smooth cylinder, from the ray's
    /// projected direction.
    pub fn exit_azimuth_rad(&self, p: usize) -> f32 {
        self.exit_normal_rad(p) - self.gamma_i_rad
    }
}

/// Mean attenuations over offsets uniform in `[-1, 1]`, by the midpoint rule in
/// the angle of incidence: 1e-5 and better for `nodes` of 256.
pub fn mean_attenuations(
    eta: f32,
    absorption_radii: Rgb,
    cos_theta: f32,
    nodes: usize,
) -> [Rgb; LOBES] {
    let mut sums = [glam::DVec3::ZERO; LOBES];
    for (h, weight) in offsets(nodes) {
        let a = Crossing::new(eta, cos_theta, h).attenuations(absorption_radii);
        for (sum, a) in sums.iter_mut().zip(a) {
            *sum += f64::from(weight) * a.0.as_dvec3();
        }
    }
    sums.map(|s| Rgb(s.as_vec3()))
}

/// Offsets in `[0, 1]` with weights that sum to one, even in the angle of
/// incidence: exit azimuths are then as even as the offsets allow.
pub(crate) fn offsets(nodes: usize) -> impl Iterator<Item = (f32, f32)> {
    let step = 0.5 * PI / nodes as f32;
    // The midpoint rule's weights cos(gamma) step sum to this.
    let sum = (0.5 * step) / (0.5 * step).sin();
    (0..nodes).map(move |k| {
        let (sin, cos) = ((k as f32 + 0.5) * step).sin_cos();
        (sin, cos * step / sum)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lobe_energies_match_brute_force_ray_optics() {
        // Brute-force ray optics in three dimensions, made apart from this program:
        // energies averaged over the offset, unpolarised.
        let text = include_str!("../tests/data/fibre_lobe_energy.csv");
        let rows = organza_testing::csv_numbers(text);
        assert_eq!(rows.len(), 36);
        for v in rows {
            let cos = (v[2] as f32).to_radians().cos();
            let got = mean_attenuations(v[0] as f32, Rgb::splat(v[1] as f32), cos, 512);
            let expected = [v[3], v[4], v[5], v[6] + v[7] + v[8]];
            for (g, e) in got.iter().zip(expected) {
                let g = f64::from(g.0.x);
                // What is still inside after four reflections is partly absorbed
                // later, which the sum of the series knows.
                let later = if v[1] > 0.0 && e == expected[3] {
                    v[8]
                } else {
                    0.0
                };
                assert!(
                    (g - e).abs() < 1e-4 || (g - e).abs() <= later,
                    "{v:?}: {g} {e}"
                );
            }
        }
    }

    #[test]
    fn without_absorption_all_light_leaves() {
        for eta in [1.01, 1.35, 1.55, 2.5] {
            for cos in [0.0, 1e-3, 0.1, 0.5, 1.0] {
                for h in [-1.0, -0.999_99, -0.3, 0.0, 0.7, 1.0] {
                    let sum: f32 = Crossing::new(eta, cos, h)
                        .attenuations(Rgb::BLACK)
                        .iter()
                        .map(|a| a.0.x)
                        .sum();
                    assert!(
                        (sum - 1.0).abs() < 4.0 * f32::EPSILON,
                        "{eta} {cos} {h}: {sum}"
                    );
                }
            }
        }
    }

    #[test]
    fn an_empty_cylinder_lets_rays_straight_through() {
        for h in [-0.9, -0.2, 0.0, 0.5] {
            let c = Crossing::new(1.0, 0.8, h);
            assert!(c.fresnel < 1e-6 && c.exit_azimuth_rad(1).abs() < 1e-5);
            // It leaves at the same offset on the far side.
            let angle = c.exit_normal_rad(1);
            assert!((angle.sin() - h).abs() < 1e-5 && angle.cos() > 0.0);
            assert!((c.exit_normal_rad(0).sin() - h).abs() < 4.0 * f32::EPSILON);
        }
    }
}
