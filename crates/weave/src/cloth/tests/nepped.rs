//! Neps: as many as asked for, within their size, of their colours, held by the yarn.

use super::irregular::irregular;
use super::*;
use crate::clump::STRAY_EXTENT;
use crate::neps::Nep;
use crate::spec::NepSpec;
use organza_basis::PathRng;

const GOLD: Rgb = Rgb::new(0.6, 0.4, 0.05);
const RED: Rgb = Rgb::new(0.5, 0.05, 0.05);

fn spec(per_m: f64, size_mm: [f64; 2]) -> NepSpec {
    NepSpec {
        per_m,
        size_mm,
        colours: vec![GOLD, RED, GOLD],
    }
}

fn nepped(repeats: u32, neps: Option<NepSpec>) -> FabricGeometry {
    let mut fabric = irregular(repeats, "tex = 40");
    (fabric.warp.per_cm, fabric.weft.per_cm) = (Some(14.0), Some(14.0));
    fabric.yarn.get_mut("cotton").unwrap().neps = neps;
    fabric
}

fn with_neps(repeats: u32, neps: Option<NepSpec>, seed: u64) -> Cloth {
    Cloth::build(&nepped(repeats, neps), &no_files, seed).unwrap()
}

fn neps(cloth: &Cloth) -> (Vec<Nep>, f64) {
    let (mut all, mut length_mm) = (Vec::new(), 0.0);
    for_each_strand(cloth, |_, strand| {
        all.extend(strand.neps());
        length_mm += strand.path.length_mm();
    });
    (all, length_mm)
}

/// The fibres of the cloth that have one of the colours of neps.
fn fibres(cloth: &Cloth) -> Vec<(usize, Vec<Segment>)> {
    let mut all: Vec<(usize, Vec<Segment>)> = Vec::new();
    for batch in 0..cloth.threads.len() {
        let mut fibre = None;
        let coloured = |s: &Segment| colour(cloth, s).is_some();
        for s in segments_of(cloth, [batch]).into_iter().filter(coloured) {
            if fibre.replace(s.fibre) != Some(s.fibre) {
                all.push((batch, Vec::new()));
            }
            all.last_mut().unwrap().1.push(s);
        }
    }
    all
}

/// How many there are is a Poisson number: its mean and its variance are as expected. Of 60 cloths,
/// the variance is known to `sqrt(2 / 59)`, of which four are allowed.
#[test]
fn neps_are_a_poisson_process() {
    let counts = |per_m: f64| -> (Vec<f64>, f64) {
        let mut expected = 0.0;
        let count = |seed| {
            let (neps, length_mm) = neps(&with_neps(2, Some(spec(per_m, [0.4, 0.1])), seed));
            expected = 1e-3 * 300.0 * length_mm;
            neps.len() as f64
        };
        ((0..60).map(count).collect(), expected)
    };
    let moments = |counts: &[f64]| {
        let n = counts.len() as f64;
        let mean = counts.iter().sum::<f64>() / n;
        let square = counts.iter().map(|c| (c - mean).powi(2)).sum::<f64>();
        (mean, square / (n - 1.0))
    };
    let (all, expected) = counts(300.0);
    let (mean, variance) = moments(&all);
    let error = 4.0 * (expected / 60.0).sqrt();
    assert!(
        (mean - expected).abs() < error,
        "seeds 0 to 59: {mean} for {expected}"
    );
    let spread = 4.0 * (2.0f64 / 59.0).sqrt();
    assert!(
        (variance / expected - 1.0).abs() < spread,
        "seeds 0 to 59: {variance} for {expected}"
    );
    // The twin: twice as many.
    let (mean, _) = moments(&counts(600.0).0);
    assert!((mean - expected).abs() > error, "{mean}");
}

/// Every fibre of a nep lies within it or strays a little, but for its root, which lies in the
/// yarn; neps have the volume and the colours that were asked for, and a part of them stands out of
/// the yarn.
#[test]
fn neps_are_small_coloured_and_half_out() {
    const SEED: u64 = 5;
    let cloth = with_neps(6, Some(spec(400.0, [0.5, 0.1])), SEED);
    let (all, _) = neps(&cloth);
    let fibres = fibres(&cloth);
    assert!(all.len() > 30 && fibres.len() > all.len());
    let (mut volume, mut out, mut in_all, mut gold) = (0.0, 0.0, 0.0, 0.0);
    for (batch, fibre) in &fibres {
        let path = cloth.path(&cloth.threads[*batch], CurveLevel::Fibre);
        let strand = &cloth.strand(*batch, &path);
        let mut beside = crate::protruding::Beside { strand, nearest: 0 };
        beside.search(fibre[0].start_mm.as_dvec3());
        for s in fibre {
            let at = (0.5 * (s.start_mm + s.end_mm)).as_dvec3();
            let radii = beside.follow(at).1;
            let extents = all.iter().map(|n| n.clump.extent(at));
            let extent = extents.fold(f64::INFINITY, f64::min);
            assert!(
                extent < 1.001 * STRAY_EXTENT || radii < 1.01,
                "seed {SEED}: {extent} {radii}"
            );
            if extent < 1.001 * STRAY_EXTENT {
                let piece = f64::from(s.length_mm() * s.start_radius_mm.powi(2));
                volume += std::f64::consts::PI * piece;
                out += f64::from(s.length_mm()) * f64::from(u8::from(radii > 1.0));
                in_all += f64::from(s.length_mm());
            }
        }
        gold += f64::from(u8::from(colour(&cloth, &fibre[0]) == Some(GOLD)));
    }
    let balls = all.iter().map(|n| n.size_mm.powi(3)).sum::<f64>();
    let wanted = crate::clump::FILL * std::f64::consts::PI / 6.0 * balls;
    assert!(
        (volume / wanted - 1.0).abs() < 0.1,
        "seed {SEED}: {volume} for {wanted}"
    );
    // Two of three colours are gold: neps have several fibres, so they are what is counted.
    let error = 4.0 * (2.0 / 9.0 / all.len() as f64).sqrt();
    let share = gold / fibres.len() as f64;
    assert!(
        (share - 2.0 / 3.0).abs() < error,
        "seed {SEED}: {share} +- {error}"
    );
    let outside = out / in_all;
    assert!((0.2..0.8).contains(&outside), "seed {SEED}: {outside}");
    // Size is mean and deviation.
    let mean = all.iter().map(|n| n.size_mm).sum::<f64>() / all.len() as f64;
    let error = 4.0 * 0.1 / (all.len() as f64).sqrt();
    assert!((mean - 0.5).abs() < error, "seed {SEED}: {mean}");
    // All lies within the heights of the tile.
    let bounds = cloth.tile().bounds_mm;
    for s in fibres.iter().flat_map(|f| &f.1) {
        assert!(s.start_mm.z > bounds.min.z && s.start_mm.z < bounds.max.z);
    }
}

/// Neps come on top of what the yarn was without them, and need no colours.
#[test]
fn neps_change_nothing_else() {
    let [without, with] = [None, Some(spec(400.0, [0.5, 0.1]))].map(|n| with_neps(2, n, 7));
    let mut more = 0;
    for batch in 0..without.batch_count() {
        let [plain, nepped] = [&without, &with].map(|cloth| segments_of(cloth, [batch]));
        let same = |(a, b): (&Segment, &Segment)| a.start_mm == b.start_mm && a.fibre == b.fibre;
        assert!(plain.iter().zip(&nepped).all(same));
        more += nepped.len() - plain.len();
    }
    assert!(more > 1000);
    let own = NepSpec {
        colours: Vec::new(),
        ..spec(400.0, [0.5, 0.1])
    };
    assert!(fibres(&with_neps(2, Some(own), 7)).is_empty());
}

/// The first distance of this seed is zero, which times any other is no end.
#[test]
fn a_yarn_without_neps_has_none() {
    const SEED: u64 = 1_061_773;
    let mut cloth = with_neps(1, None, 7);
    cloth.seed = SEED;
    let mut rng = PathRng::new(SEED, 0, neps::NEP);
    assert_eq!(rng.exponential(), 0.0, "seed {SEED}");
    assert_eq!(neps(&cloth).0.len(), 0);
}

/// Neps of a yarn of which only cut pile is made.
#[test]
fn neps_of_cut_pile_and_nonwovens_are_warned_of() {
    let pile = "[draft]\nweave = 'plain'\n[warp]\nyarn = 'cotton'\nper_cm = 20\n[weft]\nyarn = \
                'cotton'\nper_cm = 18\n[tile]\nrepeats = [2, 2]\n[pile]\nkind = 'cut'\nyarn = \
                'fluffy'\nheight_mm = 1.5\nevery = [2, 2]\n";
    let web = "[nonwoven]\nfibre = 'fluffy'\nareal_density_g_per_m2 = 60\nthickness_mm = 0.5\n\
               length_mm = 20\ntile_mm = [1.0, 1.0]\n";
    let keys = "[yarn.fluffy]\npreset = 'wool'\nfulling = 0.5\nneps = { per_m = 40, size_mm = [0.5, \
                0.1] }\n";
    for fabric in [pile, web] {
        let cloth = build(&parsed(&format!("{fabric}{keys}")));
        for key in ["neps", "fulling"] {
            let words = format!("yarn.fluffy.{key} has no effect");
            let found = cloth.warnings().iter().filter(|w| w.contains(&words));
            assert_eq!(found.count(), 1, "{:?}", cloth.warnings());
        }
        assert!(cloth.openings.is_none());
    }
    // The twin: threads of the yarn.
    let both = pile.replace(
        "yarn = 'cotton'\nper_cm = 18",
        "yarn = 'fluffy'\nper_cm = 8",
    );
    let cloth = build(&parsed(&format!("{both}{keys}")));
    let warned = cloth.warnings().iter().any(|w| w.contains("has no effect"));
    assert!(!warned && cloth.openings.is_some());
}

#[test]
fn neps_that_cannot_be_are_refused() {
    const WRONG: &str = "
per_m = -1, size_mm = [0.5, 0.1] | neps.per_m: expected a number from
per_m = 9, size_mm = [50, 0.1] | neps.size_mm[0]: expected a number
per_m = 9, size_mm = [0.5, 0.3] | neps.size_mm[1]: expected a number from 0 to 0.25, found 0.3
per_m = 900, size_mm = [2, 0.1] | would weigh
per_m = 1, size_mm = [0.8, 0.1] | neps: expected a tile as wide as a nep, 2.15 mm, found
per_m = 9, size_mm = [0.5, 0.1], colours = [[2, 0, 0]] | \
    neps.colours[0]: expected a number from 0 to 1
";
    for [neps, words] in table_rows(WRONG) {
        let error = refusal(&irregular(1, &format!("neps = {{ {neps} }}")));
        assert_contains(&error, words);
    }
}
