//! Threads that wander sideways, and marks of the reed.

use super::*;
use crate::spec::ThreadWanderSpec;

fn wandering(amplitude_um: f64, repeats: u32) -> FabricGeometry {
    let mut f = fabric("twill-2-1-z");
    f.tile.repeats = [repeats; 2];
    let wander: ThreadWanderSpec = parsed(&format!("amplitude_um = {amplitude_um}\nlength_mm = 3"));
    (f.warp.wander, f.weft.wander) = (Some(wander), Some(wander));
    f
}

/// Where an end lies across the cloth at rest, without what moves it aside along its length.
fn across_mm(end: &ThreadAtRest) -> f64 {
    match &end.line {
        Centreline::Woven { origin, .. } => origin.x,
        _ => panic!("woven"),
    }
}

/// Sideways deviations of all samples of all ends from their mean, root mean square, um.
fn rms_um(cloth: &Cloth) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for thread in &cloth.threads[..cloth.draft().unwrap().ends()] {
        for p in &cloth.path(thread, CurveLevel::Yarn).points {
            sum += (p.x - across_mm(thread)).powi(2);
            count += 1.0;
        }
    }
    1e3 * f64::sqrt(sum / count)
}

#[test]
fn wandering_threads_have_their_amplitude_and_close() {
    let small = build(&wandering(30.0, 1));
    for level in [CurveLevel::Yarn, CurveLevel::Ply, CurveLevel::Fibre] {
        assert_closed(&small, level);
    }
    // 48 ends with 9 turning points each: 432 deviates, of which four standard errors are
    // 4 / sqrt(2 n); clamped deviates take away 5 %.
    let error = 4.0 / (2.0f64 * 432.0).sqrt() + 0.05;
    let [cloth, twin] = [30.0, 40.0].map(|um| build(&wandering(um, 16)));
    let (rms, of_twin) = (rms_um(&cloth), rms_um(&twin));
    assert!((rms / 30.0 - 1.0).abs() < error, "{rms} for 30; seed 7");
    assert!((of_twin / 30.0 - 1.0).abs() > error, "{of_twin}");
    let reported = cloth.irregularity().warp.unwrap().sideways_um;
    assert!((reported / rms - 1.0).abs() < 0.05, "{reported} {rms}");
}

#[test]
fn crossings_stay_crossings_where_threads_wander() {
    let cloth = build(&wandering(40.0, 2));
    let draft = cloth.draft().unwrap();
    let (ends, picks) = (draft.ends(), draft.picks());
    let paths = cloth
        .threads
        .iter()
        .map(|t| cloth.path(t, CurveLevel::Yarn));
    let paths: Vec<Path> = paths.collect();
    let mut farthest = 0.0f64;
    for e in 0..ends {
        for p in 0..picks {
            let of_end = paths[e].points[paths[e].steps() / picks * p];
            let of_pick = paths[ends + p].points[paths[ends + p].steps() / ends * e];
            let apart = (of_end - of_pick).truncate().length();
            assert!(apart < 4.0 * f64::EPSILON, "{e} {p}: {of_end} {of_pick}");
            assert_eq!(of_end.z > of_pick.z, draft.warp_up(e, p));
            farthest = farthest.max((of_end.x - across_mm(&cloth.threads[e])).abs());
        }
    }
    assert!(farthest > 0.03, "{farthest}: nothing wanders");
}

#[test]
fn threads_that_touch_side_by_side_wander_no_nearer() {
    let mut f = wandering(30.0, 4);
    f.warp.per_cm = Some(40.0);
    f.draft.weave = Some("satin-8-3".to_owned());
    let cloth = build(&f);
    let width = cloth.figures().warp.unwrap().width_mm;
    let ends = cloth.draft().unwrap().ends();
    let paths: Vec<Path> = (0..ends)
        .map(|e| cloth.path(&cloth.threads[e], CurveLevel::Yarn))
        .collect();
    let overlap = |spacing_um: f64| {
        let mut deepest = 0.0f64;
        for pair in paths.windows(2) {
            let knots = 0..pair[0].steps();
            let gaps = knots.map(|i| pair[1].points[i].x - pair[0].points[i].x);
            deepest = deepest.max(gaps.fold(0.0, |d, gap| d.max(width - gap)));
        }
        1e3 * deepest / spacing_um
    };
    // Free threads would come nearer by up to 120 um.
    assert!(overlap(1.0) < 30.0, "{} um", overlap(1.0));
}

#[test]
fn the_reed_leaves_gaps_between_its_dents() {
    let mut f = fabric("plain");
    f.tile.repeats = [6, 1];
    f.warp.reed_dents = parsed("ends = 3\ngap_percent = 24");
    let cloth = build(&f);
    let places: Vec<f64> = cloth.threads[..12].iter().map(across_mm).collect();
    for (i, pair) in places.windows(2).enumerate() {
        // 20 ends per centimetre: 0.5 mm, of which each of the two gaps in a dent gives 12 %.
        let expected = if i % 3 == 2 { 0.62 } else { 0.44 };
        assert!(
            (pair[1] - pair[0] - expected).abs() < 8.0 * f64::EPSILON,
            "{i}: {pair:?}"
        );
    }
    for level in [CurveLevel::Yarn, CurveLevel::Fibre] {
        assert_closed(&cloth, level);
    }
    f.warp.per_cm = Some(52.0);
    f.draft.weave = Some("satin-5-2".to_owned());
    f.warp.reed_dents = parsed("ends = 2\ngap_percent = 100");
    let dense = build(&f);
    let width = dense.figures().warp.unwrap().width_mm;
    let at = |e: usize| dense.path(&dense.threads[e], CurveLevel::Yarn).points[0].x;
    assert!(
        (at(1) - at(0)) >= width.min(10.0 / 52.0) - 1e-9,
        "ends lie in each other"
    );
}

const WRONG: &str = "
warp.wander = { amplitude_um = 90, length_mm = 1 } | \
    warp.wander.amplitude_um: expected a number from 0 to 75.0000, found 90
weft.wander = { amplitude_um = 9, length_mm = 0 } | weft.wander.length_mm: expected
weft.reed_dents = { ends = 2, gap_percent = 9 } | weft.reed_dents: only the warp
warp.reed_dents = { ends = 1, gap_percent = 9 } | \
    warp.reed_dents.ends: expected 2 to 64 ends, found 1
warp.reed_dents = { ends = 2, gap_percent = -9 } | warp.reed_dents.gap_percent: expected
";

#[test]
fn displacement_is_left_out_of_ideal_cloth_and_wrong_values_name_their_key() {
    let mut f = wandering(30.0, 1);
    f.warp.reed_dents = parsed("ends = 2\ngap_percent = 20");
    f.ideal = true;
    let [ideal, even] = [f, fabric("twill-2-1-z")].map(|f| build(&f));
    assert_eq!(segments_of(&ideal, [1]), segments_of(&even, [1]));
    for [keys, expected] in table_rows(WRONG) {
        let text = format!("draft.weave = 'plain'\nwarp.per_cm = 20\nweft.per_cm = 20\n{keys}");
        assert_contains(&refusal(&parsed(&text)), expected);
    }
}
