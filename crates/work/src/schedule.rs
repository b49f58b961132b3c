//! How many samples to take next, and when to stop.
//!
//! A film does not depend on how its samples are split into passes, so passes
//! may be as short as the clock wants: about half a second, that an interrupt
//! and the time limit are met soon. Whether the target error is reached is
//! asked only at fixed numbers of samples, so that the answer depends on the
//! seed and not on the machine: every sixteen samples at first, then every
//! sixteenth to eighth of those taken.
//!
//! The target stops the whole picture. Stopping single pixels by their own
//! variance would darken the picture: a pixel that has not yet met its rare
//! bright paths shows little variance and would stop too early. The error of a
//! whole picture hardly knows of any one pixel's luck, so what is left of that
//! effect falls with their number; the first look comes at
//! [`SAMPLES_PER_LOOK`] samples a pixel at the earliest.

use organza_transport::Rendering;
use std::time::Duration;

/// Samples of every pixel between two looks at the error, at the least.
const SAMPLES_PER_LOOK: u64 = 16;

/// Samples between looks at the error when so many are taken.
fn samples_per_look(taken: u64) -> u64 {
    ((taken + 1).next_power_of_two() / 16).max(SAMPLES_PER_LOOK)
}

/// Which errors end a render: all that are given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Targets {
    /// [`Rendering::relative_error`].
    pub picture: Option<f64>,
    /// The median of [`Rendering::pixel_errors`].
    pub median: Option<f64>,
}

impl Targets {
    /// The errors of a picture that meets all targets, if there are any.
    fn met(&self, rendering: &Rendering<'_>) -> Option<Targets> {
        let reached = self.errors(rendering);
        let within = |error: Option<f64>, target: Option<f64>| match (error, target) {
            (Some(error), Some(target)) => error <= target,
            _ => true,
        };
        let all = within(reached.picture, self.picture) && within(reached.median, self.median);
        (self.are_given() && all).then_some(reached)
    }

    /// Whether samples can reach them beside errors that samples do not lessen.
    pub fn can_be_met_beside(&self, errors: &Targets) -> bool {
        let pairs = [(self.picture, errors.picture), (self.median, errors.median)];
        pairs
            .iter()
            .all(|(target, error)| target.is_none() || error < target)
    }

    /// Which share of the samples that they take is done: the variance of a picture falls with
    /// the number of samples.
    pub fn share_done(&self, rendering: &Rendering<'_>) -> f64 {
        let reached = self.errors(rendering);
        let pairs = [
            (self.picture, reached.picture),
            (self.median, reached.median),
        ];
        let shares = pairs.map(|pair| match pair {
            (Some(target), Some(error)) if error > 0.0 => (target / error).powi(2),
            _ => 1.0,
        });
        shares[0].min(shares[1]).min(1.0)
    }

    /// Whether there are any.
    pub fn are_given(&self) -> bool {
        *self != Targets::default()
    }

    /// The errors of a picture that there are targets for.
    pub fn errors(&self, rendering: &Rendering<'_>) -> Targets {
        Targets {
            picture: self.picture.map(|_| rendering.relative_error()),
            median: self.median.map(|_| rendering.pixel_errors().median),
        }
    }

    /// Whether a picture meets them all.
    pub fn are_met(&self, rendering: &Rendering<'_>) -> bool {
        self.met(rendering).is_some()
    }

    /// In words that follow others.
    pub fn description(&self) -> String {
        let text_of = |error: Option<f64>, of| {
            error.map_or(String::new(), |e| format!(", {e:.5} of the {of}"))
        };
        text_of(self.picture, "mean") + &text_of(self.median, "median pixel")
    }
}

/// How long a pass of the general walk should take.
const PASS: Duration = Duration::from_millis(500);

/// Why a render stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// It has all samples.
    Done,
    /// The next sample would not fit into the time.
    TimeLimit,
    /// The errors are these, and at most the targets.
    TargetError(Targets),
    /// The user asked.
    Interrupted,
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Take so many samples of every pixel.
    Take(u64),
    /// Stop.
    Stop(Stop),
}

/// The plan of one run.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    time_limit: Option<Duration>,
    targets: Targets,
    /// Of the last pass; unknown before.
    per_sample: Option<Duration>,
}

impl Schedule {
    /// A plan with an optional limit and target.
    pub fn new(time_limit: Option<Duration>, targets: Targets) -> Schedule {
        Schedule {
            time_limit,
            targets,
            per_sample: None,
        }
    }

    /// Notes how long a pass took.
    pub fn took(&mut self, samples: u64, time: Duration) {
        self.per_sample = Some(time.div_f64(samples.max(1) as f64));
    }

    /// What to do `elapsed` after the start. Every run takes one pass at least,
    /// so that it gets on and has a picture to show.
    pub fn next(&self, rendering: &Rendering<'_>, elapsed: Duration, interrupted: bool) -> Next {
        let taken = rendering.taken().end - rendering.taken().start;
        let per_look = samples_per_look(taken);
        let until_look = per_look - taken % per_look;
        if rendering.left() == 0 {
            return Next::Stop(Stop::Done);
        }
        if interrupted {
            return Next::Stop(Stop::Interrupted);
        }
        if taken > 0
            && until_look == per_look
            && let Some(errors) = self.targets.met(rendering)
        {
            return Next::Stop(Stop::TargetError(errors));
        }
        // Nobody looks where there is no target.
        let most = if self.targets.are_given() {
            until_look
        } else {
            rendering.left()
        };
        let pass = rendering.engine().map_or(PASS, |engine| engine.pass_time());
        self.pass(elapsed, pass)
            .map_or(Next::Stop(Stop::TimeLimit), |n| {
                Next::Take(n.clamp(1, most))
            })
    }

    /// Samples that fit into the time of a pass and into the time left; `None` when
    /// not even one does.
    fn pass(&self, elapsed: Duration, pass: Duration) -> Option<u64> {
        let Some(per_sample) = self.per_sample else {
            return Some(1);
        };
        let left = self
            .time_limit
            .map_or(Duration::MAX, |limit| limit.saturating_sub(elapsed));
        if left < per_sample || left.is_zero() {
            return None;
        }
        let fit = left.min(pass).as_secs_f64() / per_sample.as_secs_f64().max(1e-9);
        Some((fit as u64).max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_come_at_numbers_that_do_not_depend_on_passes() {
        for taken in 0..5000u64 {
            let per_look = samples_per_look(taken);
            assert!(per_look == 16 || (taken / 16..=taken / 8 + 1).contains(&per_look));
            // However it is approached, the next look is the same.
            let next = taken - taken % per_look + per_look;
            if taken + 1 < next {
                let later = samples_per_look(taken + 1);
                assert_eq!(next, taken + 1 - (taken + 1) % later + later, "{taken}");
            }
        }
    }

    #[test]
    fn passes_fit_into_half_a_second_and_the_time_left() {
        let ms = Duration::from_millis;
        let mut schedule = Schedule::new(Some(ms(1000)), Targets::default());
        assert_eq!(
            schedule.pass(ms(5000), PASS),
            Some(1),
            "one pass in any case"
        );
        schedule.took(2, ms(200));
        assert_eq!(schedule.pass(ms(0), PASS), Some(5));
        assert_eq!(schedule.pass(ms(790), PASS), Some(2));
        assert_eq!(schedule.pass(ms(950), PASS), None);
        assert_eq!(schedule.pass(ms(2000), PASS), None);
        let mut free = Schedule::new(None, Targets::default());
        free.took(1, ms(2000));
        assert_eq!(free.pass(ms(9_000_000), PASS), Some(1));
    }
}
