//! Cloths of several layers.

use super::*;

/// A cloth of round yarns with so many threads per centimetre in all layers together.
fn layered(weave: &str, warp_per_cm: f64, weft_per_cm: f64) -> Cloth {
    let mut f = fabric(weave);
    let round = YarnSpec {
        aspect: Some(1.0),
        ..YarnSpec::default()
    };
    f.yarn.insert("cotton".to_owned(), round);
    (f.warp.per_cm, f.weft.per_cm) = (Some(warp_per_cm), Some(weft_per_cm));
    build(&f)
}

/// The nearest that the centrelines of any two threads come, in units of their diameter.
fn nearest(cloth: &Cloth) -> f64 {
    let period = cloth.tile().period_mm();
    let points: Vec<Vec<Vec3>> = (0..cloth.batch_count())
        .map(|batch| {
            let path = cloth.path(&cloth.threads[batch], CurveLevel::Ply);
            path.points.iter().map(|p| p.as_vec3()).collect()
        })
        .collect();
    let mut nearest = f32::INFINITY;
    for (i, a) in points.iter().enumerate() {
        for b in &points[..i] {
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
fn layers_lie_over_each_other_in_the_order_of_the_draft() {
    let plain = layered("plain", 20.0, 18.0);
    // Where cloths change places, their threads pass steeply through each other's gaps.
    for (weave, warp, weft, least, times) in [
        ("double-plain", 40.0, 36.0, 0.85, 1.35..2.05),
        ("double-plain-4", 40.0, 36.0, 0.6, 1.35..2.05),
        ("weft-backed-8-3", 20.0, 60.0, 0.85, 1.35..2.05),
    ] {
        let cloth = layered(weave, warp, weft);
        let draft = cloth.draft().unwrap().clone();
        for i in 0..draft.ends() * draft.picks() {
            let (e, p) = (i % draft.ends(), i / draft.ends());
            let (warp, weft) = heights(&cloth, e, p);
            assert_eq!(warp > weft, draft.warp_up(e, p), "{weave} {e} {p}");
        }
        let near = nearest(&cloth);
        let thicker = cloth.figures().thickness_mm / plain.figures().thickness_mm;
        println!("{weave}: nearest {near:.3} of touching, {thicker:.2} times as thick as plain");
        assert!(near > least, "{weave}: {near}");
        assert!(times.contains(&thicker), "{weave}: {thicker}");
        // Threads keep the width that they have in a cloth of one layer.
        assert_eq!(cloth.figures().compaction, 1.0, "{weave}");
    }
    let (one, two) = (
        plain.figures(),
        layered("double-plain", 40.0, 36.0).figures(),
    );
    let heavier = two.areal_density_g_per_m2 / one.areal_density_g_per_m2;
    assert!((heavier / 2.0 - 1.0).abs() < 0.03, "{heavier}");
}

#[test]
fn each_layer_jams_as_a_cloth_of_its_own() {
    let mut f = fabric("double-plain");
    (f.warp.per_cm, f.weft.per_cm) = (Some(100.0), Some(100.0));
    let double = Cloth::build(&f, &no_files, 7).unwrap_err().to_string();
    assert!(
        double.contains("jammed") && double.contains("what fits"),
        "{double}"
    );
    f.draft.weave = Some("plain".to_owned());
    (f.warp.per_cm, f.weft.per_cm) = (Some(50.0), Some(50.0));
    let plain = Cloth::build(&f, &no_files, 7).unwrap_err().to_string();
    let tex = |message: &str| message.split("tex ").nth(1).unwrap()[..4].to_owned();
    assert_eq!(tex(&double), tex(&plain));
}

#[test]
fn yarns_of_threads_are_read_as_runs() {
    let read = |text: &str| toml::from_str::<ThreadSetSpec>(&format!("yarn = {text:?}"));
    assert_eq!(read("2 silk, wool").unwrap().yarn, ["silk", "silk", "wool"]);
    assert_eq!(read("silk").unwrap().yarn, ["silk"]);
    for (text, words) in [
        ("2 silk, 0 wool", "entry 2: expected a number of threads"),
        ("9000 silk, 9000 wool", "at most 16384 threads"),
    ] {
        let why = read(text).map(|spec| spec.yarn);
        let why = why.unwrap_err().to_string();
        assert!(why.contains(words), "{text}: {why}");
    }
}
