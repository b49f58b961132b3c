//! What commands refuse before they begin, and leave as it was.

use crate::cli::write_grid_scene;
use crate::program::{argv, complaint, ended, folder, organza, succeed};
use organza_testing::{assert_contains, file_names};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// A plain cotton cloth.
pub const SAILCLOTH: &str = r#"name = "sailcloth"
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

/// What a scene or fabric names is also an input as what the command line names.
#[test]
fn no_file_that_an_input_names_is_written_over() {
    let folder = folder("refusals-named-inputs");
    let refused = |name: &str, arguments: &str| {
        let before = fs::read(folder.join(name)).unwrap();
        assert_contains(&complaint(&folder, arguments), "is also an input");
        assert_eq!(
            fs::read(folder.join(name)).unwrap(),
            before,
            "{arguments:?}"
        );
    };
    // A scene under its own sky.
    write_grid_scene(&folder);
    succeed(&folder, "render scene.toml -o sky.exr --spp 1");
    let sky = "light=[{kind='environment',file='sky.exr'}]";
    let render = format!("render scene.toml --spp 1 --set {sky} -o");
    refused("sky.exr", &format!("{render} ./sky.exr"));
    succeed(&folder, &format!("{render} out.exr"));
    let grid = "state.exr --checkpoint sigma_t.vol --resume";
    let message = complaint(&folder, &format!("{render} {grid}"));
    assert_contains(
        &message,
        "sigma_t.vol: is not a journal; expected one of `organza render`",
    );
    let both = "x.exr --checkpoint ./x.exr";
    let message = complaint(&folder, &format!("{render} {both}"));
    assert_contains(&message, "the checkpoint and the picture at once");
    // A fabric of curves, and the pairs of a measurement.
    sailcloth(&folder);
    let curves = "weave sailcloth.toml --level yarn -o curves.txt";
    succeed(&folder, &curves);
    let imported = "[draft]\ncurves = 'curves.txt'\n[yarn.cotton]\npreset = 'cotton'\ntex = 30.0\n";
    fs::write(folder.join("imported.toml"), imported).unwrap();
    let again = "weave imported.toml --level yarn -o curves.txt";
    refused("curves.txt", again);
    fs::write(
        folder.join("p.csv"),
        "theta_i,phi_i,theta_o,phi_o\n0,0,0,0\n",
    )
    .unwrap();
    refused("p.csv", "measure sailcloth.toml --pairs p.csv -o p.csv");
}

/// A journal knows the content of every file that its fabric names.
#[test]
fn a_fit_does_not_resume_from_another_draft() {
    let folder = folder("refusals-journal");
    sailcloth(&folder);
    let wif = |colour: &str| {
        let text = format!(
            "[WIF]\nVersion=1.1\n[CONTENTS]\nWEAVING=true\nWARP=true\nWEFT=true\nTHREADING=true\n\
             TREADLING=true\nTIEUP=true\nCOLOR TABLE=true\nCOLOR PALETTE=true\n\
             [COLOR PALETTE]\nEntries=2\nRange=0,255\n[COLOR TABLE]\n1={colour}\n2=20,20,20\n\
             [WEAVING]\nShafts=2\nTreadles=2\n[WARP]\nThreads=2\nColor=1\n[WEFT]\nThreads=2\nColor=2\n\
             [THREADING]\n1=1\n2=2\n[TREADLING]\n1=1\n2=2\n[TIEUP]\n1=1\n2=2\n"
        );
        fs::write(folder.join("draft.wif"), text).unwrap();
    };
    let text = SAILCLOTH.replace("weave = \"plain\"", "wif = \"draft.wif\"");
    fs::write(folder.join("drafted.toml"), text).unwrap();
    let fit = "fit surface drafted.toml -o fitted.toml --journal journal --spp 2 --voxel-um 160 \
        --patience 0,1 --quiet";
    wif("200,30,30");
    succeed(&folder, &fit);
    succeed(&folder, &fit); // the known-bad twin: nothing changed
    wif("30,30,200");
    let said = complaint(&folder, &fit);
    assert_contains(&said, "journal: belongs to other inputs or settings");
}

#[test]
fn no_input_is_written_over() {
    let folder = folder("refusals-inputs");
    sailcloth(&folder);
    let printed = complaint(&folder, "fit surface sailcloth.toml -o sailcloth.toml");
    assert_contains(&printed, "is also an input");
    let text = fs::read_to_string(folder.join("sailcloth.toml")).unwrap();
    assert_eq!(text, SAILCLOTH);
    let printed = complaint(&folder, "fit surface sailcloth.toml -o fitted.png");
    assert_contains(&printed, "ends in .toml");
    let fit = "fit surface sailcloth.toml -o fitted.toml --journal none/journal";
    assert_contains(&complaint(&folder, &fit), "the folder none does not exist");

    write_grid_scene(&folder);
    for (name, samples) in [("a.exr", "0..1"), ("b.exr", "3..4")] {
        succeed(
            &folder,
            &format!("render scene.toml -o {name} --samples {samples}"),
        );
    }
    let before = fs::read(folder.join("a.exr")).unwrap();
    let said = complaint(&folder, "merge a.exr b.exr -o ./a.exr");
    assert_contains(&said, "is also an input");
    assert_eq!(fs::read(folder.join("a.exr")).unwrap(), before);
    let said = succeed(&folder, "merge a.exr b.exr -o all.exr");
    assert_contains(&said, "samples 1..3 are missing");
    assert_contains(&succeed(&folder, "info all.exr"), "samples: 0..1,3..4");
}

/// Channels of a cloth in the dark, or lights alone, can be meant.
#[test]
fn scenes_without_light_or_matter_are_rendered_and_reported() {
    let folder = folder("refusals-empty");
    write_grid_scene(&folder);
    for (key, words) in [("light=[]", "no [[light]]"), ("object=[]", "no [[object]]")] {
        let render = format!("render scene.toml -o x.exr --set {key}");
        assert_contains(&succeed(&folder, &render), words);
        let printed = succeed(&folder, &format!("{render} --quiet"));
        assert!(printed.is_empty(), "{printed}");
    }
}

#[test]
fn reports_of_two_kinds_do_not_share_a_folder() {
    let folder = folder("refusals-reports");
    sailcloth(&folder);
    let few = "--spp 2 --texels 8 --texel-spp 2";
    // Without a [surface] section: its fibres and its micro-flakes.
    let compare = format!("compare sailcloth.toml -o report {few}");
    assert_contains(&succeed(&folder, &compare), "microflake against fibres");
    let before = fs::read(folder.join("report/report.html")).unwrap();
    let printed = complaint(&folder, "bench sailcloth.toml -o report");
    assert_contains(&printed, "holds a comparison (pairs.csv)");
    assert_eq!(fs::read(folder.join("report/report.html")).unwrap(), before);
    assert_eq!(
        file_names(&folder.join("report")),
        ["pairs.csv", "report.html", "report.json"]
    );

    fs::create_dir(folder.join("bench")).unwrap();
    fs::write(folder.join("bench/choices.csv"), "").unwrap();
    let printed = complaint(&folder, "compare sailcloth.toml -o bench");
    assert_contains(&printed, "holds the report of a bench");
}

#[test]
fn nothing_is_left_where_inputs_are_wrong() {
    let folder = folder("refusals-traces");
    sailcloth(&folder);
    fs::write(folder.join("file"), "").unwrap();
    let before = file_names(&folder);
    for arguments in [
        "bench denm -o report",
        "bench denim none.toml -o report",
        "compare sailcloth.toml -o report --data none.csv",
        "compare sailcloth.toml -o report --models surface",
        "compare sailcloth.toml -o file",
        "bench denim -o file",
        "info first.wif --set a.b=3",
        "info sailcloth.vol",
    ] {
        complaint(&folder, arguments);
        assert_eq!(file_names(&folder), before, "{arguments:?}");
    }
}

#[test]
fn layouts_that_fit_into_no_memory_are_refused_with_the_figure() {
    let folder = folder("refusals-memory");
    sailcloth(&folder);
    for (layout, words) in [
        (
            "--layout grid --grid 1000,1000",
            "2000000000000 values need",
        ),
        ("--layout sweep --step 1e-9", "--step:"),
    ] {
        let measure = "measure sailcloth.toml -o table.csv --spp 2";
        let printed = complaint(&folder, &format!("{measure} {layout} --max-memory 1GiB"));
        assert!(
            printed.contains(words) && printed.contains("1073741824"),
            "{printed}"
        );
    }
    assert_eq!(file_names(&folder), ["sailcloth.toml"]);
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
        let fit = format!(
            "fit fibres sailcloth.toml --model {model} --data values.csv -o fitted.toml \
             --spp 4 --patience 0,1 --voxel-um 160 --set yarn.cotton.fibres_per_ply=12"
        );
        assert_contains(&succeed(&folder, &fit), gives_way);
        succeed(&folder, "info fitted.toml");
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
    for arguments in ["info sailcloth.toml", "info sailcloth.toml --json"] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_organza"))
            .current_dir(&folder)
            .args(argv(arguments))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let out = child.wait_with_output().unwrap();
        let printed = String::from_utf8_lossy(&out.stderr);
        assert!(
            out.status.success() && printed.is_empty(),
            "{arguments:?}: {printed}"
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
        let printed = ended(&out, 1);
        assert_contains(&printed, "cannot write to the standard output");
    }
    assert!(organza(&folder, "--version").status.success());
}

/// What a bench reads may not lie where it writes.
#[test]
fn a_bench_does_not_fill_the_folder_of_its_inputs() {
    let folder = folder("bench-inputs");
    fs::create_dir_all(folder.join("report/scenes")).unwrap();
    let fabric = crate::fabrics::cotton("plain", "tex = 30.0", 40.0);
    let own = folder.join("report/scenes/plain.toml");
    fs::write(&own, &fabric).unwrap();
    let named = "bench report/scenes/plain.toml -o report --quick";
    let said = complaint(&folder, &named);
    assert_contains(
        &said,
        "report/scenes/plain.toml: is an input and lies in report",
    );
    assert_eq!(fs::read_to_string(&own).unwrap(), fabric);
}

/// `render` warns if the allowed memory decides which engine renders. The twin has enough.
#[test]
fn a_choice_of_engine_by_memory_is_reported() {
    let folder = folder("engine-by-memory");
    write_grid_scene(&folder);
    let dims = [40, 40, 40];
    let cells = vec![1.0; 40 * 40 * 40];
    let bounds = [-0.2, -0.2, -0.2, 0.2, 0.2, 0.2];
    crate::program::write_vol(&folder.join("sigma_t.vol"), dims, 1, bounds, &cells);
    let warning = "the general walk renders this scene, for the tables of the kernel need up to";
    let render = |allowed: &str| {
        let arguments = format!("render scene.toml -o x.exr --max-memory {allowed}");
        succeed(&folder, &format!("{arguments} --spp 1"))
    };
    let said = render("1MiB");
    assert_contains(&said, warning);
    let said = render("1GiB");
    assert!(!said.contains(warning), "{said}");
}

/// Before the work, not after it.
#[test]
fn a_name_that_the_system_cannot_take_is_refused() {
    let folder = folder("refusals-long-names");
    sailcloth(&folder);
    write_grid_scene(&folder);
    let long = |ending: &str| "x".repeat(300) + ending;
    for arguments in [
        &["render", "scene.toml", "-o", &long(".exr")][..],
        &["voxelize", "sailcloth.toml", "-o", &long(".ovox")],
    ] {
        let message = complaint(&folder, arguments);
        assert_contains(&message, "too long");
        assert!(!message.contains("cannot write"), "{message}");
    }
}

/// The larger picture states so many pixels in 2 kB that it takes seconds to decode, or more
/// memory than is allowed.
#[test]
fn sizes_of_pictures_are_compared_before_they_are_decoded() {
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds,
        Layer, LayerAttributes, WritableImage,
    };
    let folder = folder("difference-sizes");
    for (name, window) in [("small.exr", (2, 2)), ("large.exr", (15_000, 8000))] {
        let channels = ["B", "G", "R"].map(|n| AnyChannel::new(n, FlatSamples::F32(vec![0.0; 4])));
        let layer = Layer::new(
            (2, 2),
            LayerAttributes::default(),
            Encoding::SMALL_LOSSLESS,
            AnyChannels::sort(channels.into_iter().collect()),
        );
        let window = ImageAttributes::new(IntegerBounds::from_dimensions(window));
        let image = Image::from_layers(window, vec![layer]);
        image.write().to_file(folder.join(name)).unwrap();
    }
    let words = complaint(&folder, "difference small.exr large.exr --max-memory 1MiB");
    let expected = "large.exr: has 15000 x 8000 pixels; small.exr has 2 x 2";
    assert_contains(&words, expected);
}
