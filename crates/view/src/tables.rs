//! Values in TOML that keeps its comments.

use organza_scene::InputError;
use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

/// The tables `[[key]]` of a document, made if there are none.
pub(crate) fn tables_mut<'a>(
    document: &'a mut DocumentMut,
    key: &str,
) -> Result<&'a mut toml_edit::ArrayOfTables, InputError> {
    let item = document
        .entry(key)
        .or_insert_with(|| Item::ArrayOfTables(toml_edit::ArrayOfTables::new()));
    if let Item::Value(Value::Array(_)) = item {
        // `light = [{ ... }]`, as no file of ours writes it.
        let list = std::mem::take(item).into_array_of_tables();
        *item = list.map_or_else(|old| old, Item::ArrayOfTables);
    }
    item.as_array_of_tables_mut()
        .ok_or_else(|| InputError::new(format!("expected [[{key}]] tables")).at_key(key))
}

/// Sets a value, in tables that are made where there are none.
pub(crate) fn set(table: &mut dyn TableLike, keys: &[&str], value: Value) -> Result<(), String> {
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
pub(crate) fn remove(table: &mut dyn TableLike, folder: &[&str], key: &str) {
    let Some((first, rest)) = folder.split_first() else {
        table.remove(key);
        return;
    };
    if let Some(inner) = table.get_mut(first).and_then(Item::as_table_like_mut) {
        remove(inner, rest, key);
    }
}
