//! Gives the program the digest of its sources and of how it is built, which distinguishes two builds
//! of one version apart.

#![allow(clippy::disallowed_methods)]

use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

fn main() -> std::io::Result<()> {
    let crates = Path::new("..");
    let mut files = vec![PathBuf::from("../../Cargo.lock")];
    for entry in std::fs::read_dir(crates)? {
        let source = entry?.path().join("src");
        if source.is_dir() {
            gather(&source, &mut files)?;
        }
    }
    files.sort();
    let mut digest = Sha256::new();
    let mut feed = |bytes: &[u8]| {
        digest.update((bytes.len() as u64).to_le_bytes());
        digest.update(bytes);
    };
    for file in &files {
        if file.is_file() {
            println!("cargo::rerun-if-changed={}", file.display());
            feed(file.to_string_lossy().as_bytes());
            feed(&std::fs::read(file)?);
        }
    }
    for name in ["TARGET", "OPT_LEVEL", "CARGO_ENCODED_RUSTFLAGS"] {
        feed(std::env::var(name).unwrap_or_default().as_bytes());
    }
    let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let version = std::process::Command::new(compiler).arg("-vV").output()?;
    feed(&version.stdout);
    let digits: String = digest.finalize()[..16]
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    println!("cargo::rustc-env=ORGANZA_SOURCES={digits}");
    Ok(())
}

/// Adds the files of a folder and of those in it.
fn gather(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    println!("cargo::rerun-if-changed={}", folder.display());
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        match path.is_dir() {
            true => gather(&path, files)?,
            false => files.push(path),
        }
    }
    Ok(())
}
