//! Input files: bytes from paths, and TOML whose mistakes are reported with place,
//! key, what was expected and the nearest valid name.

use crate::error::{InputError, Result};
use crate::file_kind::{self, Wanted};
use crate::memory::free_memory_bytes;
use crate::overrides::overridden;
use crate::toml_reader::{self, TomlError};
use organza_basis::nearest_name;
use serde::de::DeserializeOwned;
use std::ffi::OsString;
use std::fs::{File, Metadata};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// The largest input file read whole into memory, except volumes.
const MAX_TEXT_BYTES: u64 = 64 << 20;

/// Names of a folder that are looked through for the one that was meant.
const MAX_NAMES: usize = 10_000;

/// The bytes of a file.
///
/// # Errors
/// Names the file; a file that cannot be read is wrong input.
pub fn bytes(path: &Path) -> Result<Vec<u8>> {
    bytes_or_why(path).map_err(|e| InputError::of_io(path, &e))
}

/// The bytes of a file, for callers that word the error themselves.
///
/// # Errors
/// Those of the file system in the words of [`io_message`]; a device or a pipe,
/// which may have no end; a file larger than the free memory.
pub fn bytes_or_why(path: &Path) -> std::io::Result<Vec<u8>> {
    unchecked_bytes(path).map_err(|e| std::io::Error::new(e.kind(), io_message(&e)))
}

/// Why a file that is named somewhere cannot be read, if that is known without
/// reading it.
pub fn unreachable(path: &Path) -> Option<InputError> {
    let why = match about(path) {
        Ok(about) if about.is_dir() => ErrorKind::IsADirectory.into(),
        Ok(about) if about.is_file() => return None,
        Ok(_) => no_file(),
        Err(e) => e,
    };
    Some(InputError::of_io(path, &why))
}

fn unchecked_bytes(path: &Path) -> std::io::Result<Vec<u8>> {
    let about = about(path)?;
    let refuse = |kind, why: String| Err(std::io::Error::new(kind, why));
    if about.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    if !about.is_file() {
        return Err(no_file());
    }
    let (size, free) = (about.len(), free_memory_bytes());
    if size > free {
        let why = format!("is {size} bytes long; {free} bytes of memory are free");
        return refuse(ErrorKind::OutOfMemory, why);
    }
    // What grows while it is read is cut, and found wrong by whoever decodes it.
    let mut bytes = Vec::new();
    File::open(path)?.take(free).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn no_file() -> std::io::Error {
    let why = "is a device or a pipe; expected a file";
    std::io::Error::new(ErrorKind::InvalidInput, why)
}

/// The text of a file, at most `MAX_TEXT_BYTES` long.
///
/// # Errors
/// Names the file.
pub fn text(path: &Path) -> Result<String> {
    text_of(path, Wanted::Text)
}

/// The same, of a file that should be of a kind; only what it begins with is
/// looked at.
///
/// # Errors
/// Says what a file of another kind is.
pub fn text_of(path: &Path, wanted: Wanted) -> Result<String> {
    let fail = |why: &str| InputError::of_file(path, why);
    let size = about(path).map_err(|e| InputError::of_io(path, &e))?.len();
    if size > MAX_TEXT_BYTES {
        return Err(fail(&format!(
            "is {size} bytes long; expected {} of at most {MAX_TEXT_BYTES}",
            wanted.description()
        )));
    }
    text_in(path, bytes(path)?, wanted)
}

/// The text of bytes that are in the place of a file of this path.
///
/// # Errors
/// As [`text_of`].
pub(crate) fn text_in(path: &Path, bytes: Vec<u8>, wanted: Wanted) -> Result<String> {
    let fail = |why: &str| InputError::of_file(path, why);
    if let Some(what) = file_kind::of_bytes(&bytes) {
        return Err(fail(&format!(
            "is {what}; expected {}",
            wanted.description()
        )));
    }
    String::from_utf8(bytes).map_err(|e| {
        fail(&format!(
            "is not UTF-8 text (byte {}); expected {}",
            e.utf8_error().valid_up_to(),
            wanted.description()
        ))
    })
}

/// What the file system knows of a file; of one that is not there, which one was
/// meant.
fn about(path: &Path) -> std::io::Result<Metadata> {
    std::fs::metadata(path).map_err(|e| match meant(path) {
        Some(meant) if e.kind() == ErrorKind::NotFound => {
            std::io::Error::new(e.kind(), format!("no such file; did you mean {meant}?"))
        }
        _ => e,
    })
}

/// The file that was probably meant by one that is not there: the same path from
/// the working folder, where a scene's folder was put before it, or a file beside
/// it of nearly that name.
fn meant(path: &Path) -> Option<String> {
    let mut rest = path.components();
    while rest.next().is_some() {
        let here = rest.as_path();
        if !here.as_os_str().is_empty() && here.is_file() {
            let whole = std::path::absolute(here).ok()?;
            return Some(format!(
                "{} (a path in a scene or fabric, by --set too, begins at its folder)",
                whole.display()
            ));
        }
    }
    let folder = match path.parent()? {
        here if here.as_os_str().is_empty() => Path::new("."),
        folder => folder,
    };
    let alike = std::fs::read_dir(folder)
        .ok()?
        .take(MAX_NAMES)
        .filter_map(|entry| Some(PathBuf::from(entry.ok()?.file_name())))
        .filter(|name| name.extension() == path.extension())
        .filter_map(|name| Some(name.file_stem()?.to_str()?.to_owned()));
    let mut stems: Vec<String> = alike.collect();
    // Folders list their files in any order.
    stems.sort_unstable();
    let stem = nearest_name(path.file_stem()?.to_str()?, &stems)?;
    let mut name = OsString::from(stem);
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    Some(path.with_file_name(name).display().to_string())
}

/// What an I/O error means to the person at the terminal.
pub fn io_message(e: &std::io::Error) -> String {
    match e.kind() {
        _ if e.get_ref().is_some() => e.to_string(),
        ErrorKind::NotFound => "no such file".into(),
        ErrorKind::PermissionDenied => "permission denied".into(),
        ErrorKind::IsADirectory => "is a folder; expected a file".into(),
        _ => e.to_string(),
    }
}

/// A path named inside a file, relative to that file's folder.
pub fn beside(file: &Path, named: &str) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(named)
}

/// Parses TOML text of the file `path`, which should be of a kind, without the
/// keys `removed`, `key.path` each, and with `key.path=value` overrides. Keys are
/// removed after the overrides are set; one that is not there is no mistake.
///
/// # Errors
/// Names file, line, column and key, and the nearest valid name of a misspelt
/// key or value; for an override, the flag. Says what a file of another kind is.
pub fn toml_changed<T: DeserializeOwned>(
    path: &Path,
    source: &str,
    removed: &[String],
    overrides: &[String],
    wanted: Wanted,
) -> Result<T> {
    wanted.check(path, source)?;
    // The file alone first: its mistakes have a place, an override's do not.
    let parsed = toml_reader::from_text::<T>(source).map_err(|e| with_place(path, source, e));
    if overrides.is_empty() && removed.is_empty() {
        return parsed;
    }
    let table: ::toml::Table = match ::toml::from_str(source) {
        Ok(t) => t,
        Err(_) => return parsed,
    };
    overridden(table, removed, overrides)?.or_else(|e| parsed.and(Err(e)))
}

/// A mistake with the file, the line and column, and the key.
fn with_place(path: &Path, source: &str, e: TomlError) -> InputError {
    let Some(span) = e.span else {
        return InputError::of_file(path, e.message);
    };
    let (line, column) = line_and_column(source, span.start);
    let key = key_at(source, span.start);
    let at_header = source.get(span).is_some_and(|at| at.starts_with('['));
    let message = match &key {
        Some(key) if e.is_table_for_list && at_header => {
            format!("expected a list of tables, found one table; write [[{key}]]")
        }
        _ => e.message,
    };
    InputError {
        line: u32::try_from(line).ok(),
        column: u32::try_from(column).ok(),
        key,
        ..InputError::of_file(path, message)
    }
}

/// A mistake of [`toml_changed`] without the line and column of the file.
pub(crate) fn without_line(e: InputError) -> InputError {
    InputError {
        line: None,
        column: None,
        ..e
    }
}

/// 1-based line and column (in characters) of a byte offset.
pub fn line_and_column(source: &str, offset: usize) -> (usize, usize) {
    let before = source.get(..offset).unwrap_or(source);
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|&c| c != '\n').count() + 1;
    (line, column)
}

/// The key whose line holds an offset, with its table.
fn key_at(source: &str, offset: usize) -> Option<String> {
    let start = source.get(..offset)?.rfind('\n').map_or(0, |i| i + 1);
    let line = source.get(start..)?.lines().next()?.trim();
    let table = source
        .get(..start)?
        .lines()
        .rev()
        .find(|l| l.trim_start().starts_with('['))
        .map(|l| {
            l.split('#')
                .next()
                .unwrap_or(l)
                .trim()
                .trim_matches(['[', ']'])
                .to_owned()
        });
    if line.starts_with('[') {
        return Some(line.trim_matches(['[', ']']).to_owned());
    }
    let (key, _) = line.split_once('=')?;
    let key = key.trim();
    Some(table.map_or(key.to_owned(), |t| format!("{t}.{key}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Outer {
        inner: Inner,
    }
    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Inner {
        albedo: f32,
        list: Vec<f32>,
    }

    fn parse(source: &str, overrides: &[&str]) -> Result<Outer> {
        let overrides: Vec<String> = overrides.iter().map(|&s| s.to_owned()).collect();
        toml_changed(Path::new("a.toml"), source, &[], &overrides, Wanted::Text)
    }

    #[test]
    fn an_unknown_key_is_reported_with_place_and_nearest_name() {
        let e = parse("[inner]\nalbedo = 1.0\nlsit = [1.0]\n", &[]).unwrap_err();
        let words = e.to_string();
        assert!(
            words.contains(":3:1: inner.lsit: unknown field `lsit`"),
            "{words}"
        );
        assert!(words.ends_with("did you mean `list`?"), "{words}");
        let place = (e.line, e.column, e.key.as_deref());
        assert_eq!(place, (Some(3), Some(1), Some("inner.lsit")));
    }

    #[test]
    fn overrides_reach_tables_and_arrays_and_their_mistakes_name_the_flag() {
        let good = "[inner]\nalbedo = 1.0\nlist = [1.0, 2.0]\n";
        let got = parse(good, &["inner.albedo=0.5", "inner.list.1=7.0"]).unwrap();
        assert_eq!((got.inner.albedo, got.inner.list), (0.5, vec![1.0, 7.0]));
        let words = parse(good, &["inner.albedo=red"]).unwrap_err().to_string();
        assert!(words.starts_with("--set inner.albedo=red:"), "{words}");
        let words = parse(good, &["inner.list.9=1.0"]).unwrap_err().to_string();
        assert!(words.contains("`9` is not an element"), "{words}");
        let words = parse(good, &["inner.list.x=1.0"]).unwrap_err().to_string();
        assert!(
            words.ends_with("`inner.list` is a list of 2; write inner.list.0.x"),
            "{words}"
        );
        let deep = format!("{}=1", vec!["a"; 30_000].join("."));
        let words = parse(good, &[&deep]).unwrap_err().to_string();
        assert!(
            words.ends_with("at most 16 names, found one of 30000"),
            "{words}"
        );
    }
}
