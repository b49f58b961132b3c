//! Imported curves as cloth.

use super::*;
use crate::separate::{Line, Room, overlap};
use crate::spec::CurveKind;
use glam::{DVec2, Vec2};

#[test]
fn imported_yarns_get_fibres_and_imported_fibres_stay_as_they_are() {
    let text = "0 0 0 0.1\n1 0 0.2 0.1\n2 0.3 0 0.1\n3 0 0 0.1\n\n0 1 0 0.1\n3 1 0 0.2\n";
    let load = |name: &str| match name {
        "lines.txt" => Ok(text.as_bytes().to_vec()),
        _ => no_files(name),
    };
    let mut f = fabric("plain");
    f.draft = DraftSpec {
        curves: Some("lines.txt".to_owned()),
        curve_unit_mm: Some(2.0),
        ..DraftSpec::default()
    };
    let yarns = Cloth::build(&f, &load, 1).unwrap();
    assert!(!yarns.tile().repeats);
    let bounds = yarns.tile().bounds_mm;
    let (mut count, mut low, mut high) = (0, f32::INFINITY, f32::NEG_INFINITY);
    for s in segments(&yarns) {
        assert!(bounds.contains(s.bounds_mm().min) && bounds.contains(s.bounds_mm().max));
        assert!((s.start_tangent.length() - 1.0).abs() < 4.0 * f32::EPSILON);
        count += 1;
        (low, high) = (low.min(s.start_mm.x), high.max(s.end_mm.x));
    }
    assert!(
        count > 1000 && low < 0.1 && high > 5.9,
        "{count} {low} {high}"
    );
    let figures = yarns.figures();
    let (_, length) = poured(&yarns);
    assert!(
        (figures.fibre_length_mm / length - 1.0).abs() < 0.02,
        "{figures:?} {length}"
    );

    // In a tile that repeats, fibres that leave it come back on the other side.
    f.draft.curve_tile_mm = Some([4.0, 3.0]);
    let tiled = Cloth::build(&f, &load, 1).unwrap();
    let tile = tiled.tile();
    assert!(tile.repeats && tile.period_mm() == Vec2::new(4.0, 3.0));
    let lengths = [&yarns, &tiled].map(|cloth| {
        let mut length = 0.0;
        cloth.for_each_in_batch(0, &mut |s| {
            let middle = 0.5 * (s.start_mm + s.end_mm);
            assert!(cloth.tile().bounds_mm.contains(middle), "{middle}");
            length += f64::from(s.length_mm());
        });
        length
    });
    assert!((lengths[1] / lengths[0] - 1.0).abs() < 1e-4, "{lengths:?}");
    f.draft.curve_tile_mm = Some([4.0, 0.0]);
    let refusal = Cloth::build(&f, &load, 1).unwrap_err().to_string();
    assert_contains(&refusal, "draft.curve_tile_mm");
    f.draft.curve_tile_mm = None;

    f.draft.curves_are = CurveKind::Fibres;
    let fibres = Cloth::build(&f, &load, 1).unwrap();
    let segments = segments_of(&fibres, 0..2);
    assert_eq!(segments.len(), 4);
    assert_eq!(segments[3].end_mm, Vec3::new(6.0, 2.0, 0.0));
    assert_eq!(
        (segments[3].start_radius_mm, segments[3].end_radius_mm),
        (0.2, 0.4)
    );
    let volume = 6.0 * std::f64::consts::PI * 0.3 * 0.3;
    assert!(fibres.figures().fibre_volume_fraction > 0.0 && volume > 0.0);
}

#[test]
fn closed_imported_yarns_close() {
    let ring: String = (0..12)
        .map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 12.0).sin_cos();
            format!("{cos} {sin} {} 0.1\n", 0.3 * (2.0 * cos).sin())
        })
        .collect();
    let set = crate::curve_file::CurveSet::read_text(&ring, 1.0).unwrap();
    let points = set.curves[0].points_mm.iter().map(|p| p.as_dvec3());
    let points: Vec<DVec3> = points.collect();
    let path = Path::through(&points, Some(DVec3::ZERO), 0.05);
    let last = path.steps();
    assert!(path.points[0].distance(path.points[last]) < 4.0 * f64::EPSILON);
    assert!(path.lateral[0].distance(path.lateral[last]) < 4.0 * f64::EPSILON);
    for i in 0..=last {
        assert!((path.lateral[i].dot(path.vertical[i])).abs() < 4.0 * f64::EPSILON);
        assert!((path.lateral[i].length() - 1.0).abs() < 4.0 * f64::EPSILON);
    }
}

/// The cloth of curves in a text, with what changes its draft.
fn imported(text: &str, change: impl FnOnce(&mut DraftSpec)) -> Result<Cloth, Error> {
    let mut f = fabric("plain");
    f.draft = DraftSpec {
        curves: Some("lines.txt".to_owned()),
        ..DraftSpec::default()
    };
    change(&mut f.draft);
    Cloth::build(&f, &|_| Ok(text.as_bytes().to_vec()), 1)
}

/// The yarns of a cloth as lines.
fn lines(cloth: &Cloth) -> Vec<Line> {
    let line = |thread: &ThreadAtRest| match &thread.line {
        Centreline::Imported { points, .. } => Some(Line {
            points: points.clone(),
            radius_mm: cloth.yarns[thread.yarn].radius_mm(),
            period: None,
            held: Vec::new(),
        }),
        _ => None,
    };
    cloth.threads.iter().filter_map(line).collect()
}

fn depth(lines: &[Line], size_mm: DVec2) -> f64 {
    let faces_mm = [f64::NEG_INFINITY, f64::INFINITY];
    let (mean, _, count) = overlap(lines, Room { size_mm, faces_mm });
    mean * count as f64
}

const LARGE: DVec2 = DVec2::splat(30.0);

/// Yarns that cross bend around each other and are straight elsewhere, the later above where both
/// lie at one height. The twin, whose yarns do not collide, overlaps.
#[test]
fn imported_yarns_that_collide_bend_around_each_other() {
    for (angle_deg, z) in [(90.0f64, 0.1), (90.0, 0.0), (40.0, 0.05), (40.0, 0.0)] {
        let end = 4.0 * DVec2::from_angle(angle_deg.to_radians());
        let (x, y) = (end.x, end.y);
        let text = format!("-4 0 0 1\n4 0 0 1\n\n{} {} {z} 1\n{x} {y} {z} 1\n", -x, -y);
        let build = |collide| lines(&imported(&text, |d| d.curves_collide = collide).unwrap());
        let [plain, pushed] = [false, true].map(build);
        let [before, after] = [&plain, &pushed].map(|l| depth(l, LARGE));
        assert!(
            before > 0.4 && after < 1e-6,
            "{angle_deg}, {z}: {before}, {after}"
        );
        let radius_mm = plain[0].radius_mm;
        for p in &pushed[0].points {
            let aside_mm = p.truncate().perp_dot(DVec2::X).hypot(p.z);
            assert!(
                aside_mm < 2.0 * radius_mm && (p.x.abs() < 10.0 * radius_mm || aside_mm < 1e-6),
                "{angle_deg}, {z}: {p}"
            );
        }
        let heights = |l: &Line| l.points.iter().map(|p| p.z).collect::<Vec<_>>();
        let low = heights(&pushed[0]).into_iter().fold(0.0, f64::min);
        let high = heights(&pushed[1]).into_iter().fold(0.0, f64::max);
        assert!(low < -0.1 * radius_mm && high - z > 0.1 * radius_mm);
        let again = build(true);
        let same = pushed.iter().zip(&again).all(|(a, b)| a.points == b.points);
        assert!(same, "{angle_deg}, {z}");
    }
}

/// Yarns that cross at the edge of a tile give way alike on both sides, and go on in the next. The
/// twin's room is too large for the copies to meet.
#[test]
fn imported_yarns_collide_with_the_copies_of_their_tile() {
    let text = "0 1 0 1\n2 1 0 1\n4 1 0 1\n\n3.95 0 0.05 1\n3.95 1.5 0.05 1\n3.95 3 0.05 1\n\n\
                -0.05 2.6 0.1 1\n1 2.2 0.1 1\n";
    let build = |collide| {
        let change = |d: &mut DraftSpec| {
            d.curve_tile_mm = Some([4.0, 3.0]);
            d.curves_collide = collide;
        };
        let mut lines = lines(&imported(text, change).unwrap());
        for (line, period) in lines.iter_mut().zip([4.0 * DVec3::X, 3.0 * DVec3::Y]) {
            let end = line.points.pop().unwrap();
            assert!((end - line.points[0]).distance(period) < 1e-5, "{end}");
            line.period = Some(period);
        }
        lines
    };
    let [plain, pushed] = [false, true].map(build);
    let tile = DVec2::new(4.0, 3.0);
    let [before, after] = [&plain, &pushed].map(|l| depth(l, tile));
    assert!(before > 0.8 && after < 1e-6, "{before}, {after}");
    let [before, large] = [depth(&plain, tile), depth(&plain, LARGE)];
    assert!(large < before, "{large}, {before}");
    let first = pushed[0].points[0];
    assert!(first.z < -0.02, "{first}");
}

#[test]
fn curves_that_cannot_collide_are_refused_with_their_key() {
    let line = "0 0 0 1\n1 0 0 1\n";
    let refused = |text: &str, change: fn(&mut DraftSpec), expected: &str| {
        let both = |d: &mut DraftSpec| {
            d.curves_collide = true;
            change(d);
        };
        assert_contains(&imported(text, both).unwrap_err().to_string(), expected);
    };
    refused(
        line,
        |d| d.curves_are = CurveKind::Fibres,
        "draft.curves_collide: belongs to curves that are \"yarns\"",
    );
    refused(
        line,
        |d| d.curve_unit_mm = Some(1e6),
        "draft.curves_collide: expected at most 524288 pieces of yarn",
    );
    refused(
        &format!("{line}\n").repeat(2000),
        |d| d.curve_unit_mm = Some(1e-3),
        "draft.curves_collide: too many yarns lie within one another",
    );
}
