//! The document that a file becomes: a scene as it stands, a fabric or a draft in a scene
//! made for it.

use crate::document::{Document, FabricDocument, file_name};
use crate::made_fabric;
use organza_scene::bare_fabric::DraftName;
use organza_scene::file_kind::Wanted;
use organza_scene::loader::Loader;
use organza_scene::read::{self, beside};
use organza_scene::scene_file::{self, is_scene};
use organza_scene::studio::{self, Studio, Subject};
use organza_scene::{InputError, fabric_file, subject};
use std::path::Path;
use std::sync::Arc;
use toml_edit::DocumentMut;

/// Reads a scene, a fabric, a draft (`.wif`) or a named weave, with `key.path=value` overrides,
/// which apply to scenes and fabrics.
///
/// # Errors
/// Names the file, the place and the key at fault.
pub fn open(path: &Path, overrides: &[String]) -> Result<Document, InputError> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => ".".into(),
    };
    if let Some(bare) = subject::draft_of(path, &Loader::new())? {
        if let Some(why) = overrides.first() {
            let why = format!("{why}: a draft has no keys; name a fabric or a scene");
            return Err(InputError::after_option("set", why));
        }
        let name = file_name(path);
        let (named, stem) = match bare.is_file {
            true => (DraftName::Wif(&name), path.with_extension("")),
            false => (DraftName::Weave(&name), path.to_owned()),
        };
        let made = folder.join(format!("{}.toml", file_name(&stem)));
        return around(made_fabric::made(&made, named, &bare.draft)?, &folder);
    }
    let path = &folder.join(path.file_name().unwrap_or_default());
    if is_scene(path)? {
        return of_scene(path, overrides);
    }
    let text = changed_text(path, overrides, Wanted::Fabric)?;
    around(
        FabricDocument {
            name: file_name(path),
            path: path.clone(),
            text,
            dropped: None,
            is_changed: !overrides.is_empty(),
        },
        &folder,
    )
}

/// The text of a TOML file with overrides; comments stay where there are none.
fn changed_text(
    path: &Path,
    overrides: &[String],
    wanted: Wanted,
) -> Result<DocumentMut, InputError> {
    let loader = Loader::new();
    let source = loader.text_of(path, wanted)?;
    let table: toml::Table = read::toml_changed(path, &source, &[], overrides, wanted)?;
    let text = match overrides {
        [] => source,
        _ => toml::to_string(&table).map_err(|e| fault(path, &e.to_string()))?,
    };
    text.parse()
        .map_err(|e: toml_edit::TomlError| fault(path, &e.to_string()))
}

fn fault(path: &Path, why: &str) -> InputError {
    InputError::of_file(path, why)
}

fn of_scene(path: &Path, overrides: &[String]) -> Result<Document, InputError> {
    let loader = Loader::new();
    let file = scene_file::load(path, overrides, &loader)?;
    file.camera(path)?;
    organza_scene::scene_build::check(&file, path, &loader)?;
    let mut document = Document {
        folder: path.parent().unwrap_or(Path::new(".")).to_owned(),
        scene_path: path.to_owned(),
        scene: changed_text(path, overrides, Wanted::Scene)?,
        fabrics: Vec::new(),
    };
    for object in &file.object {
        let organza_scene::object::ObjectTable::Cloth(cloth) = object else {
            continue;
        };
        if document.fabric_named(&cloth.fabric).is_some() {
            continue;
        }
        let fabric_path = beside(path, &cloth.fabric);
        fabric_file::load(&fabric_path, &[], &loader)?;
        document.fabrics.push(FabricDocument {
            name: cloth.fabric.clone(),
            text: changed_text(&fabric_path, &[], Wanted::Fabric)?,
            path: fabric_path,
            dropped: None,
            is_changed: false,
        });
    }
    Ok(document)
}

/// The document of a fabric in a scene that is made for it.
fn around(fabric: FabricDocument, folder: &Path) -> Result<Document, InputError> {
    let stem = fabric.path.file_stem().unwrap_or_default();
    let scene_path = folder.join(format!("{}_scene.toml", stem.to_string_lossy()));
    let mut document = Document {
        folder: folder.to_owned(),
        scene_path,
        scene: DocumentMut::new(),
        fabrics: vec![fabric],
    };
    let [fabric] = &document.fabrics[..] else {
        return Ok(document);
    };
    let loader = document.loader(None);
    let cloth = fabric_file::load(&fabric.path, &[], &loader)?;
    let repeat = cloth.cloth.draft().map(|draft| {
        let repeat = draft.smallest_repeat();
        [repeat.ends(), repeat.picks()]
    });
    let shown = Subject {
        fabric: &fabric.name,
        cloth: &cloth,
        repeat,
    };
    let text = studio::scene(Studio::default(), &shown)?.text;
    let parsed = text.parse().map_err(|e: toml_edit::TomlError| {
        let why = format!("a scene for it cannot be made: {e}");
        fault(&fabric.path, &why)
    })?;
    document.scene = parsed;
    Ok(document)
}

/// A fabric for a dropped draft that takes the place of `old`.
///
/// # Errors
/// The bytes are no draft, or no cloth can be woven from it.
pub fn of_dropped(
    old: &FabricDocument,
    stem: &str,
    bytes: &[u8],
) -> Result<FabricDocument, InputError> {
    // No file of these names is made: files get their names when they are saved.
    let name = format!("{stem}.wif");
    let path = old.path.with_file_name(format!("{stem}_dropped.toml"));
    let mut made = made_fabric::of_draft(&path, &name, bytes)?;
    let in_scene = Path::new(&old.name).with_file_name(file_name(&path));
    made.name = in_scene.display().to_string();
    made.dropped = Some((name, Arc::from(bytes)));
    Ok(made)
}

/// The document with another fabric in the place of one of its own.
///
/// # Errors
/// There is no such fabric.
pub fn with_fabric(
    document: &Document,
    fabric: usize,
    new: FabricDocument,
) -> Result<Document, InputError> {
    let mut document = document.clone();
    let count = document.fabrics.len();
    let Some(slot) = document.fabrics.get_mut(fabric) else {
        let why = format!("fabric {fabric} does not exist; the scene has {count}, from 0");
        return Err(InputError::new(why));
    };
    let old = std::mem::replace(slot, new);
    let name = slot.name.clone();
    crate::edit::rename_fabric(&mut document.scene, &old.name, &name);
    Ok(document)
}
