//! Every operation on the disk fails in turn: each command ends with status 1 and one message,
//! keeps what was there, leaves nothing half-written, and succeeds when it is run again.
//!
//! A library of the tests' own (`tests/data/failing_disk.rs`) stands between the program and the
//! kernel. Of every command it fails the first operation of each kind on each file and the last
//! one of all, in one way, and of slow commands some of these; `ORGANZA_FULL=1` fails every
//! operation in both ways.
#![cfg(all(target_os = "linux", target_arch = "x86_64", target_env = "gnu"))]
#![allow(clippy::print_stdout)] // prints what was tried

mod disk;

use crate::cli::write_grid_scene;
use crate::fabrics::{SHEET, few_fibres};
use crate::kills::write_ct;
use crate::program::{contents, folder, succeed};
pub use disk::library;
use disk::{Fault, run};
use organza_testing::table_rows;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Output;

/// Puts back what a folder held.
fn restore(folder: &Path, files: &BTreeMap<String, Vec<u8>>) {
    std::fs::remove_dir_all(folder).unwrap();
    std::fs::create_dir(folder).unwrap();
    for (name, bytes) in files {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
}

/// A command on a failing disk.
struct Case<'a> {
    arguments: &'a str,
    /// What an earlier run has and the one on the failing disk has not.
    old: &'a str,
    new: &'a str,
    /// The one of several outputs that stands for all, and is absent while they are replaced.
    stands_for_all: Option<&'a str>,
    /// What is kept on the way, its flags, and the flag to resume by.
    state: &'a str,
    keep: &'a str,
    resume: &'a str,
    /// What fails without harm: the program warns and goes on.
    harmless: &'a str,
    /// In short one in so many of the chosen operations fails.
    every: usize,
}

const CASE: Case<'_> = Case {
    arguments: "",
    old: "",
    new: "",
    stands_for_all: None,
    state: "",
    keep: "",
    resume: "",
    harmless: "",
    every: 1,
};

/// Of the operations of a run, which to fail: their numbers, from 1.
fn chosen(operations: &[String], folder: &Path, every: usize) -> Vec<usize> {
    if organza_testing::is_full() {
        return (1..=operations.len()).collect();
    }
    // Files of one folder within are of one kind, and the random part of temporary names is
    // no part of it.
    let kind = |line: &str| -> String {
        let words = line.split_once(' ').map_or("", |(_, words)| words);
        let (what, path) = words.split_once(' ').unwrap();
        let path = Path::new(path)
            .strip_prefix(folder)
            .unwrap_or(Path::new(path));
        let kept = match path.parent().unwrap() {
            here if here == Path::new("") => path,
            inside => inside,
        };
        let kept = kept.to_str().unwrap();
        let name = kept.strip_suffix(".tmp").and_then(|k| k.rsplit_once('.'));
        format!("{what} {}", name.map_or(kept, |(name, _)| name))
    };
    let mut kinds = BTreeSet::new();
    let mut numbers: Vec<usize> = (1..=operations.len())
        .filter(|&number| kinds.insert(kind(&operations[number - 1])))
        .collect();
    if numbers.last() != Some(&operations.len()) {
        numbers.push(operations.len());
    }
    numbers.into_iter().skip(every - 1).step_by(every).collect()
}

/// The words of messages beside which a file or a folder is named.
const NAMING: [&str; 3] = ["cannot write ", ": cannot make the folder", "--cache: "];

/// Why what a failed run left is wrong. `before` is what was there, `whole` what an undisturbed
/// run leaves.
fn judge(
    case: &Case<'_>,
    out: &Output,
    before: &BTreeMap<String, Vec<u8>>,
    whole: &BTreeMap<String, Vec<u8>>,
    after: &BTreeMap<String, Vec<u8>>,
) -> Option<String> {
    let message = String::from_utf8_lossy(&out.stderr);
    let is_whole = |name: &str| after.get(name) == whole.get(name);
    let is_state = |name: &str| !case.state.is_empty() && name.starts_with(case.state);
    let is_cache = |name: &str| !case.harmless.is_empty() && name.starts_with(case.harmless);
    let outputs: Vec<&String> = whole
        .keys()
        .filter(|name| !is_state(name) && !is_cache(name) && before.get(*name) != whole.get(*name))
        .collect();
    // What fails without harm is warned of; on a full disk the output fails after it.
    let errors = message
        .lines()
        .filter(|line| case.harmless.is_empty() || !line.starts_with("organza: warning: "))
        .count();
    match out.status.code() {
        Some(0) if case.harmless.is_empty() => return Some(format!("succeeded: {message}")),
        Some(0) if !message.is_empty() && !message.starts_with("organza: warning: ") => {
            return Some(format!("expected a warning: {message}"));
        }
        Some(0) if !outputs.iter().all(|name| is_whole(name)) => {
            return Some(format!("succeeded without a result: {message}"));
        }
        Some(0) => {}
        // The folder is tried before the work begins: that is a refusal.
        Some(1 | 2) if errors != 1 || !message.starts_with("organza: ") => {
            return Some(format!("expected one line: {message}"));
        }
        Some(1 | 2) if !NAMING.iter().any(|words| message.contains(words)) => {
            return Some(format!("names no file: {message}"));
        }
        Some(1) => {}
        Some(2) if message.contains("cannot write in ") || message.contains("--cache: ") => {}
        code => return Some(format!("ended with {code:?}: {message}")),
    }
    for name in after.keys() {
        if !before.contains_key(name) && !whole.contains_key(name) && !is_state(name) {
            return Some(format!("left {name}"));
        }
    }
    let is_replaced = case
        .stands_for_all
        .is_some_and(|name| !after.contains_key(name));
    let states: BTreeSet<_> = outputs
        .iter()
        .map(|name| match after.get(*name) {
            bytes if bytes == whole.get(*name) => "new",
            bytes if bytes == before.get(*name) => "old",
            _ if is_replaced && case.stands_for_all == Some(name) => "being replaced",
            _ => "neither",
        })
        .collect();
    if states.contains("neither") {
        return Some(format!("half-written or lost: {message}"));
    }
    (states.len() > 1 && !is_replaced).then(|| format!("old and new together: {message}"))
}

/// A file without the lines that report seconds.
fn untimed(bytes: impl AsRef<[u8]>) -> Vec<u8> {
    let lines = bytes.as_ref().split_inclusive(|&b| b == b'\n');
    let timed = |line: &[u8]| line.trim_ascii_start().starts_with(b"\"seconds\":");
    lines
        .filter(|line| !timed(line))
        .flatten()
        .copied()
        .collect()
}

/// Fails the operations of a command in turn.
fn suffer(name: &str, folder: &Path, case: &Case<'_>) {
    let program = env!("CARGO_BIN_EXE_organza");
    let line = [case.arguments, case.old].join(" ");
    succeed(folder, &line.split_whitespace().collect::<Vec<_>>());
    let line = [case.arguments, case.new, case.keep].join(" ");
    let newer: Vec<&str> = line.split_whitespace().collect();
    let before = contents(folder);
    let (out, operations) = run(program, &newer, folder, 0, Fault::Once);
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{name}: {said}");
    let whole = contents(folder);
    assert!(operations.len() > 2, "{name}: {operations:?}");
    let numbers = chosen(&operations, folder, case.every);
    let (mut wrong, mut tried, mut refused) = (Vec::new(), 0, 0);
    for (i, &at) in numbers.iter().enumerate() {
        let both = [Fault::Once, Fault::Full];
        let ways = match organza_testing::is_full() {
            true => &both[..],
            false => &both[i % 2..][..1],
        };
        for &how in ways {
            restore(folder, &before);
            let (out, log) = run(program, &newer, folder, at, how);
            let line = log.iter().find(|line| line.contains(" fails "));
            let Some(line) = line else {
                // A full disk lets files be flushed and renamed.
                assert!(matches!(how, Fault::Full), "{name}: {at} of {log:?}");
                assert!(out.status.success(), "{name}: {at}");
                continue;
            };
            tried += 1;
            refused += u32::from(out.status.code() == Some(2));
            let mut blame = |why| wrong.push(format!("{name}, {how:?}, {line}: {why}"));
            let after = contents(folder);
            if let Some(why) = judge(case, &out, &before, &whole, &after) {
                blame(why);
            }
            if case.state.is_empty() && !organza_testing::is_full() {
                continue;
            }
            let mut again = newer.clone();
            if after.contains_key(case.state) {
                again.extend(case.resume.split_whitespace());
            }
            let (out, _) = run(program, &again, folder, 0, Fault::Once);
            // The lock of a cache is made when it is first needed.
            let is_output = |name: &str| {
                (case.state.is_empty() || !name.starts_with(case.state)) && name != "cache/lock"
            };
            let after = contents(folder);
            if !out.status.success() {
                blame(format!("then {}", String::from_utf8_lossy(&out.stderr)));
            } else if whole
                .iter()
                .filter(|(name, _)| is_output(name))
                .any(|(name, bytes)| after.get(name).map(untimed) != Some(untimed(bytes)))
            {
                blame("then another result".into());
            }
        }
    }
    println!(
        "{name}: {tried} faults among {} operations, {refused} refused before the work",
        operations.len()
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A new folder with the inputs of the cases.
fn workplace(test: &str) -> PathBuf {
    let folder = folder(&format!("failing-{test}"));
    write_grid_scene(&folder);
    std::fs::write(folder.join("cloth.toml"), few_fibres(60.0) + SHEET).unwrap();
    folder
}

#[test]
fn a_program_that_writes_in_place_is_found() {
    let folder = workplace("twin");
    std::fs::write(folder.join("out"), "0123456789").unwrap();
    let before = contents(&folder);
    let script = [
        "-c",
        "printf abcdefgh > out || { echo organza: full >&2; exit 1; }",
    ];
    let (out, _) = run("sh", &script, &folder, 0, Fault::Full);
    assert!(out.status.success());
    let whole = contents(&folder);
    let mut found = 0;
    for at in [1, 2] {
        restore(&folder, &before);
        let (mut out, log) = run("sh", &script, &folder, at, Fault::Full);
        assert!(log.iter().any(|line| line.contains(" fails ")), "{log:?}");
        out.stderr = b"organza: cannot write out: full".to_vec();
        found += u32::from(judge(&CASE, &out, &before, &whole, &contents(&folder)).is_some());
        // A message that names no file is found where the file itself is as it was.
        out.stderr = b"organza: full".to_vec();
        let why = judge(&CASE, &out, &before, &whole, &before);
        assert_eq!(why.as_deref(), Some("names no file: organza: full"));
    }
    assert_eq!(
        found, 1,
        "the write of half, not the creation that is refused"
    );
}

/// A command, what an earlier run has and the one on the failing disk has not, and the one of
/// several outputs that stands for all.
const COMMANDS: &str = "
render scene.toml -o out.exr --quiet --set camera.resolution=[24,16] | --spp 2 | --spp 3 | -
render scene.toml -o out.png --quiet --set camera.resolution=[24,16] | --spp 2 | --spp 3 | -
voxelize cloth.toml -o cloth.ovox --quiet | --voxel-um 60 | --voxel-um 50 | -
voxelize cloth.toml -o cloth.vdb --quiet | --voxel-um 60 | --voxel-um 50 | -
voxelize cloth.toml -o cloth.vol --quiet | --voxel-um 60 | --voxel-um 50 | cloth.sigma_t.vol
measure cloth.toml --layout grid --grid 2,4 --model surface --quiet -o out.csv | --spp 3 | --spp 2 | -
measure cloth.toml --layout grid --grid 2,4 --model surface --quiet -o out.json | --spp 3 | --spp 2 | -
export mitsuba scene.toml -o out --quiet | --set render.spp=2 | --set render.spp=3 | out/scene.xml
export mitsuba scene.toml --quiet | -o earlier | -o new/folder | new/folder/scene.xml
export usd cloth.toml -o cloth.usda --quiet --level yarn | --repeats 1,1 | --repeats 2,2 | -
weave cloth.toml -o draft.png | --cell-px 2 | --cell-px 3 | -
";

#[test]
fn whatever_commands_write() {
    for (i, [arguments, old, new, first]) in table_rows(COMMANDS).enumerate() {
        let case = Case {
            arguments,
            old,
            new,
            stands_for_all: (first != "-").then_some(first),
            ..CASE
        };
        suffer(arguments, &workplace(&format!("command-{i}")), &case);
    }
}

#[test]
#[ignore = "takes 10 seconds: .ci/full runs it"]
fn bakes() {
    let case = Case {
        arguments: "bake cloth.toml -o material --quiet --resolution 16 --texel-spp 4 --pairs 64 \
                    --spp 2 --fit-texels 16 --model microflake",
        old: "--seed 1",
        new: "--seed 2",
        stands_for_all: Some("material/bake.json"),
        ..CASE
    };
    suffer("bake", &workplace("bake"), &case);
}

#[test]
fn checkpoints() {
    let folder = workplace("render");
    let case = Case {
        arguments: "render scene.toml -o out.exr --quiet --threads 1",
        old: "--spp 2",
        new: "--spp 12",
        state: "state",
        keep: "--checkpoint state --checkpoint-every 0s",
        resume: "--resume",
        // The next checkpoint is tried, and the one at the end must succeed.
        harmless: "state",
        ..CASE
    };
    suffer("render with a checkpoint", &folder, &case);
}

#[test]
fn merged_pictures() {
    let folder = workplace("merge");
    for (name, range) in [("a.exr", "0..2"), ("b.exr", "2..5")] {
        let arguments = ["render", "scene.toml", "--samples", range, "-o", name];
        succeed(&folder, &arguments);
    }
    let case = Case {
        arguments: "merge a.exr -o all.exr",
        new: "b.exr",
        ..CASE
    };
    suffer("merge", &folder, &case);
}

#[test]
fn caches() {
    let folder = workplace("cache");
    let case = Case {
        arguments: "voxelize cloth.toml -o cloth.ovox --quiet",
        old: "--voxel-um 60",
        new: "--voxel-um 50 --cache cache",
        harmless: "cache",
        ..CASE
    };
    suffer("voxelize with a cache", &folder, &case);
}

#[test]
fn fits() {
    let folder = workplace("fit");
    let fabric = few_fibres(60.0) + "[surface]\npreset = \"cotton-twill\"\n";
    std::fs::write(folder.join("cloth.toml"), fabric).unwrap();
    let case = Case {
        arguments: "fit surface cloth.toml -o fitted.toml --quiet --patience 1,2 --threads 1",
        old: "--spp 2",
        new: "--spp 3",
        state: "journal",
        keep: "--journal journal",
        every: 3,
        ..CASE
    };
    suffer("fit", &folder, &case);
}

#[test]
fn tables() {
    let folder = workplace("table");
    let case = Case {
        arguments: "table cloth.toml --model surface --held-out 32 --held-out-spp 2 \
                    -o cloth.bsdf --quiet --threads 1",
        old: "--spp 8",
        new: "--spp 16",
        state: "journal",
        keep: "--journal journal",
        every: 3,
        ..CASE
    };
    suffer("table", &folder, &case);
}

#[test]
fn scans() {
    let folder = workplace("scan");
    let scanned = folder.join("ct.raw");
    write_ct(&scanned);
    // Half of its slices, with a fibre.
    let half = &std::fs::read(&scanned).unwrap()[..24 * 24 * 12];
    std::fs::write(&scanned, half).unwrap();
    let case = Case {
        arguments: "scan ct.raw --raw-size 24,24,12 --raw-type u8 -o scan.ovox \
                    --voxel-um 3.5 --fibre-radius-um 10.5 --fibre 170 --quiet --threads 1",
        old: "--colour 0.5,0.5,0.5",
        new: "--colour 0.7,0.1,0.1",
        state: "journal",
        keep: "--journal journal",
        every: 2,
        ..CASE
    };
    suffer("scan", &folder, &case);
}
