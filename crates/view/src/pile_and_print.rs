//! The `[pile]` and `[print]` of a fabric, which a page makes and removes as a whole.

use crate::document::FabricDocument;
use crate::tables::set;
use organza_scene::{InputError, draft_folder};
use std::path::Path;
use toml_edit::{Array, Item, Value};

/// Kinds of pile that the page offers, each with the keys that it needs and that a page makes.
const KINDS: [(&str, &[&str]); 3] = [
    ("cut", &["every"]),
    ("loop", &["every"]),
    ("wale", &["every", "wales_per_cm"]),
];
/// Keys that belong to some kinds alone.
const OF_A_KIND: [&str; 6] = [
    "tufts_per_cm2",
    "sides",
    "collide",
    "turn_deg",
    "wales_per_cm",
    "wale_width",
];
/// A pile that the page makes: a low velvet (estimated).
const HEIGHT_MM: f64 = 1.2;
const EVERY: [i64; 2] = [2, 2];
/// Ridges of a corduroy that the page makes (estimated).
const WALES_PER_CM: f64 = 4.5;

/// Gives a fabric a pile of a kind, or takes its pile away where the kind is empty. What an
/// older pile has in common with it stays.
///
/// # Errors
/// There is no such kind, or `[pile]` is no table.
pub(crate) fn set_pile(fabric: &mut FabricDocument, kind: &str) -> Result<(), InputError> {
    if kind.is_empty() {
        fabric.text.remove("pile");
        return Ok(());
    }
    let Some((_, needed)) = KINDS.iter().find(|(name, _)| *name == kind) else {
        let names = KINDS.map(|(name, _)| name).join(", ");
        let why = format!("expected one of {names}, found {kind:?}");
        return Err(InputError::new(why).at_key("pile.kind"));
    };
    let yarn = first_yarn(fabric);
    let table = fabric.text.entry("pile").or_insert_with(toml_edit::table);
    let table = table
        .as_table_like_mut()
        .ok_or_else(|| InputError::keyed("pile: expected a table"))?;
    if table.get("kind").and_then(Item::as_str) == Some(kind) {
        return Ok(());
    }
    for key in OF_A_KIND {
        table.remove(key);
    }
    let made = [
        ("yarn", Value::from(yarn)),
        ("height_mm", HEIGHT_MM.into()),
        ("every", EVERY.into_iter().collect::<Array>().into()),
        ("wales_per_cm", WALES_PER_CM.into()),
    ];
    set(table, &["kind"], kind.into()).map_err(InputError::keyed)?;
    for (key, value) in made {
        let is_needed = ["yarn", "height_mm"].contains(&key) || needed.contains(&key);
        if is_needed && !table.contains_key(key) {
            set(table, &[key], value).map_err(InputError::keyed)?;
        }
    }
    Ok(())
}

/// The yarn that a pile takes where none is named: that of the first end.
fn first_yarn(fabric: &FabricDocument) -> String {
    let named = fabric.text.get("warp").and_then(|warp| warp.get("yarn"));
    let first = match named.and_then(Item::as_value) {
        Some(Value::Array(list)) => list.get(0).and_then(Value::as_str),
        Some(name) => name.as_str(),
        None => None,
    };
    let own = fabric.text.get("yarn").and_then(Item::as_table_like);
    let only = own.and_then(|own| own.iter().next().map(|(name, _)| name));
    first.or(only).unwrap_or("cotton").to_owned()
}

/// Prints a picture of the folder on a fabric, or takes its print away where the name is empty.
///
/// # Errors
/// There is no such picture, or `[print]` is no table.
pub(crate) fn set_print(
    fabric: &mut FabricDocument,
    folder: &Path,
    image: &str,
) -> Result<(), InputError> {
    if image.is_empty() {
        fabric.text.remove("print");
        return Ok(());
    }
    let image = draft_folder::picture_named_from(&fabric.path, folder, image)?;
    let why = |why: String| InputError::new(why).at_key("print.image");
    if let Some(print) = fabric
        .text
        .get_mut("print")
        .and_then(Item::as_table_like_mut)
    {
        print.remove("colour");
    }
    set(
        fabric.text.as_table_mut(),
        &["print", "image"],
        image.into(),
    )
    .map_err(why)
}
