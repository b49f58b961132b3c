//! Threads that are missing from a weave.

use super::*;

fn text(keys: &str) -> String {
    format!(
        "[draft]\nweave = \"plain\"\n[warp]\nyarn = [\"a\", \"b\"]\nper_cm = 20\n{keys}\n\
         [weft]\nyarn = \"a\"\nper_cm = 20\n[tile]\nrepeats = [3, 3]\n\
         [yarn.a]\ntex = 16\n[yarn.b]\ntex = 20\n"
    )
}

fn cloth(keys: &str) -> Result<Cloth, Error> {
    Cloth::build(&parsed(&text(keys)), &no_files, 7)
}

/// Middles of the ends, mm, and the names of their yarns.
fn ends(cloth: &Cloth) -> Vec<(f64, &str)> {
    let ends = cloth.draft().unwrap().ends();
    let of = |thread: &ThreadAtRest| match &thread.line {
        Centreline::Woven { origin, .. } => origin.x,
        _ => f64::NAN,
    };
    let threads = cloth.threads[..ends].iter();
    threads
        .map(|t| (of(t), cloth.yarns[t.yarn].name.as_str()))
        .collect()
}

#[test]
fn a_missing_end_leaves_a_gap_over_which_picks_float() {
    let (whole, faulty) = (cloth("").unwrap(), cloth("missing = [2]").unwrap());
    assert_eq!(whole.tile().period_mm(), faulty.tile().period_mm());
    let (all, left) = (ends(&whole), ends(&faulty));
    assert_eq!(left.len(), all.len() - 1);
    let names: Vec<&str> = left.iter().map(|(_, name)| *name).collect();
    assert_eq!(names, ["a", "b", "b", "a", "b"]);
    // The neighbours move a quarter of a spacing into the gap of two, the others stay.
    for (k, (at_mm, _)) in left.iter().enumerate() {
        let own = all[if k < 2 { k } else { k + 1 }].0;
        let moved = [0.0, 0.125, -0.125, 0.0, 0.0][k];
        assert!((at_mm - own - moved).abs() < 1e-6, "{k}: {at_mm} {own}");
    }
    // Beside it, a pick is on the same side of two ends in turn: a float of two.
    let draft = faulty.draft().unwrap();
    assert!((0..draft.picks()).all(|p| draft.warp_up(1, p) == draft.warp_up(2, p)));
    // The twin: no such place in the whole cloth.
    let draft = whole.draft().unwrap();
    assert!((0..draft.picks()).all(|p| draft.warp_up(1, p) != draft.warp_up(2, p)));
    // What is ideal has all its threads.
    let geometry: FabricGeometry = parsed(&text("missing = [2]"));
    assert!(geometry.without_irregularity().warp.missing.is_empty());
}

#[test]
fn missing_threads_that_the_tile_does_not_have_are_refused() {
    for [keys, wanted] in table_rows(
        "missing = [6] | warp.missing: expected numbers from 0 to 5, found 6
        missing = [0, 1, 2, 3, 5] | warp.missing: leaves 1 of 6 threads; expected at least 2",
    ) {
        assert_eq!(cloth(keys).unwrap_err().to_string(), wanted);
    }
    let knit = "[draft]\nknit = \"stockinette\"\nwales_per_cm = 12\n[weft]\nper_cm = 16\n\
                missing = [1]\n";
    let error = refusal(&parsed(knit));
    let expected = "weft.missing: belongs to a weave";
    assert!(error.starts_with(expected), "{error}");
}
