//! First values of a search.

use super::Step;
use super::model::Trial;
use super::placed::Placed;
use super::recognise::{BLACK, LOOK, LOOK_COLOURS, WHITE};
use super::search::Search;
use anyhow::Result;
use nalgebra::DVector;
use organza_photograph::{Likeness, explain};

/// Shares of their spacing that threads cover.
const COVERS: [f64; 4] = [0.4, 0.6, 0.8, 1.0];
/// The brightest colour that a search begins with.
const BRIGHTEST: f64 = 0.85;

/// Of threads of several widths, those whose pictures with white warp and with white weft explain
/// most of the photographs, and the colours with which they do. The picture of any colours is taken
/// for the sum of these two, which it nearly is. `start` is the answer if no yarn fits.
///
/// # Errors
/// Those of the pictures.
pub fn first_guess(
    search: &Search<'_>,
    start: (Trial, Vec<Placed>),
    step: Step<'_>,
) -> Result<(Trial, Vec<Placed>)> {
    let target = search.target();
    let mut least = f64::INFINITY;
    let mut best = start.clone();
    for cover in COVERS.iter().flat_map(|a| COVERS.map(|b| [*a, b])) {
        let trial = Trial {
            tex: search.model.tex_of_cover(cover),
            colours: LOOK_COLOURS,
            ..start.0
        };
        if !search.model.fits(search.draft, &trial) {
            continue;
        }
        step()?;
        let pictures = search.render(&trial, LOOK)?;
        let places: Vec<Placed> = (pictures.iter().zip(&search.sides))
            .map(|(picture, side)| Likeness::best(&side.fold, &picture.folded([0.0; 2])))
            .map(|likeness| Placed::of(&likeness))
            .collect();
        let (colours, rest) = colours(search, &search.weighted(&pictures, &places), &target);
        if rest < least {
            least = rest;
            best = (Trial { colours, ..trial }, places);
        }
    }
    Ok(best)
}

/// The colours of warp and weft with which weighted pictures, whose first channel shows white warp and
/// whose second shows white weft, explain most, and the sum of squares that they leave.
fn colours(
    search: &Search<'_>,
    shown: &DVector<f64>,
    target: &DVector<f64>,
) -> ([[f64; 3]; 2], f64) {
    let mut rest = target.norm_squared();
    let mut colours = [[0.0; 3]; 2];
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for c in 0..3 {
        let [a, b] = [0, 1].map(|from| -> Vec<f64> {
            let texels = search.weights.iter().enumerate();
            texels
                .map(|(t, w)| shown[3 * t + from] / w[from] * w[c])
                .collect()
        });
        let seen: Vec<f64> = target.iter().skip(c).step_by(3).copied().collect();
        let products = [dot(&a, &a), dot(&a, &b), dot(&b, &b)];
        let (weights, explained) = explain(products, [dot(&a, &seen), dot(&b, &seen)]);
        rest -= explained;
        for (colour, weight) in colours.iter_mut().zip(weights) {
            colour[c] = (weight * WHITE).clamp(BLACK, BRIGHTEST);
        }
    }
    (colours, rest)
}
