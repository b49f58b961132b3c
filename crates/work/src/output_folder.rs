//! Folders of files that belong together: they appear together or not at all.

use crate::output::{WriteFile, folder_of, make_folder, temporary_prefix, write_files};
use anyhow::{Context, Result};
use organza_cache::temporary::{self, TemporaryFolder};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

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
    let (parent, prefix) = (folder_of(path), temporary_prefix(path));
    make_folder(parent)?;
    temporary::remove_left_over(parent, &prefix);
    let folder = TemporaryFolder::new(parent, &prefix).with_context(cannot)?;
    for (name, bytes) in files {
        let place = folder.path().join(name);
        if let Some(folder) = place.parent() {
            std::fs::create_dir_all(folder).with_context(cannot)?;
        }
        let mut file = File::create(&place).with_context(cannot)?;
        file.write_all(bytes).with_context(cannot)?;
        file.sync_all().with_context(cannot)?;
    }
    folder.complete(path).with_context(cannot)
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
        std::fs::write(left.join("lock"), "").unwrap();
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
