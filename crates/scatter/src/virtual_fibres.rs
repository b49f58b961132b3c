//! Media of fibres: how much of a direction they block, and which fibre a walk
//! meets [Schroeder2011].
//!
//! Of the populations of a voxel, population i blocks
//! `sigma_i(w) = 2 r rho_i E_i[sin(angle(w, t))]` per millimetre, the mean over
//! its distribution of tangents. A collision is with population i in proportion
//! to sigma_i, and with a fibre of tangent t in proportion to what it shows,
//! `sin(angle(w, t))` times its share of the population. Both follow from the
//! extinction; the published Algorithm 6 takes densities instead, which is
//! neither reciprocal nor unbiased (kept as a rival in the benches): in a slab of
//! two populations that cross, three pairs of light and view are off by -18, +2
//! and -11 %, and swapping light and view changes one by 44 %
//! (`tests/slabs.rs` in full, errors below 1 %).

use crate::cone_table::ConeTable;
use glam::Vec3;
use organza_basis::quadrature::{gauss_legendre, integrate_rule};
use organza_basis::{FibrePopulation, Frame, PathRng};
use std::f32::consts::{FRAC_PI_2, PI, TAU};
use std::sync::LazyLock;

/// Mean of `sin(angle(w, t))` over tangents t half-normally spread by
/// `spread_rad` about a mean axis, for the sine of the angle between w and that
/// axis: the cross-section per fibre length over the fibre's diameter.
///
/// A table, within 1e-3 of itself everywhere (tested), so also where a ray runs
/// along nearly parallel fibres. Exactly the sine for a spread of zero.
#[inline]
pub fn effective_cross_section(sine: f32, spread_rad: f32) -> f32 {
    if spread_rad <= MIN_SPREAD_RAD {
        return sine;
    }
    static TABLE: LazyLock<ConeTable> = LazyLock::new(|| ConeTable::build(1.0, 0.5, mean_sine));
    TABLE.area(sine, spread_rad.min(MAX_SPREAD_RAD))
}

/// Beyond this deviation the polar angle is uniform to single precision.
const MAX_SPREAD_RAD: f32 = 1e4;

/// Below this deviation fibres count as parallel: the error of the
/// cross-section is smaller than what single precision makes of the sine.
const MIN_SPREAD_RAD: f32 = 1e-6;

/// [`effective_cross_section`] by quadrature over polar angle and azimuth.
fn mean_sine(sine: f64, spread_rad: f64) -> f64 {
    let beta = sine.clamp(0.0, 1.0).asin();
    let rule = gauss_legendre(24);
    let (sin_beta, cos_beta) = beta.sin_cos();
    // Over azimuth the squared sine is quadratic in its cosine; the midpoint
    // rule over half a period converges fast except at the cone's tip.
    let azimuths: [(f64, f64); 48] =
        std::array::from_fn(|k| ((k as f64 + 0.5) / 48.0 * std::f64::consts::PI).sin_cos());
    let around = |alpha: f64| {
        let (sin, cos) = alpha.sin_cos();
        let sum: f64 = azimuths
            .iter()
            .map(|(sin_phi, cos_phi)| {
                // sin^2 = |w x t|^2 without cancellation.
                let x = sin_beta * cos - cos_beta * sin * cos_phi;
                let y = sin * sin_phi;
                (x * x + y * y).sqrt()
            })
            .sum();
        sum / azimuths.len() as f64
    };
    let reach = (9.0 * spread_rad).min(std::f64::consts::FRAC_PI_2);
    let weight = |alpha: f64| (-0.5 * (alpha / spread_rad).powi(2)).exp();
    let mut cuts = [
        0.0,
        beta.min(reach),
        (2.0 * beta).min(reach),
        (3.0 * spread_rad).min(reach),
        reach,
    ];
    cuts.sort_by(f64::total_cmp);
    let over = |f: &dyn Fn(f64) -> f64| -> f64 {
        cuts.windows(2)
            .map(|c| integrate_rule(&rule, c[0], c[1], f))
            .sum()
    };
    over(&|a| weight(a) * around(a)) / over(&weight)
}

/// Extinction of one population toward the unit direction `w`, per millimetre.
pub fn population_sigma_t_per_mm(population: &FibrePopulation, w: Vec3) -> f32 {
    let sine = population.axis.cross(w).length().min(1.0);
    population.broadside_per_mm() * effective_cross_section(sine, population.spread_rad)
}

/// Extinction of all populations toward the unit direction `w`, per millimetre;
/// never more than [`organza_basis::Mixture::broadside_per_mm`].
pub fn sigma_t_per_mm(populations: &[FibrePopulation], w: Vec3) -> f32 {
    let each = populations.iter().map(|c| population_sigma_t_per_mm(c, w));
    each.sum()
}

/// The fibre that a walk meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetFibre {
    /// Index of its population.
    pub population: usize,
    /// Unit tangent.
    pub tangent: Vec3,
}

/// Draws the fibre that a walk along `w` (of either sign) meets, given that
/// there is a collision with one of the populations; `None` when nothing there
/// blocks.
pub fn meet_fibre(populations: &[FibrePopulation], w: Vec3, rng: &mut PathRng) -> Option<MetFibre> {
    let mut left = rng.unit() * sigma_t_per_mm(populations, w);
    let mut chosen = None;
    for (i, c) in populations.iter().enumerate() {
        let sigma = population_sigma_t_per_mm(c, w);
        if sigma > 0.0 {
            chosen = Some(i);
            left -= sigma;
            if left < 0.0 {
                break;
            }
        }
    }
    let population = chosen?;
    let c = &populations[population];
    Some(MetFibre {
        population,
        tangent: visible_tangent_sample(c.axis, c.spread_rad, w, rng),
    })
}

/// Draws a unit tangent with density proportional to `sin(angle(w, t)) p(t)`,
/// p being half-normal about `axis` with deviation `spread_rad`.
///
/// Exact for any spread, with at most three tries on average:
/// `sin(angle(w, t)) <= sin(beta) + alpha` for the angle beta between w and the
/// axis and the polar angle alpha of t, and both terms can be drawn.
pub fn visible_tangent_sample(axis: Vec3, spread_rad: f32, w: Vec3, rng: &mut PathRng) -> Vec3 {
    if spread_rad <= MIN_SPREAD_RAD {
        return axis;
    }
    let s = spread_rad.min(1e3);
    let sine = axis.cross(w).length();
    // Integrals of the two terms against exp(-alpha^2 / (2 s^2)) on [0, pi/2].
    let cut = FRAC_PI_2 / s;
    let flat = sine * s * (PI / 2.0).sqrt() * pxfm::f_erff(cut * std::f32::consts::FRAC_1_SQRT_2);
    let cut_mass = -(-0.5 * cut * cut).exp_m1();
    let rising = s * s * cut_mass;
    let frame = Frame::from_normal(axis);
    loop {
        let alpha = if rng.unit() * (flat + rising) < flat {
            half_normal(s, rng)
        } else {
            (s * (-2.0 * (-rng.unit() * cut_mass).ln_1p()).sqrt()).min(FRAC_PI_2)
        };
        let (sin_a, cos_a) = alpha.sin_cos();
        let (sin_p, cos_p) = (TAU * rng.unit()).sin_cos();
        let t = frame.s * (sin_a * cos_p) + frame.t * (sin_a * sin_p) + axis * cos_a;
        if rng.unit() * (sine + alpha) < t.cross(w).length() {
            return t.normalize();
        }
    }
}

/// Half-normal of deviation `s`, cut at a right angle.
fn half_normal(s: f32, rng: &mut PathRng) -> f32 {
    loop {
        if s < 1.0 {
            let alpha = (s * rng.normal2().x).abs();
            if alpha <= FRAC_PI_2 {
                return alpha;
            }
        } else {
            let alpha = FRAC_PI_2 * rng.unit();
            let y = alpha / s;
            if rng.unit() < (-0.5 * y * y).exp() {
                return alpha;
            }
        }
    }
}

/// Samples a tangent of the population itself, regardless of the view: for tests, and
/// for the published form of virtual scattering.
pub fn tangent_sample(axis: Vec3, spread_rad: f32, rng: &mut PathRng) -> Vec3 {
    if spread_rad <= MIN_SPREAD_RAD {
        return axis;
    }
    let (sin_a, cos_a) = half_normal(spread_rad.min(1e3), rng).sin_cos();
    let (sin_p, cos_p) = (TAU * rng.unit()).sin_cos();
    let frame = Frame::from_normal(axis);
    (frame.s * (sin_a * cos_p) + frame.t * (sin_a * sin_p) + axis * cos_a).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proofs::*;
    use organza_basis::hypothesis::{chi_square as count_test, t_test};
    use organza_basis::{Mixture, Moments};

    #[test]
    fn cross_sections_match_an_independent_mean() {
        // By drawing tangents: shares neither table nor quadrature.
        let mut rng = PathRng::from_seed(41);
        let axis = Vec3::new(0.48, 0.36, 0.8);
        let across = axis.any_orthonormal_vector();
        for spread in [1e-3, 0.03, 0.2, 0.7, 3.0, 100.0] {
            for beta in [0.0f32, 0.02, 0.3, 1.0, 1.5] {
                let w = axis * beta.cos() + across * beta.sin();
                let m: Moments = (0..draws(20_000))
                    .map(|_| f64::from(tangent_sample(axis, spread, &mut rng).cross(w).length()))
                    .collect();
                let got = f64::from(effective_cross_section(beta.sin(), spread));
                let close = (got / m.mean - 1.0).abs() < 1e-3;
                let is_mean = close || !fails(t_test(&m, got), 30);
                assert!(is_mean, "seed 41, {spread} {beta}: {got} {m:?}");
            }
        }
    }

    #[test]
    fn the_table_follows_the_quadrature() {
        for spread in [0.0011, 0.0123, 0.057, 0.19, 0.44, 0.77, 1.31, 2.9, 17.0f64] {
            for i in 0..=50 {
                let sine = (f64::from(i) / 50.0).powi(2);
                let exact = mean_sine(sine, spread);
                let got = f64::from(effective_cross_section(sine as f32, spread as f32));
                let error = (got / exact - 1.0).abs();
                assert!(error < 1e-3, "{spread} {sine}: {got} {exact}");
            }
        }
    }

    #[test]
    fn limits_of_the_spread() {
        for i in 0..=10 {
            let sine = i as f32 / 10.0;
            assert_eq!(effective_cross_section(sine, 0.0), sine);
            assert!((effective_cross_section(sine, 1e-4) - sine).abs() < 1e-4);
            let wide = effective_cross_section(sine, f32::INFINITY);
            assert!(wide.is_finite() && wide > 0.6 && wide < 1.0);
        }
        // End-on the mean sine of a polar angle uniform on [0, 90] is 2 / pi.
        let end_on = effective_cross_section(0.0, f32::INFINITY);
        let off = (end_on - std::f32::consts::FRAC_2_PI).abs();
        assert!(off < 1e-3, "{end_on}");
    }

    fn pdf(axis: Vec3, spread: f32, w: Vec3, t: Vec3) -> f64 {
        // p(alpha) / (2 pi sin(alpha)) over the hemisphere, times what is seen.
        let alpha = f64::from(axis.cross(t).length()).atan2(f64::from(axis.dot(t)));
        if alpha > std::f64::consts::FRAC_PI_2 {
            return 0.0;
        }
        let s = f64::from(spread);
        let norm = s
            * (std::f64::consts::PI / 2.0).sqrt()
            * pxfm::f_erf(std::f64::consts::FRAC_PI_2 / (s * std::f64::consts::SQRT_2));
        let p = (-0.5 * (alpha / s).powi(2)).exp() / norm;
        let seen = f64::from(t.cross(w).length());
        let sine = axis.cross(w).length();
        let mean = f64::from(effective_cross_section(sine, spread));
        p / (std::f64::consts::TAU * alpha.sin().max(1e-9)) * seen / mean
    }

    #[test]
    fn tangents_are_drawn_as_they_are_seen() {
        let mut rng = PathRng::from_seed(42);
        let axis = Vec3::new(-0.6, 0.64, -0.48);
        for spread in [0.05f32, 0.3, 1.2, 8.0] {
            let mut edges = vec![-1.0];
            // Cells equal in polar angle out to where the population ends.
            let reach = (6.0 * spread).min(FRAC_PI_2);
            let angles = (0..=18).rev().map(|i| reach * i as f32 / 18.0);
            edges.extend(angles.map(|angle| f64::from(angle).cos()));
            if edges[1] < 1e-6 {
                edges[1] = 0.0;
            }
            let grid =
                organza_basis::hypothesis::SphereGrid::with_edges(axis, edges, 16).admitting(2e-3);
            for w in [
                Vec3::new(0.48, 0.36, 0.8),
                axis,
                -(axis + 0.05 * Vec3::X).normalize(),
            ] {
                let v = grid.chi_square(
                    draws(40_000),
                    || Some(visible_tangent_sample(axis, spread, w, &mut rng)),
                    |t| pdf(axis, spread, w, t),
                );
                assert!(!fails(v, 12), "seed 42, {spread} {w}: {v:?}");
            }
            // The published rule, blind to what is seen, is not that density.
            let w = (axis + 0.3 * Vec3::X).normalize();
            let blind = grid.chi_square(
                draws(40_000),
                || Some(tangent_sample(axis, spread, &mut rng)),
                |t| pdf(axis, spread, w, t),
            );
            assert!(blind.p_value < 1e-6, "seed 42, {spread}: {blind:?}");
        }
    }

    fn two_populations() -> Mixture {
        let mut mixture = Mixture::EMPTY;
        let population = |axis: Vec3, density, spread_rad| FibrePopulation {
            length_density_per_mm2: density,
            axis: axis.normalize(),
            spread_rad,
            radius_mm: 0.01,
            material: 0,
            yarn: 0,
        };
        mixture.push(population(Vec3::new(1.0, 0.2, 0.1), 900.0, 0.1));
        mixture.push(population(Vec3::new(0.1, 1.0, -0.3), 300.0, 0.4));
        mixture.push(population(Vec3::Z, 0.0, 0.4));
        mixture
    }

    #[test]
    fn populations_are_met_in_proportion_to_their_extinction() {
        let mixture = two_populations();
        let mut rng = PathRng::from_seed(43);
        for w in oblique().into_iter().chain([Vec3::X]) {
            let total = sigma_t_per_mm(&mixture, w);
            assert!(total > 0.0 && total <= mixture.broadside_per_mm());
            let n = draws(20_000);
            let mut counts = [0u64; 3];
            for _ in 0..n {
                counts[meet_fibre(&mixture, w, &mut rng).unwrap().population] += 1;
            }
            let expected = [0, 1, 2].map(|i| {
                let c = &mixture.as_slice()[i];
                f64::from(n) * f64::from(population_sigma_t_per_mm(c, w) / total)
            });
            let v = count_test(&counts, &expected);
            assert!(!fails(v, 6), "seed 43, {w}: {counts:?} {expected:?}");
            // By density, as published, X would meet the first three times in four.
            let by_density = [0.75, 0.25, 0.0].map(|k| k * f64::from(n));
            let p_value = count_test(&counts, &by_density).p_value;
            assert!(p_value < 1e-6 || expected[0] > 0.7 * f64::from(n));
        }
        assert_eq!(meet_fibre(&Mixture::EMPTY, Vec3::X, &mut rng), None);
    }

    #[test]
    fn parallel_fibres_block_as_smooth_micro_flakes_do() {
        use crate::{AxialFlake, MicroFlake};
        let mut mixture = Mixture::EMPTY;
        mixture.push(FibrePopulation {
            length_density_per_mm2: 50.0,
            axis: Vec3::new(0.6, 0.0, 0.8),
            spread_rad: 0.0,
            radius_mm: 0.01,
            material: 0,
            yarn: 0,
        });
        let flake = AxialFlake::new(Vec3::new(0.6, 0.0, 0.8), 0.0);
        for w in hard_directions(Vec3::new(0.6, 0.0, 0.8)) {
            let (a, b) = (sigma_t_per_mm(&mixture, w), flake.projected_area(w));
            assert!((a - b).abs() < 2e-3, "{w}: {a} {b}");
            let mut rng = PathRng::from_seed(1);
            assert!(meet_fibre(&mixture, w, &mut rng).is_none_or(|f| f.population == 0));
        }
    }
}
