//! A planted answer: values of known parameters with noise, recovered within
//! the intervals that the fit itself states.

use organza_basis::{PathRng, unwatched};
use organza_measure::fit::Patience;
use organza_measure::{
    Effort, FitError, FittedSurface, PairValue, SurfacePatch, fit_surface, grid_layout,
    measure_pairs,
};
use organza_surface::SurfaceSpec;
use std::ops::ControlFlow;

const PLANTED: &str = r#"
accuracy = 0.01
[weave]
draft = ["110", "101", "011"]
warp_pitch_mm = 0.3
weft_pitch_mm = 0.45
[shadowing]
warp_above_weft_mm = 0.0
[warp]
psi_deg = -30.0
u_max_deg = 24.0
kappa = 0.0
alpha = 0.03
beta = 4.0
fit = "narrow"
diffuse = [0.10, 0.05, 0.02]
specular = [0.25, 0.15, 0.10]
[weft]
psi_deg = -25.0
u_max_deg = 38.0
kappa = 0.0
alpha = 0.03
beta = 4.0
fit = "narrow"
diffuse = [0.10, 0.05, 0.02]
specular = [0.12, 0.20, 0.10]
"#;

const SEED: u64 = 11;
const NOISE: f64 = 0.02;

fn data() -> Vec<PairValue> {
    let model = SurfaceSpec::from_toml(PLANTED).unwrap().build().unwrap();
    let effort = Effort::new(2, 1);
    let pairs = grid_layout(3, 8);
    let reflected = pairs.into_iter().filter(|p| p.exitant.theta_deg < 90.0);
    let pairs: Vec<_> = reflected.collect();
    let mut list = measure_pairs(&SurfacePatch(model), &pairs, &effort, &unwatched)
        .unwrap()
        .list;
    let mut rng = PathRng::from_seed(SEED);
    for v in &mut list {
        for c in 0..3 {
            v.bsdf.se[c] = NOISE * v.bsdf.mean[c];
            v.bsdf.mean[c] *= 1.0 + NOISE * f64::from(rng.normal2().x);
        }
    }
    list
}

/// Of a fit that keeps the shapes it starts from.
const COLOURS_ALONE: Patience = Patience {
    scan: 0,
    steps: 0,
    stride: 1e-3,
};

/// How many fixed parameters were planted; all of them are within four of their errors.
fn check_planted(fitted: &FittedSurface, planted: impl Fn(&str) -> Option<f64>) -> usize {
    let mut checked = 0;
    for p in fitted.parameters.iter().filter(|p| p.is_fixed) {
        if let Some(truth) = planted(&p.name) {
            let far = (p.value - truth).abs() / p.se;
            assert!(far < 4.0, "seed {SEED}: {p:?} lies {far:.1} from {truth}");
            checked += 1;
        }
    }
    checked
}

/// The colours that were planted.
fn planted(name: &str) -> Option<f64> {
    Some(match name {
        "warp.specular.r" => 0.25,
        "warp.specular.g" => 0.15,
        "weft.specular.r" => 0.12,
        "weft.specular.g" => 0.20,
        _ => return None,
    })
}

#[test]
fn planted_colours_are_recovered_within_their_intervals() {
    let data = data();
    let mut start = SurfaceSpec::from_toml(PLANTED).unwrap();
    for yarn in [&mut start.warp, &mut start.weft] {
        yarn.specular = Some(organza_basis::Rgb::splat(0.5));
    }
    let fitted = fit_surface(&start, &data, &COLOURS_ALONE, &mut || unwatched(())).unwrap();
    // Noise of 0.02 in an expected error of 0.1.
    let residual = fitted.residual;
    let is_usual = residual > 0.15 && residual < 0.25;
    assert!(is_usual, "seed {SEED}: {residual}");
    let checked = check_planted(&fitted, planted);
    assert!(checked >= 3, "{:?}", fitted.parameters);
    // The known-bad twin: another shape, whatever its colours.
    start.warp.u_max_deg = Some(60.0);
    start.weft.u_max_deg = Some(10.0);
    let twin = fit_surface(&start, &data, &COLOURS_ALONE, &mut || unwatched(()));
    assert!(twin.unwrap().residual > 2.0 * fitted.residual);
}

#[test]
fn planted_shapes_are_recovered_within_their_intervals() {
    let data = data();
    let mut start = SurfaceSpec::from_toml(PLANTED).unwrap();
    for yarn in [&mut start.warp, &mut start.weft] {
        yarn.u_max_deg = Some(30.0);
        yarn.psi_deg = Some(-35.0);
        yarn.beta = Some(2.0);
        yarn.alpha = Some(0.1);
        yarn.kappa = Some(0.5);
    }
    let full = organza_testing::is_full();
    let patience = Patience {
        scan: if full { 200 } else { 30 },
        steps: if full { 400 } else { 100 },
        stride: 1e-3,
    };
    let fitted = fit_surface(&start, &data, &patience, &mut || unwatched(())).unwrap();
    assert!(fitted.residual < 0.3, "seed {SEED}: {}", fitted.residual);
    let shape = |name: &str| match name {
        "warp.u_max_deg" => Some(24.0),
        "warp.psi_deg" => Some(30.0),
        "weft.u_max_deg" => Some(38.0),
        "weft.psi_deg" => Some(25.0),
        _ => None,
    };
    let checked = check_planted(&fitted, shape);
    assert!(checked >= 2, "seed {SEED}: {:?}", fitted.parameters);
    // The twin: the shapes that the search started from, with the colours that suit them best.
    let twin = fit_surface(&start, &data, &COLOURS_ALONE, &mut || unwatched(())).unwrap();
    let least = 2.0 * fitted.residual;
    assert!(twin.residual > least, "seed {SEED}: {}", twin.residual);
}

#[test]
fn a_stop_ends_the_search() {
    let start = SurfaceSpec::from_toml(PLANTED).unwrap();
    let patience = Patience {
        scan: 30,
        steps: 100,
        stride: 1e-3,
    };
    let mut calls = 0;
    let stopped = fit_surface(&start, &data(), &patience, &mut || {
        calls += 1;
        match calls {
            3.. => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    });
    assert!(matches!(stopped, Err(FitError::Stopped(_))));
    assert_eq!(calls, 3);
}
