//! The repository tests itself: crate edges, citations, module docs, words
//! that belong to no file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Left imports from right; nothing else is allowed. See ARCHITECTURE.md.
const EDGES: [(&str, &[&str]); 23] = [
    ("basis", &[]),
    ("cache", &[]),
    ("testing", &["basis", "light", "scatter"]),
    ("weave", &["basis"]),
    ("volume", &["basis"]),
    ("scan", &["basis", "volume"]),
    ("photograph", &["weave"]),
    ("scatter", &["basis"]),
    ("mesh", &["basis"]),
    ("film", &["basis"]),
    ("denoise", &["film"]),
    ("light", &["basis"]),
    ("kernel", &["basis", "film", "light", "scatter"]),
    (
        "transport",
        &[
            "basis", "film", "kernel", "light", "mesh", "scatter", "volume",
        ],
    ),
    ("surface", &["basis", "scatter", "weave"]),
    ("measure", &["basis", "scatter", "surface", "transport"]),
    ("picture", &["basis", "film"]),
    (
        "scene",
        &[
            "basis",
            "cache",
            "light",
            "measure",
            "mesh",
            "picture",
            "scatter",
            "surface",
            "transport",
            "volume",
            "weave",
        ],
    ),
    ("python", &["basis", "cli", "scene", "volume", "weave"]),
    ("report", &["basis", "measure", "picture", "scene"]),
    ("view", &["picture", "scene", "transport", "weave"]),
    ("bake", &["basis", "measure"]),
    (
        "cli",
        &[
            "bake",
            "basis",
            "cache",
            "denoise",
            "film",
            "kernel",
            "light",
            "measure",
            "mesh",
            "photograph",
            "picture",
            "report",
            "scan",
            "scatter",
            "scene",
            "surface",
            "transport",
            "view",
            "volume",
            "weave",
        ],
    ),
];

/// The organza crates that a manifest's `[dependencies]` name.
fn own_dependencies(manifest: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(manifest).unwrap();
    let table: toml::Table = toml::from_str(&text).unwrap();
    let Some(dependencies) = table.get("dependencies").and_then(|d| d.as_table()) else {
        return BTreeSet::new();
    };
    dependencies
        .keys()
        .filter_map(|k| k.strip_prefix("organza-").map(str::to_owned))
        .collect()
}

#[test]
fn crates_import_one_way_only() {
    let allowed: BTreeMap<&str, BTreeSet<&str>> = EDGES
        .iter()
        .map(|(name, to)| (*name, to.iter().copied().collect()))
        .collect();
    let mut seen = BTreeSet::new();
    for entry in std::fs::read_dir(root().join("crates")).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        let allowed = allowed
            .get(name.as_str())
            .unwrap_or_else(|| panic!("crates/{name} is not in the table of edges"));
        for dependency in own_dependencies(&folder.join("Cargo.toml")) {
            assert!(
                allowed.contains(dependency.as_str()),
                "crates/{name} must not import crates/{dependency}"
            );
        }
        seen.insert(name);
    }
    assert_eq!(
        seen.len(),
        EDGES.len(),
        "a crate of the table does not exist"
    );
    let root = own_dependencies(&root().join("Cargo.toml"));
    assert_eq!(root, BTreeSet::from(["cli".to_owned()]));
}

/// The table "To add something" of ARCHITECTURE.md: an example and the list that registers
/// it, which names the example.
#[test]
fn the_table_of_additions_names_examples_and_their_lists() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let section = text.split("## To add something").nth(1).unwrap();
    let section = section.split("\n## ").next().unwrap();
    let mut rows = 0;
    for row in section.lines().filter(|line| line.contains("`crates/")) {
        let paths: Vec<&str> = row.split('`').skip(1).step_by(2).collect();
        let [example, list] = paths[..] else {
            panic!("expected an example and a list: {row}");
        };
        assert!(root().join(example).exists(), "{example}");
        let list_text =
            std::fs::read_to_string(root().join(list)).unwrap_or_else(|e| panic!("{list}: {e}"));
        let stem = Path::new(example).file_stem().unwrap().to_string_lossy();
        let is_named = list_text.to_lowercase().contains(stem.as_ref());
        assert!(is_named, "{list} does not register {stem}");
        rows += 1;
    }
    assert!(rows >= 7, "only {rows} rows");
}

/// Additions that were made as the table says, and the name of each in code: no file but
/// its own, the list and the declaration of the module mentions it.
const ADDED: [(&str, &str, &str, &str); 6] = [
    (
        "gaussian_diffuse",
        "crates/scatter/src/flake/gaussian_diffuse.rs",
        "crates/scatter/src/flake/catalogue.rs",
        "crates/scatter/src/flake/mod.rs",
    ),
    (
        "SpotTable",
        "crates/light/src/spot.rs",
        "crates/light/src/catalogue.rs",
        "crates/light/src/lib.rs",
    ),
    (
        "DiffuseSpec",
        "crates/surface/src/diffuse.rs",
        "crates/surface/src/catalogue.rs",
        "crates/surface/src/lib.rs",
    ),
    (
        "nrrd",
        "crates/volume/src/format/nrrd.rs",
        "crates/volume/src/format/mod.rs",
        "crates/volume/src/format/mod.rs",
    ),
    (
        "\"tif\"",
        "crates/picture/src/tiff.rs",
        "crates/picture/src/lib.rs",
        "crates/picture/src/lib.rs",
    ),
    (
        "DifferenceArgs",
        "crates/cli/src/commands/difference.rs",
        "crates/cli/src/commands/mod.rs",
        "crates/cli/src/commands/mod.rs",
    ),
];

#[test]
fn an_addition_is_one_file_and_one_line() {
    let all = files(&root().join("crates"), &["rs"]);
    let product = all.iter().filter(|path| {
        let is_source = path.components().any(|c| c.as_os_str() == "src");
        is_source && !is_test_module(path)
    });
    let texts: Vec<(String, String)> = product
        .map(|path| {
            let text = std::fs::read_to_string(path).unwrap();
            let name = path.strip_prefix(root()).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap_or_default();
            (name.display().to_string(), code.to_owned())
        })
        .collect();
    for (name, own, list, module) in ADDED {
        let mentions = |text: &str| text.lines().filter(|l| l.contains(name)).count();
        let found = texts.iter().filter(|(_, text)| mentions(text) > 0);
        let found: BTreeSet<&str> = found.map(|(path, _)| path.as_str()).collect();
        let allowed = BTreeSet::from([own, list, module]);
        assert!(root().join(own).exists(), "{own}");
        assert!(found.is_subset(&allowed), "{name} stands in {found:?}");
    }
    // The known-bad twin: a kind of object that other files match on is not one file.
    let others = texts.iter().filter(|(_, text)| text.contains("Collision"));
    assert!(others.count() > 3, "the search for names finds nothing");
}

/// All files below `folder` with one of the endings.
fn files(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                if name != "target" && name != ".git" {
                    folders.push(path);
                }
            } else if endings.iter().any(|e| name.ends_with(e)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Keys in a text: an author and a year in square brackets.
fn citations(text: &str) -> BTreeSet<String> {
    text.split('[')
        .skip(1)
        .filter_map(|s| s.split_once(']').map(|(key, _)| key))
        .filter(|key| {
            let letters = key.trim_end_matches(|c: char| c.is_ascii_digit());
            key.len() == letters.len() + 4
                && letters.len() > 2
                && letters.chars().all(char::is_alphabetic)
                && key.chars().next().is_some_and(char::is_alphabetic)
        })
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_citation_resolves_and_every_entry_is_cited() {
    let bib = std::fs::read_to_string(root().join("REFERENCES.bib")).unwrap();
    let keys: BTreeSet<String> = bib
        .lines()
        .filter_map(|l| l.strip_prefix('@')?.split_once('{')?.1.strip_suffix(','))
        .map(str::to_owned)
        .collect();
    let mut cited = BTreeSet::new();
    for path in files(&root(), &[".rs", ".md", ".toml"]) {
        for key in citations(&std::fs::read_to_string(&path).unwrap()) {
            assert!(
                keys.contains(&key),
                "{}: [{key}] is not in REFERENCES.bib",
                path.display()
            );
            cited.insert(key);
        }
    }
    let unused: Vec<_> = keys.difference(&cited).collect();
    assert!(unused.is_empty(), "never cited: {unused:?}");
}

#[test]
fn every_source_file_says_what_it_is() {
    for path in files(&root(), &[".rs"]) {
        let of_a_test = path.components().any(|c| c.as_os_str() == "tests");
        if is_test_module(&path) || of_a_test {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.starts_with("//!"),
            "{} does not open with a doc comment",
            path.display()
        );
    }
}

/// The most lines of a source file whose head gives no reason for more.
const MAX_LINES: usize = 450;

/// Whether a source file has at most [`MAX_LINES`] lines, or its head has a line
/// `//! More than 450 lines: REASON`.
fn is_short_or_says_why(text: &str) -> bool {
    let mut head = text.lines().take_while(|line| line.starts_with("//!"));
    let marker = format!("//! More than {MAX_LINES} lines: ");
    text.lines().count() <= MAX_LINES
        || head.any(|line| line.strip_prefix(&marker).is_some_and(|why| why.len() > 10))
}

#[test]
fn long_source_files_say_why() {
    let long: Vec<String> = files(&root(), &[".rs"])
        .iter()
        .filter(|path| !is_short_or_says_why(&std::fs::read_to_string(path).unwrap()))
        .map(|path| path.display().to_string())
        .collect();
    assert!(
        long.is_empty(),
        "more than {MAX_LINES} lines without a reason in the head: {long:?}"
    );
    // Known bad: a line too many, an empty reason, a reason below the head.
    let code = "fn f() {}\n".repeat(MAX_LINES);
    let reason = "//! More than 450 lines: one table that is read as a whole.\n";
    assert!(is_short_or_says_why(&code));
    assert!(is_short_or_says_why(&format!("{reason}{code}")));
    assert!(!is_short_or_says_why(&format!("{code}fn g() {{}}\n")));
    assert!(!is_short_or_says_why(&format!(
        "//! More than 450 lines: \n{code}"
    )));
    assert!(!is_short_or_says_why(&format!(
        "//! A table.\n\n{reason}{code}"
    )));
}

/// Unit tests that outgrew their file: `tests.rs`, `…_tests.rs`, and what lies in a folder of
/// such a name.
fn is_test_module(path: &Path) -> bool {
    let inside = path.strip_prefix(root()).unwrap_or(path);
    inside.iter().any(|part| {
        let part = part.to_string_lossy();
        part.trim_end_matches(".rs").ends_with("tests")
    })
}

/// Instruction sets that functions are compiled for, and those that the processor is asked
/// for first.
fn compiled_and_asked_for(dispatch: &str, backend: &str) -> [BTreeSet<String>; 2] {
    let quoted = |text: &str, before: &str| -> Vec<String> {
        let parts = text.split(before).skip(1);
        let quotes = parts.filter_map(|part| part.split('"').nth(1));
        quotes.map(str::to_owned).collect()
    };
    let compiled = quoted(dispatch, "enable = ").join(",");
    let compiled = compiled.split(',').map(str::to_owned).collect();
    let asked = quoted(backend, "is_x86_feature_detected!(");
    [compiled, asked.into_iter().collect()]
}

/// A processor without an instruction that the vector kernel is compiled for never runs it.
#[test]
fn back_ends_ask_for_all_that_they_are_compiled_for() {
    let read = |name: &str| {
        let path = root().join("crates/kernel/src/cpu").join(name);
        std::fs::read_to_string(path).unwrap()
    };
    let (dispatch, backend) = (read("dispatch.rs"), read("backend.rs"));
    let [compiled, asked] = compiled_and_asked_for(&dispatch, &backend);
    assert!(compiled.contains("bmi2") && compiled.len() >= 10);
    assert_eq!(compiled, asked);
    // Known bad: the questions of before.
    let [_, asked] = compiled_and_asked_for(&dispatch, &backend.replace("(\"bmi2\")", "(\"fma\")"));
    assert_ne!(compiled, asked);
}

#[test]
fn only_caches_scenes_benches_and_the_command_line_open_files() {
    let closed = EDGES
        .iter()
        .filter(|(n, _)| !["cache", "denoise", "scene", "report", "cli", "testing"].contains(n));
    for (name, _) in closed {
        for path in files(&root().join("crates").join(name).join("src"), &[".rs"]) {
            if is_test_module(&path) {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap_or("");
            for word in ["std::fs", "File::open", "File::create"] {
                assert!(!code.contains(word), "{} uses {word}", path.display());
            }
        }
    }
}

#[test]
fn only_the_command_line_prints() {
    // Tests print what the gate counts.
    let prints = ["cli", "testing"];
    for (name, _) in EDGES.iter().filter(|(n, _)| !prints.contains(n)) {
        for path in files(&root().join("crates").join(name).join("src"), &[".rs"]) {
            if is_test_module(&path) {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap_or("");
            for word in ["println!", "stdout()", "stderr()"] {
                let prints = code.lines().any(|l| {
                    let l = l.trim_start();
                    !l.starts_with("//") && l.contains(word)
                });
                assert!(!prints, "{} uses {word}", path.display());
            }
        }
    }
}
