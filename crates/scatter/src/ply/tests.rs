//! Energy, sampling and shape of the ply's lobe.

use super::*;
use crate::proofs::*;
use crate::{DielectricFibre, DielectricParameters};
use organza_testing::sized;

fn fibre(absorption: f32) -> Fibre {
    Fibre::from(
        DielectricFibre::new(DielectricParameters {
            ior: 1.55,
            absorption_radii: Rgb::new(absorption, 2.0 * absorption, 4.0 * absorption),
            longitudinal_rad: 0.12,
            azimuthal_rad: 0.3,
        })
        .unwrap(),
    )
}

fn cotton(absorption: f32) -> Ply {
    corrected(absorption, PlyCorrection::default())
}

fn corrected(absorption: f32, correction: PlyCorrection) -> Ply {
    let parameters = PlyParameters {
        radius_mm: 0.06,
        fibre_radius_mm: 0.006,
        fibres: 55.0,
        twist_rad_per_mm: 4.0,
        correction,
    };
    Ply::new(parameters, fibre(absorption)).unwrap()
}

/// Light at an offset across a ply along x: where it enters, and what it meets.
fn meet(ply: &Ply, w_out: Vec3, h: f32, rng: &mut PathRng) -> Option<PlyEvent> {
    let frame = FibreFrame::new(Vec3::X, w_out);
    let normal = frame.side * h - frame.forward * (1.0 - h * h).sqrt();
    let radius_mm = ply.parameters.radius_mm;
    let entry = PlyPlace {
        axis: Vec3::X,
        out_mm: radius_mm * normal,
        radius_mm,
    };
    let t = ply.first_fibre(&entry, -w_out, rng)?;
    Some(ply.event(&entry, t, -w_out, w_out, rng))
}

fn slanted(theta_deg: f32) -> Vec3 {
    let (sin, cos) = theta_deg.to_radians().sin_cos();
    Vec3::new(sin, 0.0, cos)
}

#[test]
fn chords_end_on_the_cylinder_and_transmittance_is_what_is_drawn() {
    let ply = cotton(0.0);
    let mut rng = PathRng::from_seed(81);
    let w_out = slanted(50.0);
    let frame = FibreFrame::new(Vec3::X, w_out);
    // Near the edge, where a good share passes.
    let h: f32 = 0.985;
    let normal = frame.side * h - frame.forward * (1.0 - h * h).sqrt();
    let entry = PlyPlace {
        axis: Vec3::X,
        out_mm: 0.06 * normal,
        radius_mm: 0.06,
    };
    let chord = entry.chord_mm(-w_out);
    let end = entry.moved(-w_out, chord);
    assert!((end.out_mm.length() - 0.06).abs() < 1e-6 && chord > 0.0);
    let n = 40_000;
    let passed = (0..n)
        .filter(|_| ply.first_fibre(&entry, -w_out, &mut rng).is_none())
        .count() as f32
        / n as f32;
    let expected = ply.transmittance(&entry, -w_out);
    assert!(expected > 0.1 && expected < 0.9, "{expected}");
    // Four standard errors.
    let se = (expected * (1.0 - expected) / n as f32).sqrt();
    let is_near = (passed - expected).abs() < 4.0 * se;
    assert!(is_near, "seed 81: {passed} {expected}");
}

#[test]
fn directions_are_drawn_by_their_density_and_weights_are_its_quotient() {
    let ply = cotton(0.02);
    for (theta, seed) in [(0.0, 82), (55.0, 83), (-75.0, 84)] {
        let w_out = slanted(theta);
        let mut rng = PathRng::from_seed(seed);
        for h in [-0.7, 0.2].into_iter().take(sized(1, 2)) {
            let met = (0..100).find_map(|_| meet(&ply, w_out, h, &mut rng));
            let event = met.expect("a cotton ply is dense");
            let lobe = ply.lobe(&event);
            prove_part("ply", &lobe, Vec3::X, w_out, 6);
            prove_finite("ply", &lobe, Vec3::X, w_out, &mut rng);
            for _ in 0..200 {
                if let Some(s) = lobe.sample(w_out, &mut rng) {
                    let value = lobe.eval(w_out, s.w_in);
                    let off = (value - s.weight * s.pdf).0.abs().max_element();
                    let most = 4.0 * f32::EPSILON * (1.0 + value.max_component());
                    assert!(off <= most, "seed {seed}");
                }
            }
        }
    }
}

/// Mean albedo over the width at an inclination, of what meets a fibre.
fn albedo(ply: &Ply, theta_deg: f32, seed: u64) -> (f64, f64) {
    let (w_out, mut rng) = (slanted(theta_deg), PathRng::from_seed(seed));
    let (mut sum, mut square, n) = (0.0, 0.0, sized(10_000, 30_000));
    for _ in 0..n {
        let event = loop {
            let h = 2.0 * rng.unit() - 1.0;
            if let Some(event) = meet(ply, w_out, h, &mut rng) {
                break event;
            }
        };
        let got = ply.lobe(&event).sample(w_out, &mut rng);
        let got = got.map_or(0.0, |s| f64::from(s.weight.0.x));
        sum += got;
        square += got * got;
    }
    let mean = sum / f64::from(n);
    (
        mean,
        ((square / f64::from(n) - mean * mean) / f64::from(n)).sqrt(),
    )
}

/// In an even white furnace a ply without absorption sends back what comes. A twin that
/// forgets the dimming of what is scattered once sends back more.
#[test]
fn a_clear_ply_keeps_all_light() {
    let ply = cotton(0.0);
    for (theta, seed) in [(0.0, 85), (30.0, 86), (-45.0, 87), (60.0, 88), (75.0, 89)] {
        let (mean, error) = albedo(&ply, theta, seed);
        println!("{theta} degrees: {mean:.4} +- {error:.4}");
        // The fibre's own near field keeps energy to 1 % here, walks of the table to 0.5 %.
        // Margin: the sum of both, and four standard errors.
        let is_near = (mean - 1.0).abs() < 0.025 + 4.0 * error;
        assert!(is_near, "seed {seed}: {mean} +- {error} at {theta} degrees");
    }
    let mut rng = PathRng::from_seed(90);
    let w_out = slanted(30.0);
    let (mut twin, n) = (0.0, 4000);
    for _ in 0..n {
        let event = std::iter::from_fn(|| Some(2.0 * rng.unit() - 1.0)).find_map(|h| {
            let mut rng = PathRng::from_seed(u64::from(h.to_bits()));
            meet(&ply, w_out, h, &mut rng)
        });
        let event = event.unwrap();
        let near = ply.lobe(&event).near().sample(w_out, &mut rng).unwrap();
        twin += near.weight.0.x + event.body.colour.0.x;
    }
    assert!(twin / n as f32 > 1.2, "seed 90: {}", twin / n as f32);
}

/// Corrections make no light, whatever the fibres absorb. A twin whose odds scale one side
/// alone sends back more.
#[test]
fn a_corrected_clear_ply_keeps_all_light() {
    let correction = PlyCorrection {
        extinction: 2.5,
        absorption: Rgb::new(0.0, 3.0, 1.0),
        through_odds: 3.0,
        spread_rad: 0.3,
    };
    let ply = corrected(0.0, correction);
    for (theta, seed) in [(0.0, 98), (60.0, 99)] {
        let (mean, error) = albedo(&ply, theta, seed);
        // Margin: as for the ply that is not corrected.
        let is_near = (mean - 1.0).abs() < 0.025 + 4.0 * error;
        assert!(is_near, "seed {seed}: {mean} +- {error} at {theta} degrees");
    }
    // Fibres that absorb, and a body that does not: still no more than comes.
    let (mean, error) = albedo(&corrected(0.02, correction), 30.0, 100);
    assert!(mean < 1.0 + 4.0 * error && mean > 0.9, "seed 100: {mean}");
    let mut twin = corrected(0.0, PlyCorrection::default());
    twin.body.scale_through(3.0);
    let (mean, error) = albedo(&twin, 0.0, 98);
    let least = 1.025 + 4.0 * error;
    assert!(mean > least, "seed 98: the twin passed, {mean}");
}

#[test]
fn a_place_and_its_mirror_image_send_alike() {
    // A half turn about z keeps the twist.
    let ply = cotton(0.05);
    let (a, error_a) = albedo(&ply, 40.0, 91);
    let (b, error_b) = albedo(&ply, -40.0, 92);
    assert!((a - b).abs() < 4.0 * error_a.hypot(error_b), "{a} {b}");
}

#[test]
fn light_that_a_fibre_reflects_leaves_from_where_it_was_met() {
    // So dark that nothing passes: a smooth cylinder reflects at its surface, on the spot.
    let (dark, radius_mm) = (fibre(200.0), 0.006);
    let mut rng = PathRng::from_seed(93);
    for theta_deg in [0.0, 30.0, -60.0] {
        let w_out = slanted(theta_deg);
        let frame = FibreFrame::new(Vec3::X, w_out);
        for h in [-0.95f32, -0.5, 0.0, 0.2, 0.8] {
            let mirrored = |h: f32| {
                let normal = frame.side * h - frame.forward * (1.0 - h * h).sqrt();
                2.0 * w_out.dot(normal) * normal - w_out
            };
            let near = dark.near_field(frame, h);
            let exit_mm = near.exit_mm(radius_mm, mirrored(h), &mut rng);
            // The normal is found from its angle, exact to 2e-6; the root doubles that at 0.95.
            let off = exit_mm.length() / radius_mm;
            let is_exact = off < 8.0 * f32::EPSILON;
            assert!(is_exact, "seed 93, {theta_deg} degrees, offset {h}: {off}");
            // Known bad: a fibre whose axis lies on the other side of the light.
            let to_axis = frame.forward * (1.0 - h * h).sqrt() + frame.side * h;
            let normal = near.exit_normal(mirrored(h), &mut rng);
            let twin = (to_axis + normal).length();
            let is_seen = h == 0.0 || twin > 0.3;
            assert!(is_seen, "offset {h}: the twin passed, {twin}");
        }
    }
}

#[test]
fn what_is_no_ply_is_refused() {
    let good = *cotton(0.0).parameters();
    let wrong = [
        PlyParameters {
            radius_mm: 0.0,
            ..good
        },
        PlyParameters {
            fibres: f32::NAN,
            ..good
        },
        PlyParameters {
            fibre_radius_mm: -1.0,
            ..good
        },
        PlyParameters {
            twist_rad_per_mm: f32::INFINITY,
            ..good
        },
    ];
    for parameters in wrong {
        assert!(Ply::new(parameters, fibre(0.0)).is_none(), "{parameters:?}");
    }
}
