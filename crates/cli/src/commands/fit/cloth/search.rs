//! Counts, colours and roughness of a photographed cloth, from all its pictures at once.

use super::model::{ClothModel, SYSTEMS, Trial};
use super::sides::Side;
use anyhow::Result;
use nalgebra::{DMatrix, DVector};
use organza_measure::fit::Determined;
use organza_photograph::moved;
use organza_weave::Draft;

/// Turns at most.
const TURNS: usize = 7;
/// The result is the mean of so many turns.
const MEAN_OF: usize = 3;
/// Longest step of a logarithm.
const LEAP: f64 = 0.5;
/// Steps of difference quotients: of the logarithm of counts, of colours as a share, of the
/// logarithm of the roughness.
const STEPS: [f64; 3] = [0.4, 0.25, 0.4];
/// Bounds of colours.
const COLOURS: [f64; 2] = [0.002, 0.97];
/// Bounds of a side's blur, texels.
const BLURS: [f64; 2] = [SMOOTH, 3.0];
/// Blur of the photographs before they are compared, texels: single paths and fibres do not count.
const SMOOTH: f64 = 0.8;
/// The least eigenvalue of a turn's equations, of which the greatest is about one.
const LEAST: f64 = 0.02;

/// The place of a computed picture under a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// How far it is moved right and up, texels.
    pub shift: [f64; 2],
    /// Standard deviation of its blur, texels.
    pub blur: f64,
}

/// The result of a search.
pub struct Found {
    /// The best values.
    pub trial: Trial,
    /// The pictures, moved and blurred, in the units of the photographs.
    pub pictures: Vec<Vec<[f64; 3]>>,
    /// Fitted values with their standard errors.
    pub parameters: Vec<Determined>,
    /// Root of the mean square of the residuals, as a share of the photographs' values.
    pub residual: f64,
}

/// Values that are fitted: two counts, six colours, roughness.
const VALUES: usize = 9;

/// The search over one draft.
pub struct Search<'a> {
    model: &'a ClothModel<'a>,
    draft: &'a Draft,
    sides: &'a [Side],
    paths: u64,
    /// The smoothed photographs.
    targets: Vec<Vec<[f64; 3]>>,
}

/// Two pictures of every side with independent noise, in the units of the photographs.
type Halves = [Vec<Vec<[f64; 3]>>; 2];

/// Weighted residuals of both halves.
type Residuals = [Vec<f64>; 2];

/// The sum of squares that noise does not add to: noise of the halves is independent.
fn square([a, b]: &Residuals) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl<'a> Search<'a> {
    /// A search with so many paths per texel.
    pub fn new(
        model: &'a ClothModel<'a>,
        draft: &'a Draft,
        sides: &'a [Side],
        paths: u64,
    ) -> Search<'a> {
        let smooth = |s: &Side| moved(&s.fold.mean, s.fold.size(), [0.0; 2], SMOOTH);
        Search {
            model,
            draft,
            sides,
            paths,
            targets: sides.iter().map(smooth).collect(),
        }
    }

    /// The folded photographs as they are compared: a little smoother.
    pub fn targets(&self) -> &[Vec<[f64; 3]>] {
        &self.targets
    }

    fn render(&self, trial: &Trial) -> Result<Halves> {
        let pairs: Vec<_> = self.sides.iter().map(|s| (s.pair, s.fold.texels)).collect();
        let half = |k: u64| -> Result<Vec<Vec<[f64; 3]>>> {
            let paths = (self.paths / 2).max(2);
            let pictures = self.model.pictures(self.draft, trial, &pairs, (paths, k))?;
            let folded = pictures.iter().zip(self.sides).map(|(p, s)| {
                let mut folded = s.fold.averaged(p);
                let values = folded.iter_mut().flatten();
                values.for_each(|v| *v *= s.value_per_bsdf);
                folded
            });
            Ok(folded.collect())
        };
        Ok([half(1)?, half(2)?])
    }

    /// Weighted residuals of all sides.
    fn residuals(&self, halves: &Halves, placed: &[Placed]) -> Residuals {
        let of_half = |pictures: &Vec<Vec<[f64; 3]>>| {
            let mut list = Vec::new();
            let sides = self.sides.iter().zip(&self.targets);
            for ((picture, place), (side, target)) in pictures.iter().zip(placed).zip(sides) {
                let moved = moved(picture, side.fold.size(), place.shift, place.blur);
                let n = (3 * moved.len()) as f64;
                for (m, f) in moved.iter().zip(target) {
                    for c in 0..3 {
                        // Dark texels count by the mean of their channel.
                        let mean = side.fold.mean_colour[c].max(1e-6);
                        list.push((m[c] - f[c]) / (0.7 * mean + 0.3 * f[c]) / n.sqrt());
                    }
                }
            }
            list
        };
        [of_half(&halves[0]), of_half(&halves[1])]
    }

    /// Finds the nearest place for each picture by steps that become smaller.
    fn place(&self, pictures: &Halves, placed: &mut [Placed]) {
        let cost = |p: &[Placed]| square(&self.residuals(pictures, p));
        let mut least = cost(placed);
        for step in [1.0, 0.5, 0.25, 0.12] {
            for _ in 0..4 {
                let before = least;
                for k in 0..placed.len() {
                    for axis in 0..3 {
                        for sign in [1.0, -1.0] {
                            let old = placed[k];
                            if axis == 2 {
                                let blur = old.blur * (1.0 + 0.5 * sign * step);
                                placed[k].blur = blur.clamp(BLURS[0], BLURS[1]);
                            } else {
                                placed[k].shift[axis] += sign * step;
                            }
                            let now = cost(placed);
                            if now < least {
                                least = now;
                            } else {
                                placed[k] = old;
                            }
                        }
                    }
                }
                if least > 0.9999 * before {
                    break;
                }
            }
        }
    }

    /// The search. `step` hears of each trial.
    ///
    /// # Errors
    /// Those of the pictures at the start.
    pub fn run(
        &self,
        start: Trial,
        mut placed: Vec<Placed>,
        step: &mut dyn FnMut(),
    ) -> Result<Found> {
        let range = self.model.fitted.range;
        let mut trial = start;
        let mut pictures = self.render(&trial)?;
        let mut covariance = DMatrix::zeros(VALUES, VALUES);
        self.place(&pictures, &mut placed);
        let at_start = (pictures.clone(), placed.clone());
        let mut last = Vec::new();
        for _ in 0..TURNS {
            self.place(&pictures, &mut placed);
            let residuals = self.residuals(&pictures, &placed);
            let columns = self.columns(&trial, &placed, (&pictures, &residuals), step)?;
            let free = columns[0].len();
            let jacobian =
                |h: usize| DMatrix::from_fn(residuals[h].len(), free, |i, k| columns[h][k][i]);
            let [ja, jb] = [jacobian(0), jacobian(1)];
            let [ra, rb] = [0, 1].map(|h| DVector::from_column_slice(&residuals[h]));
            // Products of different halves have no bias of noise.
            let cross = ja.transpose() * &jb;
            let normal = (&cross + cross.transpose()) * 0.5;
            let slope = (ja.transpose() * rb + jb.transpose() * ra) * 0.5;
            let all = (ja.transpose() * &ja + jb.transpose() * &jb) * 0.5;
            let size = |k: usize| {
                let own: f64 = normal[(k, k)];
                own.max(0.2 * all[(k, k)]).max(1e-6).sqrt()
            };
            let scale = DVector::from_fn(free, |k, _| 1.0 / size(k));
            // What noise makes of a direction that the pictures do not determine is no step.
            let scaled = DMatrix::from_fn(free, free, |i, k| normal[(i, k)] * scale[i] * scale[k]);
            let mut eigen = scaled.symmetric_eigen();
            let raise = |v: &mut f64| *v = v.max(LEAST);
            eigen.eigenvalues.iter_mut().for_each(raise);
            let solved = DVector::from_fn(free, |k, _| 1.0 / eigen.eigenvalues[k]);
            let inverse = &eigen.eigenvectors
                * DMatrix::from_diagonal(&solved)
                * eigen.eigenvectors.transpose();
            let inverse =
                DMatrix::from_fn(free, free, |i, k| inverse[(i, k)] * scale[i] * scale[k]);
            let rest = square(&residuals).max(0.0);
            let variance = rest / self.sides.len() as f64 / self.independent();
            let mut change: Vec<f64> = (-(&inverse * slope)).as_slice().to_vec();
            covariance = inverse * variance;
            change.iter_mut().for_each(|v| *v = v.clamp(-LEAP, LEAP));
            // Yarns that do not fit their spacing: half the way.
            for _ in 0..5 {
                step();
                let next = apply(&trial, &change, range);
                if let Ok(there) = self.render(&next) {
                    (trial, pictures) = (next, there);
                    break;
                }
                change.iter_mut().for_each(|v| *v *= 0.5);
            }
            last.push(trial);
        }
        // The noise of single turns cancels in their mean.
        let tail = &last[last.len().saturating_sub(MEAN_OF)..];
        if let Some(mean) = mean_of(tail) {
            pictures = self.render(&mean)?;
            trial = mean;
        }
        self.place(&pictures, &mut placed);
        // Turns that noise led astray are worse than none.
        let cost_of = |pictures: &Halves, placed: &[Placed]| {
            square(&self.residuals(pictures, placed)).max(0.0)
        };
        let mut cost = cost_of(&pictures, &placed);
        let start_cost = cost_of(&at_start.0, &at_start.1);
        if cost > start_cost {
            (trial, cost) = (start, start_cost);
            (pictures, placed) = at_start;
        }
        let se = |k: usize| covariance[(k, k)].max(0.0).sqrt();
        let mut parameters = Vec::new();
        let mut add = |name: String, value: f64, se: f64, range: f64| {
            parameters.push(Determined {
                name,
                value,
                se,
                is_fixed: se < 0.25 * range,
            });
        };
        for (k, system) in SYSTEMS.into_iter().enumerate() {
            let tex = trial.tex[k];
            add(format!("yarn.{system}.tex"), tex, tex * se(k), tex);
        }
        for (k, system) in SYSTEMS.into_iter().enumerate() {
            for (c, letter) in ["r", "g", "b"].into_iter().enumerate() {
                let value = trial.colours[k][c];
                let se = se(2 + 3 * k + c) * value;
                add(
                    format!("{system}.colour.{letter}"),
                    value,
                    se,
                    value.max(0.02),
                );
            }
        }
        let rough = trial.roughness;
        add(
            self.model.fitted.roughness.into(),
            rough,
            rough * se(8),
            rough,
        );
        let [first, second] = &pictures;
        let both = first.iter().zip(second).zip(placed.iter().zip(self.sides));
        let pictures = both.map(|((a, b), (p, s))| {
            let mean =
                |(a, b): (&[f64; 3], &[f64; 3])| std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
            let mean: Vec<[f64; 3]> = a.iter().zip(b).map(mean).collect();
            moved(&mean, s.fold.size(), p.shift, p.blur)
        });
        let pictures = pictures.collect();
        Ok(Found {
            trial,
            pictures,
            parameters,
            residual: (cost / self.sides.len() as f64).sqrt(),
        })
    }

    /// Texels of one side that differ, times the channels.
    fn independent(&self) -> f64 {
        let fold = &self.sides[0].fold;
        (3 * fold.repeat.count() * fold.texels[0] * fold.texels[1]) as f64
    }

    /// Difference quotients of the residuals; those of the same counts first, as they share one
    /// cloth. Counts, colours and roughness change by their logarithms; place and blur of each
    /// side follow.
    fn columns(
        &self,
        trial: &Trial,
        placed: &[Placed],
        (pictures, base): (&Halves, &Residuals),
        step: &mut dyn FnMut(),
    ) -> Result<[Vec<Vec<f64>>; 2]> {
        let quotient = |there: &Residuals, step: f64| -> Residuals {
            [0, 1].map(|h| {
                let both = there[h].iter().zip(&base[h]);
                both.map(|(a, b)| (a - b) / step).collect()
            })
        };
        let mut columns = [vec![Vec::new(); VALUES], vec![Vec::new(); VALUES]];
        let mut set = |k: usize, of_halves: Residuals| {
            for (columns, own) in columns.iter_mut().zip(of_halves) {
                if k < VALUES {
                    columns[k] = own;
                } else {
                    columns.push(own);
                }
            }
        };
        let range = self.model.fitted.range;
        let mut at = |change: &[f64]| -> Result<Residuals> {
            step();
            let there = self.render(&apply(trial, change, range))?;
            Ok(self.residuals(&there, placed))
        };
        for k in 0..2 {
            let mut change = [0.0; VALUES];
            let brightest = trial.colours[k].iter().copied().fold(0.0, f64::max);
            let size = if brightest * STEPS[1].exp() > COLOURS[1] {
                -STEPS[1]
            } else {
                STEPS[1]
            };
            change[2 + 3 * k..5 + 3 * k].fill(size);
            let all = quotient(&at(&change)?, size);
            for c in 0..3 {
                // A channel's colour changes that channel only.
                let own = |half: &Vec<f64>| -> Vec<f64> {
                    let values = half.iter().enumerate();
                    let own = values.map(|(i, v)| if i % 3 == c { *v } else { 0.0 });
                    own.collect()
                };
                set(2 + 3 * k + c, [own(&all[0]), own(&all[1])]);
            }
        }
        let mut change = [0.0; VALUES];
        let size = if trial.roughness * STEPS[2].exp() > range[1] {
            -STEPS[2]
        } else {
            STEPS[2]
        };
        change[8] = size;
        set(8, quotient(&at(&change)?, size));
        for k in 0..2 {
            // Thinner threads always fit.
            let mut change = [0.0; VALUES];
            change[k] = -STEPS[0];
            set(k, quotient(&at(&change)?, -STEPS[0]));
        }
        for k in 0..placed.len() {
            for (axis, size) in [(0, 0.3), (1, 0.3), (2, 0.1)] {
                let mut there = placed.to_vec();
                match axis {
                    2 => there[k].blur += size,
                    _ => there[k].shift[axis] += size,
                }
                set(VALUES, quotient(&self.residuals(pictures, &there), size));
            }
        }
        Ok(columns)
    }
}

/// The geometric mean of trials.
fn mean_of(list: &[Trial]) -> Option<Trial> {
    list.first()?;
    let mean = |value: &dyn Fn(&Trial) -> f64| {
        (list.iter().map(|t| value(t).max(1e-9).ln()).sum::<f64>() / list.len() as f64).exp()
    };
    Some(Trial {
        tex: [0, 1].map(|k| mean(&|t| t.tex[k])),
        colours: [0, 1].map(|k| [0, 1, 2].map(|c| mean(&|t| t.colours[k][c]))),
        roughness: mean(&|t| t.roughness),
    })
}

/// A trial with changed logarithms of counts, colours and roughness.
fn apply(trial: &Trial, change: &[f64], range: [f64; 2]) -> Trial {
    let scaled = |value: f64, change: f64| value * change.clamp(-0.7, 0.7).exp();
    let colour = |k: usize| {
        std::array::from_fn(|c| {
            scaled(trial.colours[k][c], change[2 + 3 * k + c]).clamp(COLOURS[0], COLOURS[1])
        })
    };
    Trial {
        tex: [0, 1].map(|k| scaled(trial.tex[k], change[k])),
        colours: [colour(0), colour(1)],
        roughness: scaled(trial.roughness, change[8]).clamp(range[0], range[1]),
    }
}
