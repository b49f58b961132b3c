//! Commands that are killed at random moments: their outputs are whole or absent, and what
//! they kept on the way is resumed.
//!
//! `ORGANZA_FULL=1 cargo test --release --test main kills:: -- --nocapture` kills each
//! command 100 times and prints the outcomes; without `ORGANZA_FULL` each is killed once.
#![allow(clippy::print_stdout)] // prints the outcomes

use crate::cli::write_grid_scene;
use crate::fabrics::COTTON_SATIN;
use crate::program::{argv, contents, files_left, folder, succeed};
use organza_basis::PathRng;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const SEED: u64 = 0xfa17;

/// Kills of each command.
fn kills() -> u32 {
    organza_testing::sized(1, 100)
}

/// Equal but for the line with which a fitted fabric records its command.
fn same(a: &[u8], b: &[u8]) -> bool {
    let lines = |bytes: &[u8]| -> Vec<Vec<u8>> {
        bytes
            .split(|&b| b == b'\n')
            .filter(|line| !line.starts_with(b"# Fitted by: "))
            .map(<[u8]>::to_vec)
            .collect()
    };
    lines(a) == lines(b)
}

/// What a command was killed into.
#[derive(Debug, Default)]
struct Tally {
    killed: u32,
    /// Runs that came to their end before the kill.
    ended: u32,
    /// Kills after which something was there to go on from.
    resumed: u32,
    /// Kills that left a temporary file: in the middle of writing.
    writing: u32,
}

/// A command that is killed again and again.
struct Victim<'a> {
    name: &'a str,
    line: &'a str,
    /// What it writes in the end.
    outputs: &'a [&'a str],
    /// What it keeps on the way, and the flags for that.
    state: Option<&'a str>,
    keep: &'a str,
    /// The flag to go on with, where there is one.
    resume: &'a str,
}

/// A command that keeps nothing on the way.
const VICTIM: Victim<'_> = Victim {
    name: "",
    line: "",
    outputs: &[],
    state: None,
    keep: "",
    resume: "",
};

impl Victim<'_> {
    /// The flag that sets the number of threads.
    fn threads(&self, threads: &str) -> String {
        match self.name {
            "merge" => String::new(), // works on one
            _ => format!("--threads {threads}"),
        }
    }

    /// Kills it at moments spread evenly over an undisturbed run, half of them
    /// over its last tenth, where files are written; goes on where it can.
    fn torment(&self, folder: &Path) {
        let inputs = files_left(folder);
        let started = Instant::now();
        succeed(folder, &format!("{} {}", self.line, self.threads("1")));
        let whole_s = started.elapsed().as_secs_f64();
        // Of an output that is a folder, the files in it.
        let written = || -> BTreeMap<String, Vec<u8>> {
            let mut files = contents(folder);
            files.retain(|file, _| {
                let top = file.split('/').next().unwrap_or_default();
                self.outputs.contains(&top)
            });
            files
        };
        let whole = written();
        let clear = || {
            for entry in std::fs::read_dir(folder).unwrap() {
                let name = entry.unwrap().file_name().into_string().unwrap();
                let path = folder.join(&name);
                if inputs.contains(&name) {
                    continue;
                }
                match path.is_dir() {
                    true => std::fs::remove_dir_all(path).unwrap(),
                    false => std::fs::remove_file(path).unwrap(),
                }
            }
        };
        let check = |at: &str| {
            let found = written();
            for (name, bytes) in &found {
                let expected = whole.get(name);
                let is_same = expected.is_some_and(|expected| same(bytes, expected));
                assert!(is_same, "{}: {name} differs {at}", self.name);
            }
            // A folder has its name when it is whole.
            for name in whole.keys().filter(|name| name.contains('/')) {
                let is_missing = !found.is_empty() && !found.contains_key(name);
                assert!(!is_missing, "{}: {name} is missing {at}", self.name);
            }
            for name in files_left(folder) {
                let known = inputs.contains(&name)
                    || self.outputs.contains(&name.as_str())
                    || self.state == Some(name.as_str());
                assert!(known, "{}: {name} was left {at}", self.name);
            }
        };
        let has_state = || self.state.is_some_and(|s| folder.join(s).exists());
        let kept = || {
            let resume = if has_state() { self.resume } else { "" };
            format!("{} {} {resume}", self.line, self.keep)
        };
        clear();
        let mut rng = PathRng::from_seed(SEED);
        let mut tally = Tally::default();
        while tally.killed < kills() {
            let place = f64::from(rng.unit());
            let place = if rng.below(2) == 0 {
                place
            } else {
                0.9 + 0.2 * place
            };
            tally.resumed += u32::from(has_state());
            let threads = if tally.killed % 2 == 0 { "2" } else { "1" };
            let line = format!("{} {} --quiet", kept(), self.threads(threads));
            let mut child = Command::new(env!("CARGO_BIN_EXE_organza"))
                .current_dir(folder)
                .args(argv(&line))
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            std::thread::sleep(Duration::from_secs_f64(place * whole_s));
            child.kill().unwrap(); // SIGKILL
            let ended = child.wait().unwrap().success();
            let at = format!(
                "after kill {} at {place:.3} of {whole_s:.2} s",
                tally.killed
            );
            check(&at);
            if ended {
                for name in self.outputs {
                    assert!(folder.join(name).exists(), "{}: no {name}", self.name);
                }
                tally.ended += 1;
                clear();
            } else {
                let names = std::fs::read_dir(folder).unwrap();
                let cut = names.filter(|e| {
                    let name = e.as_ref().unwrap().file_name();
                    name.to_string_lossy().ends_with(".tmp")
                });
                tally.writing += u32::from(cut.count() > 0);
                tally.killed += 1;
                // Where nothing is kept every run begins anew; where something
                // is, one in eight runs does.
                if self.state.is_none() || rng.below(8) == 0 {
                    clear();
                }
            }
        }
        // What is there now is brought to its end.
        succeed(folder, &kept());
        check("in the end");
        let present = self.outputs.iter().all(|n| folder.join(n).exists());
        assert!(present, "{}", self.name);
        println!(
            "{:<16} run of {whole_s:.2} s: {} kills, {} of runs resumed, {} in the middle of \
             writing, {} runs ended before",
            self.name, tally.killed, tally.resumed, tally.writing, tally.ended
        );
    }
}

#[test]
fn a_render_killed_at_any_moment_goes_on_to_the_same_bytes() {
    let folder = folder("kill-render");
    write_grid_scene(&folder);
    Victim {
        name: "render",
        line: "render scene.toml -o out.exr --spp 400 --set camera.resolution=[96,64]",
        outputs: &["out.exr"],
        state: Some("state"),
        keep: "--checkpoint state --checkpoint-every 0s",
        resume: "--resume",
    }
    .torment(&folder);
}

#[test]
fn a_volume_or_a_table_has_its_name_only_when_whole() {
    let folder = folder("kill-volume");
    std::fs::write(folder.join("cloth.toml"), COTTON_SATIN).unwrap();
    let voxelize = |name, outfile, outputs| {
        Victim {
            name,
            line: &format!("voxelize cloth.toml -o {outfile}"),
            outputs,
            ..VICTIM
        }
        .torment(&folder);
        for name in outputs {
            std::fs::remove_file(folder.join(name)).unwrap();
        }
    };
    voxelize("voxelize .ovox", "cloth.ovox", &["cloth.ovox"]);
    voxelize("voxelize .vdb", "cloth.vdb", &["cloth.vdb"]);
    let three: &[&str] = &["cloth.sigma_t.vol", "cloth.sggx.vol", "cloth.albedo.vol"];
    voxelize("voxelize .vol", "cloth.vol", three);
    Victim {
        name: "measure",
        line: "measure cloth.toml --layout grid --grid 2,4 --spp 16 --voxel-um 40 -o out.csv",
        outputs: &["out.csv"],
        ..VICTIM
    }
    .torment(&folder);
}

#[test]
fn a_fit_killed_at_any_moment_goes_on_to_the_same_bytes() {
    let folder = folder("kill-fit");
    std::fs::write(folder.join("cloth.toml"), COTTON_SATIN).unwrap();
    Victim {
        name: "fit",
        line: "fit surface cloth.toml --spp 6 --voxel-um 50 --patience 1,2 -o fitted.toml",
        outputs: &["fitted.toml"],
        state: Some("journal"),
        keep: "--journal journal",
        ..VICTIM
    }
    .torment(&folder);
}

#[test]
fn a_merged_picture_has_its_name_only_when_whole() {
    let folder = folder("kill-merge");
    write_grid_scene(&folder);
    for (name, range) in [("a.exr", "0..8"), ("b.exr", "8..16")] {
        let part = format!("render scene.toml --samples {range} -o {name}");
        succeed(
            &folder,
            &format!("{part} --set camera.resolution=[192,128]"),
        );
    }
    Victim {
        name: "merge",
        line: "merge a.exr b.exr -o all.exr",
        outputs: &["all.exr"],
        ..VICTIM
    }
    .torment(&folder);
}

/// A CT volume of four parallel and crossed fibres, 24 voxels a side, with an even grain.
pub fn write_ct(path: &Path) {
    // To the nearer of two parallel fibres.
    let distance = |a: f32, b: f32| (a - 6.0).hypot(b).min((a - 17.0).hypot(b));
    let mut grey = Vec::new();
    for i in 0..24 * 24 * 24u16 {
        let [x, y, z] = [i % 24, i / 24 % 24, i / 576];
        let [fx, fy, fz] = [x, y, z].map(f32::from);
        let nearest = distance(fy, fz - 7.0).min(distance(fx, fz - 16.0));
        let level = if nearest < 3.0 { 170 } else { 30 };
        grey.push((level + (x * 7 + y * 13 + z * 29) % 11) as u8);
    }
    std::fs::write(path, grey).unwrap();
}

#[test]
fn a_scan_killed_at_any_moment_goes_on_to_the_same_bytes() {
    let folder = folder("kill-scan");
    write_ct(&folder.join("ct.raw"));
    Victim {
        name: "scan",
        line: "scan ct.raw --raw-size 24,24,24 --raw-type u8 --voxel-um 3.5 --fibre-radius-um \
             10.5 --fibre 170 -o scan.ovox",
        outputs: &["scan.ovox"],
        state: Some("journal"),
        keep: "--journal journal",
        ..VICTIM
    }
    .torment(&folder);
}

#[test]
fn a_baked_folder_has_its_name_only_when_whole() {
    let folder = folder("kill-bake");
    std::fs::write(folder.join("cloth.toml"), COTTON_SATIN).unwrap();
    Victim {
        name: "bake",
        line: "bake cloth.toml -o material --resolution 16 --texel-spp 4 --pairs 64 --spp 2 \
             --fit-texels 16 --voxel-um 60",
        outputs: &["material"],
        ..VICTIM
    }
    .torment(&folder);
}
