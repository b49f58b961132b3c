//! TOML files as JSON, from which Python makes dictionaries.

use crate::errors::input;
use organza_scene::InputError;
use organza_scene::fabric_file::FabricFile;
use organza_scene::file_kind::Wanted;
use organza_scene::loader::Loader;
use organza_scene::scene_file::{SceneFile, is_scene_text};
use pyo3::prelude::*;
use std::fmt::Write as _;
use std::path::PathBuf;
use toml::{Table, Value};

/// Reads a scene or fabric file, or `text` in its place, and checks its keys and their types.
/// Returns which of them it is, "scene" or "fabric", and its table as JSON text in which
/// infinite numbers are allowed.
pub fn read_toml(
    py: Python<'_>,
    path: PathBuf,
    text: Option<Vec<u8>>,
) -> PyResult<(&'static str, String)> {
    let found = py.detach(|| {
        let mut loader = Loader::new();
        if let Some(text) = text {
            loader.give(&path, text);
        }
        let text = loader.text_of(&path, Wanted::Either)?;
        let is_scene = is_scene_text(&path, &text)?;
        let kind = if is_scene {
            let _: SceneFile = loader.toml_of(&path, &[], Wanted::Scene)?;
            "scene"
        } else {
            let _: FabricFile = loader.toml_of(&path, &[], Wanted::Fabric)?;
            "fabric"
        };
        let table: Table = loader.toml_of(&path, &[], Wanted::Either)?;
        let mut json = String::new();
        write_json(&Value::Table(table), &mut json);
        Ok((kind, json))
    });
    found.map_err(|e: InputError| input(py, &e))
}

/// Writes a value so that the same numbers are read back.
fn write_json(value: &Value, out: &mut String) {
    let text = |text: &str| serde_json::Value::from(text).to_string();
    match value {
        Value::String(s) => *out += &text(s),
        Value::Datetime(d) => *out += &text(&d.to_string()),
        Value::Integer(i) => *out += &i.to_string(),
        Value::Boolean(b) => *out += &b.to_string(),
        Value::Float(x) if x.is_nan() => *out += "NaN",
        Value::Float(x) if x.is_infinite() => {
            *out += if *x > 0.0 { "Infinity" } else { "-Infinity" }
        }
        Value::Float(x) => {
            let _ = write!(out, "{x:?}");
        }
        Value::Array(list) => {
            write_list('[', ']', list.iter(), out, |item, out| {
                write_json(item, out)
            });
        }
        Value::Table(table) => write_list('{', '}', table.iter(), out, |(key, item), out| {
            *out += &text(key);
            out.push(':');
            write_json(item, out);
        }),
    }
}

fn write_list<T>(
    open: char,
    close: char,
    items: impl Iterator<Item = T>,
    out: &mut String,
    write: impl Fn(T, &mut String),
) {
    out.push(open);
    for (i, item) in items.enumerate() {
        if i > 0 {
            out.push(',');
        }
        write(item, out);
    }
    out.push(close);
}
