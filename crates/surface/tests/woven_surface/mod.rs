//! The whole cloth: means, energy, reciprocity, sampling.

mod sampling;

use glam::{Vec2, Vec3};
use organza_basis::{Moments, PathRng, Rgb, warp};
use organza_scatter::{Footprint, Passage, Surface};
use organza_surface::spec::{NoiseSpec, PRESETS, ShadowingSpec, TransmissionSpec};
use organza_surface::{SurfaceSpec, WovenSurface};

fn preset(name: &str) -> SurfaceSpec {
    SurfaceSpec::preset(name).unwrap()
}

fn names() -> impl Iterator<Item = &'static str> {
    PRESETS.iter().map(|(name, _)| *name)
}

fn direction(theta_deg: f32, phi_deg: f32) -> Vec3 {
    warp::direction_from_angles(theta_deg.to_radians(), phi_deg.to_radians())
}

/// Ten times the work when asked for.
fn full(n: usize) -> usize {
    organza_testing::sized(n, 10 * n)
}

/// What an arriving ray is multiplied by.
fn weight(passage: Option<Passage>) -> Rgb {
    match passage {
        Some(Passage::Straight) => Rgb::WHITE,
        Some(Passage::Scattered(s)) => s.weight,
        None => Rgb::BLACK,
    }
}

fn see_through() -> TransmissionSpec {
    TransmissionSpec {
        warp_cover: 0.8,
        weft_cover: 0.7,
        diffuse: Rgb::new(0.1, 0.08, 0.05),
        forward: Rgb::new(0.15, 0.1, 0.05),
        concentration: 6.0,
    }
}

#[test]
fn the_mean_of_the_texture_is_the_reflectance() {
    // Equation 8.4 over the repeat, noise off: enough points that their own error
    // is below 3e-3 of the value.
    let mut rng = PathRng::from_seed(41);
    for name in names() {
        for shadowed in [false, true] {
            let mut spec = preset(name);
            spec.noise = None;
            for yarn in [&mut spec.warp, &mut spec.weft] {
                yarn.u_max_noise_own_deg = None;
                yarn.u_max_noise_cross_deg = None;
            }
            spec.shadowing = shadowed.then_some(ShadowingSpec {
                warp_above_weft_mm: 0.03,
            });
            let cloth = spec.build().unwrap();
            let period = cloth.period_mm();
            for _ in 0..full(2) {
                let w_in = warp::cosine_hemisphere(rng.unit2());
                let w_out = warp::cosine_hemisphere(rng.unit2());
                let n = 200_000;
                let mut sum = [0.0f64; 3];
                for k in 0..n {
                    // Lattice of the plastic number [Roberts2018].
                    let k = f64::from(k);
                    let at = [0.754_877_666_246_692_7 * k, 0.569_840_290_998_053_3 * k];
                    let at = Vec2::new(at[0].fract() as f32, at[1].fract() as f32);
                    let value: [f32; 3] = cloth
                        .eval(w_out, w_in, Footprint::point(at * period))
                        .into();
                    for (sum, v) in sum.iter_mut().zip(value) {
                        *sum += f64::from(v);
                    }
                }
                let mean = Rgb::from(sum.map(|s| (s / f64::from(n)) as f32));
                let exact = cloth.eval(w_out, w_in, Footprint::FAR);
                let error = (mean - exact).0.abs().max_element();
                // Margin: the full test draws more directions, of which some come nearer to the bound.
                let most = 6e-3 * exact.max_component() + 1e-6;
                assert!(error < most, "{name} seed 41: {mean:?} {exact:?}");
            }
        }
    }
}

#[test]
fn noise_keeps_the_mean() {
    let mut rng = PathRng::from_seed(42);
    for name in names() {
        // A short period, so that few repeats hold many independent yarns.
        let mut spec = preset(name);
        spec.noise = Some(NoiseSpec {
            grain_mm: spec.noise.as_ref().map_or(0.0, |n| n.grain_mm),
            period_mm: 1.0,
        });
        let cloth = spec.build().unwrap();
        for _ in 0..full(2) {
            let w_in = warp::cosine_hemisphere(rng.unit2());
            let w_out = warp::cosine_hemisphere(rng.unit2());
            // Batches of places far apart are independent.
            let mut moments = Moments::default();
            for _ in 0..300 {
                let corner = 2e3 * rng.unit2();
                let mut sum = 0.0;
                for _ in 0..400 {
                    let at = corner + 3.0 * rng.unit2();
                    sum += cloth.eval(w_out, w_in, Footprint::point(at)).mean();
                }
                moments.add(f64::from(sum / 400.0));
            }
            let exact = f64::from(cloth.eval(w_out, w_in, Footprint::FAR).mean());
            let error = (moments.mean - exact).abs();
            let bound = 4.0 * moments.standard_error() + 2e-3 * exact;
            assert!(error < bound, "{name} seed 42: {error} {bound} {exact}");
        }
    }
}

#[test]
fn nothing_returns_more_light_than_it_gets() {
    for name in names() {
        for transmission in [None, Some(see_through())] {
            let mut spec = preset(name);
            spec.transmission = transmission;
            let cloth = spec.build().unwrap();
            for side in [1.0, -1.0] {
                for (theta, phi) in [
                    (0.0, 0.0),
                    (60.0, 20.0),
                    (80.0, 90.0),
                    (89.0, 0.0),
                    (89.0, 77.0),
                ] {
                    let w_out = direction(theta, phi) * Vec3::new(1.0, 1.0, side);
                    // Furnace: all that is sampled under uniform light, gaps too.
                    let mut rng = PathRng::from_seed(43);
                    let mut furnace = Moments::default();
                    for _ in 0..full(4000) {
                        let passage = cloth.pass_or_sample(w_out, Footprint::FAR, &mut rng);
                        furnace.add(f64::from(weight(passage).max_component()));
                    }
                    let most = 1.0 + 4.0 * furnace.standard_error();
                    assert!(furnace.mean < most, "{name} seed 43: {}", furnace.mean);
                }
            }
        }
    }
    let mut bright = preset("wool-gabardine");
    bright.warp.diffuse = Some(Rgb::splat(0.9));
    let message = bright.build().unwrap_err().to_string();
    assert!(message.contains("lower diffuse"), "{message}");
}

/// Without highlights, half reflected and half passed on, a cloth with holes loses
/// only what the model's rule for yarn that two directions share takes away: light
/// from `w_in` is lost where its gap is wider than that of `w_out`. The share kept,
/// `1 - E[max(gap(w_in) - gap(w_out), 0)]` over the cosine, needs gaps alone.
#[test]
fn a_lossless_cloth_keeps_all_light() {
    let cloth = |diffuse: f32| {
        let mut spec = preset("polyester-lining");
        for yarn in [&mut spec.warp, &mut spec.weft] {
            yarn.specular = Some(Rgb::BLACK);
            yarn.diffuse = Some(Rgb::splat(diffuse));
        }
        spec.transmission = Some(TransmissionSpec {
            warp_cover: 0.6,
            weft_cover: 0.6,
            diffuse: Rgb::splat(0.5),
            forward: Rgb::BLACK,
            concentration: 1.0,
        });
        spec.build().unwrap()
    };
    let (lossless, twin) = (cloth(0.5), cloth(0.48));
    let gap = |w: Vec3| f64::from(lossless.gap(w, Footprint::FAR));
    let n = 400;
    let kept = |w_out: Vec3| {
        let lost = |i: u32, j: u32| {
            let u = Vec2::new(i as f32 + 0.5, j as f32 + 0.5) / n as f32;
            (gap(warp::cosine_hemisphere(u)) - gap(w_out)).max(0.0)
        };
        let sum: f64 = (0..n).flat_map(|j| (0..n).map(move |i| lost(i, j))).sum();
        1.0 - sum / f64::from(n * n)
    };
    let seen = |cloth: &WovenSurface, w_out: Vec3| {
        let mut rng = PathRng::from_seed(44);
        let mut m = Moments::default();
        for _ in 0..full(40_000) {
            let passage = cloth.pass_or_sample(w_out, Footprint::FAR, &mut rng);
            m.add(f64::from(weight(passage).mean()));
        }
        m
    };
    for theta in [0.0, 40.0, 70.0, 85.0] {
        let w_out = direction(theta, 30.0);
        let expected = kept(w_out);
        assert!((0.9..=1.0).contains(&expected), "{theta}: {expected}");
        let off = |m: &Moments| (m.mean - expected).abs() - 4.0 * m.standard_error() - 5e-4;
        let m = seen(&lossless, w_out);
        // Margin: what exceeds four standard errors is negative.
        assert!(off(&m) < 0.0, "{theta}, seed 44: {m:?} for {expected}");
        // A cloth that absorbs a fiftieth of what it reflects is found.
        let m = seen(&twin, w_out);
        assert!(off(&m) > 0.0, "{theta}, seed 44: the twin passed: {m:?}");
    }
}

#[test]
fn light_takes_the_same_way_back() {
    for name in names() {
        let mut spec = preset(name);
        spec.transmission = Some(see_through());
        spec.shadowing = Some(ShadowingSpec {
            warp_above_weft_mm: -0.04,
        });
        let cloth = spec.build().unwrap();
        let mut rng = PathRng::from_seed(47);
        for _ in 0..300 {
            let w_in = warp::uniform_sphere(rng.unit2());
            let w_out = warp::uniform_sphere(rng.unit2());
            let at = Footprint::point(3.0 * rng.unit2());
            for at in [at, Footprint::FAR] {
                let (there, back) = (cloth.eval(w_out, w_in, at), cloth.eval(w_in, w_out, at));
                let error = (there - back).0.abs().max_element();
                let most = 4.0 * f32::EPSILON * (1.0 + there.max_component());
                assert!(error <= most, "{name} seed 47");
            }
        }
    }
}

#[test]
fn hard_directions_are_survived() {
    for name in names() {
        let mut spec = preset(name);
        spec.transmission = Some(see_through());
        let cloth = spec.build().unwrap();
        let mut directions = vec![
            Vec3::Z,
            Vec3::NEG_Z,
            Vec3::X,
            Vec3::Y,
            Vec3::ZERO,
            Vec3::NAN,
        ];
        for theta in [1e-3, 45.0, 89.9, 90.0, 90.1, 179.99] {
            for phi in [0.0, 30.0, 90.0, 180.0, 270.0] {
                directions.push(direction(theta, phi));
            }
        }
        let mut rng = PathRng::from_seed(49);
        for &w_in in &directions {
            for &w_out in &directions {
                for width_mm in [0.0, 0.5, f32::INFINITY] {
                    for position_mm in [Vec2::ZERO, Vec2::new(1e4, -1e4), Vec2::splat(-1e-9)] {
                        let at = Footprint::new(position_mm, width_mm);
                        let value = cloth.eval(w_out, w_in, at);
                        assert!(value.is_valid(), "{name} {w_in} {w_out} {value:?}");
                        let pdf = cloth.pdf(w_out, w_in, at);
                        assert!(pdf.is_finite() && pdf >= 0.0, "{name} {w_in} {w_out} {pdf}");
                        if let Some(s) = cloth.sample(w_out, at, &mut rng) {
                            assert!(s.weight.is_valid() && s.w_in.is_finite());
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn footprints_blend_from_texture_to_mean() {
    let cloth = preset("denim").build().unwrap();
    let (w_in, w_out) = (direction(30.0, 40.0), direction(20.0, 200.0));
    let repeat = cloth.period_mm().max_element();
    let position_mm = Vec2::new(0.3, 0.9);
    let mut before = cloth.eval(w_out, w_in, Footprint::point(position_mm));
    let range = (before - cloth.eval(w_out, w_in, Footprint::FAR))
        .0
        .length();
    for i in 0..=200 {
        let width_mm = repeat * i as f32 / 150.0;
        let here = cloth.eval(w_out, w_in, Footprint::new(position_mm, width_mm));
        let step = (here - before).0.length();
        assert!(step < 0.05 * range, "a step at {width_mm}");
        before = here;
    }
    assert_eq!(before, cloth.eval(w_out, w_in, Footprint::FAR));
}

#[test]
fn specular_albedo_is_what_the_file_says() {
    // White highlights on black yarn: bihemispherical albedo one before
    // scaling, here a half.
    for name in names() {
        let mut spec = preset(name);
        for yarn in [&mut spec.warp, &mut spec.weft] {
            yarn.diffuse = Some(Rgb::BLACK);
            yarn.specular = Some(Rgb::splat(0.25));
        }
        let cloth = spec.build().unwrap();
        let mut rng = PathRng::from_seed(50);
        let mut m = Moments::default();
        for _ in 0..full(20_000) {
            let w_in = warp::cosine_hemisphere(rng.unit2());
            let w_out = warp::cosine_hemisphere(rng.unit2());
            m.add(f64::from(
                cloth.eval(w_out, w_in, Footprint::FAR).mean() * std::f32::consts::PI,
            ));
        }
        let error = (m.mean - 0.25).abs();
        // Margin: most of the bound is four standard errors.
        let most = 4.0 * m.standard_error() + 1e-3;
        assert!(error < most, "{name} seed 50: {}", m.mean);
    }
}
