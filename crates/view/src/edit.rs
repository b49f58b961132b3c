//! Changes that a page asks for: which keys it may set, to what, and how TOML is changed
//! without losing its comments.

use crate::document::Document;
use organza_scene::InputError;
use organza_scene::fabric_file::FabricFile;
use organza_scene::file_kind::Wanted;
use organza_scene::read;
use organza_scene::scene_build;
use organza_scene::scene_file::SceneFile;
use serde::Deserialize;
use std::path::{Component, Path};
use toml_edit::{Array, DocumentMut, Item, Table, TableLike, Value};

/// Pixels along an edge of a picture of the page at most.
pub const MAX_PIXELS: i64 = 4096;
/// Changes in one request at most.
pub const MAX_EDITS: usize = 64;
/// Lights at most.
const MAX_LIGHTS: usize = 32;
/// Colours of a system of threads at most.
const MAX_COLOURS: usize = 256;

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

/// What a key holds.
#[derive(Clone, Copy, Debug)]
enum Holds {
    /// A finite number.
    Number,
    /// A whole number of a range.
    Whole(i64, i64),
    /// So many finite numbers.
    Numbers(usize),
    /// Two whole numbers of a range.
    Size(i64, i64),
    /// Linear colours.
    Colours,
    /// One of these words.
    Word(&'static [&'static str]),
    /// `auto`, `volume`, `surface` or a level.
    Level,
}
use Holds::*;

const SCENE_KEYS: &[(&[&str], Holds)] = &[
    (&["render", "spp"], Whole(1, 65_536)),
    (&["render", "exposure"], Number),
    (&["render", "seed"], Whole(0, i64::MAX)),
    (&["render", "max_bounces"], Whole(0, 1_000_000)),
    (&["camera", "origin_mm"], Numbers(3)),
    (&["camera", "target_mm"], Numbers(3)),
    (&["camera", "up"], Numbers(3)),
    (&["camera", "width_mm"], Number),
    (&["camera", "fov_deg"], Number),
    (&["camera", "focus_mm"], Number),
    (&["camera", "f_number"], Number),
    (&["camera", "aperture_mm"], Number),
    (&["camera", "resolution"], Size(1, MAX_PIXELS)),
    (&["light", "#", "direction"], Numbers(3)),
    (&["light", "#", "irradiance"], Numbers(3)),
    (&["light", "#", "radiance"], Numbers(3)),
    (&["light", "#", "intensity"], Numbers(3)),
    (&["light", "#", "position_mm"], Numbers(3)),
    (&["light", "#", "half_angle_deg"], Number),
    (&["light", "#", "falloff_deg"], Number),
    (&["light", "#", "corner_mm"], Numbers(3)),
    (&["light", "#", "edge_u_mm"], Numbers(3)),
    (&["light", "#", "edge_v_mm"], Numbers(3)),
    (&["light", "#", "scale"], Number),
    (&["light", "#", "rotation_deg"], Number),
    (
        &["light", "#", "hemisphere"],
        Word(&["all", "front", "back"]),
    ),
    (&["object", "#", "lod"], Level),
    (&["object", "#", "tolerance"], Number),
    (&["object", "#", "voxel_um"], Number),
];

const PRESETS: &[&str] = &organza_weave::preset::NAMES;

const FABRIC_KEYS: &[(&[&str], Holds)] = &[
    (&["warp", "per_cm"], Number),
    (&["weft", "per_cm"], Number),
    (&["warp", "colours"], Colours),
    (&["weft", "colours"], Colours),
    (&["draft", "wales_per_cm"], Number),
    (&["yarn", "*", "preset"], Word(PRESETS)),
    (&["yarn", "*", "tex"], Number),
    (&["yarn", "*", "plies"], Whole(1, 64)),
    (&["yarn", "*", "aspect"], Number),
    (&["yarn", "*", "fibre_radius_um"], Number),
    (&["yarn", "*", "twist", "direction"], Word(&["S", "Z"])),
    (&["yarn", "*", "twist", "turns_per_m"], Number),
    (&["yarn", "*", "twist", "angle_deg"], Number),
    (&["yarn", "*", "ply_twist", "direction"], Word(&["S", "Z"])),
    (&["yarn", "*", "ply_twist", "turns_per_m"], Number),
    (&["yarn", "*", "ply_twist", "angle_deg"], Number),
    (&["seed"], Whole(0, i64::MAX)),
    (&["tile", "repeats"], Size(1, 64)),
];

/// Keys that a new value makes void: the same said in other terms.
const REPLACED: &[(&str, &str)] = &[
    ("per_cm", "spacing_mm"),
    ("turns_per_m", "angle_deg"),
    ("angle_deg", "turns_per_m"),
    ("f_number", "aperture_mm"),
    ("aperture_mm", "f_number"),
    ("tex", "fibres_per_ply"),
];

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

fn fail<T>(why: impl Into<String>) -> Outcome<T> {
    Err(InputError(why.into()))
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

/// Whether a change only moves the camera.
pub fn moves_camera(edit: &Edit) -> bool {
    match edit {
        Edit::Scene { key, .. } => key.first().is_some_and(|first| first == "camera"),
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
    let why = |why| InputError(format!("{}: render.{why}", path.display()));
    file.render.check().map_err(why)?;
    scene_build::check(&file, path, &document.loader(None))?;
    for fabric in &document.fabrics {
        let text = fabric.text.to_string();
        let _: FabricFile = read::toml_changed(&fabric.path, &text, &[], &[], Wanted::Fabric)?;
    }
    Ok(())
}

fn apply(document: &mut Document, edit: &Edit) -> Outcome {
    match edit {
        Edit::Scene { key, value } => set_allowed(&mut document.scene, SCENE_KEYS, key, value),
        Edit::Fabric { fabric, key, value } => {
            let fabric = fabric_mut(document, *fabric)?;
            fabric.is_changed = true;
            set_allowed(&mut fabric.text, FABRIC_KEYS, key, value)
        }
        Edit::Model { object, model } => set_model(&mut document.scene, *object, model),
        Edit::Draft { fabric, draft } => set_draft(document, *fabric, draft),
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

fn fabric_mut(
    document: &mut Document,
    fabric: usize,
) -> Outcome<&mut crate::document::FabricDocument> {
    let count = document.fabrics.len();
    document.fabrics.get_mut(fabric).ok_or_else(|| {
        InputError(format!(
            "fabric {fabric} does not exist; there are {count}, from 0"
        ))
    })
}

/// The tables `[[key]]` of a document, made if there are none.
fn tables_mut<'a>(
    document: &'a mut DocumentMut,
    key: &str,
) -> Outcome<&'a mut toml_edit::ArrayOfTables> {
    let item = document
        .entry(key)
        .or_insert_with(|| Item::ArrayOfTables(toml_edit::ArrayOfTables::new()));
    if let Item::Value(Value::Array(_)) = item {
        // `light = [{ ... }]`, as no file of ours writes it.
        let list = std::mem::take(item).into_array_of_tables();
        *item = list.map_or_else(|old| old, Item::ArrayOfTables);
    }
    item.as_array_of_tables_mut()
        .ok_or_else(|| InputError(format!("{key}: expected [[{key}]] tables")))
}

fn set_allowed(
    document: &mut DocumentMut,
    allowed: &[(&[&str], Holds)],
    key: &[String],
    value: &serde_json::Value,
) -> Outcome {
    let shown = key.join(".");
    let mut known = allowed.iter().filter(|(pattern, _)| matches(pattern, key));
    let Some((_, first)) = known.clone().next() else {
        return fail(format!("{shown}: this key cannot be set from the page"));
    };
    let Some(value) = known.find_map(|(_, holds)| value_of(*holds, value)) else {
        return fail(format!(
            "{shown}: expected {}, found {value}",
            described(*first)
        ));
    };
    let keys: Vec<&str> = key.iter().map(String::as_str).collect();
    if let Some((last, folder)) = keys.split_last() {
        for (_, old) in REPLACED.iter().filter(|(new, _)| new == last) {
            remove(document.as_table_mut(), folder, old);
        }
    }
    set(document.as_table_mut(), &keys, value).map_err(|why| InputError(format!("{shown}: {why}")))
}

fn matches(pattern: &[&str], key: &[String]) -> bool {
    let one = |(pattern, key): (&&str, &String)| match *pattern {
        "#" => key.len() < 6 && key.parse::<usize>().is_ok(),
        "*" => !key.is_empty() && key.len() <= 64,
        name => name == key,
    };
    pattern.len() == key.len() && pattern.iter().zip(key).all(one)
}

fn described(holds: Holds) -> String {
    match holds {
        Number => "a number".into(),
        Whole(least, most) => format!("a whole number from {least} to {most}"),
        Numbers(count) => format!("a list of {count} numbers"),
        Size(least, most) => format!("two whole numbers from {least} to {most}"),
        Colours => format!("from 1 to {MAX_COLOURS} colours of three numbers"),
        Word(words) => format!("one of {}", words.join(", ")),
        Level => "auto, volume, surface or a level from 0".into(),
    }
}

/// A value as TOML, if it is what a key holds.
fn value_of(holds: Holds, value: &serde_json::Value) -> Option<Value> {
    let number = |value: &serde_json::Value| value.as_f64().filter(|x| x.is_finite()).map(rounded);
    let whole = |value: &serde_json::Value, least, most| {
        value.as_i64().filter(|n| (least..=most).contains(n))
    };
    let numbers = |value: &serde_json::Value, count| {
        let list = value.as_array().filter(|list| list.len() == count)?;
        list.iter().map(number).collect::<Option<Array>>()
    };
    Some(match holds {
        Number => number(value)?.into(),
        Whole(least, most) => whole(value, least, most)?.into(),
        Numbers(count) => numbers(value, count)?.into(),
        Size(least, most) => {
            let list = value.as_array().filter(|list| list.len() == 2)?;
            let sizes = list.iter().map(|n| whole(n, least, most));
            sizes.collect::<Option<Array>>()?.into()
        }
        Colours => {
            let list = value.as_array()?;
            if !(1..=MAX_COLOURS).contains(&list.len()) {
                return None;
            }
            let colours = list
                .iter()
                .map(|colour| Some(Value::from(numbers(colour, 3)?)));
            colours.collect::<Option<Array>>()?.into()
        }
        Word(words) => {
            let word = value.as_str().filter(|word| words.contains(word))?;
            word.into()
        }
        Level => match value.as_str() {
            Some(name @ ("auto" | "volume" | "surface")) => name.into(),
            Some(_) => return None,
            None => whole(value, 0, 255)?.into(),
        },
    })
}

/// Nine digits: what a person sets, without the noise of the page's arithmetic.
fn rounded(x: f64) -> f64 {
    format!("{x:.9e}").parse().unwrap_or(x)
}

/// Sets a value, in tables that are made where there are none.
fn set(table: &mut dyn TableLike, keys: &[&str], value: Value) -> Result<(), String> {
    match keys {
        [] => Err("expected a key".into()),
        [last] => {
            match table.get_mut(last) {
                Some(Item::Value(old)) => {
                    let decor = old.decor().clone();
                    *old = value;
                    *old.decor_mut() = decor;
                }
                _ => {
                    table.insert(last, Item::Value(value));
                }
            }
            Ok(())
        }
        [list, index, rest @ ..] if index.parse::<usize>().is_ok() && !rest.is_empty() => {
            let at: usize = index.parse().unwrap_or(usize::MAX);
            let missing = || format!("there is no [[{list}]] number {index}");
            match table.get_mut(list).ok_or_else(missing)? {
                Item::ArrayOfTables(tables) => {
                    set(tables.get_mut(at).ok_or_else(missing)?, rest, value)
                }
                Item::Value(Value::Array(tables)) => {
                    let table = tables.get_mut(at).and_then(Value::as_inline_table_mut);
                    set(table.ok_or_else(missing)?, rest, value)
                }
                _ => Err(missing()),
            }
        }
        [key, rest @ ..] => {
            if !table.contains_key(key) {
                let mut made = Table::new();
                // Without a header of its own where it holds tables alone.
                made.set_implicit(rest.len() > 1);
                table.insert(key, Item::Table(made));
            }
            let inner = table.get_mut(key).and_then(Item::as_table_like_mut);
            set(
                inner.ok_or_else(|| format!("`{key}` is not a table"))?,
                rest,
                value,
            )
        }
    }
}

/// Removes a key of a table, if both are there.
fn remove(table: &mut dyn TableLike, folder: &[&str], key: &str) {
    let Some((first, rest)) = folder.split_first() else {
        table.remove(key);
        return;
    };
    if let Some(inner) = table.get_mut(first).and_then(Item::as_table_like_mut) {
        remove(inner, rest, key);
    }
}

fn object_mut(scene: &mut DocumentMut, object: usize) -> Outcome<&mut Table> {
    let objects = tables_mut(scene, "object")?;
    let count = objects.len();
    objects.get_mut(object).ok_or_else(|| {
        InputError(format!(
            "object {object} does not exist; there are {count}, from 0"
        ))
    })
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
    set(table, &["model"], model.into()).map_err(InputError)
}

/// Whether a name is that of a file of a folder, and not of one elsewhere.
pub fn is_plain_name(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let is_one = matches!(parts.next(), Some(Component::Normal(_))) && parts.next().is_none();
    is_one && name.len() <= 255 && !name.contains(['/', '\\', '\0']) && !name.starts_with('.')
}

fn set_draft(document: &mut Document, fabric: usize, draft: &str) -> Outcome {
    let is_file = draft.to_ascii_lowercase().ends_with(".wif");
    let folder = document.folder.clone();
    let fabric = fabric_mut(document, fabric)?;
    let dropped = fabric
        .dropped
        .as_ref()
        .is_some_and(|(name, _)| name == draft);
    let (key, value) = match is_file {
        true if dropped => ("wif", draft.to_owned()),
        true => (
            "wif",
            crate::folder::named_from(&fabric.path, &folder, draft)?,
        ),
        false if draft.len() <= 64 => {
            let named = organza_weave::Draft::named(draft);
            named.map_err(|e| InputError(e.to_string()))?;
            ("weave", draft.to_owned())
        }
        false => return fail("draft.weave: expected the name of a weave"),
    };
    let table = fabric.text.entry("draft").or_insert_with(toml_edit::table);
    let table = table
        .as_table_like_mut()
        .ok_or_else(|| InputError("draft: expected a table".into()))?;
    let others = [
        "weave",
        "wif",
        "drawdown",
        "knit",
        "curves",
        "wales_per_cm",
        "curve_unit_mm",
        "curves_are",
    ];
    for other in others.iter().filter(|other| **other != key) {
        table.remove(other);
    }
    fabric.is_changed = true;
    set(table, &[key], value.into()).map_err(InputError)
}

fn add_light(scene: &mut DocumentMut, kind: &str) -> Outcome {
    let keys = match kind {
        "directional" => "direction = [-0.5, -0.3, -0.8]\nirradiance = [1.0, 1.0, 1.0]",
        "environment" => "radiance = [0.3, 0.3, 0.3]",
        "rectangle" => {
            "corner_mm = [-20.0, 20.0, 60.0]\nedge_u_mm = [0.0, -40.0, 0.0]\n\
             edge_v_mm = [40.0, 0.0, 0.0]\nradiance = [2.0, 2.0, 2.0]\ntwo_sided = true"
        }
        "spot" => "position_mm = [0.0, 0.0, 60.0]\nintensity = [4000.0, 4000.0, 4000.0]",
        _ => {
            return fail(format!(
                "light: expected directional, environment, rectangle or spot, found {kind:?}"
            ));
        }
    };
    let made: DocumentMut = format!("kind = \"{kind}\"\n{keys}\n")
        .parse()
        .map_err(|e: toml_edit::TomlError| InputError(e.to_string()))?;
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
