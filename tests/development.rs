//! How display formats show a picture: exposure, tone mapping, white balance, bits.

use crate::cli::write_grid_scene;
use crate::program::{bytes, folder, organza, succeed};
use std::io::Cursor;
use std::path::Path;

/// What `render` prints, with the picture in a file of this name.
fn render(folder: &Path, name: &str, more: &[&str]) -> String {
    let command = ["render", "scene.toml", "-o", name, "--spp", "2", "--json"];
    succeed(folder, &[&command[..], more].concat())
}

/// The number that a line of the log gives for a flag, to be given again.
fn repeated(printed: &str, flag: &str) -> String {
    let (_, rest) = printed.split_once(&format!("({flag} ")).unwrap();
    rest.split_once(' ').unwrap().0.to_owned()
}

#[test]
fn what_auto_finds_is_printed_and_gives_the_same_picture() {
    let folder = folder("development");
    write_grid_scene(&folder);
    let auto = ["--exposure", "auto", "--white-balance", "auto"];
    let printed = render(&folder, "auto.png", &auto);
    let stops = repeated(&printed, "--exposure");
    let white = repeated(&printed, "--white-balance");
    let json = |text: &str| format!("\"exposure\": \"{text}\"");
    assert!(printed.contains(&json(&stops)), "{printed}");
    let by_hand = ["--exposure", &stops, "--white-balance", &white];
    render(&folder, "by_hand.png", &by_hand);
    assert!(bytes(&folder, "auto.png") == bytes(&folder, "by_hand.png"));
    // The same from the file, by any number of threads, of which flags override a part.
    let [x, y] = white.split(',').collect::<Vec<_>>()[..] else {
        panic!("{white}")
    };
    let in_file = [
        "--set",
        "render.exposure=auto",
        "--set",
        &format!("render.white_balance=[{x},{y}]"),
        "--threads",
        "1",
    ];
    render(&folder, "file.png", &in_file);
    assert!(bytes(&folder, "auto.png") == bytes(&folder, "file.png"));
    // Known bad: a hundredth of a stop apart.
    let other = (stops.parse::<f32>().unwrap() + 0.01).to_string();
    render(
        &folder,
        "other.png",
        &["--exposure", &other, "--white-balance", &white],
    );
    assert!(bytes(&folder, "auto.png") != bytes(&folder, "other.png"));
}

#[test]
fn settings_reach_the_png_and_leave_linear_files_alone() {
    let folder = folder("development-linear");
    write_grid_scene(&folder);
    let all = [
        "--exposure",
        "auto",
        "--tone-mapping",
        "agx",
        "--white-balance",
        "3200",
        "--png-bits",
        "16",
    ];
    render(&folder, "plain.exr", &[]);
    let printed = render(&folder, "all.exr", &all);
    assert!(bytes(&folder, "plain.exr") == bytes(&folder, "all.exr"));
    assert!(printed.contains("\"display\": null"), "{printed}");
    let info = |name: &str| {
        let file = bytes(&folder, name);
        let reader = png::Decoder::new(Cursor::new(file)).read_info().unwrap();
        let info = reader.info();
        (info.bit_depth as u8, info.srgb.is_some())
    };
    render(&folder, "plain.png", &[]);
    render(&folder, "all.png", &all);
    assert_eq!(
        (info("plain.png"), info("all.png")),
        ((8, true), (16, true))
    );
    // A checkpoint and parts fit whatever the settings: no sample depends on them.
    let saved = ["--checkpoint", "state", "--exposure", "1"];
    render(&folder, "a.exr", &saved);
    let resumed = ["--checkpoint", "state", "--resume"];
    let resumed = [&resumed[..], &all].concat();
    render(&folder, "again.png", &resumed);
    assert!(bytes(&folder, "again.png") == bytes(&folder, "all.png"));
    // Each setting by itself changes the picture.
    for pair in all[..6].chunks(2) {
        render(&folder, "one.png", pair);
        assert!(
            bytes(&folder, "one.png") != bytes(&folder, "plain.png"),
            "{pair:?}"
        );
    }
    let help = succeed(&folder, &["render", "--help"]);
    assert!(help.contains("--white-balance") && help.contains("--tone-mapping"));
    assert!(
        !organza(&folder, &["merge", "plain.exr", "-o", "m.png"])
            .status
            .success()
    );
}
