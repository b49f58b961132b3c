//! Colours of a photographed cloth from mean colours alone, where single threads are not seen: their
//! widths and highlights stay as they were recognised.

use super::Step;
use super::model::Trial;
use super::placed::Placed;
use super::search::{Search, SearchResult};
use super::sides::Side;
use super::unknowns::{FIXED, Unknown};
use anyhow::Result;
use organza_measure::fit::Determined;

/// Pictures that are computed at most, and the difference of the means that is good enough.
pub const PICTURES: u64 = 10;
const ENOUGH: f64 = 0.01;
/// Steps that are taken whole.
const FIRST: u64 = 3;
/// Threads of the last picture, in multiples of the usual.
const LARGER: usize = 2;
/// The most by which a colour changes in a step, by its measure.
const REACH: f64 = 1.5;

/// Finds colours with which the mean of the front is that of its photograph, both systems changed
/// alike, by so many pictures; by none, they stay as they were recognised. What white is in the other photograph, as a share of that of the front, is found for each
/// channel: its lamp and its exposure are others.
///
/// # Errors
/// Those of the pictures.
pub fn matched(
    search: &Search<'_>,
    start: (Trial, Vec<Placed>),
    most: u64,
    step: Step<'_>,
) -> Result<SearchResult> {
    let (mut trial, mut placed) = start;
    let colours: Vec<(usize, usize)> = (0..2).flat_map(|s| (0..3).map(move |c| (s, c))).collect();
    let mut moved = [REACH; 3];
    for turn in 0..most {
        step()?;
        let pictures = search.render(&trial, search.effort(false, turn))?;
        let (Some(picture), Some(side)) = (pictures.first(), search.sides.first()) else {
            break;
        };
        moved = ratios(&picture.folded([0.0; 2]), side).map(f64::ln);
        if moved.iter().all(|m| m.abs() < ENOUGH) {
            break;
        }
        for &(system, channel) in &colours {
            // Cloths differ by a few per cent, which later steps average.
            let share = 1.0 / turn.saturating_sub(FIRST).max(1) as f64;
            let change = share * moved[channel].clamp(-REACH, REACH);
            let colour = Unknown::Colour { system, channel };
            trial = colour.changed(search.model, &trial, change);
        }
    }
    step()?;
    let mut last = search.effort(most == 0, 500);
    if most > 0 {
        last.threads *= LARGER;
    }
    let pictures = search.render(&trial, last)?;
    search.place(&pictures, &mut placed);
    let mut whites = Vec::new();
    let all = pictures.iter().zip(&placed).zip(&search.sides);
    let shown: Vec<Vec<[f64; 3]>> = all
        .map(|((picture, at), side)| {
            let mut shown = at.shown(picture, side);
            if side.index > 0 {
                let white = ratios(&shown, side);
                for texel in &mut shown {
                    *texel = [0, 1, 2].map(|c| texel[c] * white[c]);
                }
                let mean = side.fold.mean_colour;
                let variances = side.fold.mean_variances();
                whites.extend([0, 1, 2].map(|c| {
                    let se = white[c] * variances[c].sqrt() / mean[c].max(1e-6);
                    (format!("back.white.{}", ["r", "g", "b"][c]), white[c], se)
                }));
            }
            shown
        })
        .collect();
    // What the last step changed is what they are uncertain by.
    let mut parameters: Vec<_> = colours
        .iter()
        .map(|&(system, channel)| {
            let colour = Unknown::Colour { system, channel };
            colour.determined(search.model, &trial, moved[channel].abs())
        })
        .collect();
    parameters.extend(whites.into_iter().map(|(name, value, se)| Determined {
        name,
        value,
        se,
        is_fixed: se < FIXED * value,
    }));
    Ok(SearchResult {
        trial,
        residual: search.residual(&shown),
        pictures: shown,
        parameters,
    })
}

/// The mean colours of a photograph over those of a picture of it.
fn ratios(shown: &[[f64; 3]], side: &Side) -> [f64; 3] {
    [0, 1, 2].map(|c| {
        let mean = shown.iter().map(|t| t[c]).sum::<f64>() / shown.len() as f64;
        side.fold.mean_colour[c].max(1e-6) / mean.max(1e-6)
    })
}
