use super::example_drafts::{EXAMPLES, damask};
use super::*;
use organza_basis::Rgb;
use organza_testing::{assert_contains, table_rows};
use std::collections::BTreeMap;

/// A four-shaft draft of the project's own, with room for oddities.
fn wif(rest: &str) -> String {
    format!(
        "[WIF]\nVersion=1.1\n[WEAVING]\nShafts=4\nTreadles=4\n\
         [WARP]\nThreads=4\n[WEFT]\nThreads=4\n{rest}"
    )
}

/// The twill with other sections behind it.
fn twill(rest: &str) -> String {
    wif(&format!("{THREADING}{TIEUP}{TREADLING}{rest}"))
}

/// The twill with a shed that is said to rise so.
fn shed(rising: &str) -> String {
    let key = format!("Treadles=4\n{rising}\n");
    twill("").replace("Treadles=4\n", &key)
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
    let lifted = "[LIFTPLAN]\n1=1,2\n2=2,3\n3=3,4\n4=4,1\n";
    let skeleton = "[TIEUP]\n1=1\n2=2\n3=3\n4=4\n[TREADLING]\n1=1,2\n2=2,0,3\n3=3,4\n4=4,1\n";
    let [lifted, skeleton] = [lifted, skeleton].map(|rest| wif(&format!("{THREADING}{rest}")));
    for text in [twill(""), lifted, skeleton] {
        assert_eq!(read(&text).drawdown(), TWILL);
    }
}

#[test]
fn a_sinking_shed_is_the_complement() {
    let (up, down) = (read(&twill("")), read(&shed("Rising Shed=no")));
    assert!((0..16).all(|i| up.warp_up(i % 4, i / 4) != down.warp_up(i % 4, i / 4)));
}

#[test]
fn dress_does_not_matter() {
    let plain = shed("rising shed = 1");
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
    let mut bytes = twill("[TEXT]\nTitle=k").into_bytes();
    bytes.extend(b"\xf6per\n");
    assert_eq!(Draft::from_wif(&bytes).unwrap().title, "köper");
}

#[test]
fn liftplan_wins_over_treadling_and_says_so_when_they_differ() {
    let both = |lift: &str| read(&twill(&format!("[LIFTPLAN]\n{lift}")));
    assert!(both("1=2,1\n2=2,3\n3=3,4\n4=1,4\n").warnings.is_empty());
    let other = both("1=1\n2=2\n3=3\n4=4\n");
    assert_eq!(other.drawdown(), "...X\n..X.\n.X..\nX...\n");
    assert!(other.warnings[0].contains("differs from TIEUP"));
    let disowned = twill("[CONTENTS]\nLIFTPLAN=no\n[LIFTPLAN]\n1=1\n");
    assert_eq!(read(&disowned).drawdown(), TWILL);
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
        let draft = read(&twill(&format!(
            "[COLOR PALETTE]\n{range}\n[COLOR TABLE]\n2={white}\n\
             [WARP COLORS]\n1=2\n[WARP]\nUnits={unit}\nSpacing={spacing}\n[WARP THICKNESS]\n3={spacing}\n"
        )));
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

/// What stands behind the twill, with `\n` at the ends of lines, and what is said of it.
const ODD: &str = r#"
[TREDLING]\n1=1 | did you mean "TREADLING"
[WARP]\nColor=7 | [WARP] Color 7 is not in the COLOR TABLE
[WARP SPACING]\n1=2\n[WARP]\nUnits=cm | 3 threads have none
[WARP]\nSpacing=2 | Units is missing
"#;

#[test]
fn odd_but_decided_files_load_with_a_warning() {
    let warned = |text: &str, expected: &str| {
        assert_contains(&read(text).warnings.join("; "), expected);
    };
    let few = format!("{THREADING}{TIEUP}[TREADLING]\n1=1\n2=\n4=0\n");
    warned(&wif(&few), "[TREADLING] 3 of 4 picks use no treadle");
    let threaded = |lines: &str| wif(&format!("[THREADING]\n{lines}\n{TIEUP}{TREADLING}"));
    warned(&threaded("1=1"), "[THREADING] 3 of 4 ends are on no shaft");
    warned(
        &threaded("1=1\n2=1\n3=1\n4=1\n9=1"),
        "1 lines lie beyond line 4",
    );
    for [rest, expected] in table_rows(ODD) {
        warned(&twill(&rest.replace(r"\n", "\n")), expected);
    }
    let uncounted = "[THREADING]\n1=1\n2=2\n[LIFTPLAN]\n1=1\n2=2\n3=1,2\n";
    let draft = read(uncounted);
    assert_eq!(draft.drawdown(), "XX\n.X\nX.\n");
    assert_eq!(draft.warnings.len(), 2);
}

/// What stands behind the twill, with `\n` at the ends of lines, and why it is refused.
const UNDECIDED: &str = r"
[WARP COLORS]\n2=3 | [WARP COLORS] 2: colour 3: there is no COLOR TABLE
[COLOR TABLE]\n1=0,0,0\n[WEFT COLORS]\n2=3 | [WEFT COLORS] 2: colour 3: the COLOR TABLE ends at 1
[COLOR TABLE]\n1=0,0 | [COLOR TABLE] 1: expected red,green,blue
[COLOR PALETTE]\nRange=5,5\n[COLOR TABLE]\n1=0,0,0 | [COLOR PALETTE] Range
[WARP]\nSpacing=1\nUnits=parsecs | [WARP] Units: expected centimeters
[WARP]\nSpacing=nan | [WARP] SPACING: expected a number
[WARP]\nThreads=99999999 | [WARP] Threads: expected 1 to
[WARP]\nThreads=16384\n[WEFT]\nThreads=16384 | crossings
[WARP]\nThreads=0 | found 0
";

#[test]
fn undecided_files_are_refused_with_section_and_key() {
    let no_tieup = format!("{THREADING}{TREADLING}");
    let threaded = |line: &str| wif(&format!("[THREADING]\n{line}\n{TIEUP}{TREADLING}"));
    let far = format!("{THREADING}{TIEUP}[TREADLING]\n1=5\n");
    for (text, expected) in [
        (String::new(), "not a WIF file"),
        ("garbage".to_owned(), "not a WIF file"),
        (wif(TIEUP), "[THREADING]: the section is missing"),
        (wif(THREADING), "[LIFTPLAN]: the section is missing"),
        (wif(&no_tieup), "[TIEUP]: the section is missing"),
        (wif(&far), "[TREADLING] 1: 5 is beyond the 4"),
        (threaded("3=x"), "[THREADING] 3: expected a whole number"),
        (threaded("3=-1"), "[THREADING] 3: expected a whole number"),
        (threaded("three=1"), "expected a line number"),
        (
            shed("Rising Shed=perhaps"),
            "[WEAVING] RISING SHED: expected true or false",
        ),
    ] {
        assert_contains(&refused(&text), expected);
    }
    for [rest, expected] in table_rows(UNDECIDED) {
        assert_contains(&refused(&twill(&rest.replace(r"\n", "\n"))), expected);
    }
}

/// Files in the dialects of several programs load, with a warning where their name starts
/// with `warn`; rising and sinking sheds are complements.
#[test]
fn drafts_in_many_dialects_load() {
    let mut drafts = BTreeMap::new();
    for (name, bytes) in EXAMPLES {
        let draft = Draft::from_wif(bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        let warns = name.starts_with("warn");
        assert!(!warns || !draft.warnings.is_empty(), "{name}");
        drafts.insert(name, draft);
    }
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
        let mut text = twill(
            "[COLOR PALETTE]\nRange=0,9\n[COLOR TABLE]\n1=1,2,3\n[WARP COLORS]\n1=1\n"
        );
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
