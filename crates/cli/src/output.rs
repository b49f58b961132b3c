//! Output files appear under their final name only when complete.

use anyhow::{Context, Result};
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

/// Where a file is written before it is renamed: in the same folder, so that
/// the rename cannot cross a file system.
fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    path.with_file_name(name)
}

/// Removes the partial file when writing did not come to its end.
struct Partial(Option<PathBuf>);

impl Partial {
    /// Gives the file its name.
    fn complete(mut self, path: &Path) -> Result<()> {
        if let Some(temporary) = &self.0 {
            std::fs::rename(temporary, path)
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        self.0 = None;
        Ok(())
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if let Some(path) = self.0.take() {
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Writes a file through `write`, flushes it to the disk and gives it its name.
///
/// # Errors
/// Names the file; nothing is left behind.
pub fn write_file(path: &Path, write: impl FnOnce(&mut dyn SeekWrite) -> Result<()>) -> Result<()> {
    let partial = write_partial(path, write)?;
    partial.complete(path)
}

/// Writes a file under its temporary name and flushes it to the disk.
fn write_partial(
    path: &Path,
    write: impl FnOnce(&mut dyn SeekWrite) -> Result<()>,
) -> Result<Partial> {
    let cannot = || format!("cannot write {}", path.display());
    refuse_special(path)?;
    let temporary = partial_path(path);
    // Left by a killed process of the same number, if it is there. Never
    // followed, should it be a link that someone else put in its place.
    let _ = std::fs::remove_file(&temporary);
    let file = File::create_new(&temporary).with_context(cannot)?;
    let partial = Partial(Some(temporary));
    let mut out = BufWriter::new(file);
    write(&mut out).with_context(cannot)?;
    let file = out
        .into_inner()
        .map_err(std::io::IntoInnerError::into_error)
        .with_context(cannot)?;
    file.sync_all().with_context(cannot)?;
    Ok(partial)
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
        let partial = write_partial(&path, write)?;
        written.push((path, partial));
    }
    if let [(first, _), _, ..] = &written[..]
        && first.exists()
    {
        std::fs::remove_file(first)
            .with_context(|| format!("cannot replace {}", first.display()))?;
    }
    let paths = written.iter().map(|(path, _)| path.clone()).collect();
    for (path, partial) in written.into_iter().rev() {
        partial.complete(&path)?;
    }
    Ok(paths)
}

/// What encoders need of a file.
pub trait SeekWrite: Write + Seek {}
impl<T: Write + Seek> SeekWrite for T {}

/// Devices and pipes keep their place: a rename would put a file there instead.
fn refuse_special(path: &Path) -> Result<()> {
    match std::fs::metadata(path) {
        Ok(about) if !about.is_file() && !about.is_dir() => Err(crate::error::input(format!(
            "{}: is a device or a pipe; expected the name of a file",
            path.display()
        ))),
        _ => Ok(()),
    }
}

/// Writes to the standard output. A reader that is gone has seen enough.
///
/// # Errors
/// Whatever else the output refuses: a full disk.
pub fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write to the standard output"),
    }
}

/// A line on the standard error, for whoever still listens.
macro_rules! note {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($words)*);
    }};
}
pub(crate) use note;

/// Refuses a name to write that is a file to read.
///
/// # Errors
/// Names the file.
pub fn check_not_an_input(path: &Path, inputs: &[impl AsRef<Path>]) -> Result<()> {
    let Ok(there) = path.canonicalize() else {
        return Ok(()); // what is not there is not read
    };
    let is_it =
        |input: &&_| AsRef::<Path>::as_ref(*input).canonicalize().ok().as_ref() == Some(&there);
    match inputs.iter().find(is_it) {
        Some(_) => Err(crate::error::input(format!(
            "{}: is also an input; expected the name of another file",
            path.display()
        ))),
        None => Ok(()),
    }
}

/// Refuses early a folder of reports that could not be made, and one that holds a
/// report of another kind, recognized by a file that only that one has.
///
/// # Errors
/// Names the folder, or what is in its place.
pub fn check_report_folder(path: &Path, other: (&str, &str)) -> Result<()> {
    let fail = |why: String| crate::error::input(format!("{}: {why}", path.display()));
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

/// Refuses early what could not be written in the end.
///
/// # Errors
/// The folder does not exist, is none or takes no files; the path names a
/// folder, a device or a pipe.
pub fn check_writable(path: &Path) -> Result<()> {
    let folder = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(crate::error::input(format!(
            "{}: the folder {} does not exist",
            path.display(),
            folder.display()
        )));
    }
    if path.is_dir() {
        return Err(crate::error::input(format!(
            "{}: is a folder; expected the name of a file",
            path.display()
        )));
    }
    refuse_special(path)?;
    // The folder itself is asked, for its mode does not tell all.
    let probe = partial_path(path);
    let _ = std::fs::remove_file(&probe);
    match File::create_new(&probe) {
        Ok(_) => Ok(std::fs::remove_file(&probe)?),
        Err(e) => Err(crate::error::input(format!(
            "{}: cannot write in {}: {}",
            path.display(),
            folder.display(),
            organza_scene::read::io_words(&e)
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A set is replaced as a whole: where one file fails, the old ones stay.
    #[test]
    fn files_of_a_set_are_replaced_together() {
        let name = format!("organza-output-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).unwrap();
        let set = |text: &'static str, fails: bool| {
            let files = ["a", "b"].map(|name| {
                let write = move |out: &mut dyn SeekWrite| {
                    anyhow::ensure!(!(fails && name == "b"), "full");
                    Ok(out.write_all(text.as_bytes())?)
                };
                (folder.join(name), Box::new(write) as WriteFile<'_>)
            });
            write_files(files.into())
        };
        let held = || ["a", "b"].map(|n| std::fs::read_to_string(folder.join(n)).unwrap());
        assert_eq!(set("old", false).unwrap().len(), 2);
        assert_eq!(held(), ["old", "old"]);
        assert!(set("new", true).is_err());
        assert_eq!(held(), ["old", "old"]);
        set("new", false).unwrap();
        assert_eq!(held(), ["new", "new"]);
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 2);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
