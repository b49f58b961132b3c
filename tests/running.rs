//! Renders in parts: sample ranges, merging, checkpoints, stopping early.

use crate::cli::write_grid_scene;
use crate::program::{complaint, exr_channels, folder, organza, succeed};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn bytes(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap()
}

/// Renders `scene.toml` and returns the file.
fn picture(folder: &Path, more: &[&str]) -> Vec<u8> {
    let mut arguments = vec!["render", "scene.toml", "-o", "out.exr"];
    arguments.extend(more);
    succeed(folder, &arguments);
    bytes(folder, "out.exr")
}

#[test]
fn parts_merge_to_the_unbroken_picture() {
    let folder = folder("merge");
    write_grid_scene(&folder);
    let whole = picture(&folder, &["--spp", "48"]);
    let splits: [&[u64]; 4] = [
        &[0, 24, 48],
        &[0, 1, 47, 48],
        &[0, 16, 17, 33, 48],
        &[0, 5, 10, 15, 20, 25, 30, 35, 40, 48],
    ];
    for split in splits {
        let mut names = Vec::new();
        for (i, ends) in split.windows(2).enumerate() {
            let range = format!("{}..{}", ends[0], ends[1]);
            let name = format!("part{i}.exr");
            let threads = if i % 2 == 0 { "1" } else { "2" };
            let arguments = ["render", "scene.toml", "--samples", &range, "-o", &name];
            succeed(&folder, &[&arguments[..], &["--threads", threads]].concat());
            names.push(name);
        }
        for _ in 0..2 {
            let mut arguments: Vec<&str> = vec!["merge"];
            arguments.extend(names.iter().map(String::as_str));
            arguments.extend(["-o", "all.exr"]);
            succeed(&folder, &arguments);
            assert!(bytes(&folder, "all.exr") == whole, "{split:?}: {names:?}");
            names.reverse();
        }
    }
    // Merged pictures merge again, with a gap in between for a while.
    for (name, range) in [("a.exr", "0..8"), ("b.exr", "8..40"), ("c.exr", "40..48")] {
        succeed(
            &folder,
            &["render", "scene.toml", "--samples", range, "-o", name],
        );
    }
    succeed(&folder, &["merge", "c.exr", "a.exr", "-o", "gap.exr"]);
    succeed(&folder, &["merge", "gap.exr", "b.exr", "-o", "all.exr"]);
    assert!(bytes(&folder, "all.exr") == whole);
    // The known-bad twin: a part is not the whole.
    assert!(bytes(&folder, "b.exr") != whole);
}

#[test]
fn cropped_parts_merge_too() {
    let folder = folder("merge-crop");
    write_grid_scene(&folder);
    let crop = ["--crop", "4,2,12,7"];
    let whole = picture(&folder, &[&crop[..], &["--spp", "9"]].concat());
    for (name, range) in [("a.exr", "0..4"), ("b.exr", "4..9")] {
        let arguments = ["render", "scene.toml", "--samples", range, "-o", name];
        succeed(&folder, &[&arguments[..], &crop[..]].concat());
    }
    succeed(&folder, &["merge", "b.exr", "a.exr", "-o", "all.exr"]);
    assert!(bytes(&folder, "all.exr") == whole);
}

#[test]
fn what_does_not_belong_together_is_not_merged() {
    let folder = folder("merge-refused");
    write_grid_scene(&folder);
    let make = |name: &str, more: &[&str]| {
        let arguments = ["render", "scene.toml", "-o", name];
        succeed(&folder, &[&arguments[..], more].concat());
    };
    make("a.exr", &["--samples", "0..4"]);
    let refuse = |name: &str| complaint(&folder, &["merge", "a.exr", name, "-o", "all.exr"]);
    make("b.exr", &["--samples", "3..6"]);
    assert_eq!(
        refuse("b.exr"),
        "organza: b.exr: cannot join a.exr: samples 3..4 twice"
    );
    make("b.exr", &["--samples", "4..6", "--seed", "7"]);
    assert_eq!(
        refuse("b.exr"),
        "organza: b.exr: cannot join a.exr: seed is 7, but 0 in a.exr"
    );
    make("b.exr", &["--samples", "4..6", "--crop", "0,0,8,8"]);
    assert_eq!(
        refuse("b.exr"),
        "organza: b.exr: cannot join a.exr: crop is 0,0,8,8, but 0,0,16,8 in a.exr"
    );
    let cannot = "organza: b.exr: cannot join a.exr: ";
    make(
        "b.exr",
        &["--samples", "4..6", "--set", "camera.width_mm=1.5"],
    );
    assert_eq!(refuse("b.exr"), format!("{cannot}the scenes differ"));
    // The same scene file with other bytes behind a name in it.
    let grid = bytes(&folder, "sigma_t.vol");
    let mut denser = grid.clone();
    denser[48..52].copy_from_slice(&6.0f32.to_le_bytes());
    std::fs::write(folder.join("sigma_t.vol"), denser).unwrap();
    make("b.exr", &["--samples", "4..6"]);
    let changed = format!("{cannot}the contents of sigma_t.vol differ");
    assert_eq!(refuse("b.exr"), changed);
    std::fs::write(folder.join("sigma_t.vol"), grid).unwrap();
    // What only says how much to take and how to show it may differ.
    make(
        "b.exr",
        &["--samples", "4..6", "--set", "render.exposure=1"],
    );
    succeed(&folder, &["merge", "a.exr", "b.exr", "-o", "all.exr"]);
    // Files that are no pictures of ours.
    std::fs::write(folder.join("b.exr"), b"not a picture").unwrap();
    assert!(refuse("b.exr").starts_with("organza: b.exr: cannot be read as EXR"));
    let part = bytes(&folder, "a.exr");
    std::fs::write(folder.join("b.exr"), &part[..part.len() - 40]).unwrap();
    assert!(refuse("b.exr").starts_with("organza: b.exr: "));
    let foreign = exr::prelude::Image::from_channels(
        (4, 2),
        exr::prelude::SpecificChannels::rgb(|_| (0.5f32, 0.5f32, 0.5f32)),
    );
    exr::prelude::WritableImage::write(&foreign)
        .to_file(folder.join("b.exr"))
        .unwrap();
    assert_eq!(
        refuse("b.exr"),
        "organza: b.exr: holds no exact sums; expected a picture of `organza render`"
    );
    assert_eq!(refuse("none.exr"), "organza: none.exr: no such file");
    assert_eq!(
        complaint(&folder, &["merge", "a.exr", "-o", "all.png"]),
        "organza: all.png: expected a name that ends in .exr"
    );
}

#[test]
fn the_channels_hold_what_the_sums_say() {
    let folder = folder("sums");
    write_grid_scene(&folder);
    picture(&folder, &["--spp", "8"]);
    let channels = exr_channels(&folder.join("out.exr"));
    // The corner sees past the grid: escaped rays are exactly one.
    let (red, through) = (&channels["R"], &channels["through"]);
    let corner = red.first().unwrap();
    assert_eq!((*corner, through[0]), (1.0, 1.0));
    assert_eq!(channels["variance.R"][0], 0.0);
    assert!(red.iter().any(|&x| x < 0.99), "the grid is seen");
    assert!(channels["tangent.Z"].contains(&1.0));
}

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(folder)
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Waits for a file of the running program.
fn wait_for(path: &Path, child: &mut Child) {
    let started = Instant::now();
    while !path.exists() {
        assert!(child.try_wait().unwrap().is_none(), "ended too soon");
        assert!(started.elapsed() < Duration::from_secs(60), "no checkpoint");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Enough to be in the middle of it for a while.
const LONG: &str = "3000";

#[test]
fn a_killed_render_resumes_to_the_unbroken_picture() {
    let folder = folder("killed");
    write_grid_scene(&folder);
    let whole = picture(&folder, &["--spp", LONG]);
    let saved = folder.join("state");
    let keep = ["--checkpoint", "state", "--checkpoint-every", "0s"];
    let run = ["render", "scene.toml", "-o", "late.exr", "--spp", LONG];
    let mut child = start(
        &folder,
        &[&run[..], &keep[..], &["--threads", "1"]].concat(),
    );
    wait_for(&saved, &mut child);
    child.kill().unwrap(); // SIGKILL
    assert!(!child.wait().unwrap().success(), "killed in the middle");
    assert!(!folder.join("late.exr").exists());
    let resume = [&run[..], &keep[..], &["--resume"]].concat();
    succeed(&folder, &resume);
    assert!(bytes(&folder, "late.exr") == whole);
    // A complete render can be shown again, and continued with more samples.
    succeed(&folder, &resume);
    assert!(bytes(&folder, "late.exr") == whole);
    let more = ["--checkpoint", "state", "--resume", "--spp", "3100"];
    let more = picture(&folder, &more);
    assert!(more == picture(&folder, &["--spp", "3100"]));
}

#[cfg(unix)]
#[test]
fn an_interrupt_saves_and_ends() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        interrupt_with(signal);
    }
}

#[cfg(unix)]
fn interrupt_with(signal: &str) {
    let folder = folder("interrupted");
    write_grid_scene(&folder);
    let whole = picture(&folder, &["--spp", LONG]);
    let run = ["render", "scene.toml", "-o", "late.exr", "--spp", LONG];
    // The first checkpoint shows that the render is under way.
    let keep = ["--checkpoint", "state", "--checkpoint-every", "0s"];
    let mut child = start(
        &folder,
        &[&run[..], &keep[..], &["--threads", "1"]].concat(),
    );
    wait_for(&folder.join("state"), &mut child);
    let sent = Command::new("kill")
        .args([signal, &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
    let out = child.wait_with_output().unwrap();
    let words = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(1), "{words}");
    assert!(
        words.starts_with("organza: interrupted with ")
            && words
                .trim_end()
                .ends_with(" of 3000 samples; saved to state, continue with --resume"),
        "{words}"
    );
    assert!(!folder.join("late.exr").exists());
    succeed(&folder, &[&run[..], &keep[..], &["--resume"]].concat());
    assert!(bytes(&folder, "late.exr") == whole);
}

/// The engine is another cause than the scene, and is named as such.
#[test]
fn parts_of_another_engine_are_refused_for_that_reason() {
    let folder = folder("other-engine");
    write_grid_scene(&folder);
    for (name, samples, backend) in [("a.exr", "0..2", "walk"), ("b.exr", "2..4", "scalar")] {
        let run = ["render", "scene.toml", "-o", name, "--samples", samples];
        let state = format!("{backend}.state");
        let more = ["--backend", backend, "--checkpoint", &state];
        succeed(&folder, &[&run[..], &more[..]].concat());
    }
    let merged = complaint(&folder, &["merge", "a.exr", "b.exr", "-o", "all.exr"]);
    assert_eq!(
        merged,
        "organza: b.exr: cannot join a.exr: backend is scalar, but walk in a.exr; render both \
         with one --backend"
    );
    let run = ["render", "scene.toml", "-o", "c.exr", "--resume"];
    let resume = |more: &[&str]| complaint(&folder, &[&run[..], more].concat());
    let walked = ["--samples", "0..2", "--checkpoint", "walk.state"];
    assert_eq!(
        resume(&[&walked[..], &["--backend", "scalar"]].concat()),
        "organza: walk.state: is a checkpoint of the general walk; this render is of the kernel; \
         continue with --backend walk"
    );
    let by_kernel = ["--samples", "2..4", "--checkpoint", "scalar.state"];
    assert_eq!(
        resume(&[&by_kernel[..], &["--set", "render.clamp=100.0"]].concat()),
        "organza: scalar.state: is a checkpoint of the kernel; this render is of the general \
         walk, for clamping needs the general walk"
    );
}

/// A scene's name in another script: its parts keep what they are of.
#[test]
fn a_scene_of_any_name_can_be_merged() {
    let folder = folder("other-script");
    write_grid_scene(&folder);
    std::fs::rename(folder.join("scene.toml"), folder.join("шёлк.toml")).unwrap();
    for (name, samples) in [("a.exr", "0..1"), ("b.exr", "1..2")] {
        let run = ["render", "шёлк.toml", "-o", name, "--samples", samples];
        succeed(&folder, &run);
    }
    succeed(&folder, &["merge", "a.exr", "b.exr", "-o", "all.exr"]);
    let info = succeed(&folder, &["info", "all.exr"]);
    assert!(info.contains("шёлк.toml"), "{info}");
}

#[test]
fn checkpoints_that_do_not_belong_are_refused() {
    let folder = folder("foreign-checkpoint");
    write_grid_scene(&folder);
    picture(&folder, &["--checkpoint", "state", "--samples", "2..6"]);
    let good = bytes(&folder, "state");
    let refuse = |content: &[u8], more: &[&str]| {
        std::fs::write(folder.join("state"), content).unwrap();
        let arguments = [
            "render",
            "scene.toml",
            "-o",
            "no.exr",
            "--checkpoint",
            "state",
        ];
        let all = [&arguments[..], &["--resume"], more].concat();
        let words = complaint(&folder, &all);
        assert_eq!(bytes(&folder, "state"), content, "the file is kept");
        words
    };
    let same = ["--samples", "2..6"];
    assert_eq!(
        refuse(&good[..good.len() - 1], &same),
        format!(
            "organza: state: is cut short after {} of {} bytes; it cannot be resumed",
            good.len() - 1,
            good.len()
        )
    );
    assert_eq!(
        refuse(&good[..20], &same),
        "organza: state: is cut short after 20 bytes; it cannot be resumed"
    );
    let no_checkpoint = "organza: state: is not a checkpoint of organza";
    assert_eq!(refuse(b"", &same), no_checkpoint);
    assert_eq!(refuse(b"something else", &same), no_checkpoint);
    let damaged = "organza: state: is damaged: its checksum does not match";
    for at in [good.len() - 1, good.len() / 2, good.len() / 3] {
        let mut bent = good.clone();
        bent[at] ^= 1;
        assert_eq!(refuse(&bent, &same), damaged, "byte {at}");
    }
    let longer = [&good[..], b"x"].concat();
    assert_eq!(refuse(&longer, &same), damaged);
    let mut newer = good.clone();
    newer[8] = 4;
    assert_eq!(
        refuse(&newer, &same),
        "organza: state: is a checkpoint of format 4; this program reads 3"
    );
    assert_eq!(
        refuse(&good, &["--samples", "2..6", "--seed", "3"]),
        "organza: state: is a checkpoint of seed 0; this render has seed 3"
    );
    assert_eq!(
        refuse(&good, &["--samples", "2..6", "--crop", "0,0,8,8"]),
        "organza: state: is a checkpoint of the pixels 0,0,16,8; this render is of 0,0,8,8"
    );
    for range in ["0..6", "2..5"] {
        assert_eq!(
            refuse(&good, &["--samples", range]),
            format!(
                "organza: state: is a checkpoint of the samples 2..6; this render is of {range}"
            )
        );
    }
    assert_eq!(
        refuse(
            &good,
            &["--samples", "2..6", "--set", "camera.width_mm=1.5"]
        ),
        "organza: state: is a checkpoint of another scene"
    );
    let grid = bytes(&folder, "sigma_t.vol");
    let mut denser = grid.clone();
    denser[48..52].copy_from_slice(&6.0f32.to_le_bytes());
    std::fs::write(folder.join("sigma_t.vol"), denser).unwrap();
    assert_eq!(
        refuse(&good, &same),
        "organza: state: is a checkpoint of another content of sigma_t.vol, which the scene names"
    );
    std::fs::write(folder.join("sigma_t.vol"), grid).unwrap();
    assert!(!folder.join("no.exr").exists());
    std::fs::remove_file(folder.join("state")).unwrap();
    let arguments = [
        "render",
        "scene.toml",
        "-o",
        "no.exr",
        "--checkpoint",
        "state",
    ];
    assert_eq!(
        complaint(&folder, &[&arguments[..], &["--resume"]].concat()),
        "organza: state: no such file"
    );
}

/// The number before " of N samples" in the final line.
fn taken(words: &str) -> u64 {
    let line = words.lines().find(|l| l.starts_with("stopped")).unwrap();
    let (_, printed) = line.rsplit_once("; ").unwrap();
    printed.split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn the_time_limit_ends_a_render() {
    let folder = folder("time-limit");
    write_grid_scene(&folder);
    let spp = "4000000";
    let limited = ["render", "scene.toml", "-o", "out.exr", "--spp", spp];
    let words = succeed(
        &folder,
        &[&limited[..], &["--time-limit", "300ms"]].concat(),
    );
    assert!(words.contains("time limit reached; "), "{words}");
    assert!(words.contains(" of 4000000 samples a pixel"), "{words}");
    let samples = taken(&words);
    assert!(samples > 0 && samples < 4_000_000, "{words}");
    // What there was time for is what as many samples give.
    let early = bytes(&folder, "out.exr");
    assert!(early == picture(&folder, &["--spp", &samples.to_string()]));
}

#[test]
fn errors_that_were_not_reached_or_are_not_known_are_told() {
    let folder = folder("target-missed");
    write_grid_scene(&folder);
    let run = ["render", "scene.toml", "-o", "out.exr", "--target-error"];
    let printed = |more: &[&str]| succeed(&folder, &[&run[..], more].concat());
    let words = printed(&["0.0001", "--spp", "4"]);
    let missed = "all samples taken, target error not reached, 0.";
    assert!(words.contains(missed), "{words}");
    assert!(words.contains(" of the mean; 4 of 4 samples"), "{words}");
    let words = printed(&["0.99", "--spp", "4"]);
    assert!(words.contains("taken, target error reached, 0."), "{words}");
    // The spread of one sample is not zero, it is not known.
    let words = printed(&["0.99", "--spp", "1", "--stats"]);
    assert!(
        words.contains("error         unknown (one sample)"),
        "{words}"
    );
    assert!(
        !words.contains("+-") && !words.contains("reached"),
        "{words}"
    );
    let figures = printed(&["0.99", "--spp", "1", "--json", "--quiet"]);
    let figures: serde_json::Value = serde_json::from_str(&figures).unwrap();
    assert!(figures["relative_error"].is_null() && figures["standard_error"].is_null());
    let figures = printed(&["0.0001", "--spp", "2", "--json", "--quiet"]);
    let figures: serde_json::Value = serde_json::from_str(&figures).unwrap();
    assert!(figures["relative_error"].as_f64() > Some(0.0), "{figures}");
}

#[test]
fn the_target_error_ends_a_render_at_the_same_sample_on_any_machine() {
    let folder = folder("target-error");
    write_grid_scene(&folder);
    let run = ["render", "scene.toml", "-o", "out.exr", "--spp", "100000"];
    let reach = |target: &str, more: &[&str]| {
        let words = succeed(
            &folder,
            &[&run[..], &["--target-error", target], more].concat(),
        );
        assert!(words.contains("target error reached, "), "{words}");
        taken(&words)
    };
    let samples = reach("0.004", &["--threads", "1"]);
    let channels = exr_channels(&folder.join("out.exr"));
    let sum = |names: [&str; 3]| -> f64 {
        let values = names.iter().flat_map(|n| channels[*n].iter());
        values.map(|&x| f64::from(x)).sum()
    };
    let values = 3.0 * channels["R"].len() as f64;
    let variance = sum(["variance.R", "variance.G", "variance.B"]) / values;
    let error = variance.sqrt() / (sum(["R", "G", "B"]) / values);
    assert!(
        error <= 0.004 && error > 0.003,
        "{error} at {samples} samples"
    );
    let early = bytes(&folder, "out.exr");
    assert_eq!(reach("0.004", &["--threads", "2"]), samples);
    assert!(bytes(&folder, "out.exr") == early);
    assert!(early == picture(&folder, &["--spp", &samples.to_string()]));
    let both = ["--target-median-error", "0.99"];
    assert_eq!(reach("0.004", &both), samples);
    let both = ["--target-median-error", "0.002"];
    assert!(reach("0.9", &both) > 16);
    // Four times the samples for half the error, within the steps of looks.
    let finer = reach("0.002", &[]);
    assert!(
        finer > 3 * samples && finer < 5 * samples,
        "{samples}, {finer}"
    );
}

#[test]
fn statistics_tell_fireflies_and_memory() {
    let folder = folder("statistics");
    write_grid_scene(&folder);
    let words = succeed(
        &folder,
        &["render", "scene.toml", "-o", "out.exr", "--stats"],
    );
    assert!(words.contains("rejected      0 samples"), "{words}");
    assert!(words.contains("times the mean"), "{words}");
    assert!(words.contains("memory "), "{words}");
    assert!(
        words.contains("all samples taken; 4 of 4 samples"),
        "{words}"
    );
}

#[test]
fn thin_lenses_are_read_and_checked() {
    let folder = folder("thin-lens");
    write_grid_scene(&folder);
    let scene = std::fs::read_to_string(folder.join("scene.toml")).unwrap();
    let lens = |keys: &str| {
        let camera = format!("kind = \"thin-lens\"\nfov_deg = 20.0\n{keys}");
        std::fs::write(
            folder.join("lens.toml"),
            scene.replace("width_mm = 1.0", &camera),
        )
        .unwrap();
        ["render", "lens.toml", "-o", "lens.exr"]
    };
    let show = |keys: &str| {
        succeed(&folder, &[&lens(keys)[..], &["--spp", "64"]].concat());
        exr_channels(&folder.join("lens.exr"))
    };
    // A sharp picture of a box has pixels that never see it, a blurred one
    // hardly any.
    let clear = |channels: std::collections::BTreeMap<String, Vec<f32>>| {
        channels["through"].iter().filter(|&&x| x == 1.0).count()
    };
    let sharp = clear(show("aperture_mm = 0.01"));
    let blurred = clear(show("aperture_mm = 1.0\nfocus_mm = 1.0"));
    assert!(blurred + 20 < sharp, "{blurred} {sharp}");
    // 20 degrees on 36 mm: the sensor is 102.08 mm away, the focus 3 mm:
    // f = 2.9144 mm, at f/2 1.4572 mm.
    let (by_number, by_diameter) = (show("f_number = 2.0"), show("aperture_mm = 1.4571824"));
    let off = by_number["R"]
        .iter()
        .zip(&by_diameter["R"])
        .filter(|(a, b)| a != b)
        .count();
    assert!(off <= 4, "{off} pixels differ");
    for (keys, words) in [
        (
            "",
            "camera: a thin lens takes either aperture_mm or f_number",
        ),
        (
            "aperture_mm = 1.0\nf_number = 2.0",
            "camera: a thin lens takes either aperture_mm or f_number",
        ),
        (
            "aperture_mm = 1.0\nfocus_mm = -3.0",
            "camera: focus_mm must be positive, found -3",
        ),
        (
            "aperture_mm = 1.0\nsensor_width_mm = 24.0",
            "camera: sensor_width_mm belongs to f_number",
        ),
    ] {
        assert_eq!(
            complaint(&folder, &lens(keys)),
            format!("organza: lens.toml: {words}")
        );
    }
    let arguments = ["render", "scene.toml", "-o", "x.exr"];
    let misplaced = [&arguments[..], &["--set", "camera.focus_mm=2.0"]].concat();
    assert_eq!(
        complaint(&folder, &misplaced),
        "organza: scene.toml: camera: focus_mm belongs to kind = \"thin-lens\""
    );
}

#[test]
fn wrong_flags_are_told() {
    let folder = folder("running-flags");
    for wrong in [
        &["--samples", "4..4"][..],
        &["--samples", "0..4", "--spp", "4"],
        &["--resume"],
        &["--time-limit", "soon"],
        &["--target-error", "0"],
        &["--checkpoint-every", "5s"],
    ] {
        let arguments = ["render", "scene.toml", "-o", "x.exr"];
        let out = organza(&folder, &[&arguments[..], wrong].concat());
        assert_eq!(out.status.code(), Some(2), "{wrong:?}");
    }
    let render = &["render", "scene.toml", "-o", "x.exr"][..];
    let voxelize = &["voxelize", "cloth.toml", "-o", "x.ovox"][..];
    for (command, flag, value, words) in [
        (render, "--clamp", "-1", "expected a number above 0"),
        (render, "--spp", "-3", "expected a whole number from 1 to"),
        (render, "--seed", "-1", "expected a whole number from 0 to"),
        (render, "--seed", "abc", "expected a whole number from 0 to"),
        (render, "--crop", "-1,0,4,4", "expected four whole numbers"),
        (render, "--samples", "-1..4", "expected A..B"),
        (render, "--time-limit", "-5s", "expected a time such as"),
        (render, "--target-error", "-1", "0.05 is 5 %"),
        (render, "--target-error", "5", "0.05 is 5 %"),
        (voxelize, "--voxel-um", "60um", "a number of micrometres"),
        (voxelize, "--levels", "9", "a whole number from 1 to 8"),
        (
            &["weave", "plain", "-o", "x.png"],
            "--cell-px",
            "0",
            "from 1 to 1024",
        ),
        (&["weave", "plain"], "--cell-px", "8", "--outfile"),
        (
            &["compare", "a.toml", "-o", "b"],
            "--limit",
            "15",
            "0.05 is 5 %",
        ),
        (&["bench", "-o", "b"], "--within", "0.1,5", "0.05 is 5 %"),
        (
            &["export", "mitsuba", "a.toml", "-o", "b"],
            "--repeats",
            "-1,2",
            "from 1 to 4096",
        ),
    ] {
        let out = organza(&folder, &[command, &[flag, value]].concat());
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{flag} {value}: {said}");
        assert!(said.contains(words), "{flag} {value}: {said}");
    }
}
