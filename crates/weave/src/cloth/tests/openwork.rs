//! Nets and gauzes: threads touch without sharing room, close over the tile and leave holes.

use super::*;
use crate::openwork::OpenworkKind;

fn openwork(kind: &str, tex: f64) -> FabricGeometry {
    parsed(&format!(
        "draft.openwork = '{kind}'\nwarp.per_cm = 9\nweft.per_cm = 10\n\
         [yarn.cotton]\ntex = {tex}\n[tile]\nrepeats = [2, 1]"
    ))
}

/// The threads as they are drawn, before they are pushed apart, are the twin: some of them share
/// room.
#[test]
fn threads_touch_and_share_no_room() {
    for kind in crate::openwork::NAMES {
        let cloth = build(&openwork(kind, 7.0));
        let figures = cloth.figures().openwork.unwrap();
        assert!(figures.greatest_overlap < 0.05, "{kind}: {figures:?}");
        // Every thread has another that it touches.
        let path = |t: &ThreadAtRest| cloth.path(t, CurveLevel::Yarn).points;
        let all: Vec<_> = cloth.threads.iter().map(path).collect();
        let size = cloth.tile().period_mm().as_dvec2();
        for (i, a) in all.iter().enumerate() {
            let mut nearest = f64::INFINITY;
            for (_, b) in all.iter().enumerate().filter(|(j, _)| *j != i) {
                for p in a {
                    for q in b {
                        let flat = (*q - *p).truncate();
                        let flat = flat - (flat / size).round() * size;
                        nearest = nearest.min(flat.extend(q.z - p.z).length());
                    }
                }
            }
            let radius = cloth.threads[i].spun.yarn.radius_mm();
            let share = nearest / (2.0 * radius);
            assert!((0.95..1.1).contains(&share), "{kind}, thread {i}: {share}");
        }
    }
}

#[test]
fn figures_are_those_asked_for() {
    let net = build(&openwork("bobbinet", 7.0));
    let figures = net.figures();
    let open = figures.openwork.clone().unwrap();
    assert_eq!(open.kind, OpenworkKind::Bobbinet);
    assert!((open.holes_per_cm2 - 90.0).abs() < 1e-9, "{open:?}");
    assert!((open.ends_per_cm - 9.0).abs() < 4.0 * f64::EPSILON);
    // Two ends, and two threads each way.
    assert_eq!(net.batch_count(), 6);
    // The middles of the threads of a regular net with straight sides would be 4.6 mm long.
    assert!((3.9..6.0).contains(&open.thread_per_hole_mm), "{open:?}");
    assert!(figures.areal_density_g_per_m2 > 20.0 && figures.areal_density_g_per_m2 < 45.0);

    let gauze = build(&openwork("leno", 12.0)).figures();
    let open = gauze.openwork.clone().unwrap();
    assert!((open.holes_per_cm2 - 45.0).abs() < 1e-9, "{open:?}");
    assert!(gauze.thickness_mm < 0.8, "{gauze:?}");
}

/// Each thread leaves the tile where it, or its copy, enters it. Around a straight weft the ends
/// of a leno change sides at every pick; the twin, a plain weave, has one end on either side.
#[test]
fn threads_close_over_the_tile_and_leno_ends_cross() {
    for kind in crate::openwork::NAMES {
        let cloth = build(&openwork(kind, 7.0));
        let size = cloth.tile().period_mm().as_dvec2();
        for thread in &cloth.threads {
            let path = cloth.path(thread, CurveLevel::Yarn);
            let ends = path.points[path.steps()] - path.points[0];
            let whole = ends.truncate() / size;
            assert!(
                (whole - whole.round()).length() < 4.0 * f64::from(f32::EPSILON),
                "{kind}: {whole}"
            );
            assert!(ends.z.abs() < 4.0 * f64::EPSILON);
        }
    }
    let cloth = build(&openwork("leno", 7.0));
    let at = |thread: usize, y: f64| {
        let path = cloth.path(&cloth.threads[thread], CurveLevel::Yarn);
        let near = |a: &DVec3, b: &DVec3| (a.y - y).abs().total_cmp(&(b.y - y).abs());
        path.points.into_iter().min_by(near).unwrap()
    };
    // Picks lie at 0.5 and 1.5 mm; ground end 0, doup end 1.
    for (y, side) in [(0.5, 1.0), (1.5, -1.0)] {
        let (ground, doup) = (at(0, y), at(1, y));
        assert!(doup.z > ground.z, "the doup end lies above the picks");
        assert!(side * (doup.x - ground.x) > 0.0, "{doup} {ground}");
    }
    let (ground, doup) = (at(0, 1.0), at(1, 1.0));
    assert!(doup.z < ground.z, "and passes under the ground end");
}

#[test]
fn wrong_openwork_is_refused() {
    let expected = "draft.openwork: no openwork is called \"bobinet\"; did you mean \"bobbinet\"?";
    assert_contains(&refusal(&openwork("bobinet", 7.0)), expected);
    let expected = "the fabric is jammed: the threads of a leno need";
    assert_contains(&refusal(&openwork("leno", 4000.0)), expected);
    let mut none = openwork("leno", 7.0);
    none.warp.per_cm = None;
    assert_contains(&refusal(&none), "warp");
    none = openwork("leno", 7.0);
    none.tile.repeats = [1000, 1000];
    assert_contains(&refusal(&none), "tile.repeats: 2000 ends x 2000 rows");
}
