//! Means over the width of a smooth dielectric cylinder; see [`Crossing`] for one ray.

use crate::near::LOBES;
use crate::near::crossing::Crossing;
use organza_basis::Rgb;
use organza_lanes::V3;

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
        let a = attenuations(&Crossing::new(eta, cos_theta, h), absorption_radii);
        for (sum, a) in sums.iter_mut().zip(a) {
            *sum += f64::from(weight) * a.0.as_dvec3();
        }
    }
    sums.map(|s| Rgb(s.as_vec3()))
}

/// [`Crossing::attenuations`] as colours.
pub(crate) fn attenuations(crossing: &Crossing<f32>, absorption_radii: Rgb) -> [Rgb; LOBES] {
    let lobes = crossing.attenuations(V3::splat(absorption_radii.0));
    lobes.map(|lobe| Rgb(lobe.into()))
}

/// Offsets in `[0, 1]` with weights that sum to one, even in the angle of
/// incidence: exit azimuths are then as even as the offsets allow.
pub(crate) fn offsets(nodes: usize) -> impl Iterator<Item = (f32, f32)> {
    let step = 0.5 * std::f32::consts::PI / nodes as f32;
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
    use crate::near::crossing::incidence;

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
                let is_last = v[1] > 0.0 && e == expected[3];
                let later = if is_last { v[8] } else { 0.0 };
                let off = (g - e).abs();
                assert!(off < 1e-4 || off <= later, "{v:?}: {g} {e}");
            }
        }
    }

    #[test]
    fn without_absorption_all_light_leaves() {
        for eta in [1.01, 1.35, 1.55, 2.5] {
            for cos in [0.0, 1e-3, 0.1, 0.5, 1.0] {
                for h in [-1.0, -0.999_99, -0.3, 0.0, 0.7, 1.0] {
                    let parts = attenuations(&Crossing::new(eta, cos, h), Rgb::BLACK);
                    let sum: f32 = parts.iter().map(|a| a.0.x).sum();
                    let off = (sum - 1.0).abs();
                    assert!(off < 4.0 * f32::EPSILON, "{eta} {cos} {h}: {sum}");
                }
            }
        }
    }

    #[test]
    fn an_empty_cylinder_lets_rays_straight_through() {
        for h in [-0.9, -0.2, 0.0, 0.5] {
            let (c, gamma_i) = (Crossing::new(1.0f32, 0.8, h), incidence(h));
            assert!(c.fresnel < 1e-6 && c.exit_azimuth(1, gamma_i).abs() < 1e-5);
            // It leaves at the same offset on the far side.
            let angle = c.exit_normal(1, gamma_i);
            assert!((angle.sin() - h).abs() < 1e-5 && angle.cos() > 0.0);
            assert!((c.exit_normal(0, gamma_i).sin() - h).abs() < 4.0 * f32::EPSILON);
        }
    }
}
