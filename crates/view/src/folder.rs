//! The folder that a page may read drafts from: nothing outside it.

use crate::edit::is_plain_name;
use organza_scene::InputError;
use std::path::Path;

/// Files of the folder that are looked at, and drafts that are listed, at most.
const MAX_FILES: usize = 10_000;
const MAX_DRAFTS: usize = 500;

/// The drafts (`.wif`) of a folder, in the order of their names.
pub fn drafts(folder: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let names = entries
        .take(MAX_FILES)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names
        .filter(|name| name.to_ascii_lowercase().ends_with(".wif"))
        .filter(|name| is_inside(folder, name))
        .collect();
    names.sort();
    names.truncate(MAX_DRAFTS);
    names
}

/// Whether a name is that of a file that lies in the folder itself, links followed.
fn is_inside(folder: &Path, name: &str) -> bool {
    let (Ok(folder), Ok(file)) = (folder.canonicalize(), folder.join(name).canonicalize()) else {
        return false;
    };
    is_plain_name(name) && file.parent() == Some(folder.as_path()) && file.is_file()
}

/// A file of the folder, as a fabric of this path names it.
///
/// # Errors
/// There is no such file in the folder.
pub fn named_from(fabric: &Path, folder: &Path, name: &str) -> Result<String, InputError> {
    if !is_inside(folder, name) {
        return Err(InputError(format!(
            "{name}: there is no such draft in {}",
            folder.display()
        )));
    }
    let beside = fabric.parent().unwrap_or(Path::new(""));
    if beside == folder {
        return Ok(name.to_owned());
    }
    let whole = folder.join(name).canonicalize();
    let whole = whole.map_err(|e| InputError(format!("{name}: {e}")))?;
    Ok(whole.display().to_string())
}
