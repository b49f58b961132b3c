//! The end of a search: what rounds of several cloths settle on, and how certain it is.

use super::Step;
use super::broyden::Broyden;
use super::equations::Equations;
use super::model::Trial;
use super::pictures::Computed;
use super::placed::Placed;
use super::search::{REACH, Search, TURNS};
use super::unknowns::Unknown;
use anyhow::Result;
use nalgebra::DVector;
use organza_measure::fit::Determined;
use organza_photograph::jackknife;

/// Cloths whose answers are averaged in a round, and rounds at most.
const CLOTHS: u64 = 3;
const ROUNDS: u64 = 8;
/// Cloths of the last rounds.
const LAST: u64 = 16;
/// Rounds count in the answer whose changes are at most this share of the ranges: within it the change that
/// is asked for is nearly linear in the unknowns.
const LINEAR: f64 = 0.25;
/// A round settles if it changes nothing by more than this share of its range, or by no more than
/// noise may do.
const NEAR: f64 = 0.04;

/// What several cloths of the same values ask for, in units of the ranges.
struct Round {
    asks: Vec<DVector<f64>>,
    /// Their mean.
    asked: DVector<f64>,
    /// Variances of the mean.
    variances: DVector<f64>,
}

impl Round {
    fn new(asks: Vec<DVector<f64>>) -> Round {
        let n = asks.len() as f64;
        let asked = asks.iter().sum::<DVector<f64>>() / n;
        let square = |a: &DVector<f64>| (a - &asked).map(|v| v * v);
        let squares = asks.iter().map(square).sum::<DVector<f64>>();
        Round {
            variances: squares / (n * (n - 1.0)),
            asks,
            asked,
        }
    }

    /// Whether a change is small or may be noise.
    fn is_near(&self, change: &DVector<f64>) -> bool {
        let mut all = change.iter().zip(self.variances.iter());
        all.all(|(c, v)| c.abs() < f64::max(NEAR, 3.0 * v.sqrt()))
    }
}

/// What the rounds of a search settled on.
pub struct Settled {
    equations: Equations,
    broyden: Broyden,
    /// Ranges of the unknowns.
    ranges: DVector<f64>,
    last: Round,
    /// Where each cloth that counts says that the answer is, from the last trial.
    answers: Vec<DVector<f64>>,
    /// What the cloths of the last round leave with a strip of an axis left out: means.
    strips: [Vec<DVector<f64>>; 2],
    /// The last change, if it was not small.
    unsettled: DVector<f64>,
    /// Turns and rounds.
    turns: u32,
}

impl Settled {
    /// Rounds that begin with a trial in its places, until one changes nothing by more than noise.
    /// `step` is called after each cloth.
    ///
    /// # Errors
    /// Those of the pictures.
    pub fn new(
        search: &Search<'_>,
        (trial, placed): (&mut Trial, &mut [Placed]),
        equations: Equations,
        step: Step<'_>,
    ) -> Result<Settled> {
        let texels = search.target().len();
        let free = search.unknowns.len();
        let ranges = search.unknowns.iter().map(|u| u.range());
        let mut this = Settled {
            equations,
            broyden: Broyden::new(free),
            ranges: DVector::from_iterator(free, ranges),
            last: Round::new(vec![DVector::zeros(free)]),
            answers: Vec::new(),
            strips: [Vec::new(), Vec::new()],
            unsettled: DVector::zeros(free),
            turns: TURNS as u32,
        };
        let (mut before, mut is_last) = (None::<Trial>, false);
        let mut rounds = Vec::new();
        for round in 0..=ROUNDS {
            let mut asks = Vec::new();
            this.turns += 1;
            let strip_counts = [0, 1].map(|axis| {
                let sides = search.sides.iter();
                sides.map(|s| s.fold.without_strip[axis].len()).min()
            });
            this.strips = strip_counts.map(|n| vec![DVector::zeros(texels); n.unwrap_or(0)]);
            for k in 0..if is_last { LAST } else { CLOTHS } {
                step()?;
                let effort = search.effort(true, 200 + 20 * round + k);
                let there = search.render(trial, effort)?;
                if k == 0 {
                    search.place(&there, placed);
                }
                if is_last {
                    this.leave_strips_out(search, &there, placed);
                }
                let target = search.target_beside(&there);
                asks.push(this.asked(&(target - search.weighted(&there, placed))));
            }
            let now = Round::new(asks);
            if let Some(before) = &before {
                let moved = this.difference(search, before, trial);
                let noise = this.last.variances.sum() + now.variances.sum();
                let (before, now) = (&this.last.asked, &now.asked);
                this.broyden.learn(&moved, before, now, noise);
            }
            let mut change = this.broyden.change(&now.asked);
            change *= (REACH / change.amax()).min(1.0);
            let is_near = now.is_near(&change);
            before = Some(*trial);
            rounds.push((*trial, now.asks.clone()));
            *trial = search.apply(trial, change.component_mul(&this.ranges).as_slice());
            this.last = now;
            if is_last && is_near {
                break;
            }
            if round == ROUNDS {
                this.unsettled = change;
            }
            is_last |= is_near || round + 1 == ROUNDS;
        }
        // The last round counts in any case.
        let last = rounds.len() - 1;
        for (k, (from, asks)) in rounds.iter().enumerate() {
            let moved = this.difference(search, trial, from);
            if k == last || moved.amax() <= LINEAR {
                let answer = |ask: &DVector<f64>| &moved + this.broyden.change(ask);
                this.answers.extend(asks.iter().map(answer));
            }
        }
        let mean = Round::new(this.answers.clone()).asked;
        *trial = search.apply(trial, mean.component_mul(&this.ranges).as_slice());
        Ok(this)
    }

    /// By how much one trial has more of the unknowns than another, in units of the ranges.
    fn difference(&self, search: &Search<'_>, from: &Trial, to: &Trial) -> DVector<f64> {
        let all = search.unknowns.iter().map(|u| u.difference(from, to));
        DVector::from_iterator(self.ranges.len(), all).component_div(&self.ranges)
    }

    /// Adds what the pictures of a cloth of the last round leave without a strip.
    fn leave_strips_out(&mut self, search: &Search<'_>, there: &[Computed], placed: &[Placed]) {
        for (axis, list) in self.strips.iter_mut().enumerate() {
            for (k, sum) in list.iter_mut().enumerate() {
                *sum += search.rest_without((axis, k), there, placed) / LAST as f64;
            }
        }
    }

    /// The change that residuals ask for, in units of the ranges.
    fn asked(&self, rest: &DVector<f64>) -> DVector<f64> {
        let change = self.equations.settled(rest, self.turns);
        change
            .rows(0, self.ranges.len())
            .component_div(&self.ranges)
    }

    /// The fitted values. Their errors are those of the trial cloths, whose answers differ, those of
    /// the photographs, by leaving out strips, and what the search leaves: the last change if it was not
    /// small, and a rest of the first guess.
    pub fn parameters(&self, search: &Search<'_>, trial: &Trial) -> Vec<Determined> {
        let mut variances = Round::new(self.answers.clone()).variances;
        for list in &self.strips {
            let answer = |rest: &DVector<f64>| self.broyden.change(&self.asked(rest));
            let answers: Vec<DVector<f64>> = list.iter().map(answer).collect();
            for (k, variance) in variances.iter_mut().enumerate() {
                *variance += jackknife(answers.iter().map(|s| s[k]));
            }
        }
        variances += self.unsettled.map(|v| v * v);
        let unsettled = self.equations.unsettled(self.turns);
        let determined = |(k, unknown): (usize, &Unknown)| {
            let variance = variances[k] * self.ranges[k].powi(2) + unsettled[k];
            unknown.determined(search.model, trial, variance.sqrt())
        };
        search.unknowns.iter().enumerate().map(determined).collect()
    }
}
