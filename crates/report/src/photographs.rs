//! The page of a cloth that was fitted to photographs.

use crate::comparison::flip;
use crate::picture::Thumbnail;
use crate::{Picture, ReportError};
use askama::Template;

/// A photograph and the picture that was fitted to it.
pub struct FittedSide {
    /// Which photograph.
    pub name: String,
    /// The photograph, or a part of it.
    pub photograph: Picture,
    /// Its mean repeat, several times.
    pub folded: Picture,
    /// The fitted cloth under the same light, as large as `folded`.
    pub picture: Picture,
    /// How well they agree.
    pub words: String,
}

/// A fit of a cloth to photographs.
pub struct PhotographFit {
    /// Its title.
    pub title: String,
    /// The command that made it.
    pub command: String,
    /// What was found, a sentence each.
    pub lines: Vec<String>,
    /// The photographs.
    pub sides: Vec<FittedSide>,
}

#[derive(Template)]
#[template(path = "photographs.html")]
struct Page<'a> {
    title: &'a str,
    command: &'a str,
    lines: &'a [String],
    sides: Vec<Side<'a>>,
}

struct Side<'a> {
    name: &'a str,
    words: &'a str,
    thumbnails: Vec<Thumbnail>,
}

impl PhotographFit {
    /// The page: one self-contained HTML file.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub fn html(&self) -> Result<String, ReportError> {
        let side = |s: &'_ FittedSide| -> Result<Vec<Thumbnail>, ReportError> {
            let gain = s.folded.exposure();
            let shown = |words: &str, p: &Picture| Thumbnail::new(words, &p.display(gain), p.size);
            let difference = flip(&s.picture, &s.folded);
            Ok(vec![
                shown("photograph", &s.photograph)?,
                shown("photograph, mean of all repeats", &s.folded)?,
                shown("picture of the fitted cloth", &s.picture)?,
                Thumbnail::new(
                    format!("FLIP {:.3}", difference.mean),
                    &difference.map,
                    s.folded.size,
                )?,
            ])
        };
        let mut sides = Vec::new();
        for s in &self.sides {
            sides.push(Side {
                name: &s.name,
                words: &s.words,
                thumbnails: side(s)?,
            });
        }
        let page = Page {
            title: &self.title,
            command: &self.command,
            lines: &self.lines,
            sides,
        };
        Ok(page.render()?)
    }
}

/// The mean of the perceptual difference FLIP [Andersson2020] of a picture and the truth, of one
/// size, at the exposure that suits the truth; from 0 to 1.
pub fn perceptual_difference(picture: &Picture, truth: &Picture) -> f32 {
    flip(picture, truth).mean
}
