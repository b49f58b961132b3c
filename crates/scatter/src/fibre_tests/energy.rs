//! What fibres keep of the light: energy of lobes, walks among clear fibres, colours.

use super::*;

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
        ("fitted", Fibre::from(FittedFibre::new(white).unwrap())),
    ] {
        assert_clear(name, &fibre, &[0.0, 30.0, 60.0, 80.0, 88.0, 89.9]);
    }
}

#[test]
fn smooth_fibres_return_the_lobe_energies() {
    let cos = 40f32.to_radians().cos();
    let w_out = TANGENT.any_orthonormal_vector() * cos + TANGENT * (1.0 - cos * cos).sqrt();
    let fibre = dielectric(1.55, 0.1, 0.5, 3.0);
    let parts = crate::cylinder::mean_attenuations(1.55, Rgb::splat(0.1), cos, 512);
    let expected: f32 = parts.iter().map(|a| a.0.x).sum();
    let mut rng = PathRng::from_seed(54);
    let m: Moments = (0..draws(20_000))
        .map(|_| {
            let s = fibre.far_field(TANGENT).sample(w_out, &mut rng);
            s.map_or(0.0, |s| f64::from(s.weight.0.x))
        })
        .collect();
    let off = (m.mean - f64::from(expected)).abs();
    assert!(off < 3.0 * m.standard_error(), "seed 54: {m:?} {expected}");
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
    let fibre = Fibre::from(DielectricFibre::new(parameters).unwrap());
    let mut rng = PathRng::from_seed(63);
    let (mut near, mut far, mut twin) = [Moments::default(); 3].into();
    for _ in 0..draws(3000) {
        let (mut w, mut v, mut product, mut far_product) = (Vec3::Z, Vec3::Z, 1.0, 1.0);
        for _ in 0..50 {
            let t = shown_tangent(w, &mut rng);
            let h = 2.0 * rng.unit() - 1.0;
            let lobe = fibre.near_field(FibreFrame::new(t, w), h);
            let drawn = lobe.sample(w, &mut rng).unwrap();
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
        // The margin is for the noise of the variance of a product of fifty weights.
        assert!(m.variance() < 1.5, "seed 63: {m:?}");
    }
    let error = twin.standard_error();
    assert!(off(&twin) > 5.0 * error, "seed 63: {twin:?}");
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
                let drawn = near.sample(w_out, rng);
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
        if organza_testing::is_full() {
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
    let fibre = Fibre::from(DielectricFibre::new(parameters).unwrap());
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
        let off = (sum.mean - f64::from(target)).abs();
        assert!(off < 0.03 + error, "seed 59: {sums:?}");
    }
}
