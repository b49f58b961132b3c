use super::*;
use organza_basis::PathRng;
use std::f32::consts::{FRAC_1_PI, PI};

fn direction(rng: &mut PathRng, side: f32) -> Vec3 {
    let u = rng.unit2();
    let z = 0.05 + 0.95 * u.x;
    let sin = (1.0 - z * z).sqrt();
    let phi = 2.0 * PI * u.y;
    Vec3::new(sin * phi.cos(), sin * phi.sin(), side * z)
}

fn matte() -> Surface {
    Surface {
        base: Vec3::new(0.8, 0.4, 0.2),
        transmission: 0.25,
        transmission_colour: Vec3::new(1.0, 0.5, 0.25),
        forward: 0.0,
        roughness: 0.6,
        anisotropy: 0.7,
        ior: 1.5,
        specular: 1.0,
        sheen: Vec3::splat(0.5),
        sheen_roughness: 0.6,
    }
}

#[test]
fn models_whose_layers_are_symmetric_are_reciprocal_and_the_others_are_not() {
    let albedos = Albedos::new();
    for target in TARGETS {
        let mut rng = PathRng::from_seed(11);
        let mut worst = 0.0f32;
        for _ in 0..500 {
            let (a, b) = (direction(&mut rng, 1.0), direction(&mut rng, 1.0));
            let f = (target.bsdf)(&matte(), &albedos, a, b);
            let g = (target.bsdf)(&matte(), &albedos, b, a);
            worst = worst.max(((f - g) / f).abs().max_element());
        }
        // The models of MaterialX weight layers by the direction of the eye alone.
        let is_symmetric = target.file != "material.mtlx";
        assert_eq!(worst < 1e-3, is_symmetric, "{}: {worst}", target.name);
    }
}

/// Share of light from `w_out` that a surface scatters into both hemispheres, by a rule that
/// follows the highlight: `w_in` runs over a grid of the sphere.
fn albedo(target: &Target, surface: &Surface, albedos: &Albedos, w_out: Vec3) -> Vec3 {
    let n = 256;
    let mut sum = Vec3::ZERO;
    for i in 0..2 * n {
        for j in 0..n {
            let z = (i as f32 + 0.5) / n as f32 - 1.0;
            let phi = 2.0 * PI * (j as f32 + 0.5) / n as f32;
            let sin = (1.0 - z * z).sqrt();
            let w_in = Vec3::new(sin * phi.cos(), sin * phi.sin(), z);
            sum += (target.bsdf)(surface, albedos, w_in, w_out) * z.abs();
        }
    }
    sum * 2.0 * PI / (n * n) as f32
}

#[test]
fn a_white_furnace_gains_no_light_and_smooth_layers_lose_little() {
    let albedos = Albedos::new();
    let white = Surface {
        base: Vec3::ONE,
        transmission: 0.3,
        transmission_colour: Vec3::ONE,
        forward: 0.3,
        roughness: 0.7,
        sheen: Vec3::ONE,
        ..matte()
    };
    for target in TARGETS {
        for cos in [0.3f32, 0.7, 0.98] {
            let w_out = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let share = albedo(target, &white, &albedos, w_out).x;
            // A facet that scatters light below the surface loses it, and glTF weights
            // layers at grazing angles by the steeper direction, which loses more.
            assert!(share < 1.03, "{} {cos}: {share}", target.name);
            let least = if target.transmits { 0.55 } else { 0.9 };
            assert!(share > least, "{} {cos}: {share}", target.name);
        }
        // The twin: light added instead of layered.
        let twin = Target {
            bsdf: |s, a, i, o| {
                let f = (GLTF.bsdf)(s, a, i, o);
                f + FRAC_1_PI * 0.2 * Vec3::ONE
            },
            ..GLTF
        };
        let w_out = Vec3::new(0.2, 0.0, 0.98).normalize();
        assert!(albedo(&twin, &white, &albedos, w_out).x > 1.03);
    }
}

#[test]
fn known_values_of_matte_surfaces_and_widths() {
    let albedos = Albedos::new();
    let mut rng = PathRng::from_seed(2);
    let surface = Surface {
        specular: 0.0,
        sheen: Vec3::ZERO,
        ..matte()
    };
    for target in [&GLTF, &OPENPBR, &STANDARD_SURFACE] {
        let (a, b) = (direction(&mut rng, 1.0), direction(&mut rng, 1.0));
        let f = (target.bsdf)(&surface, &albedos, a, b);
        let lambert = 0.75 * FRAC_1_PI * surface.base;
        assert!(
            (f - lambert).length() < 4.0 * f32::EPSILON,
            "{}: {f}",
            target.name
        );
        let f = (target.bsdf)(&surface, &albedos, -a, b);
        let passed = 0.25 * FRAC_1_PI * surface.transmission_colour;
        assert!(
            (f - passed).length() < 4.0 * f32::EPSILON,
            "{}: {f}",
            target.name
        );
    }
    // Light that keeps its direction goes where the highlight would be, seen in a mirror.
    let forward = Surface {
        forward: 0.4,
        transmission: 0.0,
        transmission_colour: surface.base,
        ..surface
    };
    let lobes = [gltf::widths(0.6, 0.7), openpbr_widths(0.6, 0.7)];
    for (target, widths) in [&GLTF, &OPENPBR].into_iter().zip(lobes) {
        let (a, b) = (direction(&mut rng, 1.0), direction(&mut rng, 1.0));
        let through = Vec3::new(a.x, a.y, -a.z);
        let passed = (target.bsdf)(&forward, &albedos, through, b);
        let expected = 0.4 * surface.base * crate::lobe::ggx(widths, a, b);
        assert!(
            (passed - expected).length() < 8.0 * f32::EPSILON * expected.length(),
            "{}: {passed} {expected}",
            target.name
        );
        let back = (target.bsdf)(&forward, &albedos, a, b);
        let lambert = 0.6 * FRAC_1_PI * surface.base;
        assert!((back - lambert).length() < 4.0 * f32::EPSILON, "{back}");
    }
    // The widths of KHR_materials_anisotropy: the rough one is mix(0.25, 1, 0.5^2).
    let (rough, fine) = gltf::widths(0.5, 0.5);
    assert!((rough - 0.4375).abs() < 1e-6 && (fine - 0.25).abs() < 1e-6);
    // OpenPBR: 0.25 sqrt(2 / 1.25), and half of it.
    let (rough, fine) = openpbr_widths(0.5, 0.5);
    assert!((rough - 0.316_228).abs() < 1e-5 && (fine - 0.158_114).abs() < 1e-5);
    // A preview surface shows nothing from behind.
    let behind = (USD_PREVIEW.bsdf)(&surface, &albedos, Vec3::NEG_Z, Vec3::Z);
    assert_eq!(behind, Vec3::ZERO);
}

#[test]
fn a_patch_is_the_mean_of_its_texels_with_their_coverage() {
    let albedos = Albedos::new();
    let pair = Pair::new(
        organza_measure::Angles::new(20.0, 0.0),
        organza_measure::Angles::new(40.0, 120.0),
    );
    let p = Parameters {
        reflectance: [1.0; 3],
        transmittance: 1.0,
        forward: 0.0,
        roughness: 0.5,
        roughening: 0.0,
        anisotropy: 0.0,
        ior: 1.0,
        specular: 1.0,
        sheen: 0.0,
        sheen_roughness: 0.5,
        relief: 1.0,
    };
    let covered = Texel {
        transmitted: Vec3::splat(0.2),
        ..Texel::flat(Vec3::splat(0.5))
    };
    let hole = Texel {
        coverage: 0.0,
        ..covered
    };
    let input = |t: Texel| (t, GLTF.surface(&p, &t));
    let half = GLTF.patch_bsdf(&[input(covered), input(hole)], 1.0, &albedos, &pair);
    assert!(
        (half[0] - 0.25 * f64::from(FRAC_1_PI)).abs() < 16.0 * f64::from(f32::EPSILON),
        "{half:?}"
    );
    // Two slopes that are opposite: light cosines about their normals, over the cloth's.
    let tilted = |x: f32| Texel {
        slope: glam::Vec2::new(x, 0.0),
        ..covered
    };
    let roof = GLTF.patch_bsdf(
        &[input(tilted(0.5)), input(tilted(-0.5))],
        1.0,
        &albedos,
        &pair,
    );
    let cos = f64::from(1.25f32.sqrt().recip());
    assert!(
        (roof[0] - 0.5 * f64::from(FRAC_1_PI) * cos).abs() < 16.0 * f64::from(f32::EPSILON),
        "{roof:?}"
    );
}
