//! The light of velvet: it rises toward grazing directions, and depends on the side to which
//! the pile leans.

use organza_basis::unwatched;
use organza_measure::{Angles, Effort, VolumePatch, measure_albedos};
use organza_scene::fabric_file;
use organza_scene::loader::Loader;
use organza_transport::{AnyMedium, Integrator};
use std::path::Path;

const SEED: u64 = 5;

/// A small tile, which is made sooner.
const SMALL: &str = "tile.repeats=[6, 4]";

/// Reflected share of red light from directions (polar, azimuth), and its standard error. By
/// reciprocity it is also the brightness from there under a uniform sky.
fn reflected(name: &str, overrides: &[&str], from: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/fabrics/");
    let path = Path::new(folder).join(name).with_extension("toml");
    let loader = Loader::new();
    let overrides: Vec<String> = overrides.iter().map(|o| (*o).to_owned()).collect();
    let fabric = fabric_file::load(&path, &overrides, &loader).unwrap();
    let fibres = fabric.explicit_fibres(&path, None, &loader).unwrap();
    let fibres = AnyMedium::ExplicitFibres(fibres);
    let patch = VolumePatch::of_media(vec![fibres], Integrator::Woodcock).unwrap();
    let angles = from
        .iter()
        .map(|&(theta_deg, phi_deg)| Angles { theta_deg, phi_deg });
    let effort = Effort {
        paths: 2000,
        seed: SEED,
        target_error: None,
    };
    let measured = measure_albedos(&patch, &angles.collect::<Vec<_>>(), &effort, &unwatched);
    let list = measured.unwrap().list;
    let red = |a: &organza_measure::Albedo| (a.reflected.mean[0], a.reflected.se[0]);
    list.iter().map(red).collect()
}

/// By how many standard errors `a` exceeds `factor * b`.
fn exceeds(a: (f64, f64), factor: f64, b: (f64, f64)) -> f64 {
    (a.0 - factor * b.0) / a.1.hypot(factor * b.1)
}

/// Velvet reflects more than four times as much at 75 degrees as along the normal. The twin is
/// flat: a satin.
#[test]
fn velvet_brightens_toward_grazing_and_a_satin_does_not() {
    let from = [(0.0, 0.0), (75.0, 0.0)];
    let velvet = reflected("pile/velvet", &[SMALL], &from);
    let satin = reflected("charmeuse", &[], &from);
    println!("velvet {velvet:?}, satin {satin:?}");
    let [velvet, satin] = [velvet, satin].map(|r| exceeds(r[1], 4.0, r[0]));
    assert!(velvet > 4.0, "seed {SEED}: {velvet:.1} standard errors");
    // Margin: an inequality, in standard errors.
    assert!(satin < -4.0, "seed {SEED}: {satin:.1} standard errors");
}

/// From the side that its tips lean away from, velvet shows their flanks and is more than
/// three times as bright. The twin stands upright.
#[test]
fn stroking_velvet_changes_its_brightness() {
    let from = [(50.0, 270.0), (50.0, 90.0)];
    let leaning = reflected("pile/velvet", &[SMALL], &from);
    let upright = reflected("pile/velvet", &[SMALL, "pile.lean_deg=0"], &from);
    println!("leaning {leaning:?}, upright {upright:?}");
    let [leaning, upright] = [leaning, upright].map(|r| exceeds(r[0], 3.0, r[1]));
    assert!(leaning > 4.0, "seed {SEED}: {leaning:.1} standard errors");
    // Margin: an inequality, in standard errors.
    assert!(upright < -4.0, "seed {SEED}: {upright:.1} standard errors");
}
