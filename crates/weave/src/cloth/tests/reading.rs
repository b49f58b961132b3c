//! Descriptions and drafts that become cloth, and what is reported about them.

use super::*;

/// What is replaced in a fabric, and why it is refused then.
const WRONG: &str = r#"
yarn = "a" | yarn = "b" | weft.yarn: there is no [yarn.b]
per_cm = 12 | per_cm = -1 | warp.per_cm: expected 0.01 to 10000 threads per cm, found -1
per_cm = 12 | # per_cm | warp: thread 1 has no spacing
drawdown = ["X.", ".X"] | wif = "x.wif" | draft.wif: x.wif:
drawdown = ["X.", ".X"] | knit = "garter" | draft.wales_per_cm
[1, 1] | [0, 1] | tile.repeats
[1, 1] | [1, 4000000000] | tile.repeats
"#;

#[test]
fn a_fabric_reads_from_toml_and_wrong_keys_are_named() {
    let text = r#"
        [draft]
        drawdown = ["X.", ".X"]
        [warp]
        yarn = ["a", "wool"]
        colours = [[0.1, 0.2, 0.3]]
        per_cm = 12
        [weft]
        yarn = "a"
        spacing_mm = 1.0
        [yarn.a]
        preset = "cotton"
        twist = { direction = "S", angle_deg = 15 }
        [tile]
        repeats = [1, 1]
    "#;
    let cloth = build(&parsed(text));
    assert_eq!(cloth.materials().len(), 3);
    assert_eq!(cloth.materials()[0].colour, Some(Rgb::new(0.1, 0.2, 0.3)));
    let error = toml::from_str::<FabricGeometry>(&text.replace("per_cm", "per_inch")).unwrap_err();
    assert_contains(&error.to_string(), "unknown field `per_inch`");
    let refused = |from, to, expected: &str| {
        let error = refusal(&parsed(&text.replacen(from, to, 1)));
        assert!(error.starts_with(expected), "{expected}: {error}");
    };
    table_rows(WRONG).for_each(|[from, to, expected]| refused(from, to, expected));
    let expected = "warp: expected per_cm or spacing_mm";
    refused("per_cm = 12", "per_cm = 12\nspacing_mm = 1", expected);
    let expected = "draft: expected exactly one";
    refused("drawdown", "weave = \"plain\"\ndrawdown", expected);
}

/// Drafts in many dialects and a damask all become cloth that closes. The damask has 96
/// threads a side, with `ORGANZA_FULL=1` 641.
#[test]
fn drafts_of_every_dialect_become_cloth() {
    let large = damask(organza_testing::sized(96, 641));
    let drafts = EXAMPLES.into_iter();
    for (name, bytes) in drafts.chain([("damask", large.as_bytes())]) {
        let draft = Draft::from_wif(bytes).unwrap();
        let mut f = fabric("plain");
        f.draft = parsed(&format!("wif = '{name}'"));
        let cloth =
            Cloth::build(&f, &|_| Ok(bytes.to_vec()), 1).unwrap_or_else(|e| panic!("{name}: {e}"));
        let tiled = cloth.draft().unwrap();
        let figures = cloth.figures();
        // Margin: one bound for all drafts of the full test, here and below.
        assert!(figures.compression < 0.1, "{name}: {figures:?}");
        assert!(figures.warp.unwrap().crimp_percent < 40.0, "{name}");
        for (e, p) in [(0, 0), (tiled.ends() - 1, tiled.picks() / 2)] {
            let (warp, weft) = heights(&cloth, e, p);
            assert_eq!(warp > weft, draft.warp_up(e, p), "{name} {e} {p}");
        }
        assert_closed(&cloth, CurveLevel::Yarn);
    }
}

#[test]
fn a_yarn_with_too_many_fibres_to_push_apart_is_warned_of() {
    let warnings = |plies: u32, fibres: u32| {
        let tow = format!("plies = {plies}\nfibres_per_ply = {fibres}");
        let mut fabric = fabric_of("plain", &tow);
        // Yarns of a few hundred thousand fibres are a centimetre thick.
        (fabric.warp.per_cm, fabric.weft.per_cm) = (Some(0.2), Some(0.2));
        build(&fabric).warnings
    };
    let warns = |plies, fibres| {
        let mut list = warnings(plies, fibres).into_iter();
        list.any(|w| w.starts_with("yarn.cotton: too many fibres"))
    };
    assert!(warns(8, 50_000));
    assert!(!warns(1, 4_000));
}
