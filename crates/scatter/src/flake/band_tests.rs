use super::*;
use crate::flake::sine_power_from_gamma;
use crate::proofs::*;
use crate::{AxialFlake, GaussianBand, SineBand};
use organza_basis::Moments;
use std::f32::consts::PI;

fn gaussian(axis: Vec3, gamma: f32) -> BandFlakes<GaussianBand> {
    BandFlakes::new(axis, GaussianBand::new(gamma))
}

const AXES: [Vec3; 2] = [Vec3::new(0.6, -0.64, 0.48), Vec3::new(0.0, 0.8, 0.6)];

#[test]
fn gaussian_bands_are_proved() {
    for (axis, gamma) in [(AXES[0], 0.1), (AXES[1], 0.4), (AXES[0], 10.0)] {
        let (name, flakes) = (format!("gaussian {gamma}"), gaussian(axis, gamma));
        prove_flakes(&name, &flakes, axis, 1e-3);
    }
}

#[test]
fn sine_bands_are_proved() {
    for (axis, p) in [(AXES[0], 60.0), (AXES[1], 3.0), (AXES[0], 0.0)] {
        let flakes = BandFlakes::new(axis, SineBand::new(p));
        prove_flakes(&format!("sine {p}"), &flakes, axis, 1e-3);
    }
}

#[test]
fn areas_match_quadrature_at_every_width() {
    for gamma in [1e-3, 0.004, 0.013, 0.05, 0.11, 0.37, 0.9, 2.1, 9.0] {
        let g = |x: f64| (-0.5 * (x / gamma).powi(2)).exp();
        let p = 1.0 / (gamma * gamma);
        let power = |x: f64| (1.0 - x * x).max(0.0).powf(0.5 * p);
        let reach = (10.0 * gamma).min(1.0);
        for i in 0..=60 {
            let sine = (f64::from(i) / 60.0).powi(2);
            for (exact, got) in [
                (
                    band_area(sine, reach, g),
                    GaussianBand::new(gamma as f32).projected_area(sine as f32),
                ),
                (
                    band_area(sine, reach, power),
                    SineBand::new(p as f32).projected_area(sine as f32),
                ),
            ] {
                let error = (f64::from(got) / exact - 1.0).abs();
                assert!(error < 1e-3, "{gamma} {sine}: {got} {exact} {error}");
            }
        }
    }
}

#[test]
fn limits_of_the_width() {
    for i in 0..=20 {
        let sine = i as f32 / 20.0;
        let thin = GaussianBand::new(1e-4).projected_area(sine);
        assert!((thin - FRAC_2_PI * sine).abs() < 2e-4, "{sine} {thin}");
        assert!((GaussianBand::new(1e4).projected_area(sine) - 0.5).abs() < 2e-4);
        assert!((SineBand::new(0.0).projected_area(sine) - 0.5).abs() < 2e-4);
    }
}

/// Narrow normals resolved by cells that follow them.
#[test]
fn narrow_bands_are_sampled_exactly_at_bounded_cost() {
    let axis = AXES[0];
    let gamma = 1e-3f32;
    let flakes = gaussian(axis, gamma);
    let mut edges = vec![-1.0];
    edges.extend((-20..=20).map(|i| f64::from(i) * 0.35 * f64::from(gamma)));
    edges.push(1.0);
    let grid = organza_basis::hypothesis::SphereGrid::with_edges(axis, edges, 16).admitting(1e-3);
    let mut rng = PathRng::from_seed(31);
    let nearly_along = (axis + 1e-3 * Vec3::new(0.1, 0.7, 0.2)).normalize();
    for w in [oblique()[0], axis, nearly_along] {
        let start = rng.clone();
        let v = grid.chi_square(
            draws(40_000),
            || Some(flakes.visible_normal_sample(w, &mut rng)),
            |m| f64::from(flakes.visible_normal_pdf(w, m)),
        );
        assert!(!fails(v, 3), "seed 31, {w}: {v:?} from {start:?}");
    }
    // Acceptance is the area over the bound that is drawn from.
    for gamma in [1e-3, 0.01, 0.1, 1.0] {
        let band = GaussianBand::new(gamma);
        for i in 0..=50 {
            let angle = i as f32 / 50.0 * 0.5 * PI;
            let (s, c) = angle.sin_cos();
            let accept = band.projected_area(s) / (c * band.mean_abs() + FRAC_2_PI * s);
            assert!(accept > 0.6 && accept < 1.001, "{gamma} {angle}: {accept}");
        }
    }
}

#[test]
fn a_wrong_width_is_rejected() {
    let axis = AXES[0];
    let (flakes, off) = (gaussian(axis, 0.2), gaussian(axis, 0.21));
    let w = oblique()[1];
    let mut rng = PathRng::from_seed(32);
    let sample = || Some(flakes.sample(w, &mut rng));
    let v = chi_square(axis, 60_000, sample, |w_in| f64::from(off.eval(w, w_in)));
    assert!(v.p_value < 1e-6, "seed 32: {v:?}");
}

#[test]
fn the_value_straight_on_is_the_mean_around_it() {
    for w in oblique() {
        let f = Frame::from_normal(w);
        let around = |flakes: &dyn Fn(Vec3) -> f32| -> Moments {
            (0..20_000)
                .map(|i| {
                    let phi = (i as f32 + 0.5) / 20_000.0 * TAU;
                    f64::from(flakes(f.s * phi.cos() + f.t * phi.sin()))
                })
                .collect()
        };
        let g = gaussian(AXES[0], 0.08);
        let s = BandFlakes::new(AXES[0], SineBand::new(150.0));
        let steep = BandFlakes::new(AXES[0], SineBand::new(900.0));
        let near = |got: f32, mean: f64, tolerance: f64| {
            let off = (f64::from(got) - mean).abs();
            assert!(off < tolerance * mean, "{w}: {got} {mean}");
        };
        near(g.ndf_mean_across(w), around(&|m| g.ndf(m)).mean, 1e-4);
        near(s.ndf_mean_across(w), around(&|m| s.ndf(m)).mean, 1e-4);
        near(
            steep.ndf_mean_across(w),
            around(&|m| steep.ndf(m)).mean,
            2e-3,
        );
    }
}

#[test]
fn conversions_keep_the_stated_errors() {
    let worst = |a: &dyn Fn(f32) -> f32, b: &dyn Fn(f32) -> f32| {
        (0..=100)
            .map(|i| i as f32 / 100.0)
            .map(|sine| (a(sine) - b(sine)).abs())
            .fold(0.0, f32::max)
    };
    let axial = |flake: AxialFlake, sine: f32| {
        flake.projected_area(Vec3::new(sine, 0.0, (1.0 - sine * sine).sqrt()))
    };
    // SGGX flakes with the same ratio of end-on to broadside area, and the factor
    // that keeps the broadside one.
    fn as_sggx(profile: &impl BandProfile) -> (AxialFlake, f32) {
        let flake = AxialFlake::new(Vec3::Z, profile.end_on_ratio());
        (flake, profile.projected_area(1.0))
    }
    for gamma in [1e-3, 0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 3.0] {
        let band = gaussian(Vec3::Z, gamma);
        let (flake, scale) = as_sggx(&band.profile);
        let e = worst(&|s| band.profile.projected_area(s) / scale, &|s| {
            axial(flake, s)
        });
        assert!(e < 0.015, "gaussian {gamma}: {e}");
        let back = GaussianBand::with_end_on_ratio(flake.end_on()).gamma();
        if gamma > 0.002 && gamma < 1.5 {
            let off = (back / gamma - 1.0).abs();
            assert!(off < 4.0 * f32::EPSILON, "{gamma} {back}");
        }
        let sine = BandFlakes::new(Vec3::Z, SineBand::new(sine_power_from_gamma(gamma)));
        let (flake, scale) = as_sggx(&sine.profile);
        let e = worst(&|s| sine.profile.projected_area(s) / scale, &|s| {
            axial(flake, s)
        });
        assert!(e < 0.02, "sine {gamma}: {e}");
        if gamma <= 0.3 {
            let scale = band.profile.projected_area(1.0);
            let e = worst(&|s| band.profile.projected_area(s) / scale, &|s| {
                sine.profile.projected_area(s) / scale
            });
            assert!(e < 0.04, "gamma {gamma} to sine power: {e}");
        }
    }
}

/// The phase function from its definition in double precision, from the
/// narrowest width to the widest; normals are drawn, so that the half vectors
/// lie where the flakes are.
#[test]
fn phase_functions_follow_double_precision() {
    fn worst<P: BandProfile>(profile: P, gamma: f64, g: impl Fn(f64) -> f64) -> f64 {
        let axis = AXES[0].normalize();
        let t = axis.as_dvec3().normalize();
        let reach = (10.0 * gamma).min(1.0);
        let mass = 2.0 * integrate(0.0, reach, 1e-10 * reach, &g);
        let flakes = BandFlakes::new(axis, profile);
        let mut rng = PathRng::from_seed(45);
        let mut worst = 0.0f64;
        let hard = hard_directions(axis);
        for i in 0..400 {
            let w_out = match hard.get(i) {
                Some(&w) => w,
                None => organza_basis::warp::uniform_sphere(rng.unit2()),
            };
            let w_in = flakes.sample(w_out, &mut rng);
            let (o, n) = (w_out.as_dvec3().normalize(), w_in.as_dvec3().normalize());
            let h = o + n;
            if h.length() < 1e-2 {
                continue;
            }
            let x = t.dot(h.normalize());
            // Half vectors carry the rounding of their directions: what it
            // makes of a value this steep is not the model's error.
            let rounding = 3e-7 / h.length() * (x.abs() / (gamma * gamma) + 1.0 / gamma);
            let area = band_area(t.cross(o).length(), reach, &g);
            let exact = g(x) / mass / std::f64::consts::TAU * 0.5 / area;
            let error = (f64::from(flakes.eval(w_out, w_in)) / exact - 1.0).abs();
            worst = worst.max((error - rounding).max(0.0));
        }
        worst
    }
    for gamma in [1e-4, 1e-3, 0.02, 0.3, 10.0f64] {
        let g = |x: f64| (-0.5 * (x / gamma).powi(2)).exp();
        let error = worst(GaussianBand::new(gamma as f32), gamma, g);
        println!("gaussian {gamma}: {error:.2e}");
        assert!(error < 2e-3, "seed 45, gaussian {gamma}: {error}");
        let p = 1.0 / (gamma * gamma);
        let g = |x: f64| (0.5 * p * (-x * x).max(-1.0 + 1e-300).ln_1p()).exp();
        let error = worst(SineBand::new(p as f32), gamma, g);
        println!("sine {p}: {error:.2e}");
        assert!(error < 2e-3, "seed 45, sine power {p}: {error}");
    }
}
