//! Folders of tests.

use std::path::Path;

/// The names of the entries of a folder, sorted.
///
/// # Panics
/// When the folder cannot be read or a name is not UTF-8.
pub fn file_names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("the folder can be read");
    let mut names: Vec<String> = entries
        .map(|entry| entry.expect("the folder can be read").file_name())
        .map(|name| name.into_string().expect("the name is UTF-8"))
        .collect();
    names.sort();
    names
}
