//! Output files appear under their final names only when complete.

use crate::error::{of_file, of_io};
use anyhow::{Context, Result};
use organza_cache::temporary;
use organza_scene::read::io_message;
use std::io::{BufWriter, Seek, Write};
use std::path::{Component, Path, PathBuf};
use tempfile::NamedTempFile;

/// What encoders need of a file.
pub trait SeekWrite: Write + Seek {}
impl<T: Write + Seek> SeekWrite for T {}

/// Characters of an output's name that its temporary file repeats: with what
/// follows, the longest name that file systems take stays within their limit.
const REPEATED_CHARS: usize = 48;

/// Writes a file under a temporary name and flushes it to the disk.
fn write_temporary(
    path: &Path,
    write: impl FnOnce(&mut dyn SeekWrite) -> Result<()>,
) -> Result<NamedTempFile> {
    let cannot = || format!("cannot write {}", path.display());
    refuse_special(path)?;
    temporary::remove_left_over(folder_of(path), &temporary_prefix(path));
    let temporary = temporary_file(path)
        .map_err(without_path)
        .with_context(cannot)?;
    let mut out = BufWriter::new(temporary.as_file());
    write(&mut out).with_context(cannot)?;
    out.flush().with_context(cannot)?;
    drop(out);
    temporary.as_file().sync_all().with_context(cannot)?;
    Ok(temporary)
}

/// Gives a complete file its name.
fn complete(temporary: NamedTempFile, path: &Path) -> Result<()> {
    let renamed = temporary.persist(path).map_err(|e| e.error);
    renamed
        .map(|_| ())
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Writes a file through `write`, flushes it to the disk and gives it its name.
///
/// # Errors
/// Names the file; nothing is left behind.
pub fn write_file(path: &Path, write: impl FnOnce(&mut dyn SeekWrite) -> Result<()>) -> Result<()> {
    complete(write_temporary(path, write)?, path)
}

/// Writes a file of these bytes.
///
/// # Errors
/// Names the file; nothing is left behind.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_file(path, |out| Ok(out.write_all(bytes)?))
}

/// What writes one of several files.
pub type WriteFile<'a> = Box<dyn FnOnce(&mut dyn SeekWrite) -> Result<()> + 'a>;

/// Writes files that belong together, the first of which stands for all: they get
/// their names when all of them are on the disk, the first one last. Meanwhile
/// there is no first one, so that old and new ones are never taken for a set.
///
/// # Errors
/// Names the file; while any of them cannot be written, the old ones stay.
pub fn write_files(files: Vec<(PathBuf, WriteFile<'_>)>) -> Result<Vec<PathBuf>> {
    let mut written = Vec::new();
    for (path, write) in files {
        let temporary = write_temporary(&path, write)?;
        written.push((path, temporary));
    }
    if let [(first, _), _, ..] = &written[..]
        && first.exists()
    {
        std::fs::remove_file(first)
            .with_context(|| format!("cannot replace {}", first.display()))?;
    }
    let paths = written.iter().map(|(path, _)| path.clone()).collect();
    for (path, temporary) in written.into_iter().rev() {
        complete(temporary, &path)?;
    }
    Ok(paths)
}

/// The folder of a file's name.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// What the names of the temporary files of a file, or of the folders of a folder, begin with.
pub(crate) fn temporary_prefix(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.chars().take(REPEATED_CHARS).collect::<String>() + "."
}

/// A new file in the same folder, so that the rename cannot cross a file system.
fn temporary_file(path: &Path) -> std::io::Result<NamedTempFile> {
    temporary::file(folder_of(path), &temporary_prefix(path))
}

/// Devices and pipes keep their place: a rename would put a file there instead.
fn refuse_special(path: &Path) -> Result<()> {
    match std::fs::metadata(path) {
        Ok(about) if !about.is_file() && !about.is_dir() => Err(of_file(
            path,
            "is a device or a pipe; expected the name of a file",
        )),
        _ => Ok(()),
    }
}

/// Whether two paths lead to one file, or would if both were written.
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    match (file_id(a), file_id(b)) {
        (Some(a), Some(b)) => a == b,
        (None, None) => place_of(a).is_some_and(|place| place_of(b) == Some(place)),
        _ => false,
    }
}

/// What names an existing file whatever path leads to it, through links of any
/// kind.
#[cfg(unix)]
fn file_id(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    let about = std::fs::metadata(path).ok()?;
    Some((about.dev(), about.ino()))
}

/// What names an existing file whatever path leads to it, through links of any
/// kind but hard ones.
#[cfg(not(unix))]
fn file_id(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok()
}

/// Where a file would appear, in folders that need not be there yet.
fn place_of(path: &Path) -> Option<PathBuf> {
    let whole = std::path::absolute(path).ok()?;
    let mut folders = whole.ancestors().skip(1);
    let (there, real) = folders.find_map(|folder| Some((folder, folder.canonicalize().ok()?)))?;
    // No link is among folders that are still to be made, so that `..` is the one before.
    let mut place = real;
    for part in whole.strip_prefix(there).ok()?.components() {
        match part {
            Component::ParentDir => drop(place.pop()),
            part => place.push(part),
        }
    }
    Some(place)
}

/// Refuses an output that is one of the files read, under whatever path.
///
/// # Errors
/// Names the output, and the input where its name is another.
pub fn check_not_an_input(
    path: &Path,
    inputs: impl IntoIterator<Item = impl AsRef<Path>>,
) -> Result<()> {
    let same = |read: &_| {
        let read = AsRef::<Path>::as_ref(read);
        file_id(read).is_some() && is_same_file(path, read)
    };
    let Some(read) = inputs.into_iter().find(same) else {
        return Ok(());
    };
    let alias = match read.as_ref() {
        read if read == path => String::new(),
        read => format!(" (as {})", read.display()),
    };
    Err(of_file(
        path,
        format!("is also an input{alias}; expected the name of another file"),
    ))
}

/// Refuses two outputs of one run that are the same file.
///
/// # Errors
/// Names the file.
pub fn check_distinct(a: (&str, &Path), b: (&str, &Path)) -> Result<()> {
    match is_same_file(a.1, b.1) {
        true => Err(of_file(
            a.1,
            format!("is {} and {} at once; expected two files", a.0, b.0),
        )),
        false => Ok(()),
    }
}

/// Refuses early a folder of reports that could not be made, and one that holds a
/// report of another kind, recognized by a file that only that one has.
///
/// # Errors
/// Names the folder, or what is in its place.
pub fn check_report_folder(path: &Path, other: (&str, &str)) -> Result<()> {
    let fail = |why: String| of_file(path, why);
    if path.exists() && !path.is_dir() {
        return Err(fail("is a file; expected a folder".into()));
    }
    let (file, kind) = other;
    if path.join(file).exists() {
        return Err(fail(format!(
            "holds {kind} ({file}); expected a folder of its own"
        )));
    }
    // The nearest folder that is there takes the others.
    let there = path.ancestors().find(|a| a.exists());
    let there = there.unwrap_or(Path::new("."));
    check_writable(&there.join("report.html"))
}

/// Makes a folder and those that it lies in.
///
/// # Errors
/// Names the folder; wrong input where the path cannot be that of a folder of this account.
pub fn make_folder(path: &Path) -> Result<()> {
    use std::io::ErrorKind::{
        AlreadyExists, InvalidFilename, InvalidInput, NotADirectory, PermissionDenied,
        ReadOnlyFilesystem,
    };
    let Err(e) = std::fs::create_dir_all(path) else {
        return Ok(());
    };
    match e.kind() {
        AlreadyExists | InvalidFilename | InvalidInput | NotADirectory | PermissionDenied
        | ReadOnlyFilesystem => Err(of_io(path, &e)),
        _ => Err(e).with_context(|| format!("cannot write {}", path.display())),
    }
}

/// Names with "or" before the last.
pub fn or_list(names: &[impl AsRef<str>]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match &names[..] {
        [before @ .., last] if !before.is_empty() => format!("{} or {last}", before.join(", ")),
        names => names.concat(),
    }
}

/// Refuses a name that has none of these endings.
///
/// # Errors
/// Names the file and the endings.
pub fn check_ending(path: &Path, endings: &[&str]) -> Result<()> {
    let has = |own: &std::ffi::OsStr| endings.iter().any(|e| own.eq_ignore_ascii_case(e));
    if path.extension().is_some_and(has) {
        return Ok(());
    }
    let endings: Vec<String> = endings.iter().map(|e| format!(".{e}")).collect();
    let why = format!("expected a name that ends in {}", or_list(&endings));
    Err(of_file(path, why))
}

/// Refuses early what could not be written in the end.
///
/// # Errors
/// The folder does not exist, is none or takes no files; the path names a
/// folder, a device or a pipe.
pub fn check_writable(path: &Path) -> Result<()> {
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(of_file(
            path,
            format!("the folder {} does not exist", folder.display()),
        ));
    }
    if path.is_dir() {
        return Err(of_file(path, "is a folder; expected the name of a file"));
    }
    refuse_special(path)?;
    // A name that the system cannot take, such as a longer one than it allows.
    match std::fs::symlink_metadata(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            return Err(of_io(path, &e));
        }
        _ => {}
    }
    // Only writing shows whether the folder takes files: its mode does not tell.
    match temporary_file(path) {
        Ok(_) => Ok(()),
        Err(e) => Err(of_file(
            path,
            format!(
                "cannot write in {}: {}",
                folder.display(),
                io_message(&without_path(e))
            ),
        )),
    }
}

/// The error of the system alone; `tempfile` adds the path of its own file.
fn without_path(e: std::io::Error) -> std::io::Error {
    let code = e.get_ref().and_then(|inner| {
        let source = std::error::Error::source(inner)?;
        source.downcast_ref::<std::io::Error>()?.raw_os_error()
    });
    match code {
        Some(code) => std::io::Error::from_raw_os_error(code),
        // Newer versions show the system's words themselves, and then the path.
        None => match e.to_string().split_once(" at path ") {
            Some((words, _)) => std::io::Error::new(e.kind(), words.to_owned()),
            None => e,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_testing::file_names;

    #[test]
    fn a_failed_write_leaves_nothing_and_files_of_a_set_appear_together() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let text =
            |text: &'static str| move |out: &mut dyn SeekWrite| Ok(out.write_all(text.as_bytes())?);
        write_file(&path("old"), text("kept")).unwrap();
        let failed = write_file(&path("old"), |out| {
            out.write_all(b"half")?;
            anyhow::bail!("the disk is full")
        });
        let words = format!("{:#}", failed.unwrap_err());
        assert!(words.ends_with("old: the disk is full"), "{words}");
        assert_eq!(std::fs::read(path("old")).unwrap(), b"kept");
        assert_eq!(file_names(folder.path()), ["old"]);
        // The second of two fails: the first does not appear either.
        let file = |name: &str, fails: bool| -> (PathBuf, WriteFile<'_>) {
            let write = move |out: &mut dyn SeekWrite| match fails {
                true => anyhow::bail!("the disk is full"),
                false => Ok(out.write_all(b"new")?),
            };
            (path(name), Box::new(write))
        };
        let failed = write_files(vec![file("old", false), file("b", true)]);
        assert!(failed.is_err());
        assert_eq!(file_names(folder.path()), ["old"]);
        assert_eq!(std::fs::read(path("old")).unwrap(), b"kept");
        write_files(vec![file("old", false), file("b", false)]).unwrap();
        assert_eq!(file_names(folder.path()), ["b", "old"]);
        assert_eq!(std::fs::read(path("old")).unwrap(), b"new");
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_what_a_living_one_writes_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out.exr");
        let left = folder.path().join("out.exr.a1B2c3D4e5F6.tmp");
        std::fs::write(&left, "half").unwrap();
        let foreign = folder.path().join("out.exr.notes.tmp");
        std::fs::write(&foreign, "of the user").unwrap();
        let living = temporary_file(&out).unwrap();
        write_file(&out, |_| Ok(())).unwrap();
        assert!(!left.exists());
        assert!(living.path().exists() && foreign.exists() && out.exists());
    }

    #[cfg(unix)]
    #[test]
    fn an_output_is_not_an_input_under_any_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("sky.exr"), "").unwrap();
        std::fs::write(path("other.exr"), "").unwrap();
        std::fs::hard_link(path("sky.exr"), path("hard.exr")).unwrap();
        std::os::unix::fs::symlink("sky.exr", path("soft.exr")).unwrap();
        let inputs = [path("sky.exr")];
        for name in ["sky.exr", "hard.exr", "soft.exr", "./sky.exr"] {
            let refused = check_not_an_input(&path(name), &inputs);
            assert!(refused.is_err(), "{name}");
        }
        for name in ["other.exr", "new.exr"] {
            check_not_an_input(&path(name), &inputs).unwrap();
        }
        // Neither is there yet.
        let twice = |a: &str, b: &str| {
            check_distinct(("the checkpoint", &path(a)), ("the picture", &path(b)))
        };
        assert!(twice("./x.exr", "x.exr").is_err());
        twice("x.exr", "y.exr").unwrap();
        // Nor are their folders.
        for other in ["new/out/x.exr", "new/./out/x.exr", "new/../new/out/x.exr"] {
            assert!(twice("new/out/x.exr", other).is_err(), "{other}");
        }
        twice("new/out/x.exr", "new/x.exr").unwrap();
    }
}
