//! Renders without noise, by a library of the tests' own in place of Open Image Denoise: what is
//! passed to it, what is written, and what is said where there is none. `tests/peers/run
//! denoise` does the same with the real one.
#![cfg(target_os = "linux")]

use crate::cli::write_grid_scene;
use crate::program::{argv, bytes, exr_channels, folder, organza, picture, succeed};
use organza_testing::assert_contains;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Where a wheel of pyoidn has the library.
const IN_WHEEL: &str = "venv/lib/python3.11/site-packages/pyoidn/oidn/lib";

/// Compiles the library, which states this version, into a Python environment of the folder.
fn write_library(folder: &Path, version: &str) -> PathBuf {
    let inside = folder.join(IN_WHEEL);
    std::fs::create_dir_all(&inside).unwrap();
    let library = inside.join("libOpenImageDenoise.so.2");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/oidn_stub.rs");
    let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let compiled = Command::new(compiler)
        .args(["--edition", "2024", "--crate-type", "cdylib", "-o"])
        .args([&library, &source])
        .env("STUB_VERSION", version)
        .status()
        .unwrap();
    assert!(compiled.success());
    library
}

/// Runs `organza` with the library that the environment of the folder has.
fn run(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(folder)
        .env("ORGANZA_OIDN", folder.join(IN_WHEEL))
        .args(argv(line))
        .output()
        .unwrap()
}

fn printed(out: &Output) -> String {
    String::from_utf8_lossy(&out.stderr).into_owned()
}

#[test]
fn a_denoised_picture_keeps_the_noisy_one_and_all_that_was_rendered() {
    let folder = folder("denoise");
    write_grid_scene(&folder);
    write_library(&folder, "20304");
    let plain = picture(&folder, "--spp 4");
    let rendered = run(&folder, "render scene.toml -o clean.exr --spp 4 --denoise");
    assert!(rendered.status.success(), "{}", printed(&rendered));
    let out = run(&folder, "denoise out.exr -o same.exr");
    assert!(printed(&out).contains("Open Image Denoise 2.3.4 without guides"));
    assert!(bytes(&folder, "same.exr") == bytes(&folder, "clean.exr"));
    // The colours alone come back as they were.
    let (noisy, clean) = (
        exr_channels(&folder.join("out.exr")),
        exr_channels(&folder.join("clean.exr")),
    );
    for (name, values) in &noisy {
        let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert!(bits(values) == bits(&clean[name]), "{name}");
        if ["R", "G", "B"].contains(&name.as_str()) {
            assert!(values == &clean[&format!("noisy.{name}")], "{name}");
        }
    }
    assert_eq!(clean.len(), noisy.len() + 3);
    // With guides: one channel of each picture that was passed, halved, because the guides
    // were denoised first.
    let out = run(&folder, "denoise clean.exr -o guided.exr --guides");
    assert!(printed(&out).contains("with guides"), "{}", printed(&out));
    let guided = exr_channels(&folder.join("guided.exr"));
    for i in 0..noisy["R"].len() {
        let events = noisy["bounces"][i];
        let met = 1.0 - noisy["through"][i];
        assert_eq!(guided["R"][i], 0.5 * noisy["R"][i]);
        assert_eq!(guided["G"][i], 0.5 * (events / (1.0 + events)));
        assert_eq!(guided["B"][i], 0.5 * (noisy["tangent.Z"][i] * met));
    }
    assert!(noisy["bounces"].iter().any(|&n| n > 0.0));
    assert!(guided["noisy.R"] == noisy["R"]);
    // `difference` takes the colours that are shown, `merge` the samples.
    let same = succeed(&folder, "difference out.exr clean.exr");
    let other = succeed(&folder, "difference out.exr guided.exr");
    assert_contains(&same, "bit for bit");
    assert!(!other.contains("bit for bit"), "{other}");
    succeed(&folder, "merge guided.exr -o merged.exr");
    assert!(bytes(&folder, "merged.exr") == plain);
}

#[test]
fn a_png_has_the_noisy_picture_beside_it() {
    let folder = folder("denoise-png");
    write_grid_scene(&folder);
    write_library(&folder, "20304");
    let render = "render scene.toml --spp 4 -o";
    succeed(&folder, &format!("{render} plain.png"));
    let out = run(&folder, &format!("{render} clean.png --denoise"));
    assert!(out.status.success(), "{}", printed(&out));
    assert!(bytes(&folder, "clean.png") == bytes(&folder, "plain.png"));
    assert!(bytes(&folder, "clean.noisy.png") == bytes(&folder, "plain.png"));
    let out = run(&folder, &format!("{render} clean.tif --denoise"));
    assert_eq!(out.status.code(), Some(2));
    assert!(
        printed(&out).contains("ends in .exr or .png"),
        "{}",
        printed(&out)
    );
}

#[test]
fn without_the_library_nothing_is_rendered_and_the_message_says_how_to_get_it() {
    let folder = folder("denoise-without");
    write_grid_scene(&folder);
    let no_library = |named: &Path, line: &str| {
        let out = Command::new(env!("CARGO_BIN_EXE_organza"))
            .current_dir(&folder)
            .env("ORGANZA_OIDN", named)
            .args(argv(line))
            .output()
            .unwrap();
        let words = printed(&out);
        assert_eq!(out.status.code(), Some(2), "{words}");
        assert_eq!(words.lines().count(), 1, "{words}");
        assert_contains(&words, "pip install pyoidn");
        words
    };
    // So many samples would take hours.
    let render = "render scene.toml -o x.exr --spp 1000000000 --denoise";
    let words = no_library(Path::new("none.so"), render);
    assert_contains(&words, "ORGANZA_OIDN names none.so");
    std::fs::write(folder.join("text.so"), "no library").unwrap();
    no_library(&folder.join("text.so"), render);
    let library = write_library(&folder, "30001");
    let words = no_library(&library, render);
    assert_contains(&words, "has version 3.0.1; expected 1 or 2");
    assert!(!folder.join("x.exr").exists());
}

#[test]
fn what_the_library_reports_and_other_pictures_are_errors_that_write_nothing() {
    let folder = folder("denoise-errors");
    write_grid_scene(&folder);
    write_library(&folder, "20304");
    picture(&folder, "--spp 2 --crop 3,0,4,4"); // one pixel wide
    let out = run(&folder, "denoise out.exr -o x.exr");
    assert_eq!(out.status.code(), Some(1));
    assert!(
        printed(&out).contains("Open Image Denoise: too narrow"),
        "{}",
        printed(&out)
    );
    let out = run(&folder, "denoise scene.toml -o x.exr");
    assert_eq!(out.status.code(), Some(2), "{}", printed(&out));
    let small = "denoise out.exr -o x.exr --max-memory 1KiB";
    let out = run(&folder, small);
    assert_eq!(out.status.code(), Some(2), "{}", printed(&out));
    let out = organza(&folder, "denoise out.exr -o out.exr");
    assert_eq!(out.status.code(), Some(2));
    assert!(!folder.join("x.exr").exists());
}
