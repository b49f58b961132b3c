//! Archives of releases: `.ci/pack` packs them under the names by which `cargo binstall` looks
//! for them. cargo-binstall itself is not run: there is no release to find yet.
#![cfg(unix)]

use crate::program::folder;
use std::path::Path;
use std::process::Command;

/// What cargo-binstall puts in place of its words.
fn filled(template: &str, target: &str, extension: &str) -> String {
    let words = [
        ("{ repo }", "https://example.org/organza"),
        ("{ version }", env!("CARGO_PKG_VERSION")),
        ("{ target }", target),
        ("{ bin }", "organza"),
        ("{ binary-ext }", extension),
    ];
    let fill = |text: String, (word, value): &(&str, &str)| text.replace(word, value);
    let text = words.iter().fold(template.to_owned(), fill);
    assert!(
        !text.contains(['{', '}']),
        "{text}: a word that is not known"
    );
    text
}

/// The archive of a target that `.ci/pack` makes, and what it holds.
fn packed(out: &Path, target: &str) -> (String, Vec<String>) {
    let run = |command: &mut Command| {
        let done = command.output().unwrap();
        let words = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{words}");
        String::from_utf8(done.stdout).unwrap()
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join(".ci/pack");
    let printed = run(Command::new(script)
        .args([
            "--target",
            target,
            "--binary",
            env!("CARGO_BIN_EXE_organza"),
        ])
        .arg("--out")
        .arg(out));
    let archive = printed.trim().to_owned();
    let listed = run(Command::new("tar").args(["-tzf", &archive]));
    run(Command::new("tar").args(["-xzf", &archive, "-C"]).arg(out));
    (archive, listed.lines().map(str::to_owned).collect())
}

#[test]
fn archives_have_the_names_that_binstall_looks_for() {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
    let manifest: toml::Table = std::fs::read_to_string(manifest).unwrap().parse().unwrap();
    let keys = &manifest["package"]["metadata"]["binstall"];
    let key = |name: &str| keys[name].as_str().unwrap();
    assert_eq!(key("pkg-fmt"), "tgz");
    let folder = folder("release");
    for (target, extension) in [
        ("x86_64-unknown-linux-gnu", ""),
        ("x86_64-pc-windows-msvc", ".exe"),
    ] {
        let (archive, files) = packed(&folder, target);
        let url = filled(key("pkg-url"), target, extension);
        let name = |path: &str| path.rsplit('/').next().unwrap().to_owned();
        assert_eq!(name(&archive), name(&url));
        let binary = filled(key("bin-dir"), target, extension);
        assert!(files.contains(&binary), "{binary}: {files:?}");
        for text in ["LICENSE-APACHE", "LICENSE-MIT", "README.md"] {
            assert!(files.iter().any(|file| file.ends_with(text)), "{text}");
        }
        // Known bad: another target's names.
        let other = filled(key("bin-dir"), "riscv64gc-unknown-linux-gnu", extension);
        assert!(!files.contains(&other));
        let unpacked = Command::new(folder.join(&binary))
            .arg("--version")
            .output()
            .unwrap();
        let printed = String::from_utf8_lossy(&unpacked.stdout).into_owned();
        assert_eq!(
            printed.trim(),
            concat!("organza ", env!("CARGO_PKG_VERSION"))
        );
    }
}
