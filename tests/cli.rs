//! Commands, exit codes and messages.

use crate::program::{argv, complaint, ended, exr_channels, folder, organza, succeed, write_vol};
use organza_scene::fabric_file;
use organza_scene::loader::Loader;
use organza_testing::{assert_contains, is_full};
use std::path::Path;

const GRID_SCENE: &str = r#"[render]
spp = 4
[camera]
origin_mm = [0.0, 0.0, 3.0]
target_mm = [0.0, 0.0, 0.0]
width_mm = 1.0
resolution = [16, 8]
[[light]]
kind = "environment"
radiance = [1.0, 1.0, 1.0]
[[object]]
kind = "grid"
extinction = "sigma_t.vol"
sggx = "sggx.vol"
albedo = [0.9, 0.9, 0.9]
"#;

/// A small scene of one grid, `scene.toml`.
pub fn write_grid_scene(folder: &Path) {
    let bounds = [-0.2, -0.2, -0.2, 0.2, 0.2, 0.2];
    write_vol(&folder.join("sigma_t.vol"), [1, 1, 1], 1, bounds, &[5.0]);
    let s = [1.0, 1.0, 0.04, 0.0, 0.0, 0.0];
    write_vol(&folder.join("sggx.vol"), [1, 1, 1], 6, bounds, &s);
    std::fs::write(folder.join("scene.toml"), GRID_SCENE).unwrap();
}

#[test]
fn help_and_version_succeed_and_show_examples() {
    let folder = folder("help");
    assert!(succeed(&folder, "--help").contains("organza render"));
    let commands = argv("render merge voxelize measure weave info completions man");
    for command in commands {
        let help = succeed(&folder, &[command, "--help"]);
        assert!(help.contains("Example"), "{command}: {help}");
    }
    assert!(succeed(&folder, "--version").starts_with("organza "));
    let version = concat!("organza ", env!("CARGO_PKG_VERSION"), "\n");
    for asked in ["--version --verbose", "--verbose --version"] {
        let told = succeed(&folder, &asked);
        assert!(told.starts_with(version), "{told}");
        for line in [
            "commit: ",
            "features: ",
            "engines on this computer: walk, scalar",
        ] {
            assert_contains(&told, &format!("\n{line}"));
        }
    }
    let said = ended(&organza(&folder, "--verbose completions bash"), 2);
    assert_contains(&said, "--verbose goes with --version");
}

#[test]
fn scenes_are_described_object_by_object() {
    let folder = folder("info-scene");
    write_grid_scene(&folder);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let fabric = root.join("scenes/fabrics/organza.toml");
    let cloth = format!(
        "object = [{{ kind = \"cloth\", fabric = {fabric:?}, model = \"fibres\" }}, \
         {{ kind = \"plane\", position_mm = [0.0, 0.0, -1.0] }}]"
    );
    let info = |set: &[&str]| {
        let printed = succeed(&folder, &[&["info", "scene.toml", "--json"], set].concat());
        serde_json::from_str::<serde_json::Value>(&printed).unwrap()
    };
    let printed = info(&[]);
    assert_eq!(printed["camera"], "orthographic");
    assert_eq!(printed["objects"][0]["kind"], "grid");
    let kinds = ["--set", &cloth.replacen(" = ", "=", 1)];
    let printed = info(&kinds);
    assert_eq!(printed["objects"][0]["model"], "fibres");
    assert_eq!(printed["objects"][1]["kind"], "plane");
    let said = succeed(&folder, "info scene.toml --set light=[]");
    assert_contains(&said, "lights: none");
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let folder = folder("manual");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = succeed(&folder, &format!("completions {shell}"));
        assert!(script.contains("voxelize"), "{shell}");
    }
    succeed(&folder, "man -o .");
    let page = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    assert!(page("organza.1").contains("voxelize"));
    assert!(page("organza-render.1").contains("checkpoint"));
    succeed(&folder, "man -o share/man1");
    assert!(folder.join("share/man1/organza-weave.1").exists());
    let message = complaint(&folder, "man -o organza.1");
    assert_contains(&message, "organza.1: is a file; expected a folder");
}

#[test]
fn mistakes_in_scenes_are_reported_with_place_and_nearest_name() {
    let folder = folder("wrong-scenes");
    write_grid_scene(&folder);
    let say = |from: &str, to: &str| {
        let text = GRID_SCENE.replace(from, to);
        assert_ne!(text, GRID_SCENE);
        std::fs::write(folder.join("wrong.toml"), text).unwrap();
        complaint(&folder, "render wrong.toml -o out.exr")
    };
    let words = say("spp = 4", "ssp = 4");
    assert_contains(&words, "wrong.toml:2:1: render.ssp: unknown field `ssp`");
    assert!(words.ends_with("did you mean `spp`?"), "{words}");
    let words = say("\"environment\"", "\"enviroment\"");
    assert_contains(&words, "did you mean `environment`?");
    let words = say("sggx = \"sggx.vol\"", "sggx = \"sigma_t.vol\"");
    assert_contains(&words, "sigma_t.vol: has 1 channels; `sggx` expects 6");
    let words = say("sggx.vol", "missing.vol");
    assert_contains(&words, "missing.vol: no such file");
    let words = say("spp = 4", "spp = 0");
    assert_contains(&words, "render.spp: expected at least 1");
    let words = say("[0.0, 0.0, 3.0]", "[0.0, 0.0, 0.0]");
    assert_contains(&words, "are the same point");
    let words = say("albedo = [0.9, 0.9, 0.9]", "albedo = [1.9, 0.9, 0.9]");
    assert!(
        words.contains("albedo") && words.contains("from 0 to 1"),
        "{words}"
    );
    assert!(!folder.join("out.exr").exists(), "nothing is written");
}

#[test]
fn damaged_volumes_are_refused() {
    let folder = folder("wrong-volumes");
    write_grid_scene(&folder);
    let whole = std::fs::read(folder.join("sggx.vol")).unwrap();
    let mut huge = whole.clone();
    huge[8..12].copy_from_slice(&i32::MAX.to_le_bytes());
    let mut not_a_number = whole.clone();
    not_a_number[48..52].copy_from_slice(&f32::NAN.to_le_bytes());
    for bytes in [
        &whole[..whole.len() - 3],
        &whole[..10],
        b"VOL\x02",
        &huge,
        &not_a_number,
    ] {
        std::fs::write(folder.join("sggx.vol"), bytes).unwrap();
        assert_contains(&complaint(&folder, "render scene.toml -o out.exr"), ".vol");
    }
    assert!(!folder.join("out.exr").exists());
}

#[test]
fn pictures_depend_on_the_seed_and_not_on_the_threads() {
    let folder = folder("threads");
    write_grid_scene(&folder);
    let picture = |more: &str| crate::program::picture(&folder, more);
    let one = picture("--threads 1");
    assert!(one == picture("--threads 2"), "same seed, same bytes");
    assert!(one != picture("--seed 1"), "another seed, another picture");
    let cropped = picture("--crop 4,2,12,8");
    assert!(cropped.len() < one.len());
    complaint(&folder, "render scene.toml -o out.exr --crop 4,2,4,8");
    complaint(&folder, "render scene.toml -o out.exr --crop 0,0,17,8");
    complaint(&folder, "render scene.toml -o out.webp");
    complaint(&folder, "render scene.toml -o nowhere/out.exr");
    complaint(&folder, "render scene.toml -o x.exr --set render.sppp=3");
}

/// What is in fabrics that take seconds, and how it is made small.
const SMALLER: [(&str, &str); 2] = [
    ("[nonwoven]", "nonwoven.tile_mm=[1, 1]"),
    ("name = \"plaid\"", "warp.colours=\"2 wine, 2 black\""),
];

/// Every file through `organza info`, which builds scenes and measures cloths. In short those of
/// folders below are only read, and their fabrics woven.
#[test]
fn the_scenes_and_fabrics_of_the_project_are_good() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let folder = folder("good");
    let mut looked_at = 0;
    let folders = ",fabrics,fabrics/irregular,fabrics/lace,fabrics/layers,fabrics/nonwoven,fabrics/pile,fabrics/print,gallery,gallery/fabrics,lace,realism,sheet";
    for within in folders.split(',') {
        for entry in std::fs::read_dir(scenes.join(within)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|e| e != "toml") {
                continue;
            }
            looked_at += 1;
            if is_full() || within.is_empty() {
                succeed(&folder, &["info", path.to_str().unwrap(), "--quiet"]);
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let small = SMALLER.iter().filter(|(part, _)| text.contains(part));
            let small: Vec<String> = small.map(|(_, set)| (*set).to_owned()).collect();
            let loader = Loader::new();
            let read = match text.contains("[camera]") {
                true => organza_scene::load(&path, &[], &loader).map(|_| ()),
                false => fabric_file::load(&path, &small, &loader).map(|_| ()),
            };
            assert!(read.is_ok(), "{}", read.unwrap_err());
        }
    }
    assert!(looked_at > 15, "{looked_at}");
}

#[test]
fn the_volumes_of_the_project_can_be_listed_and_made_again() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = folder("volumes");
    for (file, kind) in [
        ("denim.ovox", "octree"),
        ("charmeuse.ovox", "octree"),
        ("jersey.ovox", "octree"),
        ("jersey.vdb", "vdb"),
    ] {
        let path = root.join("volumes").join(file);
        let printed = succeed(&folder, &["info", path.to_str().unwrap(), "--json"]);
        assert_contains(&printed, &format!("\"kind\": \"{kind}\""));
    }
    let fabric = root.join("scenes/fabrics/jersey.toml");
    let fabric = fabric.to_str().unwrap();
    succeed(
        &folder,
        &["voxelize", fabric, "-o", "again.ovox", "--threads", "1"],
    );
    let again = std::fs::read(folder.join("again.ovox")).unwrap();
    let kept = std::fs::read(root.join("volumes/jersey.ovox")).unwrap();
    assert!(
        again == kept,
        "volumes/jersey.ovox is no longer what its command makes"
    );
    succeed(
        &folder,
        &["voxelize", fabric, "-o", "tile.vol", "--level", "1"],
    );
    let said = succeed(&folder, &["voxelize", fabric, "-o", "tile.ovox"]);
    assert_contains(&said, "MiB of memory");
    let printed = succeed(&folder, &["voxelize", fabric, "-o", "tile.ovox", "--quiet"]);
    assert!(printed.is_empty(), "{printed}");
    assert_contains(&succeed(&folder, "info tile.sggx.vol"), "channels: 6");
    let words = complaint(
        &folder,
        &["voxelize", fabric, "-o", "x.ovox", "--max-memory", "100k"],
    );
    assert_contains(&words, "bytes of memory");
    let words = complaint(
        &folder,
        &["voxelize", fabric, "-o", "x.vdb", "--level", "9"],
    );
    assert_contains(&words, "--level 9");
    assert!(!folder.join("x.ovox").exists());
}

#[test]
fn drafts_and_curves_go_through_the_command_line() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = folder("weave");
    assert_eq!(succeed(&folder, "weave plain"), ".X\nX.\n");
    let said = complaint(&folder, "weave twil-3-1-s");
    assert_contains(&said, "did you mean \"twill-3-1-s\"?");
    let draft = root.join("scenes/drafts/first_light.wif");
    let printed = succeed(&folder, &["weave", draft.to_str().unwrap(), "--json"]);
    assert_contains(&printed, "\"ends\": 16");
    // A knit is drawn from its curves; text written and read back is the same text.
    let fabric = root.join("scenes/fabrics/jersey.toml");
    let fabric = fabric.to_str().unwrap();
    succeed(&folder, &["weave", fabric, "-o", "knit.png"]);
    for ending in ["obj", "bcc", "txt"] {
        let name = format!("yarns.{ending}");
        succeed(&folder, &["weave", fabric, "--level", "yarn", "-o", &name]);
    }
    let import =
        "[draft]\ncurves = \"yarns.txt\"\ncurves_are = \"fibres\"\n[weft]\nyarn = \"cotton\"\n";
    std::fs::write(folder.join("import.toml"), import).unwrap();
    succeed(&folder, "weave import.toml --level fibre -o again.txt");
    let text = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    assert!(text("again.txt") == text("yarns.txt"));
    complaint(&folder, "weave plain -o plain.obj");
    // Threads that never cross, and colours that no fibre has.
    let loose =
        "[draft]\ndrawdown = [\"XX\", \"XX\"]\n[warp]\nper_cm = 20.0\n[weft]\nper_cm = 20.0\n";
    std::fs::write(folder.join("loose.toml"), loose).unwrap();
    let voxelize = "voxelize loose.toml -o loose.ovox --voxel-um 60";
    let warning = "organza: warning: loose.toml: draft: 2 of 2 ends never interlace";
    let printed = succeed(&folder, &voxelize);
    assert!(printed.starts_with(warning), "{printed}");
    let quiet = format!("{voxelize} --quiet");
    assert_eq!(succeed(&folder, &quiet), "");
    complaint(&folder, &["weave", fabric, "-o", "knit.jpeg"]);
}

/// Writes a scene of a little silk of explicit fibres, `scene.toml`, and its `cloth.toml`.
pub fn write_silk_scene(folder: &Path) {
    let fabric = r#"
[draft]
weave = "plain"
[warp]
yarn = "thread"
per_cm = 40.0
[weft]
yarn = "thread"
per_cm = 40.0
[yarn.thread]
preset = "silk"
tex = 4.0
[voxel]
size_um = 20.0
"#;
    std::fs::write(folder.join("cloth.toml"), fabric).unwrap();
    let scene = r#"
[render]
spp = 4
[camera]
origin_mm = [0.2, 0.2, 5.0]
target_mm = [0.2, 0.2, 0.0]
width_mm = 0.5
resolution = [12, 12]
[[light]]
kind = "directional"
direction = [0.2, 0.3, -0.9]
irradiance = [3.0, 3.0, 3.0]
[[object]]
kind = "cloth"
fabric = "cloth.toml"
"#;
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
}

/// Explicit fibres from scene and fabric files, by either key; wrong uses of
/// them.
#[test]
fn fibres_are_traced_from_scenes_and_fabrics() {
    let folder = folder("cli-fibres");
    write_silk_scene(&folder);
    let render = |name: &str, set: &str| {
        succeed(
            &folder,
            &format!("render scene.toml -o {name} --quiet --set {set}"),
        );
    };
    let red = |name: &str| {
        let channels = exr_channels(&folder.join(name));
        channels["R"].iter().map(|&v| f64::from(v)).sum::<f64>()
    };
    render("model.exr", "object.0.model=fibres");
    render("integrator.exr", "render.integrator=fibres");
    assert!(red("model.exr") > 0.0);
    assert_eq!(red("model.exr"), red("integrator.exr"));
    render("volume.exr", "object.0.model=packed");
    let near = "object.0.model=packed --set object.0.local_visibility=true";
    render("near.exr", near);
    assert_ne!(red("volume.exr"), red("near.exr"));
    std::fs::write(
        folder.join("pairs.csv"),
        "theta_i,phi_i,theta_o,phi_o\n20,0,0,0\n",
    )
    .unwrap();
    let printed = succeed(
        &folder,
        "measure cloth.toml --model fibres --pairs pairs.csv --spp 64 --json",
    );
    assert_contains(&printed, "\"model\": \"fibres\"");
    let refuse = |more: &str| complaint(&folder, &format!("render scene.toml -o x.exr {more}"));
    let why = refuse("--set object.0.local_visibility=true");
    assert_contains(&why, "object[0].local_visibility");
    let why = refuse("--set object.0.model=fibres --max-memory 64KB");
    assert_contains(&why, "bytes of memory");
    let why = refuse(
        "--set render.cache=\"first-fibre\" --set render.cache_mib=4096 \
         --set object.0.model=fibres --max-memory 1GiB",
    );
    assert_contains(&why, "render.cache_mib of at most");
}
