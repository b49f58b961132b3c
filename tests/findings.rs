//! Defects that were found from outside the project: `tests/data/findings.csv` names for each the
//! tests that hold its repair, or the page that answers it. The tests exist and are run, the
//! pages have the headings, and `docs/trust.md` states how many findings are open.

use std::collections::BTreeSet;
use std::path::Path;
use syn::Item;

/// A line of the table.
#[derive(Clone, Debug)]
struct Finding {
    id: String,
    section: String,
    /// What was wrong, in one sentence.
    finding: String,
    /// One of [`STATUSES`].
    status: String,
    /// Tests (`file.rs::function`), headings (`page.md#Heading`) and files, with `; ` between.
    place: String,
}

/// Repaired, held by tests; withdrawn or stated as a limit on a page; not repaired.
const STATUSES: [&str; 3] = ["tested", "answered", "open"];

fn read(name: &str) -> Option<String> {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).ok()
}

/// The findings of a table, whose columns have the names of the fields.
fn findings(table: &str) -> Vec<Finding> {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_reader(table.as_bytes());
    let names = reader.headers().unwrap();
    assert_eq!(names, ["id", "section", "finding", "status", "where"][..]);
    let rows = reader.records().map(|row| {
        let cells: Vec<String> = row.unwrap().iter().map(str::to_owned).collect();
        let [id, section, finding, status, place] = cells.try_into().unwrap();
        Finding {
            id,
            section,
            finding,
            status,
            place,
        }
    });
    rows.collect()
}

/// Whether source code has a test function of that name that is not ignored.
fn has_test(code: &str, name: &str) -> bool {
    fn is_among(items: &[Item], name: &str) -> bool {
        items.iter().any(|item| match item {
            Item::Fn(function) => {
                let has = |attribute: &str| {
                    let mut all = function.attrs.iter();
                    all.any(|a| a.path().is_ident(attribute))
                };
                function.sig.ident == name && has("test") && !has("ignore")
            }
            Item::Mod(inner) => match &inner.content {
                Some((_, items)) => is_among(items, name),
                None => false,
            },
            _ => false,
        })
    }
    syn::parse_file(code).is_ok_and(|file| is_among(&file.items, name))
}

fn has_heading(page: &str, heading: &str) -> bool {
    let mut headings = page.lines().filter(|line| line.starts_with('#'));
    headings.any(|line| line.trim_start_matches('#').trim() == heading)
}

/// Why a place is none, if so.
fn defect_of_place(place: &str) -> Option<String> {
    let (file, inside) = match place.split_once("::") {
        Some((file, test)) => (file, Some((test, true))),
        None => match place.split_once('#') {
            Some((file, heading)) => (file, Some((heading, false))),
            None => (place, None),
        },
    };
    let Some(text) = read(file) else {
        return Some(format!("{file} is no text of the repository"));
    };
    match inside {
        Some((test, true)) if !has_test(&text, test) => {
            Some(format!("{file} has no test `{test}` that is run"))
        }
        Some((heading, false)) if !has_heading(&text, heading) => {
            Some(format!("{file} has no heading `{heading}`"))
        }
        _ => None,
    }
}

/// What `docs/trust.md` says about the whole table.
fn counts(findings: &[Finding]) -> String {
    let of = |status: &str| -> Vec<&str> {
        let all = findings.iter().filter(|f| f.status == status);
        all.map(|f| f.id.as_str()).collect()
    };
    let [tested, answered, open] = STATUSES.map(of);
    let ids = match &open[..] {
        [] => String::new(),
        ids => format!(": {}", ids.join(", ")),
    };
    format!(
        "Of {} findings tests hold {}, pages answer {}, and {} are open{ids}.",
        findings.len(),
        tested.len(),
        answered.len(),
        open.len()
    )
}

/// What is wrong with a table and with what a page says about it.
fn defects(findings: &[Finding], page: &str) -> Vec<String> {
    let mut defects = Vec::new();
    let mut known = BTreeSet::new();
    for (i, f) in findings.iter().enumerate() {
        let mut blame = |why: String| defects.push(format!("finding {}: {why}", f.id));
        if f.id != (i + 1).to_string() {
            blame(format!("expected the id {}", i + 1));
        }
        if f.section.is_empty() || !f.finding.ends_with('.') || !known.insert(&f.finding) {
            blame("expected a section, and a sentence of its own".to_owned());
        }
        let places: Vec<&str> = f.place.split("; ").collect();
        let names = |kind: &str| places.iter().any(|place| place.contains(kind));
        let is_sound = match f.status.as_str() {
            "tested" => names(".rs::"),
            "answered" => names(".md"),
            "open" => f.place == "docs/trust.md#Known defects",
            _ => false,
        };
        if !is_sound {
            blame(format!("`{}` does not go with {places:?}", f.status));
        }
        let wrong = places.iter().filter_map(|place| defect_of_place(place));
        wrong.for_each(&mut blame);
    }
    let words: Vec<&str> = page.split_whitespace().collect();
    let counts = counts(findings);
    if !words.join(" ").contains(&counts) {
        defects.push(format!("expected in docs/trust.md: {counts}"));
    }
    defects
}

#[test]
fn every_finding_is_held_by_a_test_or_answered_or_stated_as_open() {
    let table = read("tests/data/findings.csv").unwrap();
    let all = findings(&table);
    let found = defects(&all, &read("docs/trust.md").unwrap());
    assert!(found.is_empty(), "{found:#?}");
    assert!(all.len() > 70, "only {}", all.len());

    // Known bad: a table of three lines, of which each has one mistake.
    let line = |id: &str, status: &str, place: &str| Finding {
        id: id.to_owned(),
        section: "A".to_owned(),
        finding: format!("Finding {id}."),
        status: status.to_owned(),
        place: place.to_owned(),
    };
    let own = "tests/findings.rs::every_finding_is_held_by_a_test_or_answered_or_stated_as_open";
    let good = [
        line("1", "tested", &format!("{own}; tests/data/findings.csv")),
        line("2", "answered", "docs/trust.md#Known defects"),
        line("3", "open", "docs/trust.md#Known defects"),
    ];
    let stated = counts(&good);
    assert!(stated.ends_with("and 1 are open: 3."), "{stated}");
    assert_eq!(defects(&good, &stated), [""; 0]);
    let bad = |at: usize, change: &dyn Fn(&mut Finding)| {
        let mut table = good.to_vec();
        change(&mut table[at]);
        defects(&table, &counts(&table))
    };
    for (at, place, why) in [
        (0, "tests/gone.rs::a_test", "is no text of the repository"),
        (0, "tests/findings.rs::gone", "has no test `gone`"),
        // A function that is no test, and a page where a test is expected.
        (0, "tests/findings.rs::counts", "has no test `counts`"),
        (0, "docs/trust.md#Known defects", "`tested` does not go"),
        (1, "docs/trust.md#Gone", "has no heading `Gone`"),
        (1, "docs/gone.md", "is no text of the repository"),
        (1, own, "`answered` does not go"),
        (2, own, "`open` does not go"),
    ] {
        let found = bad(at, &|f| f.place = place.to_owned());
        assert!(found.len() == 1 && found[0].contains(why), "{found:?}");
    }
    assert_eq!(bad(1, &|f| f.id = "1".to_owned()).len(), 1);
    assert_eq!(bad(1, &|f| f.finding = "Finding 1.".to_owned()).len(), 1);
    assert_eq!(bad(1, &|f| f.section.clear()).len(), 1);
    assert_eq!(bad(0, &|f| f.status = "done".to_owned()).len(), 1);
    // An open finding that the page does not state.
    let mut hidden = good.to_vec();
    hidden[1].status = "open".to_owned();
    assert_eq!(defects(&hidden, &stated).len(), 1);
}

/// Tests are recognised in modules too; those that are ignored are none.
#[test]
fn tests_are_recognised() {
    let code = "mod tests { #[cfg(unix)] #[test] fn a() {} #[test] #[ignore] fn b() {} fn c() {} }\n\
                #[test] fn d() {}\n// #[test] fn e() {}\nmod f;\n";
    let found = ["a", "b", "c", "d", "e", "f"].map(|name| has_test(code, name));
    assert_eq!(found, [true, false, false, true, false, false]);
    assert!(!has_test("fn (", "a"));
    assert!(has_heading("# A b\n\n## C\n", "C") && !has_heading("# A b\n\nC\n", "C"));
}
