//! The repository tests itself: crate edges, citations, instruction sets.

use organza_testing::table_rows;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Left imports from right; nothing else is allowed, of `-` nothing. See ARCHITECTURE.md.
const EDGES: &str = "
basis | -
cache | -
testing | basis light scatter
weave | basis
volume | basis
scan | basis volume
photograph | weave
lanes | basis
scatter | basis lanes
mesh | basis
film | basis
denoise | film
light | basis lanes
kernel | basis film lanes light mesh scatter
transport | basis film kernel light mesh scatter volume
surface | basis scatter weave
measure | basis scatter surface transport
picture | basis film
scene | basis cache light measure mesh picture scatter surface transport volume weave
work | basis cache denoise film measure picture scene transport
fit | basis measure photograph picture report scatter scene surface transport volume weave work
requests | bake basis cache film fit kernel measure picture report scan scatter scene surface transport volume weave work
report | basis measure picture scene
view | picture scene transport weave
bake | basis measure
cli | basis cache film kernel light mesh picture report requests scatter scene surface transport view volume weave work
python | basis cli requests scene volume weave work
";

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
    let allowed: BTreeMap<&str, BTreeSet<&str>> = table_rows(EDGES)
        .map(|[name, to]| (name, to.split(' ').collect()))
        .collect();
    let mut seen = BTreeSet::new();
    for entry in std::fs::read_dir(root().join("crates")).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        let own = allowed.get(name.as_str());
        let own = own.unwrap_or_else(|| panic!("crates/{name} is not in the table of edges"));
        for dependency in own_dependencies(&folder.join("Cargo.toml")) {
            let is_allowed = own.contains(dependency.as_str());
            assert!(
                is_allowed,
                "crates/{name} must not import crates/{dependency}"
            );
        }
        seen.insert(name);
    }
    assert_eq!(
        seen.len(),
        allowed.len(),
        "a crate of the table does not exist"
    );
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
        let path = root().join("crates/lanes/src").join(name);
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
