//! The drafts and pictures of one folder, for those who may read nothing outside it.

use crate::error::InputError;
use std::path::{Component, Path};

/// Files of the folder that are looked at, and files that are listed, at most.
const MAX_FILES: usize = 10_000;
const MAX_LISTED: usize = 500;

/// The drafts (`.wif`) of a folder, in the order of their names.
pub fn drafts(folder: &Path) -> Vec<String> {
    listed(folder, |name| name.to_ascii_lowercase().ends_with(".wif"))
}

/// The pictures of a folder that can be printed on cloth, in the order of their names.
pub fn pictures(folder: &Path) -> Vec<String> {
    listed(folder, is_picture)
}

/// Whether a name ends as those of pictures that can be read.
fn is_picture(name: &str) -> bool {
    let ending = Path::new(name).extension().and_then(|e| e.to_str());
    let format = ending.and_then(organza_picture::format_of_ending);
    format.is_some_and(|format| format.reader.is_some())
}

fn listed(folder: &Path, is_meant: impl Fn(&str) -> bool) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let names = entries
        .take(MAX_FILES)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names
        .filter(|name| is_meant(name))
        .filter(|name| is_inside(folder, name))
        .collect();
    names.sort();
    names.truncate(MAX_LISTED);
    names
}

/// Whether a name is that of a file that lies in the folder itself, links followed.
fn is_inside(folder: &Path, name: &str) -> bool {
    let (Ok(folder), Ok(file)) = (folder.canonicalize(), folder.join(name).canonicalize()) else {
        return false;
    };
    is_plain_name(name) && file.parent() == Some(folder.as_path()) && file.is_file()
}

/// A draft of the folder, as a fabric of this path names it.
///
/// # Errors
/// There is no such file in the folder.
pub fn named_from(fabric: &Path, folder: &Path, name: &str) -> Result<String, InputError> {
    file_named_from(fabric, folder, name, "draft")
}

/// A picture of the folder, as a fabric of this path names it.
///
/// # Errors
/// There is no such picture in the folder.
pub fn picture_named_from(fabric: &Path, folder: &Path, name: &str) -> Result<String, InputError> {
    if !is_picture(name) {
        let expected = organza_picture::Format::list_endings(|f| f.reader.is_some());
        return Err(InputError::of_file(
            name,
            format!("expected a picture ({expected})"),
        ));
    }
    file_named_from(fabric, folder, name, "picture")
}

fn file_named_from(
    fabric: &Path,
    folder: &Path,
    name: &str,
    what: &str,
) -> Result<String, InputError> {
    if !is_inside(folder, name) {
        return Err(InputError::of_file(
            name,
            format!("there is no such {what} in {}", folder.display()),
        ));
    }
    let beside = fabric.parent().unwrap_or(Path::new(""));
    if beside == folder {
        return Ok(name.to_owned());
    }
    let whole = folder.join(name).canonicalize();
    let whole = whole.map_err(|e| InputError::of_file(name, e))?;
    Ok(whole.display().to_string())
}

/// Whether a name is that of a file of a folder, and not of one elsewhere.
fn is_plain_name(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let is_one = matches!(parts.next(), Some(Component::Normal(_))) && parts.next().is_none();
    is_one && name.len() <= 255 && !name.contains(['/', '\\', '\0']) && !name.starts_with('.')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drafts_outside_the_folder_do_not_exist() {
        let scenes = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes");
        let folder = Path::new(scenes).join("drafts");
        assert_eq!(drafts(&folder), ["first_light.wif"]);
        let from = folder.join("fabric.toml");
        let named = |name: &str| named_from(&from, &folder, name);
        assert_eq!(named("first_light.wif").unwrap(), "first_light.wif");
        for name in [
            "../drafts/first_light.wif",
            "./first_light.wif",
            "/etc/passwd",
            "..",
            ".",
            "",
            "first_light.wif/",
            "first_light.wif\0",
            "..\\first_light.wif",
            "none.wif",
        ] {
            let refused = named(name).unwrap_err().to_string();
            assert!(
                refused.contains("there is no such draft"),
                "{name}: {refused}"
            );
        }
        let elsewhere = named_from(
            &Path::new(scenes).join("a.toml"),
            &folder,
            "first_light.wif",
        );
        assert!(Path::new(&elsewhere.unwrap()).is_absolute());
    }

    #[test]
    fn pictures_are_listed_by_their_endings() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["rose.PNG", "field.exr", "notes.txt", "draft.wif"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        assert_eq!(pictures(folder.path()), ["field.exr", "rose.PNG"]);
        let from = folder.path().join("fabric.toml");
        let named = |name: &str| picture_named_from(&from, folder.path(), name);
        assert_eq!(named("rose.PNG").unwrap(), "rose.PNG");
        for (name, words) in [
            ("notes.txt", "expected a picture (.exr, .png"),
            ("../rose.PNG", "there is no such picture"),
            ("lily.png", "there is no such picture"),
        ] {
            let refused = named(name).unwrap_err().to_string();
            assert!(refused.contains(words), "{name}: {refused}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_of_the_folder_are_no_drafts() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("inner");
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(outer.path().join("secret.wif"), "").unwrap();
        std::fs::write(folder.join("own.wif"), "").unwrap();
        std::fs::create_dir(folder.join("folder.wif")).unwrap();
        let link =
            |to: &str, name: &str| std::os::unix::fs::symlink(to, folder.join(name)).unwrap();
        link("../secret.wif", "out.wif");
        link("own.wif", "in.wif");
        assert_eq!(drafts(&folder), ["in.wif", "own.wif"]);
        assert!(named_from(&folder.join("a.toml"), &folder, "out.wif").is_err());
    }
}
