//! Reports on the models of a cloth: how far they are from each other ([`comparison`]),
//! and what each of them costs ([`bench`]).
//!
//! Everything is measured and judged here and shown on one page that stands alone: one
//! HTML file without links, with plots and pictures inside, legible in light and dark.
//! Pages are filled in from the files of `templates/`, checked while compiling; plots are
//! drawn by `plotters`.

pub mod bench;
pub mod comparison;
mod error;
mod picture;
mod plot;
mod write_file;

use organza_scene::representation::Representation;

pub use error::ReportError;
pub use picture::Picture;

/// A colour and what it stands for.
struct KeyEntry {
    /// As in a style sheet.
    colour: String,
    words: String,
}

impl KeyEntry {
    fn new([r, g, b]: [u8; 3], words: impl Into<String>) -> KeyEntry {
        KeyEntry {
            colour: format!("#{r:02x}{g:02x}{b:02x}"),
            words: words.into(),
        }
    }
}

/// The text of a table.
fn text_of(out: csv::Writer<Vec<u8>>) -> Result<String, ReportError> {
    let bytes = out
        .into_inner()
        .map_err(|e| csv::Error::from(e.into_error()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// What is no representation of a cloth: data, other programs. 8-bit sRGB.
const OTHER: [u8; 3] = [0x8a; 3];

/// The colour of a model in plots, legible on light and dark. 8-bit sRGB.
fn colour_of(model: &str) -> [u8; 3] {
    Representation::named(model).map_or(OTHER, |r| r.colour)
}
