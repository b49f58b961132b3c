//! Pills: as many as asked for, of their size, of the yarns' fibres, on the face and held by it.

use super::*;
use crate::clump::STRAY_EXTENT;
use crate::{PillSpec, PrintSide, WearSpec};

const BLUE: Rgb = Rgb::new(0.05, 0.1, 0.4);
const GREY: Rgb = Rgb::new(0.3, 0.3, 0.3);

fn spec(per_cm2: f64, size_mm: [f64; 2]) -> WearSpec {
    let colour = "colour = [0.3, 0.3, 0.3]";
    let pills = format!("per_cm2 = {per_cm2}, size_mm = {size_mm:?}");
    parsed(&format!("{colour}\npills = {{ {pills} }}"))
}

fn plain(repeats: u32) -> FabricGeometry {
    let mut fabric = fabric("plain");
    fabric.warp.colours = vec![BLUE];
    fabric.weft.colours = vec![GREY];
    fabric.tile.repeats = [repeats, repeats];
    fabric
}

fn worn(repeats: u32, spec: &WearSpec, seed: u64) -> Cloth {
    let mut cloth = Cloth::build(&plain(repeats), &no_files, seed).unwrap();
    cloth.wear(spec).unwrap();
    cloth
}

/// Their number is a Poisson number. Of 60 cloths, the variance is known to `sqrt(2 / 59)`, of
/// which four are allowed.
#[test]
fn pills_are_a_poisson_process() {
    let mut cloth = Cloth::build(&plain(20), &no_files, 0).unwrap();
    let heights = heights::Heights::of(&cloth);
    let area = cloth.tile().period_mm();
    let expected = 0.01 * 12.0 * f64::from(area.x * area.y);
    let mut counts = |per_cm2: f64| -> Vec<f64> {
        let mut count = |seed| {
            cloth.seed = seed;
            let spec = PillSpec {
                per_cm2,
                size_mm: [0.6, 0.1],
            };
            let pills = pills::pills(&cloth, &spec, PrintSide::Face, &heights);
            pills.unwrap().len() as f64
        };
        (0..60).map(&mut count).collect()
    };
    let mean_of = |counts: &[f64]| counts.iter().sum::<f64>() / counts.len() as f64;
    let all = counts(12.0);
    let mean = mean_of(&all);
    let error = 4.0 * (expected / 60.0).sqrt();
    assert!(
        (mean - expected).abs() < error,
        "seeds 0 to 59: {mean} for {expected}"
    );
    let square: f64 = all.iter().map(|c| (c - mean).powi(2)).sum();
    let spread = 4.0 * (2.0f64 / 59.0).sqrt();
    let variance = square / 59.0;
    assert!(
        (variance / expected - 1.0).abs() < spread,
        "seeds 0 to 59: {variance} for {expected}"
    );
    // The twin: twice as many.
    assert!((mean_of(&counts(24.0)) - expected).abs() > error);
}

/// Fibres lie in the ball, or on their way to it out of a yarn; they are of the yarns beneath it,
/// and fill what a ball of the size holds.
#[test]
fn pills_are_balls_of_the_fibres_of_their_yarns() {
    const SEED: u64 = 3;
    let without = Cloth::build(&plain(12), &no_files, SEED).unwrap();
    let cloth = worn(12, &spec(12.0, [0.8, 0.2]), SEED);
    let threads = without.batch_count();
    assert!(cloth.pills.len() > 5 && cloth.batch_count() == threads + cloth.pills.len());
    let crown = without.tile().bounds_mm.max.z;
    let (mut blue, mut all_mm, mut anchors) = (0.0, 0.0, 0);
    for (i, pill) in cloth.pills.iter().enumerate() {
        let mut volume = 0.0;
        let mut fibre = None;
        let mut is_inside = true;
        cloth.for_each_in_batch(threads + i, &mut |s| {
            let middle = (0.5 * (s.start_mm + s.end_mm)).as_dvec3();
            let extent = pill.clump.extent(middle);
            if fibre.replace(s.fibre) != Some(s.fibre) {
                is_inside = extent < 1.0;
                anchors += usize::from(!is_inside);
            }
            is_inside |= extent < 1.0;
            // Once inside, a fibre stays or strays a little.
            assert!(
                !is_inside || extent < 1.01 * STRAY_EXTENT,
                "seed {SEED}: {extent}"
            );
            let length_mm = f64::from(s.length_mm());
            if is_inside {
                let piece = length_mm * f64::from(s.start_radius_mm).powi(2);
                volume += std::f64::consts::PI * piece;
            }
            all_mm += length_mm;
            blue += length_mm * f64::from(u8::from(colour(&cloth, s) == Some(BLUE)));
        });
        let wanted = std::f64::consts::PI * pill.clump.fibre_mm(1.0);
        assert!(
            (volume / wanted - 1.0).abs() < 0.2,
            "seed {SEED}: {volume} for {wanted}"
        );
        assert!(pill.top_mm() > f64::from(crown), "it stands out");
    }
    assert!(anchors > 2 * cloth.pills.len(), "seed {SEED}: {anchors}");
    // Warp and weft are as near to a pill on plain weave.
    let share = blue / all_mm;
    assert!((0.3..0.7).contains(&share), "seed {SEED}: {share}");
    // The yarns are as they were.
    assert_eq!(segments(&without), segments_of(&cloth, 0..threads));
    assert_eq!(cloth.plies().unfit(), Some("pills"));
}

/// Every fibre of a pill has the radius of the part of the blend whose material it has.
#[test]
fn pills_of_a_nonwoven_are_of_the_parts_of_its_blend() {
    let text = "[nonwoven]\nfibre = 'felt'\nareal_density_g_per_m2 = 60\nthickness_mm = 0.5\n\
                length_mm = 20\ntile_mm = [3.0, 3.0]\n[yarn.felt]\npreset = 'wool'\ntex = 60\nblend \
                = [\n{ mass_share = 70, fibre = 'wool' },\n{ mass_share = 30, fibre = 'nylon', \
                fibre_radius_um = 7.5 },\n]\n";
    let mut cloth = build(&parsed(text));
    cloth.wear(&spec(20.0, [0.5, 0.1])).unwrap();
    assert!(!cloth.pills.is_empty());
    let mut counts = [0; 2];
    for s in segments_of(&cloth, cloth.whole_batches()..cloth.batch_count()) {
        let material = &cloth.materials()[usize::from(s.material)];
        assert_eq!(s.start_radius_mm, material.fibre_radius_mm);
        counts[usize::from(material.fibre.as_deref() == Some("nylon"))] += 1;
    }
    assert!(counts.iter().all(|n| *n > 100), "{counts:?}");
}

#[test]
fn pills_lie_on_the_side_that_is_worn() {
    for (side, has_face, has_back) in [
        (PrintSide::Face, true, false),
        (PrintSide::Back, false, true),
        (PrintSide::Both, true, true),
    ] {
        let pills = spec(20.0, [0.5, 0.1]);
        let cloth = worn(8, &WearSpec { side, ..pills }, 1);
        let heights: Vec<f64> = cloth.pills.iter().map(|p| p.clump.middle_mm.z).collect();
        assert_eq!(heights.iter().any(|z| *z > 0.0), has_face);
        assert_eq!(heights.iter().any(|z| *z < 0.0), has_back);
        let bounds = cloth.tile().bounds_mm;
        for s in segments_of(&cloth, cloth.threads.len()..cloth.batch_count()) {
            assert!(s.start_mm.z > bounds.min.z && s.start_mm.z < bounds.max.z);
        }
    }
}

#[test]
fn pills_that_cannot_be_are_refused() {
    let refused = |repeats: u32, spec: WearSpec, expected: &str| {
        let mut cloth = build(&plain(repeats));
        assert_contains(&cloth.wear(&spec).unwrap_err().to_string(), expected);
    };
    for (repeats, per_cm2, size_mm, expected) in [
        (
            8,
            100.0,
            [1.0, 0.1],
            "wear.pills: 100 per cm2 of 1 mm would cover 79 %",
        ),
        (1, 1.0, [3.0, 0.1], "expected a tile as wide as a pill"),
        (8, -1.0, [1.0, 0.1], "wear.pills.per_cm2: expected a number"),
        (
            8,
            1.0,
            [1.0, 0.6],
            "wear.pills.size_mm[1]: expected a number from 0 to 0.5, found 0.6",
        ),
    ] {
        refused(repeats, spec(per_cm2, size_mm), expected);
    }
    let mut none = spec(1.0, [1.0, 0.1]);
    none.pills = None;
    refused(1, none, "wear.amount: is missing");
    let mut half = spec(1.0, [1.0, 0.1]);
    half.amount = Some(0.5);
    refused(1, half, "wear.depth_um: is missing");
}
