//! A document as pages see it: its values, and what they can be changed to.

use crate::document::{Document, FabricDocument};
use organza_scene::draft_folder;
use organza_scene::representation::REPRESENTATIONS;
use organza_scene::scene_file::LightTable;
use organza_weave::{preset, spinning};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use toml_edit::DocumentMut;

/// Weaves that the page offers; any other name can be typed.
const WEAVES: [&str; 14] = [
    "plain",
    "twill-2-1",
    "twill-2-2",
    "twill-3-1",
    "twill-3-1-s",
    "satin-5-2",
    "satin-8-3",
    "sateen-8-3",
    "basket-2-2",
    "herringbone-2-2-8",
    "warp-rib-2",
    "weft-rib-2",
    "double-plain-8-8",
    "weft-backed-8-3",
];

/// A document of a revision, and how many steps can be undone and done again.
pub fn document(document: &Document, revision: u64, [undo, redo]: [usize; 2]) -> Value {
    let models = REPRESENTATIONS
        .iter()
        .map(|r| json!({ "name": r.name, "title": r.title, "about": r.about }));
    json!({
        "revision": revision,
        "title": document.title(),
        "undo": undo,
        "redo": redo,
        "scene": table(&document.scene),
        "fabrics": document.fabrics.iter().map(fabric).collect::<Vec<_>>(),
        "models": models.collect::<Vec<_>>(),
        "weaves": WEAVES,
        "presets": preset::NAMES,
        "irregularities": spinning::NAMES,
        "finishes": spinning::FINISHES,
        "lights": LightTable::kinds().iter().map(|(name, _)| name).collect::<Vec<_>>(),
        "drafts": draft_folder::drafts(&document.folder),
        "pictures": draft_folder::pictures(&document.folder),
    })
}

/// TOML as JSON. Dates, which no key of ours holds, become text.
fn table(text: &DocumentMut) -> Value {
    let parsed = toml::from_str::<toml::Table>(&text.to_string());
    parsed
        .ok()
        .and_then(|table| serde_json::to_value(table).ok())
        .unwrap_or_default()
}

fn fabric(fabric: &FabricDocument) -> Value {
    let table = table(&fabric.text);
    json!({
        "name": fabric.name,
        "is_changed": fabric.is_changed,
        "dropped": fabric.dropped.as_ref().map(|(name, _)| name),
        "yarns": yarns(&table),
        "table": table,
    })
}

/// Every yarn that a fabric names, with the values that hold for it: its own, and those of
/// its preset.
fn yarns(fabric: &Value) -> Value {
    let mut names: BTreeSet<String> = BTreeSet::new();
    if let Some(own) = fabric["yarn"].as_object() {
        names.extend(own.keys().cloned());
    }
    for system in ["warp", "weft"] {
        match &fabric[system]["yarn"] {
            // One name, or runs such as `8 cotton, 1 slub`.
            Value::String(text) => {
                let runs = text
                    .split(',')
                    .filter_map(|run| run.split_whitespace().last());
                names.extend(runs.map(str::to_owned));
            }
            Value::Array(list) => {
                names.extend(
                    list.iter()
                        .filter_map(|name| Some(name.as_str()?.to_owned())),
                );
            }
            _ => {}
        }
    }
    if names.is_empty() {
        names.insert("cotton".into());
    }
    let yarns = names.into_iter().map(|name| {
        let values = yarn(&name, &fabric["yarn"][&name]);
        (name, values)
    });
    Value::Object(yarns.collect::<Map<_, _>>())
}

fn yarn(name: &str, own: &Value) -> Value {
    let chosen = own["preset"].as_str().unwrap_or(name);
    let preset = preset::preset(chosen).or_else(|| preset::preset("cotton"));
    let mut values = preset
        .and_then(|preset| serde_json::to_value(preset.spec).ok())
        .unwrap_or_else(|| json!({}));
    if let (Some(values), Some(own)) = (values.as_object_mut(), own.as_object()) {
        values.extend(own.iter().map(|(key, value)| (key.clone(), value.clone())));
    }
    if values["preset"].is_null() {
        values["preset"] = match preset::NAMES.contains(&name) {
            true => name.into(),
            false => "cotton".into(),
        };
    }
    values
}
