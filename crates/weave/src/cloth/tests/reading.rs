//! Descriptions and drafts that become cloth, and what is reported about them.

use super::*;

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
    "#;
    let f: FabricGeometry = toml::from_str(text).unwrap();
    let cloth = build(&f);
    assert_eq!(cloth.materials().len(), 3);
    assert_eq!(cloth.materials()[0].colour, Some(Rgb::new(0.1, 0.2, 0.3)));
    let error = toml::from_str::<FabricGeometry>(&text.replace("per_cm", "per_inch")).unwrap_err();
    assert!(
        error.to_string().contains("unknown field `per_inch`"),
        "{error}"
    );
    for (from, to, expected) in [
        (
            "yarn = \"a\"",
            "yarn = \"b\"",
            "weft.yarn: there is no [yarn.b]",
        ),
        (
            "per_cm = 12",
            "per_cm = -1",
            "warp.per_cm: expected 0.01 to 10000 threads per cm, found -1",
        ),
        (
            "per_cm = 12",
            "per_cm = 12\nspacing_mm = 1",
            "warp: expected per_cm or spacing_mm",
        ),
        ("per_cm = 12", "", "warp: thread 1 has no spacing"),
        (
            "drawdown =",
            "weave = \"plain\"\ndrawdown =",
            "draft: expected exactly one",
        ),
        (
            "drawdown = [\"X.\", \".X\"]",
            "wif = \"x.wif\"",
            "draft.wif: x.wif: ",
        ),
        (
            "drawdown = [\"X.\", \".X\"]",
            "knit = \"garter\"",
            "draft.wales_per_cm",
        ),
        (
            "[yarn.a]",
            "[tile]\nrepeats = [0, 1]\n[yarn.a]",
            "tile.repeats",
        ),
        (
            "[yarn.a]",
            "[tile]\nrepeats = [1, 4000000000]\n[yarn.a]",
            "tile.repeats",
        ),
    ] {
        let f: FabricGeometry = toml::from_str(&text.replacen(from, to, 1)).unwrap();
        let error = Cloth::build(&f, &no_files, 1).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{expected}: {error}");
    }
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
        f.draft = DraftSpec {
            wif: Some(name.to_owned()),
            ..DraftSpec::default()
        };
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
        let mut fabric = fabric("plain");
        let tow = YarnSpec {
            plies: Some(plies),
            fibres_per_ply: Some(fibres),
            ..YarnSpec::default()
        };
        fabric.yarn.insert("cotton".to_owned(), tow);
        // Yarns of a few hundred thousand fibres are a centimetre thick.
        for system in [&mut fabric.warp, &mut fabric.weft] {
            system.per_cm = Some(0.2);
        }
        build(&fabric).warnings
    };
    let warns = |plies, fibres| {
        let mut list = warnings(plies, fibres).into_iter();
        list.any(|w| w.starts_with("yarn.cotton: too many fibres"))
    };
    assert!(warns(8, 50_000));
    assert!(!warns(1, 4_000));
}
