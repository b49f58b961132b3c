//! Colour and roughness of fibres from one picture of a cloth, by its mean and deviation
//! [Zhao2011]: the mean increases with the colour, and the deviation decreases with the width
//! of the highlights, so that two alternating line searches converge to both.

use crate::Texture;

/// The statistics by which a picture is matched.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PictureStatistics {
    /// Mean of each channel.
    pub mean: [f64; 3],
    /// Standard deviation of pixels, root mean square over the channels.
    pub deviation: f64,
}

impl PictureStatistics {
    /// The statistics of pixels with their standard errors, whose contribution to the deviation
    /// is subtracted.
    pub fn new(pixels: &[[f32; 3]], errors: &[[f32; 3]]) -> PictureStatistics {
        let count = pixels.len().max(1) as f64;
        let mut mean = [0.0; 3];
        let mut variance = 0.0;
        for c in 0..3 {
            let values = || pixels.iter().map(|p| f64::from(p[c]));
            mean[c] = values().sum::<f64>() / count;
            variance += values().map(|v| (v - mean[c]).powi(2)).sum::<f64>();
            variance -= errors.iter().map(|e| f64::from(e[c]).powi(2)).sum::<f64>();
        }
        PictureStatistics {
            mean,
            deviation: (variance / (3.0 * count)).max(0.0).sqrt(),
        }
    }

    /// The statistics of a measured picture.
    pub fn of(texture: &Texture) -> PictureStatistics {
        PictureStatistics::new(&texture.mean, &texture.se)
    }
}

/// Ranges of the search, and its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureSearch {
    /// Least and greatest colour of each channel.
    pub colour: [[f64; 2]; 3],
    /// Least and greatest width of the highlights, above zero.
    pub width: [f64; 2],
    /// Initial width.
    pub start: f64,
    /// Relative error of means and deviation at which the search ends.
    pub tolerance: f64,
    /// Maximum number of alternations.
    pub turns: u32,
}

/// The result of the search.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PictureMatch {
    /// Colour of each channel.
    pub colour: [f64; 3],
    /// Width of the highlights.
    pub width: f64,
    /// Mean and deviation of the resulting picture.
    pub statistics: PictureStatistics,
    /// Number of alternations.
    pub turns: u32,
    /// Whether mean and deviation are both met; if not, no value in the ranges
    /// meets them.
    pub is_met: bool,
}

/// Steps of one line search.
const STEPS: u32 = 12;

/// Alternates searches for the colour and for the width. `simulate` returns the statistics of
/// the picture with a colour and a width.
///
/// # Errors
/// Those of `simulate`.
pub fn match_picture<E>(
    target: &PictureStatistics,
    search: &PictureSearch,
    simulate: &mut dyn FnMut([f64; 3], f64) -> Result<PictureStatistics, E>,
) -> Result<PictureMatch, E> {
    let near = |value: f64, wanted: f64| (value - wanted).abs() <= search.tolerance * wanted.abs();
    let [narrow, wide] = search.width;
    let mut width = search.start.clamp(narrow, wide);
    let mut colour = search.colour.map(|[low, high]| 0.5 * (low + high));
    let mut turns = 0;
    loop {
        turns += 1;
        let mut statistics;
        (colour, statistics) = match_colour(
            target.mean,
            (search.colour, colour),
            &near,
            |statistics| statistics.mean,
            &mut |colour| simulate(colour, width),
        )?;
        let mean_met = (0..3).all(|c| near(statistics.mean[c], target.mean[c]));
        let is_met = mean_met && near(statistics.deviation, target.deviation);
        if is_met || turns >= search.turns {
            return Ok(PictureMatch {
                colour,
                width,
                statistics,
                turns,
                is_met,
            });
        }
        // Wider highlights give flatter pictures.
        let mut line = Line::new([narrow.ln(), wide.ln()], width.ln());
        for _ in 0..STEPS {
            if near(statistics.deviation, target.deviation) {
                break;
            }
            line.observe(target.deviation - statistics.deviation);
            width = line.at.exp();
            statistics = simulate(colour, width)?;
        }
    }
}

/// Searches the colour of fibres, from a start in ranges, for which what `simulate` returns has the
/// wanted value in each channel; `value` increases with the colour of its own channel alone. The
/// search ends where `is_near` accepts each value beside the wanted one, or after 13 simulations.
/// Returns the last colour and what was simulated with it.
///
/// # Errors
/// Those of `simulate`.
pub fn match_colour<T, E>(
    wanted: [f64; 3],
    (ranges, start): ([[f64; 2]; 3], [f64; 3]),
    is_near: &dyn Fn(f64, f64) -> bool,
    value: impl Fn(&T) -> [f64; 3],
    simulate: &mut dyn FnMut([f64; 3]) -> Result<T, E>,
) -> Result<([f64; 3], T), E> {
    // Every channel has its own search; one simulation is enough for all three.
    let mut lines: [Line; 3] = std::array::from_fn(|c| Line::new(ranges[c], start[c]));
    let mut colour = start;
    let mut found = simulate(colour)?;
    for _ in 0..STEPS {
        let values = value(&found);
        if values.iter().zip(wanted).all(|(v, w)| is_near(*v, w)) {
            break;
        }
        for (c, line) in lines.iter_mut().enumerate() {
            line.observe(values[c] - wanted[c]);
        }
        colour = lines.map(|l| l.at);
        found = simulate(colour)?;
    }
    Ok((colour, found))
}

/// The search for the zero of an increasing function: bisection, then false position.
#[derive(Clone, Copy, Debug)]
struct Line {
    low: (f64, Option<f64>),
    high: (f64, Option<f64>),
    /// The next place to evaluate.
    at: f64,
}

impl Line {
    fn new([low, high]: [f64; 2], at: f64) -> Line {
        Line {
            low: (low, None),
            high: (high, None),
            at,
        }
    }

    /// Takes the value at the place.
    fn observe(&mut self, value: f64) {
        if value < 0.0 {
            self.low = (self.at, Some(value));
        } else {
            self.high = (self.at, Some(value));
        }
        let ((a, f_a), (b, f_b)) = (self.low, self.high);
        let share = match (f_a, f_b) {
            // Away from the ends, so that the interval always shrinks.
            (Some(f_a), Some(f_b)) if f_b > f_a => (-f_a / (f_b - f_a)).clamp(0.1, 0.9),
            _ => 0.5,
        };
        self.at = a + (b - a) * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;
    use std::convert::Infallible;

    /// A cloth of bumps: light of the colour, with highlights whose width and
    /// height are bound together, and noise of known size.
    fn picture(colour: [f64; 3], width: f64, seed: u64) -> PictureStatistics {
        let mut rng = PathRng::from_seed(seed);
        let noise = 0.02;
        let (mut pixels, mut errors) = (Vec::new(), Vec::new());
        for k in 0..4096 {
            let slope = (f64::from(k) * 0.618).fract() - 0.5;
            let lobe = 0.05 * (-0.5 * (slope / width).powi(2)).exp() / width;
            pixels.push(colour.map(|c| {
                let light = c / (1.0 - 0.6 * c) * (0.3 + lobe);
                (light + noise * f64::from(rng.normal2().x)) as f32
            }));
            errors.push([noise as f32; 3]);
        }
        PictureStatistics::new(&pixels, &errors)
    }

    #[test]
    fn a_planted_colour_and_width_are_found() {
        let (colour, width) = ([0.62, 0.35, 0.08], 0.07);
        let target = picture(colour, width, 1);
        let search = PictureSearch {
            colour: [[0.0, 0.98]; 3],
            width: [0.01, 0.9],
            start: 0.3,
            tolerance: 0.004,
            turns: 20,
        };
        let count = std::cell::Cell::new(0);
        let mut simulate = |c: [f64; 3], w: f64| -> Result<_, Infallible> {
            count.set(count.get() + 1);
            Ok(picture(c, w, 2))
        };
        let found = match_picture(&target, &search, &mut simulate).unwrap();
        let made = count.get();
        assert!(found.is_met && made < 120, "{found:?} after {made}");
        // Tolerance and noise of 0.02 over 4096 pixels: about a hundredth.
        // Margin: four standard errors.
        assert!((found.width / width - 1.0).abs() < 0.04, "{found:?}");
        for (a, b) in found.colour.iter().zip(colour) {
            assert!((a / b - 1.0).abs() < 0.04, "{found:?}");
        }
        // The known-bad twin: a mean alone says nothing of the width.
        let flat = PictureStatistics {
            deviation: 3.0 * target.deviation,
            ..target
        };
        let search = PictureSearch {
            width: [0.05, 0.9],
            turns: 4,
            ..search
        };
        let found = match_picture(&flat, &search, &mut simulate).unwrap();
        assert!(!found.is_met && found.width < 0.06, "{found:?}");
    }

    #[test]
    fn each_channel_finds_its_own_colour_and_one_out_of_reach_ends_at_its_bound() {
        let cloth = |c: [f64; 3]| c.map(|c| 0.02 + 0.6 * c / (1.0 - 0.5 * c));
        let planted = [0.9, 0.3, 0.002];
        let near = |value: f64, wanted: f64| (value - wanted).abs() < 1e-4;
        let mut simulate = |c| Ok::<_, Infallible>(cloth(c));
        let ranges = ([[0.0, 0.98]; 3], [0.5; 3]);
        let wanted = cloth(planted);
        let (found, _) = match_colour(wanted, ranges, &near, |v| *v, &mut simulate).unwrap();
        for (found, planted) in found.iter().zip(planted) {
            assert!((found - planted).abs() < 2e-4, "{found} {planted}");
        }
        // The twin.
        let bright = [2.0, wanted[1], wanted[2]];
        let (found, seen) = match_colour(bright, ranges, &near, |v| *v, &mut simulate).unwrap();
        assert!(found[0] > 0.979 && !near(seen[0], bright[0]), "{found:?}");
        assert!((found[1] - planted[1]).abs() < 2e-4, "{found:?}");
    }

    #[test]
    fn noise_is_no_deviation() {
        let even = |seed| {
            let mut rng = PathRng::from_seed(seed);
            let list: Vec<[f32; 3]> = (0..20_000)
                .map(|_| [(); 3].map(|()| 1.0 + 0.1 * rng.normal2().x))
                .collect();
            list
        };
        let list = even(5);
        let errors = vec![[0.1f32; 3]; list.len()];
        assert!(PictureStatistics::new(&list, &errors).deviation < 0.012);
        let none = vec![[0.0f32; 3]; list.len()];
        let statistics = PictureStatistics::new(&list, &none).deviation;
        assert!((statistics - 0.1).abs() < 0.002, "{statistics}");
    }
}
