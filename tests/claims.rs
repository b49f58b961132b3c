//! Measured figures and their records: every figure in the README and the pages is tied to
//! a record in `benches/runs` or to a test, and no record that a page cites is older than
//! the code it measured. CONTRIBUTING.md describes records and how pages cite them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

mod page;
mod record;

use page::{blocks, cited_records, loose_figures};
use record::{Measurement, changed_lines, code_lines, measurements, outdated, records};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// What the spans of code in a text hold.
fn code_spans(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

fn is_commit(word: &str) -> bool {
    (7..=40).contains(&word.len()) && word.chars().all(|c| c.is_ascii_hexdigit())
}

/// Names and paths of all files below `folder` but those of builds, with `/`.
fn file_paths(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(inside) = folders.pop() {
        for entry in std::fs::read_dir(&inside).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if !path.is_dir() {
                let path = path.strip_prefix(folder).unwrap().display().to_string();
                found.push(path.replace('\\', "/"));
            } else if name != "target" && !name.starts_with('.') {
                folders.push(path);
            }
        }
    }
    found
}

/// What git prints, if it can.
fn git(arguments: &[&str]) -> Option<String> {
    let mut git = Command::new("git");
    let out = git.arg("-C").arg(root()).args(arguments).output().ok()?;
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    out.status.success().then_some(text)
}

/// README and the pages, by name.
fn pages() -> Vec<(String, String)> {
    let names = file_paths(&root().join("docs"))
        .into_iter()
        .map(|name| format!("docs/{name}"));
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".md")).collect();
    names.push("README.md".to_owned());
    names.sort();
    let read = |name: String| {
        let text = std::fs::read_to_string(root().join(&name)).unwrap();
        (name, text)
    };
    names.into_iter().map(read).collect()
}

#[test]
fn every_record_names_what_it_was_measured_with() {
    let files = file_paths(&root());
    let records = records();
    let defects: Vec<String> = records.iter().flat_map(|m| m.defects(&files)).collect();
    assert!(defects.is_empty(), "{defects:#?}");
    // Known bad: a record without a load, one of code that is gone, an empty reason.
    let good = "# A\n\n## B c\n\n| | |\n|---|---|\n| commit | `1234567` |\n| code | `src/main.rs` |\n\
                | command | `true` |\n| machine | AMD EPYC |\n| load | none |\n";
    let defects = |text: &str| measurements("a.md", text)[0].defects(&files).len();
    assert_eq!(measurements("a.md", good)[0].place, "a.md#b-c");
    assert_eq!(defects(good), 0);
    assert_eq!(defects(&good.replace("| load | none |\n", "")), 1);
    assert_eq!(defects(&good.replace("src/main.rs", "src/gone.rs")), 1);
    assert_eq!(defects(&format!("{good}| still holds | yes |\n")), 1);
    assert_eq!(
        defects(&format!(
            "{good}| still holds | `tests/main.rs`: it asserts the figure |\n"
        )),
        0
    );
}

#[test]
fn every_measured_figure_is_tied_to_a_record_or_a_test() {
    let files = file_paths(&root());
    let records = records();
    let mut defects = Vec::new();
    for (name, page) in pages() {
        defects.extend(
            loose_figures(&page, &files)
                .into_iter()
                .map(|line| format!("{name}:{line}")),
        );
        for place in cited_records(&page) {
            if !records.iter().any(|m| m.place == place) {
                defects.push(format!("{name}: benches/runs/{place} is no measurement"));
            }
        }
    }
    assert!(
        defects.is_empty(),
        "not tied to a record or a test: {defects:#?}"
    );
    // Known bad: each of these without what ties it.
    let loose = |page: &str| loose_figures(page, &files).len();
    for figure in [
        "It takes 3.5 s.",
        "It is 12 % darker.",
        "64 to 71 times",
        "0.386 of the light",
    ] {
        assert_eq!(loose(figure), 1, "{figure}");
        assert_eq!(loose(&format!("{figure} `tests/claims.rs` checks it.")), 0);
        let cited = format!("{figure} ([record](../benches/runs/kernel.md))");
        assert_eq!(loose(&cited), 0);
        assert_eq!(
            loose(&format!(
                "Measured ([record](../benches/runs/x.md)):\n\n- {figure}\n"
            )),
            0
        );
        assert_eq!(
            loose(&format!(
                "{cited}\n\n# Other\n\n| a | b |\n|---|---|\n| c | {figure} |\n"
            )),
            1
        );
    }
}

#[test]
fn no_cited_record_is_older_than_its_code() {
    let is_shallow = git(&["rev-parse", "--is-shallow-repository"]);
    let top = git(&["rev-parse", "--show-prefix"]);
    if is_shallow.as_deref().map(str::trim) != Some("false")
        || top.as_deref().map(str::trim) != Some("")
    {
        let why = "this copy has no history of commits, or not all of it";
        organza_testing::skipped("ages of the records in benches/runs", why);
        return;
    }
    let mut citing: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (_, page) in pages() {
        for block in blocks(&page) {
            for place in cited_records(&block.text()) {
                citing.entry(place).or_default().push(block.text());
            }
        }
    }
    let mut defects = Vec::new();
    for m in records() {
        let known = defects.len();
        for commit in m.commits() {
            if git(&["merge-base", "--is-ancestor", commit, "HEAD"]).is_none() {
                defects.push(format!(
                    "{}: commit {commit} is not part of the history",
                    m.place
                ));
            }
        }
        if let (Some(texts), true) = (citing.get(&m.place), defects.len() == known) {
            defects.extend(outdated(&m, texts, &|commit| {
                changed_lines(commit, &m.code())
            }));
        }
    }
    assert!(
        defects.is_empty(),
        "measure again with `python3 benches/records.py measure`, or say in the record why it \
         holds: {defects:#?}"
    );
    // Known bad: old code, and a page that does not name the commit of an old record.
    let table = "| commit | `1234567` |\n";
    let made = |more: &str| measurements("a.md", &format!("{table}{more}")).remove(0);
    let old = |m: &Measurement, text: &str| {
        outdated(m, &[text.to_owned()], &|commit| {
            usize::from(commit == "1234567")
        })
        .is_some()
    };
    assert!(old(&made(""), "at `1234567`"));
    assert!(!old(
        &made("| still holds | `7654321`: names changed |\n"),
        ""
    ));
    assert!(!old(
        &made("| still holds | `tests/a.rs` asserts it |\n"),
        ""
    ));
    assert!(!old(
        &made("| not measured again | takes a day |\n"),
        "at `1234567`"
    ));
    assert!(old(&made("| not measured again | takes a day |\n"), "now"));
    assert_eq!(
        code_lines("--- a\n+++ b\n-// x\n+    // y\n+\n+let x = 1;\n-let y;\n"),
        2
    );
    // Modules of tests are no code; the next part of the difference is.
    let in_tests = "@@ -9 +9 @@ mod tests {\n-let x;\n+let y;\n@@ -1 +1 @@ fn f() {\n+let z;\n";
    assert_eq!(code_lines(in_tests), 1);
    let new = "@@ -9 +9 @@ fn f() {\n+let z;\n+#[cfg(test)]\n+mod tests {\n+let x;\n+}\n";
    assert_eq!(code_lines(new), 1);
}
