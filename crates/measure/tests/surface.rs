//! A surface model through the goniometer gives back its own values.

use organza_basis::unwatched;
use organza_measure::{
    Angles, Effort, SurfacePatch, irawan_layout, measure_albedos, measure_openness, measure_pairs,
};
use organza_scatter::{Footprint, Surface};
use organza_surface::SurfaceSpec;

const SHEER: &str = r#"
preset = "polyester-lining"
[transmission]
warp_cover = 0.8
weft_cover = 0.7
diffuse = [0.1, 0.08, 0.05]
forward = [0.1, 0.1, 0.1]
concentration = 8.0
"#;

fn effort(paths: u64) -> Effort {
    Effort::new(paths, 2)
}

#[test]
fn measured_values_are_the_models_own() {
    let surface = SurfaceSpec::from_toml(SHEER).unwrap().build().unwrap();
    let patch = SurfacePatch(surface);
    let mut pairs = irawan_layout();
    for pair in pairs.iter_mut().step_by(5) {
        pair.exitant.theta_deg = 180.0 - pair.exitant.theta_deg;
    }
    let results = measure_pairs(&patch, &pairs, &effort(1), &unwatched).unwrap();
    let mut lit = 0;
    for got in &results.list {
        let (w_in, w_out) = (got.pair.incident.direction(), got.pair.exitant.direction());
        let own = patch.0.eval(w_out, w_in, Footprint::FAR).0.as_dvec3();
        assert_eq!(got.bsdf.mean, own.to_array(), "{:?}", got.pair);
        assert_eq!(got.bsdf.se, [0.0; 3]);
        lit += usize::from(own.x > 0.0);
    }
    assert!(lit > 1500, "{lit} of 1575 are not black");
}

#[test]
fn shares_add_to_one_and_openness_is_the_gap() {
    let surface = SurfaceSpec::from_toml(SHEER).unwrap().build().unwrap();
    let patch = SurfacePatch(surface);
    let incident = [(0.0, 0.0), (45.0, 30.0), (150.0, 80.0)]
        .map(|(theta_deg, phi_deg)| Angles { theta_deg, phi_deg });
    let results = measure_albedos(&patch, &incident, &effort(20_000), &unwatched).unwrap();
    for a in &results.list {
        for c in 0..3 {
            assert!((a.sum.mean[c] - 1.0).abs() < 4.0 * f64::from(f32::EPSILON));
            assert!(a.absorbed.mean[c] > -4.0 * a.absorbed.se[c], "{a:?}");
        }
        let gap = f64::from(patch.0.gap(a.incident.direction(), Footprint::FAR));
        let distance = (a.direct.mean[0] - gap).abs();
        assert!(distance <= 4.0 * (gap / 20_000.0).sqrt(), "seed 2: {a:?}");
    }
    // (1 - 0.8)(1 - 0.7): Peirce's cover factor.
    let (open, se) = measure_openness(&patch, &effort(20_000), &unwatched).unwrap();
    assert!((open - 0.06).abs() < 4.0 * se, "seed 2: {open} +- {se}");
}
