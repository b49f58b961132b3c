//! Scans of phantoms that are drawn from organza's own fabrics, against the fibres drawn.
use crate::known_answers::{Spread, bounds, scan, seeds_to_print, spread};
use glam::{DVec3, UVec3, Vec3};
use organza_basis::{Aabb, Budget, SegmentSource, unwatched};
use organza_scan::phantom::{Phantom, PhantomLook};
use organza_scan::{Scan, ScanSettings};
use organza_scene::fabric_file;
use organza_scene::loader::Loader;
use std::path::Path;

/// The fabric of `volumes/gauze_ct.tif`.
const GAUZE: &str = "[draft]\nweave = \"plain\"\n[warp]\nper_cm = 62.0\n[weft]\n\
    per_cm = 62.0\n[yarn.default]\npreset = \"silk\"\ntex = 3.0\nfibre_radius_um = 9.0\n\
    [tile]\nrepeats = [1, 1]\n";
const VOXEL_MM: f32 = 0.0035;
const RADIUS_MM: f32 = 0.009;

/// Grey values of air and fibre.
const AIR: f32 = 70.0;
const FIBRE: f32 = 170.0;

/// Blur in voxels, noise, and whether radius and grey value of fibre are given: more noise hides
/// the gaps between the fibres of yarns in some of the phantoms, which then count as one fibre.
const LOOKS: [(f32, f32, bool); 3] = [(0.5, 0.05, false), (0.8, 0.15, true), (1.0, 0.3, true)];

fn look(blur: f32, noise: f32, seed: u64) -> PhantomLook {
    PhantomLook {
        air: AIR,
        fibre: FIBRE,
        blur,
        noise,
        seed,
    }
}

/// A tile of the gauze with some air above and below.
fn gauze(seed: u64) -> Phantom {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("gauze_{seed}.toml"));
    std::fs::write(&path, format!("seed = {seed}\n{GAUZE}")).unwrap();
    let cloth = fabric_file::load(&path, &[], &Loader::new()).unwrap().cloth;
    let tile = cloth.tile().bounds_mm;
    let height = ((tile.max.z / VOXEL_MM).ceil() + 3.0) * VOXEL_MM;
    let bounds = Aabb::new(tile.min.with_z(-height), tile.max.with_z(height));
    Phantom::draw(&cloth, bounds, VOXEL_MM, &mut Budget::new(1 << 30)).unwrap()
}

/// Names of what is compared with bounds: median of the angle in degrees, relative errors of radius, grey value of fibre, density and length of fibre.
const NAMES: [&str; 5] = ["median", "radius", "grey value", "density", "length"];

struct Found {
    figures: [f32; 5],
    /// The median angle to axes whose rows and columns are exchanged, degrees.
    exchanged_deg: f32,
}

fn found(phantom: &mut Phantom, (blur, noise, is_given): (f32, f32, bool), seed: u64) -> Found {
    phantom.look(&look(blur, noise, seed));
    let settings = ScanSettings {
        fibre_radius_mm: is_given.then_some(RADIUS_MM),
        fibre: is_given.then_some(FIBRE),
        ..ScanSettings::new(DVec3::splat(VOXEL_MM.into()))
    };
    let (survey, field) = scan(phantom, &settings);
    let (mut angles, mut exchanged) = (Vec::new(), Vec::new());
    let (mut drawn, mut own) = (0.0f64, 0.0f64);
    let dims = phantom.dims();
    for i in 0..dims.element_product() {
        let cell = UVec3::new(i % dims.x, i / dims.x % dims.y, i / dims.x / dims.y);
        let (fill, axis) = phantom.truth(cell);
        let voxel = field.voxel(cell);
        drawn += f64::from(fill);
        own += f64::from(voxel.fill);
        if fill > 0.5 && voxel.fill > 0.0 {
            let angle = |a: Vec3| a.cross(axis).length().min(1.0).asin().to_degrees();
            let a = voxel.axis;
            angles.push(angle(a));
            exchanged.push(angle(Vec3::new(a.y, a.x, a.z)));
        }
    }
    let of = |list: &mut Vec<f32>, share: f32| {
        list.sort_by(f32::total_cmp);
        list[(share * list.len() as f32) as usize]
    };
    let radius = survey.fibre_radius_mm / RADIUS_MM;
    let density = (own / drawn) as f32;
    Found {
        figures: [
            of(&mut angles, 0.5),
            radius - 1.0,
            (survey.levels.fibre - AIR) / (FIBRE - AIR) - 1.0,
            density - 1.0,
            density / (radius * radius) - 1.0,
        ],
        exchanged_deg: of(&mut exchanged, 0.5),
    }
}

/// Mean and deviation over the seeds 2 to 7 of the fabric and of the noise;
/// `ORGANZA_SCAN_SEEDS=7` prints them.
const SPREADS: [Spread; 3] = [
    (
        [2.9013, 0.0182, -0.0034, 0.0029, -0.0326],
        [0.4019, 0.0045, 0.0011, 0.0010, 0.0087],
    ),
    (
        [3.5004, 0.0000, 0.0000, -0.0021, -0.0021],
        [0.5217, 0.0000, 0.0000, 0.0017, 0.0017],
    ),
    (
        [4.8061, 0.0000, 0.0000, -0.0066, -0.0066],
        [0.5821, 0.0000, 0.0000, 0.0081, 0.0081],
    ),
];

fn print_over_seeds(last: u64) {
    let mut drawn: Vec<Phantom> = (2..=last).map(gauze).collect();
    for look in LOOKS {
        let all: Vec<[f32; 5]> = (2..=last)
            .zip(&mut drawn)
            .map(|(seed, drawn)| found(drawn, look, seed).figures)
            .collect();
        println!("{look:?}: {:.4?}", spread(&all));
    }
}

#[test]
fn a_scanned_gauze_has_the_fibres_of_the_fabric() {
    if let Some(last) = seeds_to_print() {
        return print_over_seeds(last);
    }
    let mut drawn = gauze(1);
    for (look, spreads) in LOOKS.into_iter().zip(SPREADS) {
        let own = found(&mut drawn, look, 1);
        println!("{look:?}: {:?}", own.figures);
        for ((name, value), most) in NAMES.iter().zip(own.figures).zip(bounds(&spreads)) {
            let words = format!("{look:?}, seed 1: {name} is {value}; expected at most {most}");
            assert!(value.abs() <= most + 1e-6, "{words}");
            // Known bad: a radius that is a fifth too great, and the length of such fibres.
            let radius = 1.2f32;
            let bad = match *name {
                "radius" => radius * (1.0 + value) - 1.0,
                "length" => (1.0 + value) / (radius * radius) - 1.0,
                // Known bad: exchanged axes.
                "median" => own.exchanged_deg,
                _ => continue,
            };
            assert!(
                bad.abs() > most,
                "{look:?}, seed 1: {name}: {bad} passes, too"
            );
        }
    }
}

/// Gaps are hidden in the gauze of seed 3 at noise of 0.15, which is noticed; its twin is that of
/// seed 2, whose radius is right. `ORGANZA_FULL=1` takes the seeds 2 to 19 and all noises; the limit
/// was fitted to those up to 7.
#[test]
fn hidden_gaps_of_a_gauze_are_noticed() {
    let is_full = std::env::var_os("ORGANZA_FULL").is_some();
    let (seeds, looks) = match is_full {
        true => (2..=19, &LOOKS[..]),
        false => (2..=3, &LOOKS[1..2]),
    };
    let mut bundles = [0; 2];
    for seed in seeds {
        let mut phantom = gauze(seed);
        for &(blur, noise, _) in looks {
            phantom.look(&look(blur, noise, seed));
            let settings = ScanSettings::new(DVec3::splat(VOXEL_MM.into()));
            let budget = &mut Budget::new(2 << 30);
            let survey =
                Scan::survey(&mut phantom, &settings, budget, &|_, _| unwatched(())).unwrap();
            let is_bundle = survey.fibre_radius_mm > 1.5 * RADIUS_MM;
            bundles[usize::from(is_bundle)] += 1;
            assert_eq!(
                survey.shows_bundles(),
                is_bundle,
                "seed {seed}, noise {noise}: {survey:?}"
            );
        }
    }
    assert!(bundles[0] > 0 && bundles[1] > 0, "{bundles:?}");
}
