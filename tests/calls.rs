//! Commands run by another program: files in memory in, arrays out, the same numbers.

use crate::program::{argv, exr_channels, folder, succeed};
use organza_cli::{Caller, Failure, FailureKind, Numbers, Results, call};
use organza_scene::GivenFiles;
use std::ffi::OsString;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// A program that remembers everything, and stops after some calls of `progress`.
#[derive(Default)]
struct Program {
    given: Arc<GivenFiles>,
    taken: Mutex<Vec<Results>>,
    warnings: Mutex<Vec<String>>,
    calls: AtomicU64,
    most_calls: Option<u64>,
}

impl Caller for Program {
    fn given(&self) -> Arc<GivenFiles> {
        Arc::clone(&self.given)
    }
    fn warn(&self, warning: &str) {
        self.warnings.lock().unwrap().push(warning.to_owned());
    }
    fn progress(&self, _: &str, done: u64, total: u64) {
        assert!(done <= total);
        self.calls.fetch_add(1, Ordering::Relaxed);
    }
    fn is_stopped(&self) -> bool {
        let calls = self.calls.load(Ordering::Relaxed);
        self.most_calls.is_some_and(|most| calls >= most)
    }
    fn take(&self, results: Results) {
        self.taken.lock().unwrap().push(results);
    }
}

/// Runs a command for `program`.
fn run(program: Program, words: &[&str]) -> (Arc<Program>, Result<(), Failure>) {
    let program = Arc::new(program);
    let words: Vec<OsString> = words.iter().map(Into::into).collect();
    let result = call(&words, program.clone());
    (program, result)
}

/// The results of a command.
fn results(given: GivenFiles, words: &[&str]) -> Results {
    let program = Program {
        given: Arc::new(given),
        ..Program::default()
    };
    let (program, result) = run(program, words);
    result.unwrap();
    assert!(program.calls.load(Ordering::Relaxed) > 0, "no progress");
    let taken = program.taken.lock().unwrap();
    assert_eq!(taken.len(), 1);
    taken[0].clone()
}

const FABRIC: &str = "[draft]\nweave = 'plain'\n[voxel]\nsize_um = 40.0\n[tile]\nrepeats = [1, 1]\n\
                      [warp]\nyarn = 'silk'\nper_cm = 40\n[weft]\nyarn = 'silk'\nper_cm = 40\n\
                      [yarn.silk]\npreset = 'silk'\ntex = 4.6\n";

const SCENE: &str = "[render]\nspp = 4\n[camera]\norigin_mm = [0.2, 0.2, 3.0]\n\
                     target_mm = [0.2, 0.2, 0.0]\nwidth_mm = 1.0\nresolution = [12, 8]\n\
                     [[light]]\nkind = 'environment'\nradiance = [1.0, 0.9, 0.8]\n\
                     [[object]]\nkind = 'cloth'\nfabric = 'plain.toml'\n";

/// A folder with both files, and both as they are given in memory of another folder.
fn inputs(name: &str) -> (std::path::PathBuf, GivenFiles) {
    let folder = folder(name);
    std::fs::write(folder.join("scene.toml"), SCENE).unwrap();
    std::fs::write(folder.join("plain.toml"), FABRIC).unwrap();
    let given = [("<scene>", SCENE), ("plain.toml", FABRIC)];
    (folder, given.into_iter().collect())
}

fn floats(results: &Results, name: &str) -> (Vec<usize>, Vec<f32>) {
    let array = results.array(name).unwrap();
    match &array.numbers {
        Numbers::F32(numbers) => (array.shape.clone(), numbers.clone()),
        other => panic!("{name}: {other:?}"),
    }
}

/// Column `c` of `n` interleaved ones, as bits.
fn column(numbers: &[f32], c: usize, n: usize) -> Vec<u32> {
    let of = numbers.iter().skip(c).step_by(n);
    of.map(|x| x.to_bits()).collect()
}

#[test]
fn a_rendered_array_is_the_picture_of_the_command_bit_for_bit() {
    let (folder, given) = inputs("calls_render");
    let direct = "--set=render.direct=true";
    let flags = ["--spp=5", "--seed=3", "--engine=cpu", direct];
    succeed(
        &folder,
        &[&["render", "scene.toml", "-o", "out.exr"], &flags[..]].concat(),
    );
    let file = exr_channels(&folder.join("out.exr"));
    let found = results(
        given,
        &[&["render"], &flags[..], &["--", "<scene>"]].concat(),
    );
    let bits = |name: &str| file[name].iter().map(|x| x.to_bits()).collect::<Vec<u32>>();
    for (array, channels) in [
        ("rgb", &["R", "G", "B"][..]),
        ("variance", &["variance.R", "variance.G", "variance.B"]),
        ("tangent", &["tangent.X", "tangent.Y", "tangent.Z"]),
        ("yarn", &["yarn"]),
        ("depth_mm", &["depth_mm"]),
        ("bounces", &["bounces"]),
        ("through", &["through"]),
        ("direct", &["direct.R", "direct.G", "direct.B"]),
    ] {
        let (shape, numbers) = floats(&found, array);
        assert_eq!(shape[..2], [8, 12], "{array}");
        for (c, channel) in channels.iter().enumerate() {
            assert_eq!(
                column(&numbers, c, channels.len()),
                bits(channel),
                "{channel}"
            );
        }
    }
    // The twin: another seed gives another picture.
    let (_, given) = inputs("calls_render");
    let other = results(
        given,
        &argv("render --spp=5 --seed=4 --engine=cpu -- <scene>"),
    );
    let (_, numbers) = floats(&other, "rgb");
    assert_ne!(column(&numbers, 0, 3), bits("R"));
}

#[test]
fn measured_arrays_are_the_table_of_the_command() {
    let (folder, given) = inputs("calls_measure");
    let flags = ["--layout=grid", "--grid=2,3", "--spp=64", "--seed=5"];
    succeed(
        &folder,
        &[&["measure", "plain.toml", "-o", "out.csv"], &flags[..]].concat(),
    );
    let found = results(
        given,
        &[&["measure"], &flags[..], &["--", "plain.toml"]].concat(),
    );
    let text = std::fs::read_to_string(folder.join("out.csv")).unwrap();
    let rows = text.lines().skip(1);
    let rows: Vec<Vec<f64>> = rows
        .map(|row| row.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    let names = ["theta_i", "phi_i", "theta_o", "phi_o", "rgb", "se_rgb"];
    let columns = [0, 1, 2, 3, 4, 7];
    for (name, from) in names.into_iter().zip(columns) {
        let array = found.array(name).unwrap();
        let Numbers::F64(numbers) = &array.numbers else {
            panic!("{name}")
        };
        assert_eq!(array.shape[0], rows.len());
        let width = numbers.len() / rows.len();
        let bits = |list: &[f64]| list.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
        for (row, numbers) in rows.iter().zip(numbers.chunks(width)) {
            assert_eq!(bits(&row[from..from + width]), bits(numbers), "{name}");
        }
    }
}

#[test]
fn a_volume_in_memory_is_the_file_of_the_command() {
    let (folder, given) = inputs("calls_voxelize");
    succeed(&folder, &["voxelize", "plain.toml", "-o", "volume.ovox"]);
    let found = results(given, &["voxelize", "plain.toml"]);
    let [(name, bytes)] = &found.files[..] else {
        panic!("{} files", found.files.len())
    };
    assert_eq!(name, "volume.ovox");
    assert!(*bytes == std::fs::read(folder.join(name)).unwrap());
}

#[test]
fn a_call_stops_when_its_caller_asks_and_nothing_is_taken() {
    for words in [
        &["render", "--spp=4000000", "<scene>"][..],
        &["measure", "--layout=irawan", "plain.toml"],
        &["fit", "plain.toml"],
        &["voxelize", "plain.toml"],
    ] {
        let (_, given) = inputs("calls_stop");
        let program = Program {
            given: Arc::new(given),
            most_calls: Some(2),
            ..Program::default()
        };
        let (program, result) = run(program, words);
        assert_eq!(result.unwrap_err().kind, FailureKind::Stopped, "{words:?}");
        assert!(program.taken.lock().unwrap().is_empty());
    }
}

#[test]
fn failures_know_file_place_and_key() {
    let fail = |scene: &str, words: &[&str]| {
        let given = [("<scene>", scene), ("plain.toml", FABRIC)];
        let program = Program {
            given: Arc::new(given.into_iter().collect()),
            ..Program::default()
        };
        run(program, words).1.unwrap_err()
    };
    let wrong = fail(&SCENE.replace("spp", "sp"), &["render", "<scene>"]);
    assert_eq!(wrong.kind, FailureKind::Input);
    assert_eq!(wrong.file.as_deref(), Some("<scene>"));
    assert_eq!(
        (wrong.line, wrong.key.as_deref()),
        (None, Some("render.sp"))
    );
    assert!(wrong.message.ends_with("did you mean `spp`?"), "{wrong}");
    let flag = fail(SCENE, &["render", "--spp=0", "<scene>"]);
    assert_eq!(flag.kind, FailureKind::Input);
    assert!(
        flag.text.contains("--spp") && !flag.text.contains('\n'),
        "{flag}"
    );
    assert_eq!(flag.option.as_deref(), Some("spp"));
    let (folder, _) = inputs("calls_failures");
    std::fs::write(folder.join("bad.toml"), "[draft]\nweave = 'plane'\n").unwrap();
    let path = folder.join("bad.toml").display().to_string();
    let place = fail(SCENE, &["voxelize", &path]);
    assert_eq!(place.file.as_deref(), Some(&*path), "{place:?}");
    let no_file = fail(SCENE, &["voxelize", "none.toml"]);
    assert_eq!(no_file.file.as_deref(), Some("none.toml"));
    assert!(no_file.is_missing);
    assert!(!Path::new("picture.exr").exists());
}
