//! Colours of single threads in stripes and checks.

use super::Step;
use super::model::Trial;
use super::search::Search;
use anyhow::Result;

/// Greys of the cloths that are looked at, one in each channel of two pictures: channels do not mix.
const GREYS: [[f64; 3]; 2] = [[0.01, 0.05, 0.15], [0.35, 0.65, 0.95]];
/// Seeds of these pictures.
const STREAM: u64 = 700;

/// Colours of one repeat of the threads of warp and weft, from their light as shares of that of a trial's.
/// Fibres shine whatever their colour, so that a share of the light is none of the colour: it is read off
/// the light of cloths of several greys.
///
/// # Errors
/// Those of the pictures.
pub fn thread_colours(
    search: &Search<'_>,
    trial: &Trial,
    shares: Option<&[Vec<[f64; 3]>; 2]>,
    step: Step<'_>,
) -> Result<[Vec<[f64; 3]>; 2]> {
    let Some(shares) = shares else {
        return Ok(trial.colours.map(|c| vec![c]));
    };
    // Logarithms of greys and of the light of cloth that has them.
    let mut curve: Vec<[f64; 2]> = Vec::new();
    for (stream, greys) in (STREAM..).zip(GREYS) {
        step()?;
        let grey = Trial {
            colours: [greys; 2],
            ..*trial
        };
        let pictures = search.render(&grey, search.effort(false, stream))?;
        let texels = pictures.first().map(|p| p.folded([0.0; 2]));
        let texels = texels.unwrap_or_default();
        for (c, grey) in greys.into_iter().enumerate() {
            let sum: f64 = texels.iter().map(|t| t[c]).sum();
            let light = (sum / texels.len().max(1) as f64).max(1e-9).ln();
            // Noise makes no cloth darker by brighter threads.
            let least = curve.last().map_or(f64::NEG_INFINITY, |l| l[1] + 1e-6);
            curve.push([grey.ln(), light.max(least)]);
        }
    }
    let colour = |mean: f64, share: f64| {
        let light = between(&curve, 0, mean.ln()) + share.ln();
        between(&curve, 1, light).exp()
    };
    Ok([0, 1].map(|system| {
        let mean = trial.colours[system];
        let each = shares[system].iter();
        each.map(|share| [0, 1, 2].map(|c| colour(mean[c], share[c])))
            .collect()
    }))
}

/// The other coordinate of a rising curve where one (0 or 1) has a value; that of an end beyond it.
fn between(curve: &[[f64; 2]], of: usize, value: f64) -> f64 {
    let (Some(first), Some(last)) = (curve.first(), curve.last()) else {
        return value;
    };
    let other = 1 - of;
    let inside = value.clamp(first[of], last[of]);
    let pair = curve.windows(2).find(|w| inside <= w[1][of]);
    pair.map_or(last[other], |w| {
        let t = (inside - w[0][of]) / (w[1][of] - w[0][of]);
        w[0][other] + t * (w[1][other] - w[0][other])
    })
}
