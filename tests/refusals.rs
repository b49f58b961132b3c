//! What commands refuse before they begin, and leave as it was.

use crate::cli::write_grid_scene;
use crate::program::{complaint, folder, organza, succeed};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

const SAILCLOTH: &str = r#"name = "sailcloth"
[draft]
weave = "plain"
[warp]
yarn = "cotton"
per_cm = 24.0
[weft]
yarn = "cotton"
per_cm = 22.0
[yarn.cotton]
preset = "cotton"
tex = 30.0
[voxel]
size_um = 80.0
"#;

fn sailcloth(folder: &Path) {
    fs::write(folder.join("sailcloth.toml"), SAILCLOTH).unwrap();
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn no_input_is_written_over() {
    let folder = folder("refusals-inputs");
    sailcloth(&folder);
    let told = complaint(&folder, &["fit", "sailcloth.toml", "-o", "sailcloth.toml"]);
    assert!(told.contains("is also an input"), "{told}");
    let text = fs::read_to_string(folder.join("sailcloth.toml")).unwrap();
    assert_eq!(text, SAILCLOTH);
    let told = complaint(&folder, &["fit", "sailcloth.toml", "-o", "fitted.png"]);
    assert!(told.contains("ends in .toml"), "{told}");
    let fit = [
        "fit",
        "sailcloth.toml",
        "-o",
        "fitted.toml",
        "--journal",
        "none/journal",
    ];
    let told = complaint(&folder, &fit);
    assert!(told.contains("the folder none does not exist"), "{told}");

    write_grid_scene(&folder);
    for (name, samples) in [("a.exr", "0..1"), ("b.exr", "3..4")] {
        succeed(
            &folder,
            &["render", "scene.toml", "-o", name, "--samples", samples],
        );
    }
    let before = fs::read(folder.join("a.exr")).unwrap();
    let told = complaint(&folder, &["merge", "a.exr", "b.exr", "-o", "./a.exr"]);
    assert!(told.contains("is also an input"), "{told}");
    assert_eq!(fs::read(folder.join("a.exr")).unwrap(), before);
    let told = succeed(&folder, &["merge", "a.exr", "b.exr", "-o", "all.exr"]);
    assert!(told.contains("samples 1..3 are missing"), "{told}");
    let told = succeed(&folder, &["info", "all.exr"]);
    assert!(told.contains("samples: 0..1,3..4"), "{told}");
}

/// Channels of a cloth in the dark, or lights alone, can be meant.
#[test]
fn scenes_without_light_or_matter_are_rendered_and_told() {
    let folder = folder("refusals-empty");
    write_grid_scene(&folder);
    for (key, words) in [("light=[]", "no [[light]]"), ("object=[]", "no [[object]]")] {
        let render = ["render", "scene.toml", "-o", "x.exr", "--set", key];
        let told = succeed(&folder, &render);
        assert!(told.contains(words), "{told}");
        let told = succeed(&folder, &[&render[..], &["--quiet"]].concat());
        assert!(told.is_empty(), "{told}");
    }
}

#[test]
fn reports_of_two_kinds_do_not_share_a_folder() {
    let folder = folder("refusals-reports");
    sailcloth(&folder);
    let few = ["--spp", "2", "--texels", "8", "--texel-spp", "2"];
    // Without a [surface] section: its fibres and its volume.
    let compare = [&["compare", "sailcloth.toml", "-o", "report"][..], &few].concat();
    let told = succeed(&folder, &compare);
    assert!(told.contains("volume against fibres"), "{told}");
    let before = fs::read(folder.join("report/report.html")).unwrap();
    let told = complaint(&folder, &["bench", "sailcloth.toml", "-o", "report"]);
    assert!(told.contains("holds a comparison (pairs.csv)"), "{told}");
    assert_eq!(fs::read(folder.join("report/report.html")).unwrap(), before);
    assert_eq!(
        names(&folder.join("report")),
        ["pairs.csv", "report.html", "report.json"]
    );

    fs::create_dir(folder.join("bench")).unwrap();
    fs::write(folder.join("bench/choices.csv"), "").unwrap();
    let told = complaint(&folder, &["compare", "sailcloth.toml", "-o", "bench"]);
    assert!(told.contains("holds the report of a bench"), "{told}");
}

#[test]
fn nothing_is_left_where_inputs_are_wrong() {
    let folder = folder("refusals-traces");
    sailcloth(&folder);
    fs::write(folder.join("file"), "").unwrap();
    let before = names(&folder);
    for arguments in [
        &["bench", "denm", "-o", "report"][..],
        &["bench", "denim", "none.toml", "-o", "report"],
        &[
            "compare",
            "sailcloth.toml",
            "-o",
            "report",
            "--data",
            "none.csv",
        ],
        &[
            "compare",
            "sailcloth.toml",
            "-o",
            "report",
            "--models",
            "surface",
        ],
        &["compare", "sailcloth.toml", "-o", "file"],
        &["bench", "denim", "-o", "file"],
        &["info", "first.wif", "--set", "a.b=3"],
        &["info", "sailcloth.vol"],
    ] {
        complaint(&folder, arguments);
        assert_eq!(names(&folder), before, "{arguments:?}");
    }
}

#[test]
fn layouts_that_fit_into_no_memory_are_refused_with_the_figure() {
    let folder = folder("refusals-memory");
    sailcloth(&folder);
    for (layout, words) in [
        (
            &["--layout", "grid", "--grid", "1000,1000"][..],
            "2000000000000 values need",
        ),
        (&["--layout", "sweep", "--step", "1e-9"], "--step:"),
    ] {
        let measure = ["measure", "sailcloth.toml", "-o", "table.csv", "--spp", "2"];
        let told = complaint(
            &folder,
            &[&measure[..], layout, &["--max-memory", "1GiB"]].concat(),
        );
        assert!(
            told.contains(words) && told.contains("1073741824"),
            "{told}"
        );
    }
    assert_eq!(names(&folder), ["sailcloth.toml"]);
}

/// What a fit finds takes the place of keys that say it otherwise.
#[test]
fn fits_begin_at_optics_in_other_words() {
    let folder = folder("refusals-fit");
    let values = "theta_i,phi_i,theta_o,phi_o,r,g,b\n30,0,20,0,0.2,0.15,0.1\n";
    fs::write(folder.join("values.csv"), values).unwrap();
    for (model, optics, gives_way) in [
        ("volume", "gamma = 0.3\n", "optics.cotton.gamma"),
        ("packed", "fitted = \"silk\"\n", "optics.cotton.fitted"),
        (
            "packed",
            "absorption_per_mm = [1.0, 2.0, 3.0]\n",
            "optics.cotton.absorption_per_mm",
        ),
    ] {
        let text = format!("{SAILCLOTH}[optics.cotton]\n{optics}");
        fs::write(folder.join("sailcloth.toml"), text).unwrap();
        let mut fit = vec!["fit", "sailcloth.toml", "--what", "fibres", "--model"];
        fit.extend([model, "--data", "values.csv", "-o", "fitted.toml"]);
        fit.extend(["--spp", "4", "--patience", "0,1"]);
        let told = succeed(&folder, &fit);
        assert!(told.contains(gives_way), "{told}");
        succeed(&folder, &["info", "fitted.toml"]);
        let text = fs::read_to_string(folder.join("fitted.toml")).unwrap();
        let key = gives_way.rsplit('.').next().unwrap();
        assert!(!text.contains(&format!("\n{key} =")), "{text}");
    }
}

/// A reader that goes away early ends the program quietly.
#[test]
fn listings_may_be_cut_short() {
    let folder = folder("refusals-pipes");
    sailcloth(&folder);
    for arguments in [
        &["info", "sailcloth.toml"][..],
        &["info", "sailcloth.toml", "--json"],
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_organza"))
            .current_dir(&folder)
            .args(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let out = child.wait_with_output().unwrap();
        let told = String::from_utf8_lossy(&out.stderr);
        assert!(
            out.status.success() && told.is_empty(),
            "{arguments:?}: {told}"
        );
    }
    if Path::new("/dev/full").exists() {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let out = Command::new(env!("CARGO_BIN_EXE_organza"))
            .current_dir(&folder)
            .args(["info", "sailcloth.toml"])
            .stdout(full)
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{told}");
        assert!(
            told.contains("cannot write to the standard output"),
            "{told}"
        );
    }
    assert!(organza(&folder, &["--version"]).status.success());
}
