//! Folders of files that belong together: they appear together or not at all.

use crate::output::{WriteFile, make_folder, write_files};
use anyhow::{Context, Result};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Ending of a folder that is filled before it gets its name.
const TEMPORARY: &str = ".tmp";

/// File in such a folder that is locked while a run fills it.
const LOCK: &str = "lock";

/// Entries of a folder that are looked through for what killed runs left.
const MAX_NAMES: usize = 100_000;

/// Writes files, by their paths within a folder. A new folder is filled under a temporary name
/// and appears whole. In a folder that is there, and not empty, the files get their names when
/// all of them are on the disk; the first one, which stands for all, is removed before and
/// appears last.
///
/// # Errors
/// Names the folder or the file; no part of a new folder is left.
pub fn write_folder(path: &Path, files: &[(String, Vec<u8>)]) -> Result<()> {
    let is_empty = |path: &Path| std::fs::read_dir(path).is_ok_and(|mut e| e.next().is_none());
    // A link to a folder, or a path without a name of its own, keeps its place.
    let is_named = path.file_name().is_some() && !path.is_symlink();
    if path.exists() && !(is_named && is_empty(path)) {
        return replace(path, files);
    }
    let cannot = || format!("cannot write {}", path.display());
    let parent = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    make_folder(parent)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let prefix = name.chars().take(48).collect::<String>() + ".";
    remove_left_over(parent, &prefix);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(TEMPORARY).rand_bytes(12);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o777)); // less the umask
    }
    let temporary = builder.tempdir_in(parent).with_context(cannot)?;
    let lock_path = temporary.path().join(LOCK);
    let lock = File::create(&lock_path).with_context(cannot)?;
    let _ = lock.try_lock();
    for (name, bytes) in files {
        let place = temporary.path().join(name);
        if let Some(folder) = place.parent() {
            std::fs::create_dir_all(folder).with_context(cannot)?;
        }
        let mut file = File::create(&place).with_context(cannot)?;
        file.write_all(bytes).with_context(cannot)?;
        file.sync_all().with_context(cannot)?;
    }
    std::fs::remove_file(&lock_path).with_context(cannot)?;
    if path.exists() {
        std::fs::remove_dir(path).with_context(cannot)?;
    }
    std::fs::rename(temporary.path(), path).with_context(cannot)?;
    // It has another name now, so that there is nothing to remove.
    let _ = temporary.keep();
    Ok(())
}

fn replace(path: &Path, files: &[(String, Vec<u8>)]) -> Result<()> {
    let mut list: Vec<(PathBuf, WriteFile<'_>)> = Vec::new();
    for (name, bytes) in files {
        let place = path.join(name);
        if let Some(folder) = place.parent() {
            make_folder(folder)?;
        }
        let write = move |out: &mut dyn crate::output::SeekWrite| {
            out.write_all(bytes).context("writing failed")
        };
        list.push((place, Box::new(write)));
    }
    write_files(list).map(|_| ())
}

/// Removes the temporary folders that killed runs left: those whose lock no process holds.
fn remove_left_over(parent: &Path, prefix: &str) {
    let Ok(names) = std::fs::read_dir(parent) else {
        return;
    };
    for entry in names.take(MAX_NAMES).flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let middle = name.strip_prefix(prefix);
        let middle = middle.and_then(|rest| rest.strip_suffix(TEMPORARY));
        let is_ours = middle.is_some_and(|m| m.len() == 12 && m.chars().all(char::is_alphanumeric));
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if is_ours && is_folder {
            let lock = File::options().write(true).open(entry.path().join(LOCK));
            if lock.is_ok_and(|f| f.try_lock().is_ok()) {
                let _ = std::fs::remove_dir_all(entry.path());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_testing::file_names;

    fn files(text: &str) -> Vec<(String, Vec<u8>)> {
        let file = |name: &str| (name.to_owned(), text.as_bytes().to_vec());
        vec![file("a.json"), file("inside/b.png")]
    }

    #[test]
    fn a_folder_appears_whole_and_left_over_ones_are_removed() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        let left = root.path().join("out.a1B2c3D4e5F6.tmp");
        std::fs::create_dir(&left).unwrap();
        std::fs::write(left.join(LOCK), "").unwrap();
        std::fs::write(left.join("half"), "").unwrap();
        let foreign = root.path().join("out.notes.tmp");
        std::fs::create_dir(&foreign).unwrap();
        write_folder(&out, &files("one")).unwrap();
        assert_eq!(file_names(root.path()), ["out", "out.notes.tmp"]);
        assert_eq!(file_names(&out), ["a.json", "inside"]);
        // Files of the user beside those of an earlier run stay.
        std::fs::write(out.join("mine"), "").unwrap();
        write_folder(&out, &files("two")).unwrap();
        assert_eq!(file_names(&out), ["a.json", "inside", "mine"]);
        assert_eq!(std::fs::read(out.join("inside/b.png")).unwrap(), b"two");
    }

    #[test]
    fn a_file_that_cannot_be_written_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        let mut list = files("one");
        list.push(("a.json/c".to_owned(), Vec::new()));
        assert!(write_folder(&out, &list).is_err());
        assert!(file_names(root.path()).is_empty());
    }
}
