//! Requests of another program: as a value, as a table, as a command; files in memory in, arrays out,
//! the same numbers.

use crate::program::{complaint, ended, exr_channels, folder, succeed};
use organza::{
    Bake, Context, Error, ErrorKind, Fit, Listener, Measure, Numbers, Output, Render, Request,
    Results, StopFlag, Voxelize, run_table,
};
use organza_scene::GivenFiles;
use organza_testing::{assert_contains, table_rows};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use toml::toml;

/// Counts calls of `progress`, and asks for a stop after some.
#[derive(Default)]
struct Watcher {
    calls: AtomicU64,
    most_calls: Option<u64>,
    stop: StopFlag,
}

impl Listener for Watcher {
    fn progress(&self, _: &str, done: u64, total: u64) {
        assert!(done <= total);
        let calls = self.calls.fetch_add(1, Ordering::Relaxed) + 1;
        if self.most_calls.is_some_and(|most| calls >= most) {
            self.stop.ask();
        }
    }
}

fn given(files: &[(&str, &str)]) -> Context {
    Context {
        given: Arc::new(files.iter().copied().collect::<GivenFiles>()),
        ..Context::default()
    }
}

/// What a request that a table states finds.
fn results(context: &Context, name: &str, table: toml::Table) -> Results {
    let watcher = Arc::new(Watcher::default());
    let context = Context {
        listener: watcher.clone(),
        ..context.clone()
    };
    let found = run_table(name, table, &context).unwrap();
    assert!(watcher.calls.load(Ordering::Relaxed) > 0, "no progress");
    found
}

const FABRIC: &str = "[draft]\nweave = 'plain'\n[voxel]\nsize_um = 40.0\n[tile]\nrepeats = [1, 1]\n\
                      [warp]\nyarn = 'silk'\nper_cm = 40\n[weft]\nyarn = 'silk'\nper_cm = 40\n\
                      [yarn.silk]\npreset = 'silk'\ntex = 4.6\n";

const SCENE: &str = "[render]\nspp = 4\n[camera]\norigin_mm = [0.2, 0.2, 3.0]\n\
                     target_mm = [0.2, 0.2, 0.0]\nwidth_mm = 1.0\nresolution = [12, 8]\n\
                     [[light]]\nkind = 'environment'\nradiance = [1.0, 0.9, 0.8]\n\
                     [[object]]\nkind = 'cloth'\nfabric = 'plain.toml'\n";

/// A folder with both files, and both as they are given in memory of another folder.
fn inputs(name: &str) -> (std::path::PathBuf, Context) {
    let folder = folder(name);
    std::fs::write(folder.join("scene.toml"), SCENE).unwrap();
    std::fs::write(folder.join("plain.toml"), FABRIC).unwrap();
    (folder, given(&[("<scene>", SCENE), ("plain.toml", FABRIC)]))
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
    let (folder, context) = inputs("requests_render");
    let flags = "--spp=5 --seed=3 --engine=cpu --set=render.direct=true";
    succeed(&folder, &format!("render scene.toml -o out.exr {flags}"));
    let file = exr_channels(&folder.join("out.exr"));
    let table = |seed: i64| {
        toml! {
            scene = "<scene>"
            spp = 5
            seed = seed
            engine = "cpu"
            set = { "render.direct" = true }
        }
    };
    let found = results(&context, "render", table(3));
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
    // The same request as a value, and the file that it writes.
    let render = Render {
        scene: "<scene>".into(),
        spp: Some(5),
        seed: Some(3),
        set: vec!["render.direct=true".into()],
        ..Render::from_table(toml! { engine = "cpu" }).unwrap()
    };
    let picture = render.run(&context).unwrap();
    let same = picture.results().unwrap();
    assert_eq!(floats(&same, "rgb"), floats(&found, "rgb"));
    picture.write(&folder.join("again.exr")).unwrap();
    assert_eq!(exr_channels(&folder.join("again.exr"))["R"], file["R"]);
    // The twin: another seed gives another picture.
    let (_, numbers) = floats(&results(&context, "render", table(4)), "rgb");
    assert_ne!(column(&numbers, 0, 3), bits("R"));
}

#[test]
fn measured_arrays_are_the_table_of_the_command() {
    let (folder, context) = inputs("requests_measure");
    let flags = "--layout=grid --grid=2,3 --spp=64 --seed=5";
    succeed(&folder, &format!("measure plain.toml -o out.csv {flags}"));
    let table = toml! {
        file = "plain.toml"
        layout = "grid"
        grid = [2, 3]
        spp = 64
        seed = 5
    };
    let found = results(&context, "measure", table);
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
fn files_in_memory_are_the_files_of_the_commands() {
    let (folder, context) = inputs("requests_files");
    let measure = "--layout=klems --klems-basis=quarter --spp=16";
    succeed(&folder, "voxelize plain.toml -o volume.ovox");
    succeed(&folder, &format!("measure plain.toml -o out.xml {measure}"));
    let found = results(&context, "voxelize", toml! { fabric = "plain.toml" });
    let [(name, bytes)] = &found.files[..] else {
        panic!("{} files", found.files.len())
    };
    assert_eq!(name, "volume.ovox");
    assert!(*bytes == std::fs::read(folder.join(name)).unwrap());
    // Written by the request itself, in the format of the ending.
    let path = folder.join("again.xml").display().to_string();
    let mut table = toml! {
        file = "plain.toml"
        layout = "klems"
        klems_basis = "quarter"
        spp = 16
    };
    table.insert("outfile".into(), path.into());
    results(&context, "measure", table);
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(read("again.xml") == read("out.xml"));
}

/// The error of a request that is stopped at its second report.
fn stopped<R: Request>(request: &R, context: &Context) -> Error {
    let stop = StopFlag::default();
    let watcher = Watcher {
        most_calls: Some(2),
        stop: stop.clone(),
        ..Watcher::default()
    };
    let context = Context {
        listener: Arc::new(watcher),
        stop,
        ..context.clone()
    };
    match request.run(&context) {
        Ok(_) => panic!("{} does not stop", R::NAME),
        Err(e) => e,
    }
}

#[test]
fn requests_stop_when_they_are_asked() {
    let (_, context) = inputs("requests_stop");
    let fabric = || Path::new("plain.toml").to_path_buf();
    let render = Render {
        scene: "<scene>".into(),
        spp: Some(4_000_000),
        ..Render::default()
    };
    let measure = Measure {
        file: fabric(),
        ..Measure::default()
    };
    let fit = Fit {
        fabric: Some(fabric()),
        ..Fit::default()
    };
    let voxelize = Voxelize {
        fabric: fabric(),
        ..Voxelize::default()
    };
    let bake = Bake {
        fabrics: vec![fabric()],
        resolution: 64,
        ..Bake::default()
    };
    for error in [
        stopped(&render, &context),
        stopped(&measure, &context),
        stopped(&fit, &context),
        stopped(&voxelize, &context),
        stopped(&bake, &context),
    ] {
        assert_eq!(error.kind, ErrorKind::Stopped, "{error}");
    }
}

/// The table that stands between the braces of an inline one.
fn inline(keys: &str) -> toml::Table {
    let mut document: toml::Table = format!("it = {{{keys}}}").parse().unwrap();
    let Some(toml::Value::Table(table)) = document.remove("it") else {
        panic!("{keys}")
    };
    table
}

/// A request, its keys, the key that its error names, and a part of the message.
const WRONG: &str = r#"
render | scene = "<scene>", spp = 0 | spp | expected a whole number from 1
render | scene = "<scene>", sp = 1 | sp | did you mean `spp`?
render | scene = "<scene>", engine = "cpi" | engine | did you mean "cpu"?
render | scene = "<scene>", crop = [0, 0, 99, 1] | crop | 12 pixels wide
measure | file = "plain.toml", spp = 1 | spp | expected a whole number from 2
measure | file = "plain.toml", model = "fibre" | model | did you mean "fibres"?
voxelize | fabric = "plain.toml", levels = 9 | levels | expected a whole number from 1 to 8
"#;

/// A request, its keys, and the key that its error names.
const CONTRADICTIONS: &str = r#"
render | scene = "<scene>", spp = 1, samples = [0, 2] | samples
render | scene = "<scene>", resume = true | resume
render | spp = 1 | scene
measure | file = "plain.toml", pairs = "a.csv", layout = "klems" | pairs
measure | file = "plain.toml", layout = "grid", bands = "nir,solar" | bands
voxelize | fabric = "plain.toml", voxel_um = -1.0 | voxel_um
scan | files = ["a.tif"], albedo = [1, 1, 1], colour = [1, 1, 1] | albedo
scan | files = ["a.tif"], flatten = 9 | flatten
scan | files = ["a.vti"], array = "grey", raw_size = [1, 1, 1], raw_type = "u8" | array
scan | files = ["a.tif", "b.tif"], array = "grey" | array
scan | files = ["a", "b"], raw_size = [1, 1, 1], raw_type = "u8" | raw_size
fit | fabric = "plain.toml", front = "a.png" | front
render | scene = "<scene>", denoise = true | denoise
measure | file = "plain.toml", layout = "klems", target_error = 0.1 | target_error
measure | file = "plain.toml", layout = "ptm", target_error = 0.1 | target_error
"#;

#[test]
fn errors_know_file_place_and_key() {
    let fail = |scene: &str, name: &str, table| {
        let context = given(&[("<scene>", scene), ("plain.toml", FABRIC)]);
        run_table(name, table, &context).unwrap_err()
    };
    let file = |error: &Error| error.file.as_ref().map(|f| f.display().to_string());
    let scene = || toml! { scene = "<scene>" };
    let wrong = fail(&SCENE.replace("spp", "sp"), "render", scene());
    assert_eq!(wrong.kind, ErrorKind::Input);
    assert_eq!(file(&wrong).as_deref(), Some("<scene>"));
    let key = wrong.key.as_deref();
    assert_eq!((wrong.line, key), (None, Some("render.sp")));
    assert!(wrong.message.ends_with("did you mean `spp`?"), "{wrong}");
    for [name, table, key, words] in table_rows(WRONG) {
        let error = fail(SCENE, name, inline(table));
        assert_eq!(error.kind, ErrorKind::Input, "{error}");
        assert_eq!(error.key.as_deref(), Some(key), "{error}");
        assert!(error.to_string().contains(words), "{error}");
        assert!(!error.to_string().contains('\n'), "{error}");
    }
    let (folder, _) = inputs("requests_failures");
    std::fs::write(folder.join("bad.toml"), "[draft]\nweave = 'plane'\n").unwrap();
    let path = folder.join("bad.toml").display().to_string();
    let mut table = toml! { fabric = "" };
    table.insert("fabric".into(), path.clone().into());
    let place = fail(SCENE, "voxelize", table);
    assert_eq!(file(&place), Some(path), "{place:?}");
    let no_file = fail(SCENE, "voxelize", toml! { fabric = "none.toml" });
    assert_eq!(file(&no_file).as_deref(), Some("none.toml"));
    assert!(no_file.is_missing);
    let none = fail(SCENE, "rendr", scene());
    assert!(none.to_string().contains("no such request"), "{none}");
}

#[test]
fn contradictions_are_refused_and_both_are_named() {
    let (_, context) = inputs("requests_contradictions");
    for [name, table, key] in table_rows(CONTRADICTIONS) {
        let error = run_table(name, inline(table), &context).unwrap_err();
        assert_eq!(error.kind, ErrorKind::Input, "{error}");
        assert_eq!(error.key.as_deref(), Some(key), "{error}");
    }
}

#[test]
fn a_file_of_requests_is_read_as_a_whole_and_done_in_order() {
    let (folder, _) = inputs("requests_run");
    let volume = "[voxelize]\nfabric = 'plain.toml'\noutfile = 'plain.ovox'\n";
    let info =
        "[[measure]]\nfile = 'scan.toml'\nlayout = 'in-plane'\nspp = 2\noutfile = 'scan.csv'\n";
    std::fs::write(
        folder.join("scan.toml"),
        "[[object]]\nkind = 'volume'\nfile = 'plain.ovox'\n",
    )
    .unwrap();
    let write = |text: &str| std::fs::write(folder.join("requests.toml"), text).unwrap();
    // Nothing is written where one of them is wrong.
    for (wrong, words) in [
        (
            "[render]\nscene = 'scene.toml'\n",
            "expected the key outfile",
        ),
        (
            "[render]\nsceen = 'a'\noutfile = 'a.exr'\n",
            "did you mean `scene`?",
        ),
        ("[rendr]\noutfile = 'a.exr'\n", "no such request"),
        (
            "[render]\nscene = 'scene.toml'\noutfile = 'no/a.exr'\n",
            "does not exist",
        ),
        (
            "[weave]\ndraft = 'plain'\noutfile = 'requests.toml'\n",
            "is also an input",
        ),
        (
            "[scan]\nfiles = ['a']\noutfile = 'plain.ovox'\n",
            "requests.toml:4:1: scan: plain.ovox is written twice",
        ),
        // Values are wrong here, too, and not when their turn comes.
        (
            "[render]\nscene = 'scene.toml'\nspp = 0\noutfile = 'a.exr'\n",
            "requests.toml:6:1: render.spp: expected a whole number from 1",
        ),
        (
            "[render]\nscene = 'scene.toml'\nresume = true\noutfile = 'a.exr'\n",
            "requests.toml:6:1: render.resume: expected a --checkpoint",
        ),
        (
            "[weave]\ndraft = 'plain'\noutfile = 'a.jpg'\n",
            "a.jpg: expected a name that ends in .png, .toml, .obj, .txt or .bcc",
        ),
        (
            "[weave]\ndraft = 'plain.toml'\noutfile = 'a.toml'\n",
            "plain.toml: is a fabric file already",
        ),
        (
            "[measure]\nfile = 'plain.toml'\nlayout = 'klems'\nrows = [0, 2]\noutfile = 'a.csv'\n",
            "requests.toml:7:1: measure.rows: 0..2: this layout is measured all at once",
        ),
        (
            "[measure]\nfile = 'plain.toml'\ntarget_error = 0.1\noutfile = 'a.exr'\n",
            "requests.toml:6:1: measure.target_error: does not apply to pictures of the tile",
        ),
        (
            "[[fit]]\nfabric = 'plain.toml'\ntarget = 'shade'\noutfile = 'a.toml'\n",
            "requests.toml:4:1: fit.data: expected measured values",
        ),
        (
            "[[fit]]\ntarget = 'cloth'\nfront = 'a.png'\nwidth_mm = 1\ndraft = 'plane'\n\
             outfile = 'a.toml'\n",
            "requests.toml:8:1: fit.draft: ",
        ),
    ] {
        write(&format!("{volume}{wrong}"));
        assert_contains(&complaint(&folder, "run requests.toml"), words);
        assert!(!folder.join("plain.ovox").exists(), "{wrong}");
    }
    // The measurement, whose name is earlier in the alphabet, reads the volume.
    write(&format!("{volume}{info}"));
    succeed(&folder, "run requests.toml");
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    succeed(&folder, "voxelize plain.toml -o same.ovox");
    assert!(read("plain.ovox") == read("same.ovox"));
    let rows = String::from_utf8(read("scan.csv")).unwrap().lines().count();
    assert_eq!(rows, 1 + 4 * 2 * 2 * 17);
}

#[test]
fn folders_may_be_there() {
    let (folder, context) = inputs("requests_folder");
    let mut table = toml! {
        fabric = "plain.toml"
        models = "microflake, plain"
        spp = 2
        texels = 8
        texel_spp = 2
    };
    let report = folder.join("a/report").display().to_string();
    table.insert("outdir".into(), report.clone().into());
    for _ in 0..2 {
        results(&context, "compare", table.clone());
    }
    assert!(Path::new(&report).join("report.html").exists());
}

#[cfg(unix)]
#[test]
fn arguments_need_not_be_text() {
    use std::os::unix::ffi::OsStrExt;
    let folder = folder("requests_bytes");
    let name = std::ffi::OsStr::from_bytes(b"b\xff.wif");
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_organza"));
    let command = command.current_dir(&folder).arg("render").arg(name);
    let done = command.args(["-o", "a.png"]).output().unwrap();
    let words = ended(&done, 2);
    assert_contains(&words, "b\u{fffd}.wif");
}
