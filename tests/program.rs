//! Runs the program as a user does, in a folder of the test's own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A fresh folder below the build folder, emptied first.
pub fn folder(test: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Arguments of the program: words, or one line of words without quotes.
pub trait Arguments {
    /// The words.
    fn words(&self) -> Vec<&str>;
}

impl Arguments for str {
    fn words(&self) -> Vec<&str> {
        argv(self)
    }
}

impl Arguments for String {
    fn words(&self) -> Vec<&str> {
        argv(self)
    }
}

impl Arguments for [&str] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl<const N: usize> Arguments for [&str; N] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl Arguments for Vec<&str> {
    fn words(&self) -> Vec<&str> {
        self.clone()
    }
}

impl<A: Arguments + ?Sized> Arguments for &A {
    fn words(&self) -> Vec<&str> {
        (**self).words()
    }
}

/// Runs `organza` in a folder.
pub fn organza(folder: &Path, arguments: &(impl Arguments + ?Sized)) -> Output {
    Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(folder)
        .env_remove("ORGANZA_CACHE")
        .args(arguments.words())
        .output()
        .unwrap()
}

/// Sends a signal to a running program.
#[cfg(unix)]
pub fn signal(child: &std::process::Child, signal: &str) {
    let id = child.id().to_string();
    let sent = Command::new("kill").args([signal, &id]).status();
    assert!(sent.unwrap().success());
}

/// Runs `organza` and demands success.
pub fn succeed(folder: &Path, arguments: &(impl Arguments + ?Sized)) -> String {
    let out = organza(folder, arguments);
    let stderr = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success(), "{:?}: {stderr}", arguments.words());
    String::from_utf8_lossy(&out.stdout).into_owned() + &stderr
}

/// The words of a command line without quotes.
pub fn argv(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// Demands an exit status, and returns what was said about it.
#[track_caller]
pub fn ended(out: &Output, status: i32) -> String {
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert_eq!(out.status.code(), Some(status), "{said}");
    said
}

/// Runs `organza`, demands the exit status of wrong input, and returns the
/// message, which must be one line.
pub fn complaint(folder: &Path, arguments: &(impl Arguments + ?Sized)) -> String {
    let said = ended(&organza(folder, arguments), 2).trim_end().to_owned();
    assert_eq!(said.lines().count(), 1, "{said}");
    said
}

/// The digest of the sources of the program.
pub fn sources() -> String {
    let about = succeed(Path::new("."), "--version --verbose");
    let mut lines = about.lines();
    let digest = lines.find_map(|line| line.strip_prefix("sources: "));
    digest.unwrap().to_owned()
}

/// The channels of an EXR file, by name.
pub fn exr_channels(path: &Path) -> BTreeMap<String, Vec<f32>> {
    let image = exr::prelude::read_first_flat_layer_from_file(path).unwrap();
    let list = image.layer_data.channel_data.list;
    list.iter()
        .map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect()))
        .collect()
}

/// Writes a `.vol` file (Mitsuba's grid format, version 3) without the help of
/// the crate under test.
pub fn write_vol(path: &Path, dims: [i32; 3], channels: i32, bounds: [f32; 6], data: &[f32]) {
    let mut bytes = b"VOL\x03".to_vec();
    for i in [1, dims[0], dims[1], dims[2], channels] {
        bytes.extend(i.to_le_bytes());
    }
    for x in bounds.iter().chain(data) {
        bytes.extend(x.to_le_bytes());
    }
    std::fs::write(path, bytes).unwrap();
}

/// The contents of a file of a folder.
pub fn bytes(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap()
}

/// Renders `scene.toml` with further flags and returns the bytes of the picture.
pub fn picture(folder: &Path, more: &(impl Arguments + ?Sized)) -> Vec<u8> {
    let mut arguments = argv("render scene.toml -o out.exr");
    arguments.extend(more.words());
    succeed(folder, &arguments);
    bytes(folder, "out.exr")
}

/// The names of what a run left in a folder, sorted, without temporary files.
pub fn files_left(folder: &Path) -> Vec<String> {
    let mut names = organza_testing::file_names(folder);
    names.retain(|name| !name.ends_with(".tmp"));
    names
}

/// Every file below a folder, by its path within it.
pub fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(inside) = folders.pop() {
        for entry in std::fs::read_dir(&inside).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().display().to_string();
                found.insert(name.replace('\\', "/"), std::fs::read(path).unwrap());
            }
        }
    }
    found
}
