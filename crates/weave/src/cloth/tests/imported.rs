//! Imported curves as cloth.

use super::*;
use glam::Vec2;

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
    for batch in 0..yarns.batch_count() {
        yarns.for_each_in_batch(batch, &mut |s| {
            assert!(bounds.contains(s.bounds_mm().min) && bounds.contains(s.bounds_mm().max));
            assert!((s.start_tangent.length() - 1.0).abs() < 4.0 * f32::EPSILON);
            count += 1;
            (low, high) = (low.min(s.start_mm.x), high.max(s.end_mm.x));
        });
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
    assert!(refusal.contains("draft.curve_tile_mm"), "{refusal}");
    f.draft.curve_tile_mm = None;

    f.draft.curves_are = crate::spec::CurveKind::Fibres;
    let fibres = Cloth::build(&f, &load, 1).unwrap();
    let mut segments = Vec::new();
    (0..2).for_each(|b| fibres.for_each_in_batch(b, &mut |s| segments.push(*s)));
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
    let points: Vec<DVec3> = set.curves[0]
        .points_mm
        .iter()
        .map(|p| p.as_dvec3())
        .collect();
    let path = Path::through(&points, Some(DVec3::ZERO), 0.05);
    let last = path.steps();
    assert!(path.points[0].distance(path.points[last]) < 4.0 * f64::EPSILON);
    assert!(path.lateral[0].distance(path.lateral[last]) < 4.0 * f64::EPSILON);
    for i in 0..=last {
        assert!((path.lateral[i].dot(path.vertical[i])).abs() < 4.0 * f64::EPSILON);
        assert!((path.lateral[i].length() - 1.0).abs() < 4.0 * f64::EPSILON);
    }
}
