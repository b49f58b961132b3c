//! Packed fabrics against the explicit fibres that they stand for: light reflected,
//! transmitted by scattering and passing straight through. In full
//! (`ORGANZA_FULL=1 cargo test --release -p organza-scene --test main packed_fabrics --
//! --nocapture`) every difference is held against the goal.

use organza_basis::unwatched;
use organza_measure::{Albedo, Angles, Effort, Measured, measure_albedos};
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::loader::Loader;
use organza_scene::patches::{Matter, PatchOptions};
use organza_scene::representation::{EXPLICIT_FIBRES, PACKED, ShownAs};
use organza_volume::{MaterialPacking, MeasuredPacking, Octree, PackingFactor};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const SEED: u64 = 31;

fn fabric_path(name: &str) -> PathBuf {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/fabrics/");
    Path::new(folder).join(name).with_extension("toml")
}

/// A fabric in three representations.
struct Sample {
    fabric: Fabric,
    path: PathBuf,
    fibres: Matter,
    packed: Matter,
    /// The twin: packed fibres with the factors of fibres strewn at random.
    strewn: Matter,
}

fn options<'a>(loader: &'a Loader<'a>) -> PatchOptions<'a> {
    PatchOptions {
        loader,
        voxel_um: None,
        level: 0,
        max_memory_bytes: None,
    }
}

impl Sample {
    fn new(name: &str) -> Sample {
        let loader = Loader::new();
        let path = fabric_path(name);
        let fabric = fabric_file::load(&path, &[], &loader).unwrap();
        let matter = |shown| {
            let shown = ShownAs::usual(shown);
            Matter::new(&fabric, &path, shown, &options(&loader)).unwrap()
        };
        let (fibres, packed) = (matter(&EXPLICIT_FIBRES), matter(&PACKED));
        let Matter::Voxels(octree, shown, level) = &packed else {
            panic!("{name}: no voxels");
        };
        let packing = octree.packing().unwrap();
        let one = PackingFactor {
            mean: 1.0,
            standard_error: 0.0,
        };
        let ones = MaterialPacking::from([Some(one); 3]);
        let levels = packing.levels.iter().map(|l| vec![ones; l.len()]);
        let ones = MeasuredPacking {
            walks: packing.walks,
            levels: levels.collect(),
        };
        let octree = Octree::clone(octree).with_packing(Some(ones)).unwrap();
        let strewn = Matter::Voxels(Arc::new(octree), *shown, *level);
        Sample {
            fibres,
            packed,
            strewn,
            fabric,
            path,
        }
    }

    fn measure(&self, matter: &Matter, incident: &[Angles], paths: u64, seed: u64) -> Vec<Albedo> {
        let loader = Loader::new();
        let patch = matter
            .patch(&self.fabric, &self.path, &options(&loader))
            .unwrap();
        let effort = Effort {
            paths,
            seed,
            target_error: None,
        };
        measure_albedos(&patch, incident, &effort, &unwatched)
            .unwrap()
            .list
    }
}

/// A share of the light.
type Part = fn(&Albedo) -> &Measured;

/// What is compared: its name, the goal as a share of the value, and the difference that
/// is no matter.
const PARTS: [(&str, Part, f64, f64); 3] = [
    ("R", |a| &a.reflected, 0.03, 0.0),
    ("T", |a| &a.transmitted, 0.05, 0.0),
    ("D", |a| &a.direct, 0.05, 0.003),
];

/// By how much a part misses its goal, beyond four standard errors; green.
fn miss(found: &Measured, truth: &Measured, goal: f64, floor: f64) -> f64 {
    let noise = 4.0 * f64::hypot(found.se[1], truth.se[1]);
    let allowed = (goal * truth.mean[1]).max(floor) + noise;
    ((found.mean[1] - truth.mean[1]).abs() - allowed).max(0.0) / truth.mean[1].max(floor)
}

fn incident(angles_deg: &[[f64; 2]]) -> Vec<Angles> {
    let one = |&[theta_deg, phi_deg]: &[f64; 2]| Angles { theta_deg, phi_deg };
    angles_deg.iter().map(one).collect()
}

/// Every fabric and part that is known to miss the goal, and by how much at most beyond
/// it, as a share of the value: see `docs/trust.md`.
const KNOWN_MISSES: [(&str, &str, f64); 3] = [
    ("charmeuse", "R", 0.08),
    ("charmeuse", "T", 0.2),
    ("charmeuse", "D", 0.4),
];

/// R within 3 %, T within 5 %, D within 5 % or 0.003: reduced, for organza under light
/// from straight above. The twin of organza reflects a third too little.
#[test]
fn packed_fabrics_are_the_fibres_they_stand_for() {
    let full = std::env::var_os("ORGANZA_FULL").is_some();
    let lights = incident(&[[0.0, 0.0], [60.0, 0.0], [60.0, 90.0]]);
    let (fabrics, lights, paths): (&[&str], _, _) = if full {
        (
            &["organza", "denim", "jersey", "charmeuse"],
            &lights[..],
            60_000,
        )
    } else {
        (&["organza"], &lights[..1], 3000)
    };
    let mut missed = Vec::new();
    for &name in fabrics {
        let sample = Sample::new(name);
        let truths = sample.measure(&sample.fibres, lights, paths, SEED);
        let found = sample.measure(&sample.packed, lights, paths, SEED + 1);
        for (found, truth) in found.iter().zip(&truths) {
            for (part_name, part, goal, floor) in PARTS {
                let (a, b) = (part(found), part(truth));
                let off = miss(a, b, goal, floor);
                let what = format!(
                    "{name} {:?} {part_name}: {:.4} for {:.4}, misses the goal by {off:.3}",
                    truth.incident, a.mean[1], b.mean[1]
                );
                println!("{what}");
                let known = KNOWN_MISSES
                    .iter()
                    .find(|k| (k.0, k.1) == (name, part_name))
                    .map_or(0.0, |k| k.2);
                if off > known {
                    missed.push(what);
                }
            }
        }
        if name == "organza" {
            let twin = sample.measure(&sample.strewn, &lights[..1], paths, SEED + 1)[0];
            let off = miss(&twin.reflected, &truths[0].reflected, 0.03, 0.0);
            assert!(off > 0.0, "seed {SEED}, twin: {twin:?} for {:?}", truths[0]);
        }
    }
    assert!(missed.is_empty(), "seed {SEED}: {missed:#?}");
}
