//! Cloths of several layers.

use super::*;
use crate::spec::ThreadSetSpec;

/// A cloth of round yarns with so many threads per centimetre in all layers together.
fn layered(weave: &str, warp_per_cm: f64, weft_per_cm: f64) -> Cloth {
    let mut f = fabric_of(weave, "aspect = 1");
    (f.warp.per_cm, f.weft.per_cm) = (Some(warp_per_cm), Some(weft_per_cm));
    build(&f)
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
        let near = nearest(&cloth, |_, _| true);
        let thicker = cloth.figures().thickness_mm / plain.figures().thickness_mm;
        println!("{weave}: nearest {near:.3} of touching, {thicker:.2} times as thick as plain");
        assert!(near > least, "{weave}: {near}");
        assert!(times.contains(&thicker), "{weave}: {thicker}");
        // Threads keep the width that they have in a cloth of one layer.
        assert_eq!(cloth.figures().compaction, 1.0, "{weave}");
    }
    let [one, two] = [plain, layered("double-plain", 40.0, 36.0)]
        .map(|cloth| cloth.figures().areal_density_g_per_m2);
    let heavier = two / one;
    assert!((heavier / 2.0 - 1.0).abs() < 0.03, "{heavier}");
}

#[test]
fn each_layer_jams_as_a_cloth_of_its_own() {
    let mut f = fabric("double-plain");
    (f.warp.per_cm, f.weft.per_cm) = (Some(100.0), Some(100.0));
    let double = refusal(&f);
    assert_contains(&double, "jammed");
    assert_contains(&double, "what fits");
    f.draft.weave = Some("plain".to_owned());
    (f.warp.per_cm, f.weft.per_cm) = (Some(50.0), Some(50.0));
    let plain = refusal(&f);
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
        assert_contains(&read(text).unwrap_err().to_string(), words);
    }
}
