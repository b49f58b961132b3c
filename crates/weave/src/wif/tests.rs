use super::example_drafts::{EXAMPLES, damask};
use super::*;
use organza_basis::Rgb;
use std::collections::BTreeMap;

/// A four-shaft draft of the project's own, with room for oddities.
fn wif(weaving: &str, rest: &str) -> String {
    format!(
        "[WIF]\nVersion=1.1\n[WEAVING]\nShafts=4\nTreadles=4\n{weaving}\n\
         [WARP]\nThreads=4\n[WEFT]\nThreads=4\n{rest}"
    )
}

const THREADING: &str = "[THREADING]\n1=1\n2=2\n3=3\n4=4\n";
const TIEUP: &str = "[TIEUP]\n1=1,2\n2=2,3\n3=3,4\n4=4,1\n";
const TREADLING: &str = "[TREADLING]\n1=1\n2=2\n3=3\n4=4\n";
const TWILL: &str = "X..X\n..XX\n.XX.\nXX..\n";

fn read(text: &str) -> Draft {
    Draft::from_wif(text.as_bytes()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn refused(text: &str) -> String {
    Draft::from_wif(text.as_bytes()).unwrap_err().to_string()
}

#[test]
fn tieup_liftplan_and_skeleton_tieup_give_the_same_cloth() {
    let tied = wif("", &format!("{THREADING}{TIEUP}{TREADLING}"));
    let lifted = wif(
        "",
        &format!("{THREADING}[LIFTPLAN]\n1=1,2\n2=2,3\n3=3,4\n4=4,1\n"),
    );
    let skeleton = wif(
        "",
        &format!(
            "{THREADING}[TIEUP]\n1=1\n2=2\n3=3\n4=4\n[TREADLING]\n1=1,2\n2=2,0,3\n3=3,4\n4=4,1\n"
        ),
    );
    for text in [tied, lifted, skeleton] {
        assert_eq!(read(&text).drawdown(), TWILL);
    }
}

#[test]
fn a_sinking_shed_is_the_complement() {
    let rest = format!("{THREADING}{TIEUP}{TREADLING}");
    let (up, down) = (read(&wif("", &rest)), read(&wif("Rising Shed=no", &rest)));
    assert!((0..16).all(|i| up.warp_up(i % 4, i / 4) != down.warp_up(i % 4, i / 4)));
}

#[test]
fn dress_does_not_matter() {
    let plain = wif("rising shed = 1", &format!("{THREADING}{TIEUP}{TREADLING}"));
    let crlf = plain.replace('\n', "\r\n");
    let mac = plain.replace('\n', "\r");
    let bom = format!("\u{feff}{plain}");
    let shouting = plain.to_uppercase().replace('=', "  =  ");
    let spaced = plain.replace("[", " [ ").replace("]", "  ] ; a section");
    let commented = plain
        .replace(
            "[TIEUP]",
            "; a comment\n# another = one\nno equals sign\n[TIEUP]",
        )
        .replace("2=2,3", "2 = 2, 3 ; on one line, with a comma");
    let mut sections: Vec<&str> = plain.split_inclusive('[').collect();
    sections.rotate_left(1);
    for text in [plain.clone(), crlf, mac, bom, shouting, spaced, commented] {
        assert_eq!(read(&text).drawdown(), TWILL, "{text}");
    }
    let reordered: Vec<String> = plain[1..]
        .rsplit("\n[")
        .map(|s| format!("[{s}\n"))
        .collect();
    assert_eq!(read(&reordered.concat()).drawdown(), TWILL);
}

#[test]
fn latin_1_titles_are_read() {
    let mut bytes = wif("", &format!("{THREADING}{TIEUP}{TREADLING}[TEXT]\nTitle=k")).into_bytes();
    bytes.extend(b"\xf6per\n");
    assert_eq!(Draft::from_wif(&bytes).unwrap().title, "köper");
}

#[test]
fn liftplan_wins_over_treadling_and_says_so_when_they_differ() {
    let both = |lift: &str| {
        read(&wif(
            "",
            &format!("{THREADING}{TIEUP}{TREADLING}[LIFTPLAN]\n{lift}"),
        ))
    };
    assert!(both("1=2,1\n2=2,3\n3=3,4\n4=1,4\n").warnings.is_empty());
    let other = both("1=1\n2=2\n3=3\n4=4\n");
    assert_eq!(other.drawdown(), "...X\n..X.\n.X..\nX...\n");
    assert!(other.warnings[0].contains("differs from TIEUP"));
    let disowned =
        format!("[CONTENTS]\nLIFTPLAN=no\n{THREADING}{TIEUP}{TREADLING}[LIFTPLAN]\n1=1\n");
    assert_eq!(read(&wif("", &disowned)).drawdown(), TWILL);
}

#[test]
fn palettes_of_any_range_and_lengths_of_any_unit() {
    for (range, white, unit, spacing) in [
        ("Range=0,255", "255,255,255", "Centimeters", "0.1"),
        ("Range=0,999", "999,999,999", "decipoints ", "28.346457"),
        (
            "range = 20 , 1200",
            "1200,1200,1200",
            "INCHES",
            "0.039370079",
        ),
        ("", "255,255,255", "cm", "0.1"),
        ("Range=1,0", "0,0,0", "mm", "1"),
    ] {
        let text = wif(
            "",
            &format!(
                "{THREADING}{TIEUP}{TREADLING}[COLOR PALETTE]\n{range}\n[COLOR TABLE]\n2={white}\n\
                 [WARP COLORS]\n1=2\n[WARP]\nUnits={unit}\nSpacing={spacing}\n[WARP THICKNESS]\n3={spacing}\n"
            ),
        );
        let draft = read(&text);
        assert_eq!(draft.warp[0].colour, Some(Rgb::WHITE), "{range}");
        assert_eq!(draft.warp[1].colour, None);
        assert!(
            (draft.warp[3].spacing_mm.unwrap() - 1.0).abs() < 4.0 * f32::EPSILON,
            "{unit}"
        );
        assert!((draft.warp[2].thickness_mm.unwrap() - 1.0).abs() < 4.0 * f32::EPSILON);
        assert_eq!(draft.warp[1].thickness_mm, None);
    }
}

#[test]
fn odd_but_decided_files_load_with_a_warning() {
    for (rest, expected) in [
        (
            format!("{THREADING}{TIEUP}[TREADLING]\n1=1\n2=\n4=0\n"),
            "[TREADLING] 3 of 4 picks use no treadle",
        ),
        (
            format!("[THREADING]\n1=1\n{TIEUP}{TREADLING}"),
            "[THREADING] 3 of 4 ends are on no shaft",
        ),
        (
            format!("[THREADING]\n1=1\n2=1\n3=1\n4=1\n9=1\n{TIEUP}{TREADLING}"),
            "1 lines lie beyond line 4",
        ),
        (
            format!("{THREADING}{TIEUP}{TREADLING}[TREDLING]\n1=1\n"),
            "did you mean \"TREADLING\"",
        ),
        (
            format!("{THREADING}{TIEUP}{TREADLING}[WARP]\nColor=7\n"),
            "[WARP] Color 7 is not in the COLOR TABLE",
        ),
        (
            format!("{THREADING}{TIEUP}{TREADLING}[WARP SPACING]\n1=2\n[WARP]\nUnits=cm"),
            "3 threads have none",
        ),
        (
            format!("{THREADING}{TIEUP}{TREADLING}[WARP]\nSpacing=2\n"),
            "Units is missing",
        ),
    ] {
        let draft = read(&wif("", &rest));
        assert!(
            draft.warnings.iter().any(|w| w.contains(expected)),
            "{expected}: {:?}",
            draft.warnings
        );
    }
    let uncounted = "[THREADING]\n1=1\n2=2\n[LIFTPLAN]\n1=1\n2=2\n3=1,2\n";
    let draft = read(uncounted);
    assert_eq!(draft.drawdown(), "XX\n.X\nX.\n");
    assert_eq!(draft.warnings.len(), 2);
}

#[test]
fn undecided_files_are_refused_with_section_and_key() {
    let all = format!("{THREADING}{TIEUP}{TREADLING}");
    for (text, expected) in [
        (String::new(), "not a WIF file"),
        ("garbage".to_owned(), "not a WIF file"),
        (wif("", TIEUP), "[THREADING]: the section is missing"),
        (wif("", THREADING), "[LIFTPLAN]: the section is missing"),
        (
            wif("", &format!("{THREADING}{TREADLING}")),
            "[TIEUP]: the section is missing",
        ),
        (
            wif("", &format!("{THREADING}{TIEUP}[TREADLING]\n1=5\n")),
            "[TREADLING] 1: 5 is beyond the 4",
        ),
        (
            wif("", &format!("[THREADING]\n3=x\n{TIEUP}{TREADLING}")),
            "[THREADING] 3: expected a whole number",
        ),
        (
            wif("", &format!("[THREADING]\n3=-1\n{TIEUP}{TREADLING}")),
            "[THREADING] 3: expected a whole number",
        ),
        (
            wif("", &format!("[THREADING]\nthree=1\n{TIEUP}{TREADLING}")),
            "expected a line number",
        ),
        (
            wif("Rising Shed=perhaps", &all),
            "[WEAVING] RISING SHED: expected true or false",
        ),
        (
            wif("", &format!("{all}[WARP COLORS]\n2=3\n")),
            "[WARP COLORS] 2: colour 3: there is no COLOR TABLE",
        ),
        (
            wif(
                "",
                &format!("{all}[COLOR TABLE]\n1=0,0,0\n[WEFT COLORS]\n2=3\n"),
            ),
            "[WEFT COLORS] 2: colour 3: the COLOR TABLE ends at 1",
        ),
        (
            wif("", &format!("{all}[COLOR TABLE]\n1=0,0\n")),
            "[COLOR TABLE] 1: expected red,green,blue",
        ),
        (
            wif(
                "",
                &format!("{all}[COLOR PALETTE]\nRange=5,5\n[COLOR TABLE]\n1=0,0,0\n"),
            ),
            "[COLOR PALETTE] Range",
        ),
        (
            wif("", &format!("{all}[WARP]\nSpacing=1\nUnits=parsecs\n")),
            "[WARP] Units: expected centimeters",
        ),
        (
            wif("", &format!("{all}[WARP]\nSpacing=nan\n")),
            "[WARP] SPACING: expected a number",
        ),
        (
            wif("", &format!("{all}[WARP]\nThreads=99999999\n")),
            "[WARP] Threads: expected 1 to",
        ),
        (
            wif(
                "",
                &format!("{all}[WARP]\nThreads=16384\n[WEFT]\nThreads=16384\n"),
            ),
            "crossings",
        ),
        (wif("", &format!("{all}[WARP]\nThreads=0\n")), "found 0"),
    ] {
        let error = refused(&text);
        assert!(
            error.contains(expected),
            "expected {expected}, found {error}"
        );
    }
}

/// Files in the dialects of several programs load, with a warning where their name starts
/// with `warn`; rising and sinking sheds are complements.
#[test]
fn drafts_in_many_dialects_load() {
    let drafts: BTreeMap<&str, Draft> = EXAMPLES
        .iter()
        .map(|(name, bytes)| {
            let draft = Draft::from_wif(bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert!(
                !name.starts_with("warn") || !draft.warnings.is_empty(),
                "{name}"
            );
            (*name, draft)
        })
        .collect();
    for name in ["liftplan", "treadles"] {
        let up = &drafts[format!("{name}_rising").as_str()];
        let down = &drafts[format!("{name}_sinking").as_str()];
        for i in 0..up.ends() * up.picks() {
            let (e, p) = (i % up.ends(), i / up.ends());
            assert_ne!(up.warp_up(e, p), down.warp_up(e, p), "{name}");
        }
    }
    let forgiving = drafts["forgiving_liftplan"].drawdown();
    assert_eq!(forgiving, "X....\n.....\n.....\n.X...\n");
    assert_eq!(drafts["studio_latin_1"].title, "Köper für Tücher");
    let inch = drafts["studio_latin_1"].warp[2].spacing_mm.unwrap();
    assert!((inch - 0.09 * 25.4).abs() < 4.0 * f32::EPSILON, "{inch}");
    let private = &drafts["private_sections_and_defaults"];
    assert_eq!(private.warp[1].colour, private.weft[4].colour);
    assert!((private.warp[3].spacing_mm.unwrap() - 0.53).abs() < 4.0 * f32::EPSILON);
    assert!((private.warp[4].spacing_mm.unwrap() - 2.12).abs() < 4.0 * f32::EPSILON);
}

/// A lift plan of jacquard size is read completely: every crossing is that of the damask.
#[test]
fn a_large_lift_plan_is_read() {
    let draft = read(&damask(641));
    assert_eq!((draft.ends(), draft.picks()), (641, 641));
    assert_eq!(draft.smallest_repeat().ends(), 641);
    let in_figure = |thread: usize| [0, 3, 4, 8, 10, 11, 15].contains(&(thread / 12 % 17));
    for i in 0..641 * 641 {
        let (e, p) = (i % 641, i / 641);
        let diagonal = e % 4 == p % 4;
        let expected = diagonal != (in_figure(e) == in_figure(p));
        assert_eq!(draft.warp_up(e, p), expected, "{e} {p}");
    }
}

proptest::proptest! {
    /// Whatever is in a file, reading ends with a draft or an error.
    #[test]
    fn no_file_makes_the_reader_panic(
        cuts in proptest::collection::vec((0usize..400, "[0-9,=;\\[\\]A-Za-z \\n.-]{0,6}"), 0..8),
    ) {
        let mut text = wif("", &format!(
            "{THREADING}{TIEUP}{TREADLING}[COLOR PALETTE]\nRange=0,9\n[COLOR TABLE]\n1=1,2,3\n[WARP COLORS]\n1=1\n"
        ));
        for (place, new) in cuts {
            let place = place.min(text.len());
            text.replace_range(place..(place + new.len()).min(text.len()), &new);
        }
        if let Ok(draft) = Draft::from_wif(text.as_bytes()) {
            let again = Draft::from_drawdown(&draft.drawdown().lines().collect::<Vec<_>>()).unwrap();
            proptest::prop_assert_eq!(again.drawdown(), draft.drawdown());
        }
    }
}
