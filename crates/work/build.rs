//! Gives the program the digest of its sources, by which it recognises what other code computed,
//! and the digest of how it is built, by which the cache distinguishes two builds of one code.

#![allow(clippy::disallowed_methods)]

use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

fn main() -> std::io::Result<()> {
    let sources = digest(sources()?)?;
    println!("cargo::rustc-env=ORGANZA_SOURCES={sources}");
    let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let compiler = std::process::Command::new(compiler).arg("-vV").output()?;
    let mut build = Digester::default();
    build.feed(sources.as_bytes());
    for name in ["TARGET", "OPT_LEVEL", "CARGO_ENCODED_RUSTFLAGS"] {
        build.feed(std::env::var(name).unwrap_or_default().as_bytes());
    }
    build.feed(&compiler.stdout);
    println!("cargo::rustc-env=ORGANZA_BUILD={}", build.digits());
    println!("cargo::rerun-if-changed=build.rs");
    Ok(())
}

/// In the repository, the sources of all crates and the versions of what they depend on. A package
/// of this crate has only its own; the version, which all crates share, names the rest.
fn sources() -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let here = Path::new(".").canonicalize()?;
    if Path::new("../../crates/work").canonicalize().ok() != Some(here) {
        gather(Path::new("src"), &mut files)?;
        return Ok(files);
    }
    files.push("../../Cargo.lock".into());
    for entry in std::fs::read_dir("..")? {
        let source = entry?.path().join("src");
        if source.is_dir() {
            gather(&source, &mut files)?;
        }
    }
    Ok(files)
}

/// The digest of files and their names, the same on every system.
fn digest(files: Vec<PathBuf>) -> std::io::Result<String> {
    let named = files.into_iter().filter(|file| file.is_file()).map(|file| {
        let parts = file.iter().map(|part| part.to_string_lossy());
        (parts.collect::<Vec<_>>().join("/"), file)
    });
    let mut named: Vec<(String, PathBuf)> = named.collect();
    named.sort();
    let mut digest = Digester::default();
    for (name, file) in named {
        println!("cargo::rerun-if-changed={}", file.display());
        digest.feed(name.as_bytes());
        digest.feed(&std::fs::read(file)?);
    }
    Ok(digest.digits())
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

/// A digest of several lists of bytes, each with its length.
#[derive(Default)]
struct Digester(Sha256);

impl Digester {
    fn feed(&mut self, bytes: &[u8]) {
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    /// Its first 16 bytes in hexadecimal.
    fn digits(self) -> String {
        let digest = self.0.finalize();
        digest[..16]
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect()
    }
}
