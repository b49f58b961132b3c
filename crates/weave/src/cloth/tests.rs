mod bending;
mod blended;
mod covered;
mod crimped;
mod displaced;
mod flattening;
mod fulled;
mod imported;
mod irregular;
mod layered;
mod missing;
mod nepped;
mod nonwoven;
mod openwork;
mod pile;
mod pilled;
mod printed;
mod reading;
mod shipped;
mod smooth_hairs;
mod spun;
mod tufted;
mod twist;
mod worn;

use super::*;
use crate::FabricGeometry;
use crate::spec::{DraftSpec, TileSpec, YarnSpec};
use crate::wif::example_drafts::{EXAMPLES, damask};
use organza_testing::{assert_contains, table_rows};

fn no_files(name: &str) -> std::io::Result<Vec<u8>> {
    Err(std::io::Error::new(
        std::io::ErrorKind::NotFound,
        name.to_owned(),
    ))
}

/// What a text in TOML describes.
fn parsed<T: serde::de::DeserializeOwned>(text: &str) -> T {
    toml::from_str(text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn fabric(weave: &str) -> FabricGeometry {
    let threads = "warp.per_cm = 20\nweft.per_cm = 18";
    parsed(&format!("draft.weave = '{weave}'\n{threads}"))
}

/// That fabric with other keys of its yarn.
fn fabric_of(weave: &str, yarn: &str) -> FabricGeometry {
    let mut f = fabric(weave);
    f.yarn.insert("cotton".to_owned(), parsed(yarn));
    f
}

const NO_FUZZ: &str = "hairs.per_mm = 0\nloops.per_mm = 0\n";

fn build(fabric: &FabricGeometry) -> Cloth {
    Cloth::build(fabric, &no_files, 7).unwrap()
}

/// Why there is no cloth of a fabric.
fn refusal(fabric: &FabricGeometry) -> String {
    let refused = Cloth::build(fabric, &no_files, 1);
    refused.unwrap_err().to_string()
}

/// The segments of some batches, one batch after the other.
fn segments_of(cloth: &Cloth, batches: impl IntoIterator<Item = usize>) -> Vec<Segment> {
    let mut all = Vec::new();
    for batch in batches {
        cloth.for_each_in_batch(batch, &mut |s| all.push(*s));
    }
    all
}

fn segments(cloth: &Cloth) -> Vec<Segment> {
    segments_of(cloth, 0..cloth.batch_count())
}

/// Calls a function with the number and the fibres of every thread.
fn for_each_strand(cloth: &Cloth, mut visit: impl FnMut(usize, &Strand)) {
    for (batch, thread) in cloth.threads.iter().enumerate() {
        let path = cloth.path(thread, CurveLevel::Fibre);
        visit(batch, &cloth.strand(batch, &path));
    }
}

/// The colour of the material of a segment, if it has one.
fn colour(cloth: &Cloth, segment: &Segment) -> Option<Rgb> {
    cloth.materials()[usize::from(segment.material)].colour
}

/// Heights of warp and weft where end `e` crosses pick `p`, from the curves.
fn heights(cloth: &Cloth, e: usize, p: usize) -> (f32, f32) {
    let at = |batch: usize, axis: usize, place: f32| {
        let mut best = (f32::INFINITY, 0.0);
        let source = cloth.curves(CurveLevel::Yarn);
        let period = source.tile().period_mm()[axis];
        source.for_each_in_batch(batch, &mut |s| {
            let away = (s.start_mm[axis] - place).rem_euclid(period);
            let away = away.min(period - away);
            if away < best.0 {
                best = (away, s.start_mm.z);
            }
        });
        best.1
    };
    let ends = cloth.draft().unwrap().ends();
    let across = |batch, axis| {
        let mut place = 0.0;
        cloth
            .curves(CurveLevel::Yarn)
            .for_each_in_batch(batch, &mut |s| place = s.start_mm[axis]);
        place
    };
    (at(e, 1, across(ends + p, 1)), at(ends + p, 0, across(e, 0)))
}

#[test]
fn a_planted_draft_is_read_back_from_the_heights_of_the_curves() {
    for weave in [
        "plain",
        "twill-3-1-s",
        "satin-8-3",
        "basket-2-2",
        "herringbone",
    ] {
        let cloth = build(&fabric(weave));
        let planted = Draft::named(weave).unwrap();
        let (ends, picks) = (
            cloth.draft().unwrap().ends(),
            cloth.draft().unwrap().picks(),
        );
        for i in 0..ends * picks {
            let (e, p) = (i % ends, i / ends);
            let (warp, weft) = heights(&cloth, e, p);
            assert_eq!(warp > weft, planted.warp_up(e, p), "{weave} {e} {p}");
        }
    }
}

/// Every curve's end must be another's (or its own) start, one period on.
fn assert_closed(cloth: &Cloth, level: CurveLevel) {
    let source = cloth.curves(level);
    for batch in 0..source.batch_count() {
        let mut ends: Vec<(Segment, Segment)> = Vec::new();
        let path = cloth.path(&cloth.threads[batch], level);
        let strand = cloth.strand(batch, &path);
        let pieces = match level {
            CurveLevel::Fibre => strand.closure.fibres_per_ply() * strand.yarn.plies,
            _ => u32::MAX,
        };
        source.for_each_in_batch(batch, &mut |s| match ends.last_mut() {
            // Hairs come last and end where they like.
            _ if s.fibre >= pieces => {}
            Some((first, last)) if first.fibre == s.fibre => {
                assert_eq!(last.end_mm, s.start_mm, "curves are unbroken");
                assert_eq!(last.end_tangent, s.start_tangent);
                *last = *s;
            }
            _ => ends.push((*s, *s)),
        });
        let period = source.tile().period_mm().extend(0.0);
        let warps = cloth.draft().map_or(0, Draft::ends);
        let along = if batch < warps { Vec3::Y } else { Vec3::X };
        // Single precision of the largest coordinate.
        let near = 2e-6 + 2e-7 * period.max_element();
        let mut starts = vec![0u32; ends.len()];
        for (_, last) in &ends {
            let wanted = last.end_mm - along * period;
            let matches = |first: &Segment| {
                first.start_mm.distance(wanted) < near
                    && first.start_tangent.distance(last.end_tangent) < 1e-4
            };
            let next = ends.iter().position(|(first, _)| matches(first));
            starts[next.unwrap_or_else(|| panic!("{level:?} {batch}: {last:?} goes nowhere"))] += 1;
        }
        assert!(
            starts.iter().all(|&n| n == 1),
            "each start continues one end"
        );
    }
}

#[test]
fn every_curve_continues_across_the_border_of_the_tile() {
    let mut f = fabric("twill-2-1-s");
    f.weft.yarn = vec!["two".to_owned(), "wool".to_owned()];
    f.yarn.insert("two".to_owned(), parsed("plies = 2"));
    f.tile = TileSpec { repeats: [1, 2] };
    let cloth = build(&f);
    for level in [CurveLevel::Yarn, CurveLevel::Ply, CurveLevel::Fibre] {
        assert_closed(&cloth, level);
    }
}

#[test]
fn the_tile_holds_every_height() {
    let cloth = build(&fabric("satin-5-2"));
    let bounds = cloth.tile().bounds_mm;
    for s in segments(&cloth) {
        let b = s.bounds_mm();
        let inside = b.min.z >= bounds.min.z - 1e-6 && b.max.z <= bounds.max.z + 1e-6;
        assert!(inside, "{s:?} leaves {bounds:?}");
    }
}

/// Streams everything: number of segments and length without hairs.
fn poured(cloth: &Cloth) -> (usize, f64) {
    let (mut count, mut length) = (0, 0.0);
    for_each_strand(cloth, |batch, strand| {
        let pieces = strand.closure.fibres_per_ply() * strand.yarn.plies;
        cloth.for_each_in_batch(batch, &mut |s| {
            count += 1;
            if s.fibre < pieces {
                length += f64::from(s.length_mm());
            }
        });
    });
    (count, length)
}

#[test]
fn figures_agree_with_the_fibres_and_with_closed_forms() {
    let yarn = "plies = 2\naspect = 1\nloops.per_mm = 0";
    let cloth = build(&fabric_of("twill-2-2", yarn));
    let figures = cloth.figures();
    let (_, length) = poured(&cloth);
    assert!(
        (figures.fibre_length_mm / length - 1.0).abs() < 0.01,
        "{figures:?} {length}"
    );
    let (warp, weft) = (figures.warp.clone().unwrap(), figures.weft.clone().unwrap());
    assert!((warp.threads_per_cm - 20.0).abs() < 4.0 * f64::from(f32::EPSILON));
    assert!((weft.threads_per_cm - 18.0).abs() < 16.0 * f64::from(f32::EPSILON));
    assert!((warp.tex / 30.0 - 1.0).abs() < 0.02);
    // tex (g/km) x ends/cm x (1 + crimp) x 0.1 is g/m^2 of one system.
    let mass = |s: &SystemFigures| 0.1 * s.tex * s.threads_per_cm * (1.0 + s.crimp_percent / 100.0);
    let textbook = mass(&warp) + mass(&weft);
    assert!(
        (figures.areal_density_g_per_m2 / textbook - 1.0).abs() < 0.03,
        "{figures:?} {textbook}"
    );
    let yarn = &cloth.yarns()[0];
    let cover = 2.0 * yarn.radius_mm() / 0.5;
    assert!((warp.cover_factor - cover).abs() < 1e-6);
    let both = 1.0 - (1.0 - cover) * (1.0 - 2.0 * yarn.radius_mm() * 1.8);
    assert!((figures.cover_factor - both).abs() < 4.0 * f64::from(f32::EPSILON));
    let volume = figures.areal_density_g_per_m2 / (1000.0 * 1.52 * figures.thickness_mm);
    assert!((figures.fibre_volume_fraction / volume - 1.0).abs() < 4.0 * f64::from(f32::EPSILON));
    // Two threads on top of each other at least, four at most.
    assert!(
        (3.9..8.0).contains(&(figures.thickness_mm / yarn.radius_mm())),
        "{figures:?}"
    );
}

#[test]
fn crimp_of_a_plain_weave_follows_its_curve() {
    let cloth = build(&fabric("plain"));
    let figures = cloth.figures();
    let warp = figures.warp.unwrap();
    let Centreline::Woven { curve, .. } = &cloth.threads[0].line else {
        panic!("woven");
    };
    // Quadrature of the arc length.
    let n = 2000;
    let length: f64 = (0..curve.height_mm.len())
        .flat_map(|k| (0..n).map(move |i| (k, (f64::from(i) + 0.5) / f64::from(n))))
        .map(|(k, t)| curve.interval(k).0 / f64::from(n) * curve.at(k, t).1.hypot(1.0))
        .sum();
    let crimp = 100.0 * (length / curve.period_mm() - 1.0);
    assert!(
        (warp.crimp_percent / crimp - 1.0).abs() < 0.01,
        "{} {crimp}",
        warp.crimp_percent
    );
}

#[test]
fn twist_turns_the_way_of_its_letter() {
    for (direction, sign) in [("Z", 1.0), ("S", -1.0)] {
        let twist = format!("twist = {{ direction = '{direction}', angle_deg = 30 }}");
        let cloth = build(&fabric_of("plain", &twist));
        // On the face of a warp yarn, seen with y up, Z runs like `/`.
        let mut slope = 0.0;
        cloth.for_each_in_batch(0, &mut |s| {
            slope += f64::from(s.start_tangent.x * s.start_tangent.y.signum() * s.start_mm.z);
        });
        assert!(slope * sign > 0.0, "{direction}: {slope}");
    }
}

#[test]
fn seeds_make_cloths_and_yarns_differ_and_equal_seeds_do_not() {
    let f = fabric("plain");
    let collect = |seed, batch| -> Vec<Vec3> {
        let cloth = Cloth::build(&f, &no_files, seed).unwrap();
        let all = segments_of(&cloth, [batch]);
        all.iter().map(|s| s.start_tangent).collect()
    };
    assert_eq!(collect(1, 0), collect(1, 0));
    assert_ne!(collect(1, 0), collect(2, 0));
    assert_ne!(collect(1, 0)[..50], collect(1, 1)[..50]);
}

#[test]
fn knits_are_closed_and_weigh_what_their_loops_do() {
    for name in crate::knit::NAMES {
        let f = knit(name);
        let cloth = build(&f);
        assert!(cloth.draft().is_none());
        for level in [CurveLevel::Yarn, CurveLevel::Fibre] {
            assert_closed(&cloth, level);
        }
        let figures = cloth.figures();
        assert!((figures.wales_per_cm.unwrap() - 8.0).abs() < 4.0 * f64::from(f32::EPSILON));
        let (_, length) = poured(&cloth);
        assert!(
            (figures.fibre_length_mm / length - 1.0).abs() < 0.03,
            "{name}"
        );
        let bounds = cloth.tile().bounds_mm;
        cloth.for_each_in_batch(0, &mut |s| {
            let b = s.bounds_mm();
            assert!(b.min.z >= bounds.min.z && b.max.z <= bounds.max.z);
        });
    }
}

fn knit(name: &str) -> FabricGeometry {
    let mut f = fabric("plain");
    f.draft = DraftSpec {
        knit: Some(name.to_owned()),
        wales_per_cm: Some(8.0),
        ..DraftSpec::default()
    };
    f.weft.per_cm = Some(11.0);
    f
}

#[test]
fn hairs_are_as_many_as_asked_for_and_stand_out() {
    let f = fabric_of("plain", "hairs.per_mm = 2.3");
    let (mut hairs, mut expected, mut threads) = (0.0, 0.0, 0.0);
    for seed in 0..40 {
        for_each_strand(&Cloth::build(&f, &no_files, seed).unwrap(), |_, strand| {
            let mut last = None;
            strand.emit_hairs(0, &mut |s| {
                if last.replace(s.fibre) != Some(s.fibre) {
                    hairs += 1.0;
                }
            });
            expected += 2.3 * strand.path.length_mm();
            threads += 1.0;
        });
    }
    // Each thread rounds its number up or down: variance a quarter at most.
    let deviation = (0.25f64 * threads).sqrt();
    assert!(
        (hairs - expected).abs() < 4.0 * deviation,
        "seeds 0 to 39: {hairs} {expected}"
    );
    assert!(
        (hairs - 1.1 * expected).abs() > 4.0 * deviation,
        "a tenth more would be seen"
    );
}

/// The nearest that the centrelines of two threads come, of those that `counts` names by their
/// numbers, in units of their diameter.
fn nearest(cloth: &Cloth, counts: impl Fn(usize, usize) -> bool) -> f64 {
    let period = cloth.tile().period_mm();
    let points = |thread| -> Vec<Vec3> {
        let path = cloth.path(thread, CurveLevel::Ply);
        path.points.iter().map(|p| p.as_vec3()).collect()
    };
    let points: Vec<Vec<Vec3>> = cloth.threads.iter().map(points).collect();
    let mut nearest = f32::INFINITY;
    for (i, a) in points.iter().enumerate() {
        for (_, b) in points[..i]
            .iter()
            .enumerate()
            .filter(|(j, _)| counts(i, *j))
        {
            for (a, b) in a.iter().flat_map(|a| b.iter().map(move |b| (*a, *b))) {
                let mut d = a - b;
                d.x -= period.x * (d.x / period.x).round();
                d.y -= period.y * (d.y / period.y).round();
                nearest = nearest.min(d.length());
            }
        }
    }
    f64::from(nearest) / (2.0 * cloth.yarns()[0].radius_mm())
}

#[test]
fn crossing_yarns_stay_apart_between_crossings_too() {
    for (weave, least) in [("plain", 0.9), ("twill-2-2", 0.9), ("satin-5-2", 0.9)] {
        let cloth = build(&fabric_of(weave, "aspect = 1"));
        let ends = cloth.draft().unwrap().ends();
        let share = nearest(&cloth, |a, b| (a < ends) != (b < ends));
        println!("{weave}: nearest {share:.3} of touching");
        assert!(share > least, "{weave}: {share}");
    }
}
