//! The page of a library: one file that shows all fabrics, without a server.

use super::{Entry, PARTS, read_record};
use anyhow::{Context, Result};
use organza_work::output;
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
    let links: Vec<Value> = PARTS
        .iter()
        .filter_map(|part| {
            let made = record.get(part.name)?;
            let link = url(&(part.output)(&entry.copy));
            Some(match &made.refused {
                None => json!({ "part": part.name, "title": part.title, "file": link }),
                Some(why) => json!({ "part": part.name, "title": part.title, "refused": why }),
            })
        })
        .collect();
    let sheet = std::fs::read(own.join("sheet.json")).unwrap_or_default();
    let sheet: Value = serde_json::from_slice(&sheet).unwrap_or_default();
    let name = sheet["name"]
        .as_str()
        .map_or_else(|| entry.id.replace('_', " "), str::to_owned);
    json!({
        "id": entry.id,
        "name": name,
        "fabric": url(&entry.copy),
        "weave": sheet["draft"]["title"],
        "figures": sheet["figures"],
        "openness": sheet["openness"],
        "yarns": sheet["materials"],
        "links": links,
    })
}

/// A place below the fabric's folder, as addresses have it on all systems.
fn url(place: &Path) -> String {
    let words: Vec<_> = place.iter().map(|w| w.to_string_lossy()).collect();
    words.join("/")
}
