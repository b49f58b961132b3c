//! What is saved: the scene, its changed fabrics, dropped drafts, and the picture.

use crate::document::{Document, FabricDocument};
use crate::edit::rename_fabric;
use organza_picture::{Attributes, Display, Rendered, WriteSeek, exr, png};
use organza_transport::Film;
use std::path::{Path, PathBuf};
use toml_edit::Item;

/// A file that is written when all others of its set can be.
pub struct SavedFile<'a> {
    /// Where it goes.
    pub path: PathBuf,
    /// Writes it.
    pub write: WriteFile<'a>,
}

/// What writes one file; the error says what failed.
pub type WriteFile<'a> = Box<dyn FnOnce(&mut dyn WriteSeek) -> Result<(), String> + 'a>;

/// Writes files that belong together, the first of which stands for all.
pub type WriteFiles<'a> = dyn Fn(Vec<SavedFile<'_>>) -> Result<(), String> + Sync + 'a;

/// Characters of a name at most.
const MAX_NAME: usize = 60;

/// Refuses a name that files cannot have everywhere.
///
/// # Errors
/// Says what a name is made of.
pub fn check_name(name: &str) -> Result<(), String> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty()
        || name.len() > MAX_NAME
        || !name.chars().all(is_plain)
        || name.starts_with('-')
    {
        return Err(format!(
            "the name: expected 1 to {MAX_NAME} letters, digits, _ or -, found {name:?}"
        ));
    }
    Ok(())
}

/// Saves a document and its picture as `NAME.toml`, `NAME.png`, `NAME.exr`, and fabrics and
/// drafts that no file holds beside them. Files of earlier saves are replaced, `own` says
/// which; others are not. Returns the names of the files.
///
/// # Errors
/// A file that is already there, or cannot be written.
pub fn save(
    document: &Document,
    name: &str,
    film: &Film,
    display: Display,
    own: &dyn Fn(&Path) -> bool,
    write: &WriteFiles<'_>,
) -> Result<Vec<String>, String> {
    check_name(name)?;
    let mut document = document.clone();
    let texts = texts(&mut document, name);
    let at = |name: &str| document.folder.join(name);
    let attributes: Attributes = [
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("scene", format!("{name}.toml")),
    ]
    .into_iter()
    .collect();
    let rendered = Rendered::new(film, display, &attributes);
    let mut files: Vec<SavedFile<'_>> = texts
        .into_iter()
        .map(|(file, bytes)| SavedFile {
            path: at(&file),
            write: Box::new(move |out| out.write_all(&bytes).map_err(|e| e.to_string())),
        })
        .collect();
    for format in [png::FORMAT, exr::FORMAT] {
        if let (Some(writer), Some(ending)) = (format.writer, format.endings.first()) {
            files.push(SavedFile {
                path: at(&format!("{name}.{ending}")),
                write: Box::new(move |out| writer(&rendered, out).map_err(|e| e.to_string())),
            });
        }
    }
    if let Some(there) = files.iter().find(|f| f.path.exists() && !own(&f.path)) {
        return Err(format!(
            "{} is already there; choose another name",
            document.in_words(&there.path.display().to_string())
        ));
    }
    let names = files.iter().map(|f| crate::document::file_name(&f.path));
    let names: Vec<String> = names.collect();
    write(files)?;
    Ok(names)
}

/// The texts of a document under a new name: the scene first. Names in them are changed to
/// those of the files.
fn texts(document: &mut Document, name: &str) -> Vec<(String, Vec<u8>)> {
    let mut beside = Vec::new();
    let scene = &mut document.scene;
    for (i, fabric) in document.fabrics.iter_mut().enumerate() {
        if !fabric.is_changed {
            continue;
        }
        let number = match i {
            0 => String::new(),
            i => format!("_{}", i + 1),
        };
        if let Some((old, bytes)) = &fabric.dropped
            && draft_name(fabric).as_deref() == Some(old)
        {
            let wif = format!("{name}{number}.wif");
            beside.push((wif.clone(), bytes.to_vec()));
            set_draft_name(fabric, "wif", &wif);
        } else {
            for key in ["wif", "curves"] {
                rebase(fabric, key);
            }
        }
        let file = format!("{name}_fabric{number}.toml");
        rename_fabric(scene, &fabric.name, &file);
        beside.push((file, fabric.text.to_string().into_bytes()));
    }
    let scene = (
        format!("{name}.toml"),
        document.scene.to_string().into_bytes(),
    );
    std::iter::once(scene).chain(beside).collect()
}

fn draft_name(fabric: &FabricDocument) -> Option<String> {
    let draft = fabric.text.get("draft")?.as_table_like()?;
    Some(draft.get("wif")?.as_str()?.to_owned())
}

fn set_draft_name(fabric: &mut FabricDocument, key: &str, name: &str) {
    let draft = fabric
        .text
        .get_mut("draft")
        .and_then(Item::as_table_like_mut);
    if let Some(Item::Value(value)) = draft.and_then(|draft| draft.get_mut(key)) {
        *value = name.into();
    }
}

/// A file that a fabric names beside itself, as the scene's folder sees it.
fn rebase(fabric: &mut FabricDocument, key: &str) {
    let draft = fabric.text.get("draft").and_then(Item::as_table_like);
    let named = draft.and_then(|draft| Some(draft.get(key)?.as_str()?.to_owned()));
    let folder = Path::new(&fabric.name).parent().map(Path::to_owned);
    if let (Some(named), Some(folder)) = (named, folder) {
        let name = folder.join(named).display().to_string();
        set_draft_name(fabric, key, &name);
    }
}
