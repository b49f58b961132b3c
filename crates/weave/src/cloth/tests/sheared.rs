//! Shear rigidity of cloth, from the bending of its threads.

use super::*;

fn woven(weave: &str, per_cm: [f64; 2], more: &str) -> Figures {
    let [ends, picks] = per_cm;
    let text = format!(
        "ideal = true\n[draft]\nweave = \"{weave}\"\n[warp]\nyarn = \"y\"\nper_cm = {ends}\n[weft]\n\
         yarn = \"y\"\nper_cm = {picks}\n[yarn.y]\npreset = \"cotton\"\ntex = 20\n{more}\n"
    );
    build(&toml::from_str(&text).unwrap()).figures()
}

/// The angle by which a beam turns that is held at both ends, under a force across it: the beam's
/// equation in small steps, once with the force and once with a moment at its start, of which as
/// much is taken as keeps its end from turning.
fn bent_rad(force_n: f64, length_mm: f64, rigidity_n_mm2: f64) -> f64 {
    const STEPS: usize = 10_000;
    let step_mm = length_mm / STEPS as f64;
    let shot = |force_n: f64, moment_n_mm: f64| {
        let (mut w, mut slope) = (0.0, 0.0);
        for k in 0..STEPS {
            let bend = (moment_n_mm - force_n * (k as f64 + 0.5) * step_mm) / rigidity_n_mm2;
            w += (slope + 0.5 * bend * step_mm) * step_mm;
            slope += bend * step_mm;
        }
        (w, slope)
    };
    let (forced, turned) = (shot(force_n, 0.0), shot(0.0, 1.0));
    (forced.0 - turned.0 * forced.1 / turned.1) / length_mm
}

/// Both systems bend under the shear force of their spacings, between places of `held` spacings of
/// the other system.
fn expected_n_m(figures: &Figures, held: f64) -> f64 {
    let systems = [figures.warp.as_ref(), figures.weft.as_ref()].map(Option::unwrap);
    let [p1, p2] = systems.map(|s| 10.0 / s.threads_per_cm);
    // uN m are N mm2 of a thread on each mm, times 1000.
    let [b1, b2] = systems.map(|s| 1e-3 * s.bending_rigidity_un_m.unwrap());
    1e3 / (bent_rad(p1, held * p2, b1 * p1) + bent_rad(p2, held * p1, b2 * p2))
}

#[test]
fn threads_bend_as_beams_between_interlacings() {
    for (weave, held) in [
        ("plain", 1.0),
        ("twill-2-2", 2.0),
        ("twill-3-1", 2.0),
        ("satin-5", 2.5),
    ] {
        let figures = woven(weave, [24.0, 15.0], "");
        let found = figures.shear_rigidity_n_m.unwrap();
        let expected = expected_n_m(&figures, held);
        assert!(
            (found / expected - 1.0).abs() < 1e-6,
            "{weave}: {found} {expected}"
        );
        // Twins: floats as long as a spacing, and twice as long.
        for wrong in [0.5, 2.0] {
            assert!((found / expected_n_m(&figures, wrong * held) - 1.0).abs() > 0.5);
        }
    }
}

#[test]
fn it_scales_with_the_modulus_and_is_the_same_of_a_larger_tile() {
    let rigidity = |more: &str| {
        let figures = woven("twill-2-2", [24.0, 15.0], more);
        figures.shear_rigidity_n_m.unwrap()
    };
    let found = rigidity("");
    assert!((rigidity("fibre_modulus_gpa = 15.2") / found - 2.0).abs() < 1e-9);
    let larger = rigidity("[tile]\nrepeats = [2, 3]");
    assert!((larger / found - 1.0).abs() < 1e-6, "{larger} {found}");
}

#[test]
fn cloth_that_is_not_woven_has_none() {
    let text = "[draft]\nknit = \"stockinette\"\nwales_per_cm = 12\n[weft]\nyarn = \"cotton\"\n\
                per_cm = 16\n[yarn.cotton]\ntex = 20\n";
    let knit = build(&toml::from_str(text).unwrap()).figures();
    assert_eq!(knit.shear_rigidity_n_m, None);
    // Ends that lie loose on the picks.
    let mut loose = fabric("plain");
    loose.draft.weave = None;
    loose.draft.drawdown = Some(vec!["XX".into(), "XX".into()]);
    assert_eq!(build(&loose).figures().shear_rigidity_n_m, None);
}
