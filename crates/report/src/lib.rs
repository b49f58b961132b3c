//! Reports on the models of a cloth: their differences ([`comparison`]), their costs ([`bench`])
//! and their fit to photographs ([`PhotographFit`]).
//!
//! Everything is measured and compared here and shown on one self-contained page: an HTML file
//! without links, with plots and pictures inside, legible in light and dark colour schemes. The
//! templates of pages are the files of `templates/`, which are checked at compile time;
//! `plotters` draws the plots.
#![allow(clippy::disallowed_methods)] // keeps the results of a bench

pub mod bench;
pub mod comparison;
mod error;
mod photographs;
mod picture;
mod plot;
mod write_file;

use organza_scene::representation::Representation;

pub use error::ReportError;
pub use photographs::{FittedSide, PhotographFit, perceptual_difference};
pub use picture::Picture;

/// A colour and its meaning.
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

/// The colour of everything but representations of a cloth: data, other programs. 8-bit sRGB.
const OTHER: [u8; 3] = [0x8a; 3];

/// The colour of a model in plots, legible on light and dark. 8-bit sRGB.
fn colour_of(model: &str) -> [u8; 3] {
    Representation::named(model).map_or(OTHER, |r| r.colour)
}
