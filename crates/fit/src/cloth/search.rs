//! Counts, colours and roughness of a photographed cloth, and what else is unknown, from all its
//! pictures at once.
//!
//! Two cloths of the same values have different fibres, and pictures of them differ: by a few per
//! cent of a texel, and by one per cent in the mean, for 16 x 16 threads. Derivatives therefore come
//! from several cloths whose noise is independent, and the answer is what several cloths settle on.

use super::Step;
use super::equations::Equations;
use super::first_guess::first_guess;
use super::model::{ClothModel, Trial};
use super::pictures::{Computed, Effort, pictures};
use super::placed::Placed;
use super::settled::Settled;
use super::sides::Side;
use super::unknowns::{COLOUR_STEP, Unknown};
use anyhow::Result;
use nalgebra::{DMatrix, DVector};
use organza_measure::fit::Determined;
use organza_photograph::Shading;
use organza_weave::Draft;

/// Turns of one cloth each.
pub const TURNS: u64 = 6;
/// Cloths of the last turns whose derivatives count.
const KEPT: usize = 5;
/// A turn is taken back if the misfit grows by this factor, which is more than noise.
const WORSE: f64 = 1.3;
/// Threads of the trial cloth.
const THREADS: usize = 16;
/// Most fibres of a yarn of the trial cloth: as many hide what is behind them.
const MOST_FIBRES: f64 = 1000.0;
/// Longest change of a turn or a round, in ranges.
pub const REACH: f64 = 1.0;
/// Changes of shift and blur in a turn that are expected, texels.
const PLACE_RANGES: [f64; 3] = [0.3, 0.3, 0.2];
/// Deviation of a texel that the model is allowed in any case, as a share of the mean.
const FLOOR: f64 = 0.01;

/// The result of a search.
pub struct SearchResult {
    /// The best values.
    pub trial: Trial,
    /// The pictures, moved and blurred, in the units of the photographs.
    pub pictures: Vec<Vec<[f64; 3]>>,
    /// Fitted values with their standard errors.
    pub parameters: Vec<Determined>,
    /// Root of the mean square of the residuals, as a share of the photographs' means.
    pub residual: f64,
}

/// The search over one draft.
pub struct Search<'a> {
    /// The cloth.
    pub model: &'a ClothModel<'a>,
    /// Its draft.
    pub draft: &'a Draft,
    /// The photographs.
    pub sides: Vec<Side>,
    /// What is unknown of the cloth.
    pub unknowns: Vec<Unknown>,
    paths: u64,
    /// Weights of the texels of all sides: one over the deviation of the photographs.
    pub weights: Vec<[f64; 3]>,
}

/// The texels of one side.
type Texels = Vec<[f64; 3]>;

/// How light and view shade the pictures of a cloth, where they do.
type Shadings = Vec<Option<Shading>>;

impl<'a> Search<'a> {
    /// A search with so many paths per texel.
    pub fn new(
        model: &'a ClothModel<'a>,
        draft: &'a Draft,
        sides: Vec<Side>,
        paths: u64,
    ) -> Search<'a> {
        Search {
            model,
            draft,
            unknowns: Unknown::all(model, &sides),
            paths,
            weights: sides.iter().flat_map(weights).collect(),
            sides,
        }
    }

    /// Computed photographs.
    ///
    /// # Errors
    /// As [`pictures`].
    pub fn render(&self, trial: &Trial, effort: Effort) -> Result<Vec<Computed>> {
        pictures(self.model, self.draft, trial, &self.sides, effort)
    }

    /// The effort for a cloth of a stream of seeds; half as many paths are not fine.
    pub fn effort(&self, is_fine: bool, stream: u64) -> Effort {
        Effort {
            threads: THREADS,
            paths: self.paths.div_ceil(if is_fine { 1 } else { 2 }),
            most_fibres: MOST_FIBRES,
            seed: self.model.args.seed.wrapping_mul(1_000_003) % (1 << 40) + 1 + stream,
        }
    }

    /// Pictures in their places, times the weights.
    pub fn weighted(&self, pictures: &[Computed], placed: &[Placed]) -> DVector<f64> {
        let all = pictures.iter().zip(placed).zip(&self.sides);
        self.weigh(all.flat_map(|((picture, at), side)| at.shown(picture, side)))
    }

    fn weigh(&self, texels: impl Iterator<Item = [f64; 3]>) -> DVector<f64> {
        let values: Vec<f64> = texels
            .zip(&self.weights)
            .flat_map(|(t, w)| [t[0] * w[0], t[1] * w[1], t[2] * w[2]])
            .collect();
        DVector::from_vec(values)
    }

    /// The photographs, times the weights.
    pub fn target(&self) -> DVector<f64> {
        self.weigh(self.sides.iter().flat_map(|s| s.fold.mean.iter().copied()))
    }

    /// The same, if these pictures decide what vignetting is.
    pub fn target_beside(&self, pictures: &[Computed]) -> DVector<f64> {
        let all = self.sides.iter().zip(pictures);
        self.weigh(all.flat_map(|(side, picture)| side.mean_beside(picture.shading())))
    }

    /// What pictures leave of the photographs, times the weights, with a strip of an axis left out of
    /// both.
    pub fn rest_without(
        &self,
        strip: (usize, usize),
        pictures: &[Computed],
        placed: &[Placed],
    ) -> DVector<f64> {
        let all = pictures.iter().zip(placed).zip(&self.sides);
        let rests = all.flat_map(|((picture, at), side)| {
            let shown = at.shown_without(strip, picture, side);
            let seen = &side.fold.without_strip[strip.0][strip.1];
            let texels = seen.iter().zip(shown);
            let rest = texels.map(|(a, b)| std::array::from_fn(|c| a[c] - b[c]));
            rest.collect::<Texels>()
        });
        self.weigh(rests)
    }

    /// Moves each picture to the nearest place where it fits.
    pub fn place(&self, pictures: &[Computed], placed: &mut [Placed]) {
        let mut first = 0;
        for ((picture, side), placed) in pictures.iter().zip(&self.sides).zip(placed) {
            let weights = &self.weights[first..first + side.fold.mean.len()];
            first += weights.len();
            *placed = placed.nearest(picture, side, weights);
        }
    }

    /// Derivatives of the weighted pictures of one cloth by the unknowns and by the places.
    fn slopes(
        &self,
        trial: &Trial,
        pictures: &[Computed],
        placed: &[Placed],
        effort: Effort,
        step: Step<'_>,
    ) -> Result<DMatrix<f64>> {
        let base = self.weighted(pictures, placed);
        let mut columns = Vec::new();
        let mut shared: [Option<DVector<f64>>; 2] = [None, None];
        for unknown in &self.unknowns {
            let column = match *unknown {
                Unknown::Exposure => base.clone(),
                // A channel's colour changes that channel alone, so one picture serves three.
                Unknown::Colour { system, channel } => {
                    if shared[system].is_none() {
                        step()?;
                        let there = Unknown::all_channels(trial, system, COLOUR_STEP);
                        let there = self.render(&there, effort)?;
                        shared[system] =
                            Some((self.weighted(&there, placed) - &base) / COLOUR_STEP);
                    }
                    let all = shared[system].clone().unwrap_or_else(|| base.clone());
                    let own = |(i, v): (usize, &f64)| if i % 3 == channel { *v } else { 0.0 };
                    DVector::from_iterator(all.len(), all.iter().enumerate().map(own))
                }
                _ => {
                    step()?;
                    let size = unknown.step();
                    let there = self.render(&unknown.changed(self.model, trial, size), effort)?;
                    (self.weighted(&there, placed) - &base) / size
                }
            };
            columns.push(column);
        }
        for k in 0..placed.len() {
            for (axis, size) in [(0, 0.3), (1, 0.3), (2, 0.1)] {
                let mut there = placed.to_vec();
                match axis {
                    2 => there[k].blur += size,
                    _ => there[k].shift[axis] += size,
                }
                columns.push((self.weighted(pictures, &there) - &base) / size);
            }
        }
        Ok(DMatrix::from_columns(&columns))
    }

    /// The equations of the last cloths.
    fn equations(&self, slopes: &[DMatrix<f64>]) -> Equations {
        let places = PLACE_RANGES.into_iter().cycle();
        let ranges = self.unknowns.iter().map(|u| u.range()).chain(places);
        let columns = 3 * self.sides.len() + self.unknowns.len();
        let ranges: Vec<f64> = ranges.take(columns).collect();
        let last = slopes.len().saturating_sub(KEPT);
        let cloths: Vec<&DMatrix<f64>> = slopes[last..].iter().collect();
        Equations::new(&cloths, &ranges)
    }

    /// The trial with changed unknowns, by shorter steps where yarns do not fit their spacing.
    pub fn apply(&self, trial: &Trial, change: &[f64]) -> Trial {
        let mut share = 1.0;
        for _ in 0..5 {
            let changes = self.unknowns.iter().zip(change);
            let next = changes.fold(*trial, |t, (unknown, v)| {
                unknown.changed(self.model, &t, share * v)
            });
            if self.model.fits(self.draft, &next) {
                return next;
            }
            share *= 0.5;
        }
        *trial
    }

    /// Folds the photographs anew, as they are without the mean of the shadings of computed ones.
    fn reshade(&mut self, cloths: &[Shadings]) {
        for (k, side) in self.sides.iter_mut().enumerate() {
            let shadings: Vec<Shading> = cloths.iter().filter_map(|c| c[k]).collect();
            if !shadings.is_empty() {
                side.reshade(Shading::mean(&shadings));
            }
        }
        self.weights = self.sides.iter().flat_map(weights).collect();
    }

    /// The search. `step` is called after each cloth.
    ///
    /// # Errors
    /// Those of the pictures.
    pub fn run(
        &mut self,
        start: Trial,
        placed: Vec<Placed>,
        step: Step<'_>,
    ) -> Result<SearchResult> {
        let (mut trial, mut placed) = first_guess(self, (start, placed), step)?;
        if self.sides.iter().any(|s| !s.view.is_parallel()) {
            step()?;
            let there = self.render(&trial, self.effort(false, 100))?;
            self.reshade(&[shadings(&there)]);
        }
        let (slopes, cloths) = self.turns(&mut trial, &mut placed, step)?;
        self.reshade(&cloths[cloths.len().saturating_sub(KEPT)..]);
        let equations = self.equations(&slopes);
        let settled = Settled::new(self, (&mut trial, &mut placed), equations, step)?;
        step()?;
        let pictures = self.render(&trial, self.effort(true, 500))?;
        self.place(&pictures, &mut placed);
        let rest = pictures.iter().zip(&placed).zip(&self.sides);
        let shown: Vec<Texels> = rest
            .map(|((picture, at), side)| at.shown(picture, side))
            .collect();
        Ok(SearchResult {
            trial,
            parameters: settled.parameters(self, &trial),
            residual: self.residual(&shown),
            pictures: shown,
        })
    }

    /// Turns of one cloth each from a first guess: derivatives of their pictures, and
    /// how light and view shade these.
    fn turns(
        &self,
        trial: &mut Trial,
        placed: &mut [Placed],
        step: Step<'_>,
    ) -> Result<(Vec<DMatrix<f64>>, Vec<Shadings>)> {
        let target = self.target();
        // A turn that makes the pictures worse is taken back, and the next one is half as long.
        let (mut reach, mut best) = (REACH, None::<(f64, Trial, DVector<f64>)>);
        let (mut slopes, mut cloths) = (Vec::new(), Vec::new());
        for turn in 0..TURNS {
            step()?;
            let effort = self.effort(false, turn);
            let there = self.render(trial, effort)?;
            self.place(&there, placed);
            let rest = &target - self.weighted(&there, placed);
            let misfit = rest.norm_squared();
            let (least, last, rest) = match best {
                Some(last) if misfit > WORSE * last.0 => {
                    reach *= 0.5;
                    last
                }
                _ => {
                    slopes.push(self.slopes(trial, &there, placed, effort, step)?);
                    (misfit, *trial, rest)
                }
            };
            let change = self.equations(&slopes).change(&rest, reach);
            *trial = self.apply(&last, &change.as_slice()[..self.unknowns.len()]);
            best = Some((least, last, rest));
            cloths.push(shadings(&there));
        }
        Ok((slopes, cloths))
    }

    /// Root mean square of what pictures leave unexplained, as a share of the mean colours.
    pub fn residual(&self, shown: &[Texels]) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (picture, side) in shown.iter().zip(&self.sides) {
            for (a, b) in picture.iter().zip(&side.fold.mean) {
                for c in 0..3 {
                    sum += ((a[c] - b[c]) / side.fold.mean_colour[c].max(1e-9)).powi(2);
                    count += 1.0;
                }
            }
        }
        f64::sqrt(sum / f64::max(count, 1.0))
    }
}

fn shadings(pictures: &[Computed]) -> Shadings {
    pictures.iter().map(Computed::shading).collect()
}

/// Weights of the texels of a side. The variance of single texels is noisy itself, so half of it is
/// the variance of all texels.
fn weights(side: &Side) -> Vec<[f64; 3]> {
    let variances = side.fold.variances();
    let n = variances.len() as f64;
    let mean: [f64; 3] = std::array::from_fn(|c| variances.iter().map(|v| v[c]).sum::<f64>() / n);
    let weight = |v: &[f64; 3]| {
        std::array::from_fn(|c| {
            let floor = (FLOOR * side.fold.mean_colour[c]).max(1e-9);
            1.0 / (0.5 * (v[c] + mean[c]) + floor * floor).sqrt()
        })
    };
    variances.iter().map(weight).collect()
}
