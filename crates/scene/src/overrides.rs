//! `--set key.path=value`: overrides of the keys of a TOML file.

use crate::error::{InputError, Result};
use crate::toml_reader;
use serde::de::DeserializeOwned;

/// Names in a key at most. The deepest key of a scene has seven
/// (`object.0.optics.cotton.fitted.colour_r.0`); tables nest as deep as a key has
/// names, and each level takes stack where they are read and dropped.
const MAX_KEYS: usize = 16;

/// Checks overrides against a text that is known to be right.
///
/// # Errors
/// Names the flag.
pub fn check_overrides<T: DeserializeOwned>(source: &str, overrides: &[String]) -> Result<()> {
    let table = toml::from_str(source).map_err(InputError::new)?;
    overridden::<T>(table, &[], overrides)?.map(|_| ())
}

/// The outer error is an override that cannot be applied, the inner one what came
/// of all of them.
pub(crate) fn overridden<T: DeserializeOwned>(
    mut table: toml::Table,
    removed: &[String],
    overrides: &[String],
) -> Result<Result<T>> {
    for o in overrides {
        apply_override(&mut table, o)?;
    }
    for key in removed {
        remove(&mut table, key);
    }
    Ok(toml_reader::from_table(table).map_err(|e| {
        InputError::after_option("set", format!("{}: {e}", overrides.join(" --set ")))
    }))
}

/// Applies `key.path=value` to a table; numbers name elements of arrays.
fn apply_override(table: &mut toml::Table, text: &str) -> Result<()> {
    let fail = |why: String| InputError::after_option("set", format!("{text}: {why}"));
    let (path, value) = text
        .split_once('=')
        .ok_or_else(|| fail("expected key.path=value".into()))?;
    // A bare word is a string: --set render.integrator=regular.
    let value = toml::from_str::<toml::Table>(&format!("v = {value}"))
        .ok()
        .and_then(|mut t| t.remove("v"))
        .unwrap_or_else(|| toml::Value::String(value.to_owned()));
    let keys: Vec<&str> = path.split('.').map(str::trim).collect();
    if keys.len() > MAX_KEYS {
        let found = keys.len();
        return Err(InputError::of_option(
            "set",
            format!("a key of at most {MAX_KEYS} names, found one of {found}"),
        ));
    }
    let (Some((last, folders)), false) = (keys.split_last(), keys.contains(&"")) else {
        return Err(fail("expected key.path=value".into()));
    };
    let mut whole = toml::Value::Table(std::mem::take(table));
    let mut at = &mut whole;
    for (i, key) in folders.iter().enumerate() {
        at = match at {
            toml::Value::Table(t) => t
                .entry(*key)
                .or_insert_with(|| toml::Value::Table(toml::Table::new())),
            other => element(other, &keys, i).map_err(fail)?,
        };
    }
    match at {
        toml::Value::Table(t) => {
            t.insert((*last).to_owned(), value);
        }
        other => *element(other, &keys, folders.len()).map_err(fail)? = value,
    }
    if let toml::Value::Table(whole) = whole {
        *table = whole;
    }
    Ok(())
}

/// Removes the value at `key.path`, if there is one.
fn remove(table: &mut toml::Table, path: &str) {
    let (folders, last) = path.rsplit_once('.').unwrap_or(("", path));
    let mut folders = folders.split('.').filter(|f| !f.is_empty());
    let at = folders.try_fold(table, |t, key| t.get_mut(key)?.as_table_mut());
    if let Some(table) = at {
        table.remove(last);
    }
}

/// The element of a list that `keys[i]` names.
fn element<'a>(
    value: &'a mut toml::Value,
    keys: &[&str],
    i: usize,
) -> Result<&'a mut toml::Value, String> {
    let (before, rest) = keys.split_at(i);
    let (before, key) = (before.join("."), rest.first().copied().unwrap_or_default());
    let toml::Value::Array(list) = value else {
        return Err(format!("`{key}` lies inside a value that is not a table"));
    };
    let count = list.len();
    let Ok(index) = key.parse::<usize>() else {
        return Err(format!(
            "`{before}` is a list of {count}; write {before}.0.{}",
            rest.join(".")
        ));
    };
    list.get_mut(index).ok_or_else(|| {
        format!("`{key}` is not an element of `{before}`; there are {count}, from 0")
    })
}
