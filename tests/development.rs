//! How display formats show a picture: exposure, tone mapping, white balance, bits.

use crate::cli::write_grid_scene;
use crate::program::{bytes, ended, folder, organza, succeed};
use organza_testing::{assert_contains, table_rows};
use std::io::Cursor;
use std::path::Path;

/// What `render` prints, with the picture in a file of this name.
fn render(folder: &Path, name: &str, more: &str) -> String {
    let command = format!("render scene.toml -o {name} --spp 2 --json");
    succeed(folder, &format!("{command} {more}"))
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
    let auto = "--exposure auto --white-balance auto";
    let printed = render(&folder, "auto.png", auto);
    let stops = repeated(&printed, "--exposure");
    let white = repeated(&printed, "--white-balance");
    let json = |text: &str| format!("\"exposure\": \"{text}\"");
    assert_contains(&printed, &json(&stops));
    let by_hand = format!("--exposure {stops} --white-balance {white}");
    render(&folder, "by_hand.png", &by_hand);
    assert!(bytes(&folder, "auto.png") == bytes(&folder, "by_hand.png"));
    // The same from the file, by any number of threads, of which flags override a part.
    let [x, y] = white.split(',').collect::<Vec<_>>()[..] else {
        panic!("{white}")
    };
    let white_balance = format!("--set render.white_balance=[{x},{y}]");
    let in_file = format!("--set render.exposure=auto {white_balance} --threads 1");
    render(&folder, "file.png", &in_file);
    assert!(bytes(&folder, "auto.png") == bytes(&folder, "file.png"));
    // Known bad: a hundredth of a stop apart.
    let other = (stops.parse::<f32>().unwrap() + 0.01).to_string();
    render(
        &folder,
        "other.png",
        &format!("--exposure {other} --white-balance {white}"),
    );
    assert!(bytes(&folder, "auto.png") != bytes(&folder, "other.png"));
}

#[test]
fn settings_reach_the_png_and_leave_linear_files_alone() {
    let folder = folder("development-linear");
    write_grid_scene(&folder);
    let settings = [
        "--exposure auto",
        "--tone-mapping agx",
        "--white-balance 3200",
    ];
    let all = settings.join(" ") + " --png-bits 16";
    render(&folder, "plain.exr", "");
    let printed = render(&folder, "all.exr", &all);
    assert!(bytes(&folder, "plain.exr") == bytes(&folder, "all.exr"));
    assert_contains(&printed, "\"display\": null");
    let info = |name: &str| {
        let file = bytes(&folder, name);
        let reader = png::Decoder::new(Cursor::new(file)).read_info().unwrap();
        let info = reader.info();
        (info.bit_depth as u8, info.srgb.is_some())
    };
    render(&folder, "plain.png", "");
    render(&folder, "all.png", &all);
    assert_eq!(
        (info("plain.png"), info("all.png")),
        ((8, true), (16, true))
    );
    // A checkpoint and parts fit whatever the settings: no sample depends on them.
    let saved = "--checkpoint state --exposure 1";
    render(&folder, "a.exr", saved);
    let resumed = "--checkpoint state --resume";
    let resumed = format!("{resumed} {all}");
    render(&folder, "again.png", &resumed);
    assert!(bytes(&folder, "again.png") == bytes(&folder, "all.png"));
    // Each setting by itself changes the picture.
    for setting in settings {
        render(&folder, "one.png", setting);
        let is_same = bytes(&folder, "one.png") == bytes(&folder, "plain.png");
        assert!(!is_same, "{setting}");
    }
    let help = succeed(&folder, "render --help");
    assert!(help.contains("--white-balance") && help.contains("--tone-mapping"));
    assert!(
        !organza(&folder, "merge plain.exr -o m.png")
            .status
            .success()
    );
}

/// Bytes of a PNG of 8 bits, with its width and height.
fn pixels(folder: &Path, name: &str) -> (Vec<u8>, usize, usize) {
    let mut reader = png::Decoder::new(Cursor::new(bytes(folder, name)))
        .read_info()
        .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    (pixels, info.width as usize, info.height as usize)
}

#[test]
fn a_contact_sheet_shows_each_scene_as_render_does() {
    let folder = folder("contact-sheet");
    write_grid_scene(&folder);
    let text = std::fs::read_to_string(folder.join("scene.toml")).unwrap();
    std::fs::write(folder.join("other.toml"), format!("{text}\n")).unwrap();
    let sheet = "render --contact-sheet sheet.png scene.toml other.toml scene.toml --cell-px 32 \
        --spp 2 --exposure auto";
    let printed = succeed(&folder, sheet);
    assert_contains(&printed, "sheet.png: 3 scenes");
    let (shown, width, height) = pixels(&folder, "sheet.png");
    // Two columns and rows of 32 pixels, labels of 12 and gaps of 8.
    assert_eq!((width, height), (2 * 40 + 8, 2 * 52 + 8));
    let cell_size = printed.lines().find(|l| l.starts_with("other.toml: "));
    let cell_size = cell_size.unwrap()["other.toml: ".len()..].split(',').next();
    let (w, h) = cell_size.unwrap().split_once(" x ").unwrap();
    let size = format!("camera.resolution=[{w},{h}]");
    render(&folder, "one.png", &format!("--exposure auto --set {size}"));
    let (one, w, h) = pixels(&folder, "one.png");
    assert!(w.max(h) == 32 && one.iter().any(|&b| b > 20));
    let (left, top) = (8 + (32 - w) / 2, 8 + (32 - h) / 2);
    for (column, row) in [(0, 0), (1, 0), (0, 1)] {
        for y in 0..h {
            let at = ((top + row * 52 + y) * width + left + column * 40) * 3;
            let expected = &one[y * w * 3..(y + 1) * w * 3];
            assert!(&shown[at..at + w * 3] == expected, "row {y}");
        }
    }
    succeed(&folder, &format!("{sheet} --threads 1"));
    assert!(pixels(&folder, "sheet.png").0 == shown, "threads");
}

/// Words after `render --contact-sheet`, and a part of the message.
const WRONG: &str = "
s.png scene.toml missing.toml | missing.toml
s.png scene.toml bad.toml | bad.toml
s.exr scene.toml | s.exr: a contact sheet is written as .png
scene.toml scene.toml | a contact sheet is written as .png
s.png scene.toml -o x.png | cannot be used with
s.png scene.toml --crop 0,0,1,1 | cannot be used with
s.png scene.toml --cell-px 9 | from 16 to 2048
s.png scene.toml --max-memory 1k | a sheet of
s.png | required
";

#[test]
fn a_contact_sheet_is_refused_before_anything_is_rendered() {
    let folder = folder("contact-sheet-wrong");
    write_grid_scene(&folder);
    std::fs::write(folder.join("bad.toml"), "[render]\nspp = 0\n[camera]\n").unwrap();
    for [wrong, why] in table_rows(WRONG) {
        let said = ended(
            &organza(&folder, &format!("render --contact-sheet {wrong}")),
            2,
        );
        assert!(said.contains(why), "{wrong:?}: {said}");
        assert!(!folder.join("s.png").exists() && !folder.join("s.exr").exists());
    }
    let said = ended(
        &organza(&folder, "render scene.toml scene.toml -o x.png"),
        2,
    );
    assert_contains(&said, "several are rendered with --contact-sheet");
    let said = ended(&organza(&folder, "render scene.toml"), 2);
    assert_contains(&said, "--outfile");
}
