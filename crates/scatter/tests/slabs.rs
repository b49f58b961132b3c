//! Whole walks through slabs, made of this crate alone: media that are proved
//! event by event must also be reciprocal and agree with references as a whole.
//! `ORGANZA_FULL=1` takes forty times the paths; `--nocapture` shows figures.

use glam::Vec3;
use organza_basis::hypothesis::{sidak, welch_test, z_test};
use organza_basis::{FibrePopulation, Mixture, Moments, PathRng, Rgb};
use organza_scatter::virtual_fibres::tangent_sample;
use organza_scatter::{
    AxialFlake, BandFlakes, DiffuseFlake, Fibre, GaussianBand, Lobe, LobeSample, MicroFlake, Sggx,
    SpecularFlakes, meet_fibre, sigma_t_per_mm,
};
use organza_testing::{dielectric_fibre, fitted_fibre, sized};

fn draws(small: u64) -> u64 {
    sized(small, 40 * small)
}

/// A homogeneous medium, as a tracker sees it.
trait Medium {
    fn sigma_t_per_mm(&self, w: Vec3) -> f32;
    /// Scattered light per radiance from `light`, and the next direction, of one
    /// event met from `w_out`.
    fn event(&self, w_out: Vec3, light: Vec3, rng: &mut PathRng) -> (Rgb, Option<LobeSample>);
}

fn both(
    lobe: &impl Lobe,
    w_out: Vec3,
    light: Vec3,
    rng: &mut PathRng,
) -> (Rgb, Option<LobeSample>) {
    (lobe.eval(w_out, light), lobe.sample(w_out, rng))
}

struct Mirrors<F>(f32, SpecularFlakes<F>);

impl<F: MicroFlake> Medium for Mirrors<F> {
    fn sigma_t_per_mm(&self, w: Vec3) -> f32 {
        self.0 * self.1.flakes.projected_area(w)
    }
    fn event(&self, w_out: Vec3, light: Vec3, rng: &mut PathRng) -> (Rgb, Option<LobeSample>) {
        both(&self.1, w_out, light, rng)
    }
}

fn mirrors<F>(density: f32, flakes: F) -> Mirrors<F> {
    let albedo = ALBEDO;
    Mirrors(density, SpecularFlakes { flakes, albedo })
}

struct Diffuse<F>(f32, F, Rgb);

impl<F: MicroFlake> Medium for Diffuse<F> {
    fn sigma_t_per_mm(&self, w: Vec3) -> f32 {
        self.0 * self.1.projected_area(w)
    }
    fn event(&self, w_out: Vec3, light: Vec3, rng: &mut PathRng) -> (Rgb, Option<LobeSample>) {
        let flake = DiffuseFlake::meet(&self.1, self.2, w_out, rng);
        both(&flake, w_out, light, rng)
    }
}

struct VirtualFibres {
    mixture: Mixture,
    fibre: Fibre,
    as_published: bool,
}

impl Medium for VirtualFibres {
    fn sigma_t_per_mm(&self, w: Vec3) -> f32 {
        sigma_t_per_mm(&self.mixture, w)
    }
    fn event(&self, w_out: Vec3, light: Vec3, rng: &mut PathRng) -> (Rgb, Option<LobeSample>) {
        let tangent = if self.as_published {
            // Algorithm 6: by density, whoever sees it.
            let all = self.mixture.as_slice().iter();
            let all: f32 = all.map(|c| c.length_density_per_mm2).sum();
            let mut left = rng.unit() * all;
            let met = self.mixture.as_slice().iter().find(|c| {
                left -= c.length_density_per_mm2;
                left < 0.0
            });
            let c = met.unwrap_or(&self.mixture.as_slice()[0]);
            tangent_sample(c.axis, c.spread_rad, rng)
        } else {
            meet_fibre(&self.mixture, w_out, rng).unwrap().tangent
        };
        both(&self.fibre.far_field(tangent), w_out, light, rng)
    }
}

/// Radiance toward `view` of a slab from z = 0 down to -thickness under a
/// directional light of unit irradiance across it, over the cosine of the light:
/// the slab's BSDF. Both directions point away from the slab.
fn bsdf(
    medium: &dyn Medium,
    thickness: f32,
    light: Vec3,
    view: Vec3,
    n: u64,
    stream: u64,
) -> [Moments; 3] {
    let mut sums = [Moments::default(); 3];
    let sigma_light = medium.sigma_t_per_mm(light);
    for i in 0..n {
        let mut rng = PathRng::new(81, stream, i);
        let mut z = if view.z > 0.0 { 0.0 } else { -thickness };
        let mut w_out = view;
        let mut throughput = Rgb::WHITE;
        let mut radiance = Rgb::BLACK;
        for _ in 0..5000 {
            z -= w_out.z * rng.exponential() / medium.sigma_t_per_mm(w_out);
            if !(-thickness..=0.0).contains(&z) {
                break;
            }
            let (f, next) = medium.event(w_out, light, &mut rng);
            let way = if light.z > 0.0 { -z } else { z + thickness } / light.z.abs();
            radiance += throughput * f * (-sigma_light * way).exp();
            let Some(s) = next else { break };
            throughput *= s.weight;
            w_out = -s.w_in;
            let survive = throughput.max_component().min(1.0);
            if rng.unit() >= survive {
                break;
            }
            throughput *= 1.0 / survive;
        }
        let f = radiance / light.z.abs();
        for (sum, x) in sums.iter_mut().zip(f.0.to_array()) {
            sum.add(f64::from(x));
        }
    }
    sums
}

fn direction(theta_deg: f32, phi_deg: f32) -> Vec3 {
    organza_basis::warp::direction_from_angles(theta_deg.to_radians(), phi_deg.to_radians())
}

const AXIS: Vec3 = Vec3::new(0.6, 0.64, -0.48);
const ALBEDO: Rgb = Rgb::new(0.95, 0.8, 0.5);

fn two_populations(as_published: bool) -> VirtualFibres {
    let mut mixture = Mixture::EMPTY;
    for (axis, density, spread_rad) in [(Vec3::X, 600.0, 0.15), (AXIS, 300.0, 0.4)] {
        mixture.push(FibrePopulation {
            length_density_per_mm2: density,
            axis,
            spread_rad,
            radius_mm: 0.008,
            ..Default::default()
        });
    }
    VirtualFibres {
        mixture,
        fibre: dielectric_fibre(Rgb::new(0.01, 0.05, 0.2), 0.15, 0.3),
        as_published,
    }
}

/// Swapping light and view changes nothing, for every kind of medium: the walk,
/// the extinction and the values agree with one another. It does change the
/// published virtual scattering.
#[test]
fn slabs_are_reciprocal() {
    let axial = AxialFlake::new(AXIS, 0.25);
    let band = BandFlakes::new(AXIS, GaussianBand::new(0.2));
    let fitted = VirtualFibres {
        fibre: fitted_fibre("gabardine"),
        ..two_populations(false)
    };
    let matrix = Sggx::new(axial.matrix());
    let media: [(&str, Box<dyn Medium>); 7] = [
        ("specular", Box::new(mirrors(10.0, axial))),
        ("matrix", Box::new(mirrors(10.0, matrix))),
        ("band", Box::new(mirrors(15.0, band))),
        ("diffuse", Box::new(Diffuse(10.0, axial, ALBEDO))),
        ("virtual", Box::new(two_populations(false))),
        ("fitted", Box::new(fitted)),
        ("as published", Box::new(two_populations(true))),
    ];
    let pairs = [
        (direction(20.0, 10.0), direction(55.0, 200.0)),
        (direction(60.0, 80.0), direction(150.0, 30.0)),
    ];
    let n = draws(12_000);
    let alpha = sidak(1e-3, 3 * pairs.len() * media.len());
    for (name, medium) in &media {
        let mut least = 1.0f64;
        for (a, b) in pairs {
            let there = bsdf(medium.as_ref(), 0.3, a, b, n, 0);
            let back = bsdf(medium.as_ref(), 0.3, b, a, n, 1);
            for (x, y) in there.iter().zip(&back) {
                least = least.min(welch_test(x, y).p_value);
            }
            println!("{name}: {:.4} {:.4}", there[0].mean, back[0].mean);
        }
        if *name == "as published" {
            // Margin: the smaller, the clearer is the rejection.
            assert!(least < 1e-6, "seed 81, {name}: {least}");
        } else {
            assert!(least > alpha, "seed 81, {name}: {least}");
        }
    }
}

/// How far the published choice of fibres is off, in reflected radiance.
#[test]
fn the_published_choice_is_biased() {
    let (right, published) = (two_populations(false), two_populations(true));
    let n = draws(8_000);
    let mut worst = 0.0f64;
    for (light, view) in [
        (direction(10.0, 0.0), direction(60.0, 180.0)),
        (direction(60.0, 0.0), direction(30.0, 0.0)),
        (direction(70.0, 90.0), direction(50.0, 270.0)),
    ] {
        let a = bsdf(&right, 0.3, light, view, n, 2);
        let b = bsdf(&published, 0.3, light, view, n, 3);
        println!(
            "{light} {view}: {:.4} as published {:.4}",
            a[0].mean, b[0].mean
        );
        worst = worst.max((b[0].mean / a[0].mean - 1.0).abs());
    }
    assert!(worst > 0.03, "seed 81: {worst}");
}

/// A slab of SGGX fibres against a walk in double precision
/// (`tests/peers/slab_f64.py`), within the errors of both.
#[test]
fn a_slab_of_flakes_matches_a_walk_in_double_precision() {
    let table = include_str!("../../../tests/data/slab_f64.csv");
    let medium = mirrors(20.0, AxialFlake::new(Vec3::X, 0.2));
    let rows = organza_testing::csv_numbers(table);
    assert_eq!(rows.len(), 16);
    for (row, v) in rows.iter().enumerate() {
        let way = |k: usize| direction(v[k] as f32, v[k + 1] as f32);
        let got = bsdf(&medium, 0.3, way(0), way(2), draws(10_000), 10 + row as u64);
        for (channel, m) in got.iter().enumerate() {
            let error = (m.variance() / m.count as f64).sqrt().hypot(v[7 + channel]);
            let z = z_test(m.mean, v[4 + channel], error);
            println!("{v:?}: {:.5}, {:+.2} errors", m.mean, z.statistic);
            let (mean, errors) = (m.mean, z.statistic);
            let is_near = z.p_value > sidak(1e-3, 48);
            assert!(is_near, "seed 81, {v:?}: {mean} is {errors} errors off");
        }
    }
}
