use super::*;
use crate::layout::planned_pairs;
use crate::model::{GLTF, TARGETS, USD_PREVIEW};
use glam::{Vec2, Vec3};
use organza_basis::{PathRng, unwatched};
use organza_measure::Measured;

/// Texels of a twill: threads along both axes, tilted to and fro.
fn texels() -> Vec<Texel> {
    let mut rng = PathRng::from_seed(8);
    (0..24)
        .map(|k| {
            let is_warp = k % 3 == 0;
            let tilt = rng.unit2() - Vec2::splat(0.5);
            Texel {
                coverage: 0.95,
                slope: 0.8 * tilt,
                across_rad: if is_warp { 0.0 } else { 1.5 },
                order: 0.9 - 0.3 * rng.unit(),
                reflected: Vec3::new(0.5, 0.3, 0.2) * (0.7 + 0.3 * rng.unit()),
                transmitted: Vec3::new(0.15, 0.1, 0.05),
                gloss: 0.5 + 0.5 * rng.unit(),
            }
        })
        .collect()
}

fn measurement(
    target: &Target,
    planted: &Parameters,
    plan: &[PlannedPair],
    noise: f64,
) -> Vec<PairValue> {
    let pairs: Vec<Pair> = plan.iter().map(|p| p.pair).collect();
    let values = model_values(target, planted, &texels(), &Albedos::new(), &pairs);
    let mut rng = PathRng::from_seed(9);
    pairs
        .iter()
        .zip(values)
        .map(|(&pair, v)| PairValue {
            pair,
            bsdf: Measured {
                mean: v.map(|x| x * (1.0 + noise * f64::from(rng.normal2().x))),
                se: v.map(|x| x * noise),
            },
            paths: 1,
        })
        .collect()
}

const PATIENCE: Patience = Patience {
    scan: 10,
    steps: 220,
    stride: 1e-3,
};

#[test]
fn planted_parameters_are_found_and_the_wrong_model_leaves_more_error() {
    let planted = Parameters {
        reflectance: [0.8, 0.9, 1.0],
        transmittance: 1.1,
        forward: 0.4,
        roughness: 0.45,
        roughening: 0.3,
        anisotropy: 0.6,
        ior: 1.6,
        specular: 0.8,
        sheen: 0.3,
        sheen_roughness: 0.6,
        relief: 0.7,
    };
    let plan = planned_pairs(96);
    let albedos = Albedos::new();
    let data = measurement(&GLTF, &planted, &plan, 0.0);
    let fitted = |target: &Target, sky: f64| {
        let texels = texels();
        fit_target(
            target,
            &texels,
            &plan,
            &data,
            &albedos,
            sky,
            Some(0.3),
            &PATIENCE,
            &mut || unwatched(()),
        )
        .unwrap()
    };
    let found = fitted(&GLTF, 0.0);
    let p = found.parameters;
    let near = |name: &str, a: f64, b: f64, within: f64| {
        assert!((a - b).abs() < within, "{name}: {a}, planted {b}");
    };
    near("roughness", p.roughness, planted.roughness, 0.02);
    near("ior", p.ior, planted.ior, 0.03);
    near("relief", p.relief, planted.relief, 0.03);
    near("anisotropy", p.anisotropy, planted.anisotropy, 0.04);
    near(
        "transmittance",
        p.transmittance,
        planted.transmittance,
        0.03,
    );
    near("forward", p.forward, planted.forward, 0.03);
    near("specular", p.specular, planted.specular, 0.05);
    near("sheen", p.sheen, planted.sheen, 0.05);
    for c in 0..3 {
        near(
            "reflectance",
            p.reflectance[c],
            planted.reflectance[c],
            0.03,
        );
    }
    let rms = |fit: &Fitted| {
        let rows = crate::error_table::error_rows(&plan, &fit.values, &data, true);
        rows.iter()
            .find(|r| r.side == Side::Face && r.part.is_none())
            .unwrap()
            .rms
    };
    assert!(
        rms(&found) < 32.0 * f64::from(f32::EPSILON),
        "{}",
        rms(&found)
    );
    // The twin: a model without anisotropy and sheen cannot match pairs that it did not see.
    let twin = fitted(&USD_PREVIEW, 0.0);
    assert!(rms(&twin) > 0.03, "{}", rms(&twin));
    // Texels under a bright sky, which the planted material does not match, pull it to them.
    let sky = |fit: &Fitted| {
        let error = |t: &Texel| sky_error(&GLTF, &fit.parameters, t, &albedos);
        let squares = texels().iter().flat_map(error).map(|e| e * e).sum::<f32>();
        squares.sqrt()
    };
    // Margin: an inequality; any pull toward the sky shows.
    assert!(sky(&fitted(&GLTF, 1.0)) < 0.9 * sky(&found));
}

#[test]
fn noise_is_subtracted_from_errors() {
    let plan = planned_pairs(320);
    let planted = TARGETS[0].parameters(
        &TARGETS[0]
            .bounds(None)
            .iter()
            .map(|b| b.start)
            .collect::<Vec<_>>(),
        None,
    );
    let exact = measurement(&GLTF, &planted, &plan, 0.0);
    let noisy = measurement(&GLTF, &planted, &plan, 0.1);
    let values: Vec<[f64; 3]> = exact.iter().map(|v| v.bsdf.mean).collect();
    let rows = crate::error_table::error_rows(&plan, &values, &noisy, false);
    let row = rows
        .iter()
        .find(|r| r.side == Side::Face && r.part.is_none())
        .unwrap();
    assert!((row.noise - 0.1).abs() < 0.01 && row.rms < 0.04, "{row:?}");
}

#[test]
fn a_stop_ends_the_fit() {
    let (plan, albedos) = (planned_pairs(96), Albedos::new());
    let places: Vec<f64> = GLTF.bounds(None).iter().map(|b| b.start).collect();
    let data = measurement(&GLTF, &GLTF.parameters(&places, None), &plan, 0.0);
    let mut calls = 0;
    let stopped = fit_target(
        &GLTF,
        &texels(),
        &plan,
        &data,
        &albedos,
        0.0,
        None,
        &PATIENCE,
        &mut || {
            calls += 1;
            ControlFlow::Break(())
        },
    );
    assert_eq!(stopped.err(), Some(Stopped));
    assert_eq!(calls, 1);
}
