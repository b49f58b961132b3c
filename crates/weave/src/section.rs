//! The cross-section of a thread in the cloth: an ellipse, which may change along the thread.
//!
//! A thread is pressed flat where another crosses it with some force, and is fuller where
//! nothing presses on it. Its area is the same everywhere: what it gains in width it loses in
//! height.

use crate::path::Path;
use crate::spline::periodic_spline;
use glam::DVec2;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Samples of a changing section per crossing of the thread: a transition takes several.
const SAMPLES_PER_CROSSING: usize = 16;
/// The most samples along one thread.
const MAX_SAMPLES: usize = 1 << 16;

/// Factors on the width and height of a thread's round cross-section.
#[derive(Clone, Debug)]
pub(crate) struct ThreadSection {
    /// Without crossings; what all users see of a thread whose section is the same everywhere.
    pub flatten: DVec2,
    /// Factors on the width, by which the height is divided, at equal distances along the
    /// period.
    widening: Option<Arc<[f64]>>,
}

impl ThreadSection {
    /// The same along the whole thread.
    pub fn even(flatten: DVec2) -> ThreadSection {
        ThreadSection {
            flatten,
            widening: None,
        }
    }

    /// The factors at the share `s` of the period, which may lie outside 0 to 1.
    pub fn at(&self, s: f64) -> DVec2 {
        match &self.widening {
            None => self.flatten,
            Some(all) => widened(self.flatten, periodic_spline(all, s)),
        }
    }

    /// The flattest and the highest section.
    pub fn range(&self) -> [DVec2; 2] {
        let Some(all) = &self.widening else {
            return [self.flatten; 2];
        };
        // The spline may exceed its knots by an eighth of their difference at most.
        let (low, high) = all
            .iter()
            .fold((f64::INFINITY, 0.0f64), |(a, b), &w| (a.min(w), b.max(w)));
        let beyond = 0.125 * (high - low);
        [high + beyond, low - beyond].map(|w| widened(self.flatten, w))
    }

    /// Whether it is the same along the whole thread.
    pub fn is_even(&self) -> bool {
        self.widening.is_none()
    }

    /// The mean factors over the period.
    pub fn mean(&self) -> DVec2 {
        match &self.widening {
            None => self.flatten,
            Some(all) => {
                let each = all.iter().map(|&w| widened(self.flatten, w));
                each.sum::<DVec2>() / all.len() as f64
            }
        }
    }

    /// Its area relative to the round section's, the same everywhere.
    pub fn area(&self) -> f64 {
        self.flatten.x * self.flatten.y
    }

    /// The largest height.
    pub fn highest(&self) -> f64 {
        self.range()[1].y
    }
}

/// A section of the same area, so many times as wide.
fn widened(flatten: DVec2, factor: f64) -> DVec2 {
    DVec2::new(flatten.x * factor, flatten.y / factor)
}

/// Where and how strongly other threads press on a thread.
pub(crate) struct Pressed<'a> {
    /// Places along the axis where others cross, growing, and the period, millimetres.
    pub crossing_mm: &'a [f64],
    pub period_mm: f64,
    /// How strongly each presses, 0 to 1.
    pub pressure: &'a [f64],
    /// Distance from each crossing at which its pressure has vanished, millimetres.
    pub reach_mm: &'a [f64],
    /// Factors on the width where the pressure is 1, and where it is 0.
    pub factors: [f64; 2],
}

impl Pressed<'_> {
    /// Factors on the width at places along the axis, which grow and lie within one period.
    /// Pressures of neighbouring crossings combine to at most 1.
    pub fn widening(&self, places_mm: &[f64]) -> Vec<f64> {
        let mut free = vec![1.0; places_mm.len()];
        let crossings = self
            .crossing_mm
            .iter()
            .zip(self.pressure)
            .zip(self.reach_mm);
        for ((&crossing_mm, &pressure), &reach_mm) in crossings.filter(|((_, p), _)| **p > 0.0) {
            let copies = 1 + (reach_mm / self.period_mm) as i32;
            for copy in -copies..=copies {
                let middle_mm = crossing_mm + f64::from(copy) * self.period_mm;
                let first = places_mm.partition_point(|&x| x <= middle_mm - reach_mm);
                for (x, free) in places_mm.iter().zip(&mut free).skip(first) {
                    let share = (x - middle_mm).abs() / reach_mm;
                    if share >= 1.0 {
                        break;
                    }
                    *free *= 1.0 - pressure * (FRAC_PI_2 * share).cos().powi(2);
                }
            }
        }
        let [pressed, loose] = self.factors;
        let factor = |free: f64| pressed * (loose / pressed).powf(free);
        free.into_iter().map(factor).collect()
    }

    /// The section of a thread that follows `path`, whose samples lie at these places along the
    /// axis before it was displaced.
    pub fn section(&self, flatten: DVec2, path: &Path, path_mm: &[f64]) -> ThreadSection {
        let samples = (SAMPLES_PER_CROSSING * self.crossing_mm.len()).min(MAX_SAMPLES);
        let place_mm = |i: usize| {
            let arc_mm = i as f64 / samples as f64 * path.length_mm();
            let (k, t) = path.place(arc_mm);
            path_mm[k] + t * (path_mm[k + 1] - path_mm[k])
        };
        let places_mm: Vec<f64> = (0..samples).map(place_mm).collect();
        ThreadSection {
            flatten,
            widening: Some(self.widening(&places_mm).into()),
        }
    }
}
