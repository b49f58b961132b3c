//! The page of a library: one file that shows all fabrics, without a server.

use super::{Entry, PARTS, PRINTED, read_record};
use crate::output;
use anyhow::{Context, Result};
use serde_json::{Value, json};
use std::path::Path;

const PAGE: &str = include_str!("page.html");

/// Where the page's script has its data.
const DATA: &str = "/* the fabrics */ []";

/// Writes `index.html` for what has been made of these fabrics.
///
/// # Errors
/// The file cannot be written.
pub fn write(folder: &Path, entries: &[Entry]) -> Result<()> {
    let cards: Vec<Value> = entries.iter().map(|e| card(folder, e)).collect();
    // No text may end the script.
    let data = serde_json::to_string(&cards)?.replace("</", "<\\/");
    let page = PAGE.replacen(DATA, &data, 1);
    let path = folder.join("index.html");
    output::write_file(&path, |out| {
        out.write_all(page.as_bytes()).context("writing failed")
    })
}

/// What the page shows of a fabric.
fn card(folder: &Path, entry: &Entry) -> Value {
    let own = folder.join(&entry.id);
    let record = read_record(&own);
    let stem = entry.path.file_stem().unwrap_or_default();
    let stem = stem.to_string_lossy();
    let links: Vec<Value> = PARTS
        .iter()
        .filter_map(|part| {
            let made = record.get(part.name)?;
            let output = (part.output)(&stem);
            let link = match part.name {
                "table" => beside_copy(&own, &entry.path, &output),
                _ => output,
            };
            Some(match &made.refused {
                None => json!({ "part": part.name, "title": part.title, "file": link }),
                Some(why) => json!({ "part": part.name, "title": part.title, "refused": why }),
            })
        })
        .collect();
    let sheet = std::fs::read(own.join("sheet.json")).unwrap_or_default();
    let sheet = if record.contains_key(PRINTED) {
        serde_json::from_slice(&sheet).unwrap_or(Value::Null)
    } else {
        Value::Null
    };
    let name = sheet["name"]
        .as_str()
        .map_or_else(|| entry.id.replace('_', " "), str::to_owned);
    let file = entry.path.file_name().unwrap_or_default().to_string_lossy();
    json!({
        "id": entry.id,
        "name": name,
        "fabric": beside_copy(&own, &entry.path, &file),
        "weave": sheet["draft"]["title"],
        "figures": sheet["figures"],
        "openness": sheet["openness"],
        "yarns": sheet["materials"],
        "links": links,
    })
}

/// A file beside the copy of the fabric, from its folder in the library. The copy lies below that
/// folder as deep as the fabric lies below what holds all its files.
fn beside_copy(own: &Path, fabric: &Path, file: &str) -> String {
    let name = fabric.file_name().unwrap_or_default();
    if own.join(name).exists() {
        return file.to_owned();
    }
    let mut folders = Vec::new();
    for above in fabric.ancestors().skip(1) {
        let Some(word) = above.file_name() else { break };
        folders.insert(0, word.to_string_lossy().into_owned());
        let below = folders.join("/");
        if own.join(&below).join(name).exists() {
            return format!("{below}/{file}");
        }
    }
    file.to_owned()
}
