//! Optics planted in a formula are found with true errors.

use organza_basis::PathRng;
use organza_measure::{Appearance, AppearanceFit, AppearanceSearch, Measured, fit_appearance};
use std::convert::Infallible;

/// A sheet of fibres in a formula: light decreases with what is absorbed, highlights with
/// the width of flakes, and the share of light that is lost through it with the density.
fn sheet(optics: &Appearance, seed: u64) -> Vec<Measured> {
    let mut rng = PathRng::from_seed(seed);
    let cover = 1.0 - (-2.0 * optics.density).exp();
    let mut list = Vec::new();
    let diffuse = |albedo: f64| {
        let s = (1.0 - albedo).sqrt();
        (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)
    };
    for albedo in &optics.albedo {
        list.push(albedo.map(|a| cover * (diffuse(a) + 0.1 * a)));
    }
    let first = optics.albedo[0];
    list.push(first.map(|a| 0.02 * a * cover / optics.gamma.sqrt() + 0.05 * diffuse(a)));
    list.push(first.map(|a| 0.03 * diffuse(a) * (1.0 - cover) + 0.004 * a));
    let mut noisy = |v: f64| v * (1.0 + 0.003 * f64::from(rng.normal2().x));
    let measured =
        |values: [f64; 3]| Measured::new(values.map(&mut noisy), values.map(|v| 0.003 * v));
    list.into_iter().map(measured).collect()
}

fn search(materials: usize, density: [f64; 2]) -> AppearanceSearch {
    AppearanceSearch {
        names: (0..materials).map(|k| format!("yarn {k}")).collect(),
        gamma: [0.02, 0.8],
        density,
        start: Appearance {
            albedo: vec![[0.7; 3]; materials],
            gamma: 0.2,
            density: 1.0,
        },
        steps: 12,
    }
}

fn fit(target: &[Measured], search: &AppearanceSearch) -> AppearanceFit {
    let simulate = |o: &Appearance| Ok::<_, Infallible>(sheet(o, 2));
    let mut simulations = 0;
    let mut cut = |o: &Appearance| {
        simulations += 1;
        simulate(o).map(|mut list| {
            list.truncate(target.len());
            list
        })
    };
    let found = fit_appearance(target, search, &mut cut).unwrap();
    assert_eq!(found.simulations, simulations);
    found
}

#[test]
fn planted_optics_are_found_within_their_errors() {
    let planted = Appearance {
        albedo: vec![[0.95, 0.6, 0.2], [0.3, 0.85, 0.99]],
        gamma: 0.11,
        density: 0.6,
    };
    let truth = |name: &str| match name {
        "gamma" => planted.gamma,
        "density" => planted.density,
        _ => {
            let yarn = usize::from(name.starts_with("yarn 1"));
            let c = "rgb".find(&name[name.len() - 1..]).unwrap();
            planted.albedo[yarn][c]
        }
    };
    let (mut chi2, mut count) = (0.0, 0.0);
    for seed in 10..18 {
        let found = fit(&sheet(&planted, seed), &search(2, [0.2, 3.0]));
        let is_met = found.is_met && found.simulations < 130;
        assert!(is_met, "seed {seed}: {found:?}");
        assert_eq!(found.parameters.len(), 8);
        for p in &found.parameters {
            assert!(p.is_fixed, "seed {seed}: {p:?}");
            chi2 += ((p.value - truth(&p.name)) / p.se).powi(2);
            count += 1.0;
        }
        let gamma = &found.parameters[6];
        let ratio = gamma.value / 0.11;
        assert!((ratio - 1.0).abs() < 0.08, "seed {seed}: {gamma:?}");
    }
    // The errors are of the stated size: they contain the floor of half a percent,
    // which the noise of 0.3 % does not fill.
    let mean = chi2 / count;
    assert!((0.1..2.0).contains(&mean), "{mean}, seeds 10..18");
}

#[test]
fn a_mean_alone_fixes_the_colour_and_nothing_else() {
    let planted = Appearance {
        albedo: vec![[0.9, 0.5, 0.3]],
        gamma: 0.11,
        density: 1.0,
    };
    let whole = sheet(&planted, 4);
    let found = fit(&whole[..1], &search(1, [1.0, 1.0]));
    let fixed: Vec<bool> = found.parameters.iter().map(|p| p.is_fixed).collect();
    assert_eq!(fixed, [true, true, true, false], "{found:?}");
    let green = found.appearance.albedo[0][1];
    assert!((green - 0.5).abs() < 0.02, "{found:?}");
    // A contrast that no width gives is not met.
    let mut wrong = whole;
    wrong[1].mean = wrong[1].mean.map(|v| 9.0 * v);
    let found = fit(&wrong, &search(1, [1.0, 1.0]));
    assert!(!found.is_met && !found.parameters[3].is_fixed, "{found:?}");
}
