//! Changes that a page asks for: which keys it may set, to what, and how TOML is changed
//! without losing its comments.

use crate::document::{Document, FabricDocument};
use crate::keys::{FABRIC_KEYS, SCENE_KEYS, set_allowed};
use crate::pile_and_print::{set_pile, set_print};
use crate::tables::{set, tables_mut};
use organza_scene::file_kind::Wanted;
use organza_scene::scene_file::{LightTable, SceneFile};
use organza_scene::{InputError, draft_folder, read, scene_build};
use serde::Deserialize;
use std::fmt::Display;
use toml_edit::{DocumentMut, Item, Table};

/// Changes in one request at most.
pub const MAX_EDITS: usize = 64;
/// Lights at most.
const MAX_LIGHTS: usize = 32;

/// A change.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "op", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Edit {
    /// Sets a key of the scene: names and indices, outermost first.
    Scene {
        /// The key.
        key: Vec<String>,
        /// Its new value.
        value: serde_json::Value,
    },
    /// Sets a key of a fabric.
    Fabric {
        /// Which of the document's fabrics.
        fabric: usize,
        /// The key.
        key: Vec<String>,
        /// Its new value.
        value: serde_json::Value,
    },
    /// Shows a cloth by another representation, or `auto`.
    Model {
        /// Which of the scene's objects.
        object: usize,
        /// The representation's name.
        model: String,
    },
    /// Weaves a fabric by a named weave, or by a draft of the folder.
    Draft {
        /// Which of the document's fabrics.
        fabric: usize,
        /// The weave's name, or the name of a `.wif` file.
        draft: String,
    },
    /// Gives a fabric a pile, or takes it away.
    Pile {
        /// Which of the document's fabrics.
        fabric: usize,
        /// `cut`, `loop` or `wale`; empty for none.
        kind: String,
    },
    /// Prints a picture on a fabric, or takes its print away.
    Print {
        /// Which of the document's fabrics.
        fabric: usize,
        /// The name of a picture of the folder; empty for none.
        image: String,
    },
    /// Adds a light of a kind.
    AddLight {
        /// `directional`, `environment`, `rectangle` or `spot`.
        kind: String,
    },
    /// Removes a light.
    RemoveLight {
        /// Which.
        light: usize,
    },
}

/// Keys of a cloth that belong to single representations, or that `auto` decides.
const OF_A_MODEL: &[&str] = &[
    "flake",
    "event",
    "local_visibility",
    "first_events",
    "while_weight",
    "tolerance",
    "lod",
    "voxel_um",
];

type Outcome<T = ()> = Result<T, InputError>;

fn fail<T>(why: impl Display) -> Outcome<T> {
    Err(InputError::keyed(why))
}

/// A document after changes, which are all made or none.
///
/// # Errors
/// Names the key that cannot be set, or the place of the value that is wrong.
pub fn changed(document: &Document, edits: &[Edit]) -> Outcome<Document> {
    if edits.len() > MAX_EDITS {
        return fail(format!(
            "expected at most {MAX_EDITS} changes, found {}",
            edits.len()
        ));
    }
    let mut document = document.clone();
    for edit in edits {
        apply(&mut document, edit)?;
    }
    check(&document)?;
    Ok(document)
}

/// Keys of a camera that moving it sets.
const OF_A_MOVE: [&str; 5] = ["origin_mm", "target_mm", "up", "width_mm", "focus_mm"];

/// Whether a change only moves the camera.
pub fn moves_camera(edit: &Edit) -> bool {
    match edit {
        Edit::Scene { key, .. } => match &key[..] {
            [table, name] => table == "camera" && OF_A_MOVE.contains(&name.as_str()),
            _ => false,
        },
        _ => false,
    }
}

/// Refuses a document whose files cannot be read.
///
/// # Errors
/// Names the file, the place and the key.
pub fn check(document: &Document) -> Outcome {
    let (path, text) = (&document.scene_path, document.scene.to_string());
    let file: SceneFile = read::toml_changed(path, &text, &[], &[], Wanted::Scene)?;
    let why = |why| InputError::keyed(format!("render.{why}")).in_file(path);
    file.render.check().map_err(why)?;
    scene_build::check(&file, path, &document.loader(None))?;
    for fabric in &document.fabrics {
        fabric.read()?;
    }
    Ok(())
}

fn apply(document: &mut Document, edit: &Edit) -> Outcome {
    match edit {
        Edit::Scene { key, value } => set_allowed(&mut document.scene, SCENE_KEYS, key, value),
        Edit::Fabric { fabric, key, value } => {
            let fabric = changed_fabric(document, *fabric)?;
            set_allowed(&mut fabric.text, FABRIC_KEYS, key, value)
        }
        Edit::Model { object, model } => set_model(&mut document.scene, *object, model),
        Edit::Draft { fabric, draft } => set_draft(document, *fabric, draft),
        Edit::Pile { fabric, kind } => set_pile(changed_fabric(document, *fabric)?, kind),
        Edit::Print { fabric, image } => {
            let folder = document.folder.clone();
            set_print(changed_fabric(document, *fabric)?, &folder, image)
        }
        Edit::AddLight { kind } => add_light(&mut document.scene, kind),
        Edit::RemoveLight { light } => {
            let lights = tables_mut(&mut document.scene, "light")?;
            if *light >= lights.len() {
                return fail(format!(
                    "light {light} does not exist; there are {}",
                    lights.len()
                ));
            }
            lights.remove(*light);
            Ok(())
        }
    }
}

/// A fabric that is to be changed.
fn changed_fabric(document: &mut Document, number: usize) -> Outcome<&mut FabricDocument> {
    let count = document.fabrics.len();
    let fabric = document.fabrics.get_mut(number);
    let fabric = fabric.ok_or_else(|| missing("fabric", number, count))?;
    fabric.is_changed = true;
    Ok(fabric)
}

fn missing(what: &str, number: usize, count: usize) -> InputError {
    InputError::new(format!(
        "{what} {number} does not exist; there are {count}, from 0"
    ))
}

fn object_mut(scene: &mut DocumentMut, object: usize) -> Outcome<&mut Table> {
    let objects = tables_mut(scene, "object")?;
    let count = objects.len();
    let table = objects.get_mut(object);
    table.ok_or_else(|| missing("object", object, count))
}

fn set_model(scene: &mut DocumentMut, object: usize, model: &str) -> Outcome {
    use organza_scene::representation::{REPRESENTATIONS, Representation};
    if model != "auto" && Representation::named(model).is_none() {
        let names: Vec<&str> = REPRESENTATIONS.iter().map(|r| r.name).collect();
        return fail(format!(
            "object.{object}.model: expected auto, {}, found {model:?}",
            names.join(", ")
        ));
    }
    let table = object_mut(scene, object)?;
    if table.get("kind").and_then(Item::as_str) != Some("cloth") {
        return fail(format!("object.{object}.model: the object is no cloth"));
    }
    OF_A_MODEL.iter().for_each(|key| {
        table.remove(key);
    });
    set(table, &["model"], model.into()).map_err(InputError::keyed)
}

fn set_draft(document: &mut Document, fabric: usize, draft: &str) -> Outcome {
    let is_file = draft.to_ascii_lowercase().ends_with(".wif");
    let folder = document.folder.clone();
    let fabric = changed_fabric(document, fabric)?;
    let dropped = fabric
        .dropped
        .as_ref()
        .is_some_and(|(name, _)| name == draft);
    let (key, value) = match is_file {
        true if dropped => ("wif", draft.to_owned()),
        true => (
            "wif",
            draft_folder::named_from(&fabric.path, &folder, draft)?,
        ),
        false if draft.len() <= 64 => {
            let named = organza_weave::Draft::named(draft);
            named?;
            ("weave", draft.to_owned())
        }
        false => return fail("draft.weave: expected the name of a weave"),
    };
    let table = fabric.text.entry("draft").or_insert_with(toml_edit::table);
    let table = table
        .as_table_like_mut()
        .ok_or_else(|| InputError::keyed("draft: expected a table"))?;
    let others = [
        "weave",
        "wif",
        "drawdown",
        "knit",
        "curves",
        "wales_per_cm",
        "curve_unit_mm",
        "curve_tile_mm",
        "curves_are",
    ];
    for other in others.iter().filter(|other| **other != key) {
        table.remove(other);
    }
    set(table, &[key], value.into()).map_err(InputError::keyed)
}

fn add_light(scene: &mut DocumentMut, kind: &str) -> Outcome {
    let kinds = LightTable::kinds();
    let Some((_, keys)) = kinds.iter().find(|(name, _)| *name == kind) else {
        let names: Vec<&str> = kinds.iter().map(|(name, _)| *name).collect();
        let names = names.join(", ");
        return fail(format!("light: expected one of {names}, found {kind:?}"));
    };
    let made: DocumentMut = format!("kind = \"{kind}\"\n{keys}\n")
        .parse()
        .map_err(|e: toml_edit::TomlError| InputError::new(e))?;
    let lights = tables_mut(scene, "light")?;
    if lights.len() >= MAX_LIGHTS {
        return fail(format!("light: expected at most {MAX_LIGHTS}"));
    }
    lights.push(made.as_table().clone());
    Ok(())
}

/// Gives a fabric another name in every cloth of the scene.
pub(crate) fn rename_fabric(scene: &mut DocumentMut, old: &str, new: &str) {
    let Ok(objects) = tables_mut(scene, "object") else {
        return;
    };
    for object in objects.iter_mut() {
        if object.get("fabric").and_then(Item::as_str) == Some(old) {
            let _ = set(object, &["fabric"], new.into());
        }
    }
}
