//! Runs a program on a disk that fails.

use crate::program::folder;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

/// What a fault looks like.
#[derive(Clone, Copy, Debug)]
pub enum Fault {
    /// One operation fails, the next one works.
    Once,
    /// The disk is full from one operation on, half of which is still written.
    Full,
}

/// The library, compiled once.
pub fn library() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let library = folder("failing-disk-library").join("libfailing_disk.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/failing_disk.rs");
        let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let compiled = Command::new(compiler)
            .args(["--edition", "2024", "--crate-type", "cdylib", "-O", "-o"])
            .args([&library, &source])
            .status()
            .unwrap();
        assert!(compiled.success());
        library
    })
}

/// Runs a program in a folder whose disk fails at an operation (0: at none). Also returns what
/// the operations were.
pub fn run(
    program: &str,
    arguments: &[&str],
    folder: &Path,
    at: usize,
    how: Fault,
) -> (Output, Vec<String>) {
    let log = folder.with_extension("log");
    let _ = std::fs::remove_file(&log);
    let how = match how {
        Fault::Once => "once",
        Fault::Full => "full",
    };
    let out = Command::new(program)
        .current_dir(folder)
        .args(arguments)
        .env_remove("ORGANZA_CACHE")
        .env("LD_PRELOAD", library())
        .env("FAILING_FOLDER", folder)
        .env("FAILING_AT", at.to_string())
        .env("FAILING_HOW", how)
        .env("FAILING_LOG", &log)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let log = std::fs::read_to_string(log).unwrap();
    (out, log.lines().map(str::to_owned).collect())
}
