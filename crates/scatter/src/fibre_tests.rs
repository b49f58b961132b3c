use crate::cylinder::Crossing;
use crate::fitted::PRESETS;
use crate::proofs::*;
use crate::{
    DielectricFibre, DielectricParameters, Fibre, FibreFrame, FittedFibre, FittedParameters, Lobe,
    absorption_for_colour, meet_fibre,
};
use glam::{DVec3, Vec3};
use organza_basis::hypothesis::{SphereGrid, t_test};
use organza_basis::{FibrePopulation, Mixture, Moments, PathRng, Rgb, warp};

pub fn dielectric(ior: f32, absorption: f32, longitudinal_deg: f32, azimuthal_deg: f32) -> Fibre {
    let parameters = DielectricParameters {
        ior,
        absorption_radii: Rgb::new(absorption, 0.3, 2.0),
        longitudinal_rad: longitudinal_deg.to_radians(),
        azimuthal_rad: azimuthal_deg.to_radians(),
    };
    Fibre::Dielectric(DielectricFibre::new(parameters).unwrap())
}

pub fn fitted(name: &str) -> Fibre {
    let parameters = FittedParameters::preset(name).unwrap();
    Fibre::Fitted(FittedFibre::new(parameters).unwrap())
}

const TANGENT: Vec3 = Vec3::new(0.6, -0.64, 0.48);

#[test]
fn far_fields_are_proved() {
    for (name, fibre) in [
        ("clear", dielectric(1.55, 0.0, 6.0, 10.0)),
        ("rough", dielectric(1.46, 0.05, 15.0, 40.0)),
        ("cotton", fitted("cotton")),
        ("fleece", fitted("fleece")),
    ] {
        for w_out in oblique() {
            prove_lobe(name, &fibre.far_field(TANGENT), TANGENT, w_out, 20);
        }
    }
}

#[test]
fn near_fields_are_proved() {
    let mut rng = PathRng::from_seed(50);
    for (name, fibre) in [
        ("clear", dielectric(1.55, 0.0, 6.0, 10.0)),
        ("silk", fitted("silk")),
    ] {
        for (w_out, h) in oblique().into_iter().zip([-0.97, -0.4, 0.0, 0.3, 0.8]) {
            let near = fibre.near_field(FibreFrame::new(TANGENT, w_out), h);
            prove_lobe(name, &near, TANGENT, w_out, 40);
            prove_part(
                &format!("chosen {name}"),
                &near.choose_lobe(&mut rng),
                TANGENT,
                w_out,
                40,
            );
        }
    }
}

/// Fibres that lose nothing: the integral over the sphere is one for every
/// view, also along the fibre.
#[test]
fn clear_fibres_conserve_energy() {
    let white = FittedParameters {
        colour_tt: Rgb::WHITE,
        ..FittedParameters::preset("cotton").unwrap()
    };
    for (name, fibre) in [
        ("smooth", dielectric(1.55, 0.0, 2.0, 5.0)),
        ("middling", dielectric(1.55, 0.0, 8.0, 15.0)),
        ("rough", dielectric(1.4, 0.0, 25.0, 60.0)),
        ("fitted", Fibre::Fitted(FittedFibre::new(white).unwrap())),
    ] {
        for theta_deg in [0.0f32, 30.0, 60.0, 80.0, 88.0, 89.9] {
            let (sin, cos) = theta_deg.to_radians().sin_cos();
            let w_out = TANGENT * sin + TANGENT.any_orthonormal_vector() * cos;
            let lobe = fibre.far_field(TANGENT);
            let grid = SphereGrid::new(TANGENT, 60, 24);
            let albedo = grid.integrate(|w| f64::from(lobe.eval(w_out, w).0.x));
            let admitted = if theta_deg > 85.0 { 1e-2 } else { 1e-3 };
            assert!(
                (albedo - 1.0).abs() < admitted,
                "{name}, {theta_deg} degrees: {albedo}"
            );
        }
    }
}

#[test]
fn far_fields_are_reciprocal() {
    let mut rng = PathRng::from_seed(51);
    for fibre in [dielectric(1.55, 0.1, 8.0, 15.0), fitted("gabardine")] {
        let lobe = fibre.far_field(TANGENT);
        for _ in 0..2000 {
            let (a, b) = (
                warp::uniform_sphere(rng.unit2()),
                warp::uniform_sphere(rng.unit2()),
            );
            // Extinction toward each is the sine of its angle to the fibre.
            let there = lobe.eval(a, b) * TANGENT.cross(a).length();
            let back = lobe.eval(b, a) * TANGENT.cross(b).length();
            let off = (there - back).0.abs().max_element();
            assert!(
                off <= 1e-3 * there.max_component() + 1e-6,
                "seed 51, {a} {b}: {there:?} {back:?}"
            );
        }
    }
}

#[test]
fn the_far_field_is_the_mean_of_the_near() {
    let mut rng = PathRng::from_seed(52);
    let fibre = dielectric(1.55, 0.1, 8.0, 15.0);
    let far = fibre.far_field(TANGENT);
    let mut worst = 0.0f64;
    for _ in 0..100 {
        let w_out = warp::uniform_sphere(rng.unit2());
        let w_in = match far.sample(w_out, &mut rng) {
            Some(s) => s.w_in,
            None => continue,
        };
        let frame = FibreFrame::new(TANGENT, w_out);
        let n = 4000;
        let mean: Moments = (0..n)
            .map(|i| {
                let h = (2.0 * (i as f32 + 0.5) / n as f32 - 1.0).clamp(-1.0, 1.0);
                f64::from(fibre.near_field(frame, h).eval(w_out, w_in).0.x)
            })
            .collect();
        let got = f64::from(far.eval(w_out, w_in).0.x);
        worst = worst.max((got / mean.mean - 1.0).abs());
    }
    assert!(worst < 0.02, "seed 52: {worst}");
}

/// The near field once more in double precision, from the formulas alone; its
/// balance is taken from the model.
fn near_in_f64(f: &Fibre, p: &DielectricParameters, w_out: Vec3, w_in: Vec3, h: f64) -> f64 {
    let t = TANGENT.as_dvec3().normalize();
    let (wo, wi) = (w_out.as_dvec3().normalize(), w_in.as_dvec3().normalize());
    let (so, si) = (t.dot(wo), t.dot(wi));
    let (to, ti) = (so.asin(), si.asin());
    let travel = (-(wo - t * so)).normalize();
    let side = t.cross(travel);
    let across: DVec3 = wi - t * si;
    let azimuth = across.dot(side).atan2(across.dot(travel));
    let eta = f64::from(p.ior);
    let td = 0.5 * (to - ti);
    let index = (eta * eta - td.sin().powi(2)).sqrt() / td.cos();
    let (gi, gt) = (h.asin(), (h / index).asin());
    let ci = td.cos() * gi.cos();
    let ct = (1.0 - (1.0 - ci * ci) / (eta * eta)).sqrt();
    let fresnel = 0.5
        * (((ci - eta * ct) / (ci + eta * ct)).powi(2)
            + ((eta * ci - ct) / (eta * ci + ct)).powi(2));
    let inside = 2.0 * gt.cos() / (1.0 - (td.sin() / eta).powi(2)).sqrt();
    let through = (-f64::from(p.absorption_radii.0.x) * inside).exp();
    let pi = std::f64::consts::PI;
    let gauss = |x: f64, s: f64| (-0.5 * (x / s).powi(2)).exp() / (s * (2.0 * pi).sqrt());
    let beta = f64::from(p.longitudinal_rad);
    let widths = [beta, 0.5 * beta, 2.0 * beta, 2.0 * beta];
    let mut sum = 0.0;
    for (lobe, s) in widths.into_iter().enumerate() {
        let a = match lobe {
            0 => fresnel,
            k => {
                let a = (1.0 - fresnel).powi(2) * through * (fresnel * through).powi(k as i32 - 1);
                if lobe == 3 {
                    a / (1.0 - fresnel * through)
                } else {
                    a
                }
            }
        };
        let k = gauss(ti + to, s) + gauss(pi - ti + to, s) + gauss(-pi - ti + to, s);
        let centre = pi - 2.0 * gi - lobe as f64 * (pi - 2.0 * gt);
        let n = if lobe == 3 {
            0.5 / pi
        } else {
            let s = f64::from(p.azimuthal_rad);
            (-3..=3)
                .map(|k| gauss(azimuth - centre + 2.0 * pi * f64::from(k), s))
                .sum()
        };
        sum += a * k * n;
    }
    let Fibre::Dielectric(model) = f else {
        unreachable!()
    };
    let c = |theta: f64| f64::from(model.balance().at(theta.cos() as f32).scale.x);
    c(to) * c(ti) * ti.cos() * sum
}

#[test]
fn single_precision_follows_double() {
    let mut rng = PathRng::from_seed(53);
    let fibre = dielectric(1.55, 0.2, 8.0, 15.0);
    let Fibre::Dielectric(model) = &fibre else {
        unreachable!()
    };
    for _ in 0..3000 {
        let w_out = warp::uniform_sphere(rng.unit2());
        let h = 2.0 * rng.unit() - 1.0;
        let near = fibre.near_field(FibreFrame::new(TANGENT, w_out), h);
        let Some(s) = near.sample(w_out, &mut rng) else {
            continue;
        };
        let exact = near_in_f64(&fibre, model.parameters(), w_out, s.w_in, f64::from(h));
        let got = f64::from(near.eval(w_out, s.w_in).0.x);
        assert!(
            (got - exact).abs() < 2e-3 * exact + 1e-5,
            "seed 53, {w_out} {h} {s:?}: {got} {exact}"
        );
    }
}

/// Worst relative error of a far field against `exact`, over directions that
/// are drawn and directions that are hard; values below 1e-4 of the greatest
/// count as that.
fn far_error(fibre: &Fibre, exact: impl Fn(Vec3, Vec3) -> f64) -> f64 {
    let far = fibre.far_field(TANGENT);
    let mut rng = PathRng::from_seed(57);
    let mut pairs: Vec<(Vec3, Vec3)> = (0..150)
        .filter_map(|_| {
            let w_out = warp::uniform_sphere(rng.unit2());
            Some((w_out, far.sample(w_out, &mut rng)?.w_in))
        })
        .collect();
    for w_out in hard_directions(TANGENT) {
        pairs.push((w_out, -w_out));
        pairs.extend(
            hard_directions(TANGENT)
                .into_iter()
                .step_by(3)
                .map(|w_in| (w_out, w_in)),
        );
    }
    // At a degree from the fibre a table of energies has nothing to hold on to.
    pairs.retain(|(a, b)| {
        [a, b]
            .into_iter()
            .all(|w| TANGENT.cross(*w).length() > 0.02)
    });
    let values: Vec<[f64; 2]> = pairs
        .into_iter()
        .map(|(a, b)| [f64::from(far.eval(a, b).0.x), exact(a, b)])
        .collect();
    let greatest = values.iter().map(|v| v[1]).fold(0.0, f64::max);
    let error = |v: &[f64; 2]| (v[0] - v[1]).abs() / v[1].max(1e-4 * greatest);
    values.iter().map(error).fold(0.0, f64::max)
}

/// A dielectric's far field is the mean over offsets of its near field, both in
/// double precision: what tables and single precision leave of it.
#[test]
fn dielectric_far_fields_follow_double_precision() {
    for (absorption, longitudinal_deg, azimuthal_deg, limit) in [
        (0.2, 8.0, 15.0, 0.02),
        (0.0, 3.0, 20.0, 0.02),
        (1.0, 15.0, 40.0, 0.02),
    ] {
        let fibre = dielectric(1.55, absorption, longitudinal_deg, azimuthal_deg);
        let Fibre::Dielectric(model) = &fibre else {
            unreachable!()
        };
        let error = far_error(&fibre, |w_out, w_in| {
            const N: u32 = 400;
            let at = |i: u32| std::f64::consts::PI * ((f64::from(i) + 0.5) / f64::from(N) - 0.5);
            let near = |g: f64| {
                let near = near_in_f64(&fibre, model.parameters(), w_out, w_in, g.sin());
                near * g.cos()
            };
            let sum: f64 = (0..N).map(|i| near(at(i))).sum();
            0.5 * sum * std::f64::consts::PI / f64::from(N)
        });
        println!("{absorption} {longitudinal_deg} {azimuthal_deg}: {error:.2e}");
        assert!(error < limit, "seed 57, {longitudinal_deg}: {error}");
    }
}

/// The fitted far field from its formulas alone; the balance is the model's.
#[test]
fn fitted_far_fields_follow_double_precision() {
    let pi = std::f64::consts::PI;
    let gauss = |x: f64, s: f64| (-0.5 * (x / s).powi(2)).exp() / (s * (2.0 * pi).sqrt());
    for name in PRESETS {
        let fibre = fitted(name);
        let Fibre::Fitted(model) = &fibre else {
            unreachable!()
        };
        let p = model.parameters();
        let error = far_error(&fibre, |w_out, w_in| {
            let t = TANGENT.as_dvec3().normalize();
            let (wo, wi) = (w_out.as_dvec3().normalize(), w_in.as_dvec3().normalize());
            let (to, ti) = (t.dot(wo).asin(), t.dot(wi).asin());
            let travel = (-(wo - t * t.dot(wo))).normalize();
            let across = wi - t * t.dot(wi);
            let azimuth = across.dot(t.cross(travel)).atan2(across.dot(travel));
            let r = f64::from(p.colour_r.0.x);
            let r = r + (1.0 - r) * (1.0 - (0.5 * (to - ti)).cos()).powi(5);
            let along = |s: f32| {
                let s = f64::from(s.max(crate::longitudinal::MIN_BLUR_RAD));
                gauss(ti + to, s) + gauss(pi - ti + to, s) + gauss(-pi - ti + to, s)
            };
            let s = f64::from(p.azimuthal_tt_rad.max(crate::longitudinal::MIN_BLUR_RAD));
            let about: f64 = (-3..=3)
                .map(|k| gauss(azimuth + 2.0 * pi * f64::from(k), s))
                .sum();
            let tt = (1.0 - r) * f64::from(p.colour_tt.0.x);
            let lobes = r * along(p.longitudinal_r_rad) / (2.0 * pi)
                + tt * along(p.longitudinal_tt_rad) * about;
            let c = |theta: f64| f64::from(model.balance().at(theta.cos() as f32).scale.x);
            c(to) * c(ti) * ti.cos() * lobes
        });
        println!("{name}: {error:.2e}");
        assert!(error < 0.01, "seed 57, {name}: {error}");
    }
}

#[test]
fn smooth_fibres_return_the_lobe_energies() {
    let cos = 40f32.to_radians().cos();
    let w_out = TANGENT.any_orthonormal_vector() * cos + TANGENT * (1.0 - cos * cos).sqrt();
    let fibre = dielectric(1.55, 0.1, 0.5, 3.0);
    let expected: f32 = crate::cylinder::mean_attenuations(1.55, Rgb::splat(0.1), cos, 512)
        .iter()
        .map(|a| a.0.x)
        .sum();
    let mut rng = PathRng::from_seed(54);
    let m: Moments = (0..draws(20_000))
        .map(|_| {
            let s = fibre.far_field(TANGENT).sample(w_out, &mut rng);
            s.map_or(0.0, |s| f64::from(s.weight.0.x))
        })
        .collect();
    assert!(
        (m.mean - f64::from(expected)).abs() < 2e-3,
        "seed 54: {m:?} {expected}"
    );
}

#[test]
fn known_bad_twins_are_rejected() {
    let fibre = dielectric(1.55, 0.0, 8.0, 15.0);
    let lobe = fibre.far_field(TANGENT);
    let w_out = oblique()[0];
    let mut rng = PathRng::from_seed(55);
    let mut p = |pdf: &dyn Fn(Vec3) -> f32| {
        let sample = || lobe.sample(w_out, &mut rng).map(|s| s.w_in);
        chi_square(TANGENT, 60_000, sample, |w| f64::from(pdf(w))).p_value
    };
    assert!(p(&|w| lobe.pdf(w_out, w)) > 1e-4, "seed 55");
    assert!(p(&|w| 0.98 * lobe.pdf(w_out, w)) < 1e-9, "2 % off");
    assert!(p(&|w| lobe.pdf(w, w_out)) < 1e-9, "arguments swapped");
    assert!(
        p(&|w| lobe.pdf(w_out, w) * TANGENT.cross(w).length()) < 1e-9,
        "cosine lost"
    );
    let swapped = fibre.far_field(Vec3::new(0.64, -0.6, 0.48));
    assert!(p(&|w| swapped.pdf(w_out, w)) < 1e-9, "another frame");
}

#[test]
fn every_hard_case_is_finite() {
    let mut rng = PathRng::from_seed(56);
    for fibre in [
        dielectric(1.0, 0.0, 0.0, 0.0),
        dielectric(3.0, 1e4, 34.0, 90.0),
        dielectric(1.55, 0.0, 8.0, 15.0),
        fitted("polyester"),
    ] {
        for w_out in hard_directions(TANGENT) {
            prove_finite("far", &fibre.far_field(TANGENT), TANGENT, w_out, &mut rng);
            let frame = FibreFrame::new(TANGENT, w_out);
            for h in [-1.0, 0.0, 0.5, 1.0] {
                let near = fibre.near_field(frame, h);
                prove_finite("near", &near, TANGENT, w_out, &mut rng);
                let one = near.choose_lobe(&mut rng);
                prove_finite("one lobe", &one, TANGENT, w_out, &mut rng);
                let n = one.exit_normal(w_out, &mut rng);
                assert!((n.length() - 1.0).abs() < 1e-5 && n.dot(TANGENT).abs() < 1e-5);
                assert!(n.dot(w_out) > -1e-5, "leaves into itself");
            }
        }
    }
}

/// Through fifty events among white fibres all ways a path keeps its light, and
/// does so without rare bright paths: what is drawn is what is sent.
#[test]
fn walks_among_clear_rough_fibres_keep_their_light() {
    let parameters = DielectricParameters {
        ior: 1.55,
        absorption_radii: Rgb::BLACK,
        longitudinal_rad: 0.6,
        azimuthal_rad: 1.2,
    };
    let fibre = Fibre::Dielectric(DielectricFibre::new(parameters).unwrap());
    let mut rng = PathRng::from_seed(63);
    let (mut near, mut far, mut twin) = [Moments::default(); 3].into();
    for _ in 0..draws(3000) {
        let (mut w, mut v, mut product, mut far_product) = (Vec3::Z, Vec3::Z, 1.0, 1.0);
        for _ in 0..50 {
            let t = shown_tangent(w, &mut rng);
            let h = 2.0 * rng.unit() - 1.0;
            let lobe = fibre.near_field(FibreFrame::new(t, w), h);
            let drawn = lobe.choose_lobe(&mut rng).sample(w, &mut rng).unwrap();
            product *= f64::from(drawn.weight.mean());
            w = -drawn.w_in;
            let lobe = fibre.far_field(shown_tangent(v, &mut rng));
            let drawn = lobe.sample(v, &mut rng).unwrap();
            far_product *= f64::from(drawn.weight.mean());
            v = -drawn.w_in;
        }
        near.add(product);
        far.add(far_product);
        // It loses three thousandths at every event.
        twin.add(product * 0.997f64.powi(50));
    }
    // What the balance's table may be off by, in fifty events.
    let slack = 50.0 * 2e-4;
    let off = |m: &Moments| (m.mean - 1.0).abs() - slack;
    for m in [&near, &far] {
        assert!(off(m) < 5.0 * m.standard_error(), "seed 63: {m:?}");
        // With inclinations of the blur alone it was 8 and more.
        assert!(m.variance() < 1.5, "seed 63: {m:?}");
    }
    assert!(
        off(&twin) > 5.0 * twin.standard_error(),
        "seed 63: {twin:?}"
    );
}

/// The balance is that of all offsets: where a ray passes the fibre light is kept
/// in the mean over offsets and, unless blurs are wide and the view runs along the
/// fibre, nearly so at each. The table of docs/hard_cases.md is this test's; its
/// bounds over all offsets stand there and in the crate's documentation.
#[test]
fn near_fields_keep_light_in_the_mean_over_offsets() {
    const OFFSETS: usize = 20;
    // Blur and angle between view and fibre; the least and most of an offset.
    for (blur_deg, view_deg, [least, most]) in [
        (6.0f32, 90.0f32, [0.98, 1.02]),
        (6.0, 25.0, [0.98, 1.02]),
        (6.0, 10.0, [0.96, 1.09]),
        (20.0, 90.0, [0.94, 1.02]),
        (20.0, 25.0, [0.97, 1.09]),
        (20.0, 10.0, [0.90, 1.40]),
        (34.0, 90.0, [0.92, 1.02]),
        (34.0, 25.0, [0.97, 1.14]),
        (34.0, 10.0, [0.90, 1.43]),
    ] {
        let fibre = dielectric(1.55, 0.0, blur_deg, (2.0 * blur_deg).min(60.0));
        let (sin, cos) = view_deg.to_radians().sin_cos();
        let w_out = TANGENT * cos + TANGENT.any_orthonormal_vector() * sin;
        let frame = FibreFrame::new(TANGENT, w_out);
        let mut rng = PathRng::from_seed(67);
        let mut energy = |h: f32| -> Moments {
            let near = fibre.near_field(frame, h);
            let draw = |rng: &mut PathRng| {
                let drawn = near.choose_lobe(rng).sample(w_out, rng);
                drawn.map_or(0.0, |s| f64::from(s.weight.0.x))
            };
            (0..draws(4000)).map(|_| draw(&mut rng)).collect()
        };
        let energies: Vec<Moments> = (0..OFFSETS)
            .map(|i| energy((2.0 * i as f32 + 1.0) / OFFSETS as f32 - 1.0))
            .collect();
        let edges = [-0.99, 0.99].map(&mut energy);
        let report = || {
            let of = |m: &Moments| format!("{:.3} +- {:.3}", m.mean, m.standard_error());
            let all: Vec<String> = energies.iter().map(of).collect();
            format!(
                "seed 67, blur {blur_deg}, view {view_deg}: {}",
                all.join(", ")
            )
        };
        for m in energies.iter().chain(&edges) {
            let noise = 5.0 * m.standard_error();
            let kept = least - noise..=most + noise;
            assert!(kept.contains(&m.mean), "{m:?} of {}", report());
        }
        if (blur_deg, view_deg) == (34.0, 10.0) {
            // The bound is no wider than it must be.
            assert!(edges.iter().any(|m| m.mean > most - 0.08), "{edges:?}");
        }
        let mean = |list: &[Moments]| {
            let n = list.len() as f64;
            let mean = list.iter().map(|m| m.mean).sum::<f64>() / n;
            let variance: f64 = list.iter().map(|m| m.standard_error().powi(2)).sum();
            (mean, variance.sqrt() / n)
        };
        // Twenty offsets for the integral.
        let off = |(mean, se): (f64, f64)| (mean - 1.0).abs() > 5.0 * se + 2e-3;
        assert!(!off(mean(&energies)), "{}", report());
        if view_deg == 10.0 {
            // The outer offsets alone keep too much.
            let outer = [&energies[..2], &energies[OFFSETS - 2..]].concat();
            assert!(off(mean(&outer)), "{}", report());
        }
        if std::env::var_os("ORGANZA_FULL").is_some() {
            eprintln!("{}", report());
        }
    }
}

/// A tangent of fibres all ways, as a walk along `w` meets them.
fn shown_tangent(w: Vec3, rng: &mut PathRng) -> Vec3 {
    loop {
        let t = warp::uniform_sphere(rng.unit2());
        if rng.unit() < t.cross(w).length() {
            return t;
        }
    }
}

/// A lobe drawn first, its values divided by its probability, averages to all.
#[test]
fn chosen_lobes_average_to_the_near_field() {
    let fibre = dielectric(1.5, 0.1, 10.0, 20.0);
    let mut rng = PathRng::from_seed(57);
    let w_out = oblique()[1];
    let near = fibre.near_field(FibreFrame::new(TANGENT, w_out), 0.4);
    for w_in in oblique() {
        let m: Moments = (0..draws(20_000))
            .map(|_| f64::from(near.choose_lobe(&mut rng).eval(w_out, w_in).0.x))
            .collect();
        let all = f64::from(near.eval(w_out, w_in).0.x);
        assert!(
            !fails(t_test(&m, all), 5) || (m.mean - all).abs() < 1e-6,
            "seed 57: {m:?} {all}"
        );
    }
}

#[test]
fn smooth_exits_lie_where_the_ray_leaves() {
    // Without blur light leaves TT at the point opposite along its chord.
    let fibre = dielectric(1.5, 0.0, 0.0, 0.0);
    let w_out = TANGENT.any_orthonormal_vector();
    let frame = FibreFrame::new(TANGENT, w_out);
    let mut rng = PathRng::from_seed(58);
    for h in [-0.8f32, 0.0, 0.3] {
        let near = fibre.near_field(frame, h);
        for _ in 0..50 {
            let one = near.choose_lobe(&mut rng);
            let Some(p) = one.chosen().filter(|&p| p < 3) else {
                continue;
            };
            let crossing = Crossing::new(1.5, frame.cos_out, h);
            let w_in = frame.across(crossing.exit_azimuth_rad(p));
            let n = one.exit_normal(w_in, &mut rng);
            // Time reversed, the ray enters there at the same offset.
            let back = FibreFrame::new(TANGENT, w_in);
            assert!((back.offset(n).abs() - h.abs()).abs() < 1e-4, "{p} {h}");
            assert!(n.dot(w_in) > 0.0);
            if p == 0 {
                let entry = frame.side * h - frame.forward * (1.0 - h * h).sqrt();
                assert!((n - entry).length() < 1e-4);
            }
        }
    }
}

#[test]
fn presets_and_bounds() {
    for name in PRESETS {
        let _ = fitted(name);
    }
    assert_eq!(FittedParameters::preset("gabardin"), Err(Some("gabardine")));
    assert_eq!(FittedParameters::preset("wood pulp"), Err(None));
    let mut parameters = DielectricParameters {
        ior: 0.9,
        absorption_radii: Rgb::BLACK,
        longitudinal_rad: 0.1,
        azimuthal_rad: 0.1,
    };
    let message = DielectricFibre::new(parameters).unwrap_err().to_string();
    assert_eq!(message, "ior is 0.9, expected 1 to 3");
    parameters.ior = 1.5;
    parameters.azimuthal_rad = f32::NAN;
    assert!(DielectricFibre::new(parameters).is_err());
}

/// Random walks in a half-space of tangled fibres against the closed form that
/// colours are inverted with.
#[test]
fn colours_come_out_of_a_tangle() {
    let mut mixture = Mixture::EMPTY;
    mixture.push(FibrePopulation {
        length_density_per_mm2: 1.0,
        axis: Vec3::Z,
        spread_rad: 0.0,
        radius_mm: 0.5,
        ..Default::default()
    });
    let mut rng = PathRng::from_seed(59);
    let colour = Rgb::new(0.9, 0.6, 0.2);
    let parameters = DielectricParameters {
        ior: 1.55,
        absorption_radii: absorption_for_colour(1.55, colour),
        longitudinal_rad: 0.1,
        azimuthal_rad: 0.2,
    };
    let fibre = Fibre::Dielectric(DielectricFibre::new(parameters).unwrap());
    let mut sums = [Moments::default(); 3];
    for _ in 0..draws(4000) {
        let mut w_out = warp::cosine_hemisphere(rng.unit2());
        let mut depth = 0.0f32;
        let mut throughput = Rgb::WHITE;
        for bounce in 0..2000 {
            // Tangents even over the sphere block pi / 4 of what they are.
            depth += w_out.z * rng.exponential() / std::f32::consts::FRAC_PI_4;
            let travel_up = bounce > 0 && depth < 0.0;
            if travel_up || throughput.max_component() < 1e-3 {
                break;
            }
            let tangent = loop {
                let t = warp::uniform_sphere(rng.unit2());
                if rng.unit() < t.cross(w_out).length() {
                    break t;
                }
            };
            match fibre.far_field(tangent).sample(w_out, &mut rng) {
                Some(s) => {
                    throughput *= s.weight;
                    w_out = -s.w_in;
                }
                None => throughput = Rgb::BLACK,
            }
        }
        let escaped = if depth < 0.0 { throughput } else { Rgb::BLACK };
        for (sum, x) in sums.iter_mut().zip(escaped.0.to_array()) {
            sum.add(f64::from(x));
        }
    }
    assert!(meet_fibre(&mixture, Vec3::X, &mut rng).is_some());
    for (sum, target) in sums.iter().zip(colour.0.to_array()) {
        let error = 3.0 * (sum.variance() / sum.count as f64).sqrt();
        assert!(
            (sum.mean - f64::from(target)).abs() < 0.03 + error,
            "seed 59: {sums:?}"
        );
    }
}
