//! Mass per length along a yarn: uneven as spun yarn is, with thick places.
//!
//! Fibres that lie at random along a yarn make its mass vary. Pieces that share fibres vary
//! together, so the correlation falls linearly with their distance and vanishes at the length
//! of a fibre: the spectrum over the wave number `f` is `sinc^2(f * fibre_length)`
//! [Martindale1945]. A tile holds one period of each thread, usually less than a fibre's
//! length. Most of the variation therefore lies between the threads, and the rest along them.
//!
//! Drafting moves short fibres in groups, which leaves waves of a length of 2.5 to 3 fibres
//! [Furter1982]: a share of the variance can lie in a hill of the spectrum about that length.

use crate::spec::{DraftingWaveSpec, EvennessSpec};
use crate::yarn::Yarn;
use organza_basis::PathRng;
use std::f64::consts::{PI, TAU};

/// Waves along a period at most.
const MAX_WAVES: u32 = 64;
/// Samples of the profile per wave, and the fewest per period.
const SAMPLES_PER_WAVE: usize = 16;
const MIN_SAMPLES: usize = 256;
/// Bounds of the mass relative to the mean, which keep yarns whole and cloth buildable.
const LEAST: f64 = 0.4;
pub(crate) const MOST: f64 = 2.2;
/// Normal deviates are clamped to this magnitude.
const MAX_DEVIATIONS: f64 = 2.5;

/// Mass per length along one period, relative to the mean of the thread.
#[derive(Clone, Debug)]
pub(crate) struct Profile {
    /// At equal distances along the period; the next sample after the last is the first.
    mass: Vec<f64>,
    /// Share of the period's twist before each sample; thin places take more of it.
    twisted: Vec<f64>,
    most: f64,
}

impl Profile {
    /// The profile of one thread; `None` for an even yarn.
    pub fn new(yarn: &Yarn, length_mm: f64, rng: &mut PathRng) -> Option<Profile> {
        let slubs = slubs(yarn, length_mm, rng);
        let waves = waves(yarn, length_mm, rng);
        if slubs.is_empty() && waves.is_empty() {
            return None;
        }
        let samples = (SAMPLES_PER_WAVE * waves.len()).max(MIN_SAMPLES);
        let mass: Vec<f64> = (0..samples)
            .map(|i| {
                let s = i as f64 / samples as f64;
                let wavy: f64 = waves
                    .iter()
                    .enumerate()
                    .map(|(k, [a, b])| {
                        let (sin, cos) = (TAU * (k + 1) as f64 * s).sin_cos();
                        a * cos + b * sin
                    })
                    .sum();
                let thick: f64 = slubs.iter().map(|slub| slub.excess(s)).sum();
                (1.0 + wavy + thick).clamp(LEAST, MOST)
            })
            .collect();
        let mut sum = 0.0;
        let mut twisted: Vec<f64> = mass
            .iter()
            .enumerate()
            .map(|(i, m)| {
                let before = sum;
                sum += 0.5 * (1.0 / m + 1.0 / mass[(i + 1) % samples]);
                before
            })
            .collect();
        twisted.iter_mut().for_each(|t| *t /= sum);
        let most = mass.iter().fold(0.0f64, |a, &b| a.max(b));
        Some(Profile {
            mass,
            twisted,
            most,
        })
    }

    /// The same mass with twist that does not depend on it.
    #[cfg(test)]
    pub fn with_even_twist(mut self) -> Profile {
        let samples = self.twisted.len() as f64;
        for (i, t) in self.twisted.iter_mut().enumerate() {
            *t = i as f64 / samples;
        }
        self
    }

    /// Mass at the share `s` of a period, which may lie outside 0 to 1.
    pub fn mass(&self, s: f64) -> f64 {
        let (i, t) = self.place(s);
        let next = self.mass[(i + 1) % self.mass.len()];
        self.mass[i] + t * (next - self.mass[i])
    }

    /// The largest mass.
    pub fn most(&self) -> f64 {
        self.most
    }

    /// Mean over the period of `f` of the mass.
    pub fn mean(&self, f: impl Fn(f64) -> f64) -> f64 {
        self.mass.iter().map(|&m| f(m)).sum::<f64>() / self.mass.len() as f64
    }

    /// Share of a period's twist between its start and the share `s` of its length; one more
    /// for every period.
    pub fn twisted(&self, s: f64) -> f64 {
        let (i, t) = self.place(s);
        let next = self.twisted.get(i + 1).copied().unwrap_or(1.0);
        s.floor() + self.twisted[i] + t * (next - self.twisted[i])
    }

    /// The sample at or before a share of the period, and how far it is to the next.
    fn place(&self, s: f64) -> (usize, f64) {
        let samples = self.mass.len();
        let at = (s - s.floor()) * samples as f64;
        let i = (at as usize).min(samples - 1);
        (i, at - i as f64)
    }
}

/// The mean mass of one thread, relative to that of all threads of its yarn.
pub(crate) fn thread_mass(yarn: &Yarn, length_mm: f64, rng: &mut PathRng) -> f64 {
    let Some(evenness) = yarn.evenness else {
        return 1.0;
    };
    let share = shares(yarn, &evenness, length_mm).0;
    let deviation = 0.01 * evenness.mass_cv_percent * share.sqrt();
    (1.0 + deviation * normal(rng)).clamp(LEAST, MOST)
}

/// Shares of the variance between threads and in each wave along a thread.
fn shares(yarn: &Yarn, evenness: &EvennessSpec, length_mm: f64) -> (f64, Vec<f64>) {
    let count = wave_count(yarn, length_mm);
    let (between, along) = random_shares(evenness.fibre_length_mm / length_mm, count);
    let Some(drafting) = yarn.drafting_waves else {
        return (between, along);
    };
    let waves = drafting_shares(&drafting, length_mm, count);
    let mixed = |random: f64, wave: f64| random + drafting.share * (wave - random);
    let along = along.iter().zip(&waves[1..]).map(|(&a, &b)| mixed(a, b));
    (mixed(between, waves[0]), along.collect())
}

/// The same of drafting waves alone, those between threads first: a normal distribution about
/// their wave number. Where the period is too short for them they lie between the threads.
fn drafting_shares(drafting: &DraftingWaveSpec, length_mm: f64, count: u32) -> Vec<f64> {
    let wave_periods = drafting
        .length_mm
        .map_or(f64::INFINITY, |mm| length_mm / mm);
    // Squares of the deviations, of which the least is taken off: no power of all vanishes.
    let off = |k: u32| {
        let deviation = (f64::from(k) / wave_periods - 1.0) / drafting.spread;
        0.5 * deviation * deviation
    };
    let least = (0..=count).map(off).fold(f64::INFINITY, f64::min);
    let power = |k: u32| (least - off(k)).exp() * if k == 0 { 0.5 } else { 1.0 };
    let all: Vec<f64> = (0..=count).map(power).collect();
    let sum: f64 = all.iter().sum();
    all.into_iter().map(|p| p / sum).collect()
}

/// Shares of the variance of fibres at random, for fibres of so many periods.
fn random_shares(fibre_periods: f64, waves: u32) -> (f64, Vec<f64>) {
    let power = |k: u32| {
        let x = PI * f64::from(k) * fibre_periods;
        2.0 * (x.sin() / x).powi(2)
    };
    let along: Vec<f64> = (1..=waves).map(power).collect();
    let sum = 1.0 + along.iter().sum::<f64>();
    (1.0 / sum, along.into_iter().map(|p| p / sum).collect())
}

/// Waves that are longer than twice the yarn is thick.
fn wave_count(yarn: &Yarn, length_mm: f64) -> u32 {
    ((length_mm / (4.0 * yarn.radius_mm())) as u32).clamp(1, MAX_WAVES)
}

/// Cosine and sine amplitudes of the waves along one thread.
fn waves(yarn: &Yarn, length_mm: f64, rng: &mut PathRng) -> Vec<[f64; 2]> {
    let Some(evenness) = yarn.evenness.filter(|e| e.mass_cv_percent > 0.0) else {
        return Vec::new();
    };
    let (_, along) = shares(yarn, &evenness, length_mm);
    let cv = 0.01 * evenness.mass_cv_percent;
    // Both parts of a wave have its variance, and half of it each on average.
    let draw = |share: f64| [0; 2].map(|_| cv * share.sqrt() * normal(rng));
    along.into_iter().map(draw).collect()
}

/// One thick place.
struct Slub {
    /// Its middle and its length, as shares of the period.
    middle: f64,
    length: f64,
    /// Relative mass beyond the yarn's own, in the middle.
    excess: f64,
}

impl Slub {
    /// Beyond the yarn's own mass: a smooth hump.
    fn excess(&self, s: f64) -> f64 {
        let from = s - self.middle;
        let from = (from - from.round()) / self.length;
        if from.abs() < 0.5 {
            self.excess * (PI * from).cos().powi(2)
        } else {
            0.0
        }
    }
}

/// The slubs of one thread. Their number has the right mean, even where that is below one.
fn slubs(yarn: &Yarn, length_mm: f64, rng: &mut PathRng) -> Vec<Slub> {
    let Some(spec) = yarn.slubs else {
        return Vec::new();
    };
    let expected = 1e-3 * spec.per_m * length_mm;
    let count = expected.floor() as u32 + u32::from(f64::from(rng.unit()) < expected.fract());
    let pair = |rng: &mut PathRng, [mean, deviation]: [f64; 2]| mean + deviation * normal(rng);
    (0..count)
        .map(|_| Slub {
            middle: f64::from(rng.unit()),
            length: (pair(rng, spec.length_mm) / length_mm).clamp(1e-3, 1.0),
            excess: pair(rng, spec.mass) - 1.0,
        })
        .collect()
}

fn normal(rng: &mut PathRng) -> f64 {
    f64::from(rng.normal2().x).clamp(-MAX_DEVIATIONS, MAX_DEVIATIONS)
}

#[cfg(test)]
mod tests;
