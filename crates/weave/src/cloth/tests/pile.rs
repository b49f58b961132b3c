//! Pile: heights, densities and lean come out as they were asked for, inside the tile.

use super::*;
use crate::separate::{Line, Room, overlap};
use glam::DVec2;

const CUT: &str = "kind = 'cut'\nyarn = 'rayon'\nheight_mm = 1.5\nevery = [2, 2]\n\
                   height_cv_percent = 4\nlean_deviation_deg = 6";
const LOOP: &str = "kind = 'loop'\nyarn = 'cotton'\nheight_mm = 2\nevery = [1, 3]\n\
                    sides = 'both'\nlean_deviation_deg = 12";
const WALE: &str = "kind = 'wale'\nyarn = 'cotton'\nheight_mm = 1\nevery = [1, 1]\n\
                    wales_per_cm = 5";

fn with_pile(pile: &str, repeats: u32) -> FabricGeometry {
    let mut f = fabric("plain");
    f.pile = parsed(pile);
    f.tile.repeats = [repeats, repeats];
    f
}

/// Mean displacement of the tips from where their fibre leaves the ground, per height.
fn mean_lean(cloth: &Cloth) -> DVec2 {
    let face = cloth.pile.as_ref().unwrap().face_mm;
    let (mut sum, mut count) = (DVec2::ZERO, 0.0);
    for batch in cloth.threads.len()..cloth.batch_count() {
        let mut root = DVec2::ZERO;
        let mut middle = DVec2::ZERO;
        let mut line: Vec<DVec3> = Vec::new();
        let mut end = |line: &[DVec3]| {
            let (Some(a), Some(b)) = (line.first(), line.last()) else {
                return;
            };
            // Both legs splay alike, so their tips' middle is above the root.
            middle = 0.5 * (a.truncate() + b.truncate());
            let lowest = line.iter().min_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
            root = lowest.truncate();
            sum += (middle - root) / (0.5 * (a.z + b.z) - face);
            count += 1.0;
        };
        let mut fibre = None;
        cloth.for_each_in_batch(batch, &mut |s| {
            if fibre.replace(s.fibre) != Some(s.fibre) {
                end(&std::mem::take(&mut line));
                line.push(s.start_mm.as_dvec3());
            }
            line.push(s.end_mm.as_dvec3());
        });
        end(&line);
    }
    sum / count
}

/// The twin leans the other way.
#[test]
fn cut_pile_has_its_height_density_and_lean() {
    for (lean_deg, direction_deg) in [(0.0f64, 90.0f64), (20.0, 90.0), (20.0, 270.0)] {
        let text = format!("{CUT}\nlean_deg = {lean_deg}\nlean_direction_deg = {direction_deg}");
        let cloth = build(&with_pile(&text, 8));
        let figures = cloth.figures().pile.unwrap();
        // 20 x 18 crossings per square centimetre, a tuft at every fourth.
        assert!(
            (figures.tufts_per_cm2 / 90.0 - 1.0).abs() < 4.0 * f64::from(f32::EPSILON),
            "{figures:?}"
        );
        // 64 tufts that vary by 3 %: four standard errors are 1.4 %.
        // Margin: four standard errors.
        assert!((figures.height_mm / 1.5 - 1.0).abs() < 0.015, "{figures:?}");
        let lean = mean_lean(&cloth);
        let wanted = lean_deg.to_radians().tan() * DVec2::from_angle(direction_deg.to_radians());
        // Tufts deviate by 4 degrees, so four standard errors over 64 are 0.04.
        // Margin: four standard errors.
        assert!(
            lean.distance(wanted) < 0.04,
            "{lean_deg}: {lean} for {wanted}"
        );
        if lean_deg > 0.0 {
            assert!(lean.distance(-wanted) > 0.04);
        }
    }
}

#[test]
fn pile_stays_inside_the_tile_and_is_the_same_every_time() {
    let pushed = format!("{CUT}\ncollide = true");
    for text in [CUT, LOOP, WALE, &pushed] {
        let cloth = build(&with_pile(text, 3));
        let bounds = cloth.tile().bounds_mm;
        let again = build(&with_pile(text, 3));
        let (mut top, mut pieces) = (f32::NEG_INFINITY, 0);
        for batch in 0..cloth.batch_count() {
            let all = segments_of(&cloth, [batch]);
            assert_eq!(all, segments_of(&again, [batch]));
            pieces += all.len();
            for s in all {
                assert_eq!(s.yarn as usize, batch);
                assert!(usize::from(s.material) < cloth.material_count());
                let (low, high) = (s.start_mm.z.min(s.end_mm.z), s.start_mm.z.max(s.end_mm.z));
                let r = s.start_radius_mm;
                assert!(
                    low - r >= bounds.min.z && high + r <= bounds.max.z,
                    "{text}: {s:?}"
                );
                top = top.max(high);
            }
        }
        let face = cloth.pile.as_ref().unwrap().face_mm as f32;
        assert!(pieces > 1000 && top > face + 0.8, "{text}: {pieces}, {top}");
    }
}

/// A pile end leaves the tile where it enters it, and rises on both sides in turns.
#[test]
fn loops_close_over_the_tile_and_alternate_between_the_sides() {
    let cloth = build(&with_pile(LOOP, 4));
    let period = f64::from(cloth.tile().bounds_mm.size().y);
    let mut sides = [0; 2];
    for thread in &cloth.threads {
        let Centreline::Laid { .. } = &thread.line else {
            continue;
        };
        let path = cloth.path(thread, CurveLevel::Yarn);
        let (first, last) = (path.points[0], path.points[path.steps()]);
        assert!((last - first).distance(period * DVec3::Y) < 4.0 * f64::EPSILON);
        let top = path
            .points
            .iter()
            .fold(0.0, |a: f64, p| if p.z.abs() > a.abs() { p.z } else { a });
        sides[usize::from(top > 0.0)] += 1;
    }
    assert!(sides[0] > 0 && sides[0] == sides[1], "{sides:?}");
}

/// A pile end is as long as its ratio says, and loops hide more of the ground the more of them
/// there are: yarn over the area of the cloth bounds the share from above. The twin stands on
/// every third end.
#[test]
fn figures_tell_how_long_pile_ends_are_and_what_loops_hide() {
    let cloth = build(&with_pile(LOOP, 4));
    let figures = cloth.figures().pile.unwrap();
    let (ratio, cover) = (figures.pile_ratio.unwrap(), figures.loop_cover.unwrap());
    let size = cloth.tile().bounds_mm.size().as_dvec3();
    let laid = |t: &&ThreadAtRest| matches!(t.line, Centreline::Laid { .. });
    let ends: Vec<_> = cloth.threads.iter().filter(laid).collect();
    let length_mm = |t: &&ThreadAtRest| cloth.path(t, CurveLevel::Yarn).length_mm();
    let length_mm: f64 = ends.iter().map(length_mm).sum();
    let expected = length_mm / (ends.len() as f64 * size.y);
    assert!(
        (ratio / expected - 1.0).abs() < 4.0 * f64::from(f32::EPSILON),
        "{ratio}, {expected}"
    );
    assert!(ratio > 2.0, "{ratio}");
    let width_mm = 2.0 * ends[0].spun.yarn.radius_mm();
    let most = length_mm * width_mm / (size.x * size.y);
    assert!(cover > 0.05 && cover < most.min(1.0), "{cover}, {most}");

    let sparse = build(&with_pile(&LOOP.replace("[1, 3]", "[3, 3]"), 4));
    let sparse = sparse.figures().pile.unwrap().loop_cover.unwrap();
    assert!(sparse < 0.7 * cover, "{sparse}, {cover}");
    let cut = build(&with_pile(CUT, 2)).figures().pile.unwrap();
    assert_eq!(cut.loop_cover, None);
}

/// By how much the lines overlap, in the room of the cloth's tile.
fn depth(cloth: &Cloth, lines: &[Line]) -> f64 {
    let room = Room {
        size_mm: cloth.tile().bounds_mm.size().truncate().as_dvec2(),
        faces_mm: [f64::NEG_INFINITY, f64::INFINITY],
    };
    let (mean, _, count) = overlap(lines, room);
    mean * count as f64
}

/// A cloth whose pile does not collide and the same whose pile does.
fn plain_and_pushed(pile: &str, repeats: u32) -> [Cloth; 2] {
    ["", "\ncollide = true"].map(|key| build(&with_pile(&format!("{pile}{key}"), repeats)))
}

/// The pile ends as lines.
fn pile_ends(cloth: &Cloth) -> Vec<Line> {
    let line = |thread: &ThreadAtRest| match &thread.line {
        Centreline::Laid { points, period } => Some(Line {
            points: points.to_vec(),
            radius_mm: thread.spun.yarn.radius_mm(),
            period: Some(*period),
            held: Vec::new(),
        }),
        _ => None,
    };
    cloth.threads.iter().filter_map(line).collect()
}

/// Loops that collide keep their feet and the lengths of their ends, and give way above the
/// ground. The twin, whose loops do not collide, overlaps three times as much at least.
#[test]
fn loops_that_collide_hardly_overlap() {
    let dense = LOOP.replace("'both'", "'face'");
    for text in [LOOP, dense.as_str()] {
        let clothes = plain_and_pushed(text, 6);
        let face_mm = clothes[0].pile.as_ref().unwrap().face_mm;
        let [before, after] = clothes.each_ref().map(|c| depth(c, &pile_ends(c)));
        let [plain, pushed] = clothes.each_ref().map(pile_ends);
        assert!(3.0 * after < before, "{text}: {before}, {after}");
        let mut moved = 0;
        for (a, b) in plain.iter().zip(&pushed) {
            let ratio = b.length_mm() / a.length_mm();
            assert!((ratio - 1.0).abs() < 0.01, "{text}: {ratio}");
            for (p, q) in a.points.iter().zip(&b.points) {
                let is_foot = p.z.abs() <= face_mm;
                assert!(!is_foot || p == q, "{text}: {p}, {q}");
                moved += usize::from(p != q);
            }
        }
        assert!(moved > 100, "{moved}");
    }
}

/// Tufts that collide give way above the ground, and keep their roots and heights. The twin, whose
/// tufts do not collide, overlaps five times as much at least.
#[test]
fn tufts_that_collide_hardly_overlap() {
    let leaning = "height_mm = 1.5\nlean_deviation_deg = 20\nkind = 'cut'\nyarn = 'rayon'";
    for text in [
        format!("{leaning}\nevery = [2, 2]"),
        format!("{leaning}\ntufts_per_cm2 = 120\nsplay = 0.8"),
        format!("{leaning}\nevery = [2, 2]\nlean_deg = 30\nruffle_deg = 15"),
    ] {
        let clothes = plain_and_pushed(&text, 12);
        let [before, after] = clothes.each_ref().map(|cloth| {
            let lines: Vec<Line> = cloth.tufts().unwrap().lines().collect();
            depth(cloth, &lines)
        });
        assert!(
            before > 10.0 && 5.0 * after < before,
            "{text}: {before}, {after}"
        );
        let face_mm = clothes[0].pile.as_ref().unwrap().face_mm as f32;
        let [plain, pushed] =
            clothes.map(|cloth| segments_of(&cloth, cloth.threads.len()..cloth.batch_count()));
        assert_eq!(plain.len(), pushed.len());
        let mut moved = 0;
        for (p, q) in plain.iter().zip(&pushed) {
            let (p, q) = (p.start_mm, q.start_mm);
            assert_eq!(p.z, q.z, "{text}");
            assert!(p.z > face_mm || p == q, "{text}: {p}, {q}");
            moved += usize::from(p != q);
        }
        assert!(moved > 1000, "{moved}");
    }
}

/// Neighbouring tufts lean alike, and over the tile their lean has the root mean square that was
/// asked for. The twin, whose tufts deviate each on its own, has no likeness.
#[test]
fn ruffled_tufts_lean_as_their_neighbours_do() {
    let likeness = |key: &str, seed: u64| {
        let text = format!("kind = 'cut'\nyarn = 'rayon'\nheight_mm = 1\nevery = [2, 2]\n{key}");
        let cloth = Cloth::build(&with_pile(&text, 32), &no_files, seed).unwrap();
        let tufts = &cloth.tufts().unwrap().tufts;
        let dot = |step: usize| -> f64 {
            let pairs = tufts.iter().zip(tufts.iter().cycle().skip(step));
            pairs.map(|(a, b)| a.tip_mm.dot(b.tip_mm)).sum()
        };
        let rms = (dot(0) / (2.0 * tufts.len() as f64)).sqrt();
        (rms, dot(1) / dot(0))
    };
    for seed in [1, 2, 3] {
        // 13 x 14 knots of two numbers: the root mean square deviates by 1 / sqrt(4 x 182).
        // Margin: four standard errors.
        let (rms, alike) = likeness("ruffle_deg = 20\nruffle_mm = 2.5", seed);
        let wanted = 20f64.to_radians().tan();
        assert!((rms / wanted - 1.0).abs() < 0.15, "seed {seed}: {rms}");
        // Tufts of a column stand 1.1 mm apart.
        assert!(alike > 0.5, "seed {seed}: {alike}");
        let (_, alike) = likeness("lean_deviation_deg = 20", seed);
        assert!(alike < 0.2, "seed {seed}: {alike}");
    }
}

#[test]
fn without_irregularity_all_tufts_are_alike() {
    let mut f = with_pile(CUT, 4);
    f.ideal = true;
    let cloth = build(&f);
    let heights = cloth.tufts().unwrap().tufts.iter().map(|t| t.height_mm);
    assert!(heights.into_iter().all(|h| (h - 1.5).abs() < 1e-12));
}

/// What is added to cut pile, and why it is refused then.
const ADDED: &str = r#"
lean_deg = 80 | pile.lean_deg: expected a number from 0 to 70 degrees, found 80
tufts_per_cm2 = 100 | pile.tufts_per_cm2: pile.every gives the density already
sides = 'both' | pile.sides: belongs to pile of kind "loop"
ruffle_mm = 2 | pile.ruffle_mm: needs pile.ruffle_deg
colours = [[2, 0, 0]] | pile.colours[0]: expected linear RGB
"#;

/// The same for what is replaced.
const REPLACED: &str = "
1.5 | -1 | pile.height_mm: expected a number from 0.05 to 30 mm, found -1
every = [2, 2] | # every | pile.every: expected [ends, picks]
[2, 2] | [0, 2] | pile.every: expected two numbers from 1 to 1024
rayon | raion | pile.yarn: there is no [yarn.raion]
";

#[test]
fn wrong_pile_is_refused_with_its_key() {
    let refused = |pile: &str, expected| assert_contains(&refusal(&with_pile(pile, 2)), expected);
    for [keys, expected] in table_rows(ADDED) {
        refused(&format!("{CUT}\n{keys}"), expected);
    }
    for [from, to, expected] in table_rows(REPLACED) {
        refused(&CUT.replace(from, to), expected);
    }
    let expected = "pile.collide: belongs to pile of kind \"cut\" or \"loop\"";
    refused(&format!("{WALE}\ncollide = true"), expected);
    let expected = "pile.wales_per_cm: pile of kind \"wale\" needs";
    refused(&WALE.replace("wales_per_cm = 5", ""), expected);
    let dense = CUT.replace("every = [2, 2]", "tufts_per_cm2 = 1e5\ncollide = true");
    let expected = "pile.collide: expected at most 65536 tufts in one tile, found";
    assert_contains(&refusal(&with_pile(&dense, 10)), expected);
    let knit = FabricGeometry {
        draft: knit("stockinette").draft,
        ..with_pile(CUT, 1)
    };
    assert_contains(&refusal(&knit), "pile: needs a weave");
}
