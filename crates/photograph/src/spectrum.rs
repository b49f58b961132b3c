//! The power spectrum of a photograph and its peaks.

use crate::Photograph;
use glam::DVec2;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

/// Longest side that is transformed, pixels; more is left out at the borders.
const MAX_SIDE: usize = 1024;

/// A peak of the power spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Cycles per pixel, x not negative.
    pub frequency: DVec2,
    /// Root of its power as a multiple of the root of the median power.
    pub strength: f64,
}

/// The power spectrum of the contrast of a photograph under a Hann window.
#[derive(Clone, Debug)]
pub struct Spectrum {
    side: usize,
    /// Power, frequencies from 0 to `side - 1` in both directions, wrapped.
    power: Vec<f64>,
    median: f64,
    /// Least frequency of which the picture shows six cycles, and the greatest that it shows, per
    /// pixel.
    range: [f64; 2],
    /// Power of a peak at least, as a multiple of the median.
    stands_out: f64,
}

/// Waves are like another if their frequency differs by less than this share.
const LIKE: f64 = 0.15;

/// Side of the parts of a local spectrum, pixels, and the least side of a photograph whose parts
/// are twice as large.
const PART: usize = 128;
const LARGE: usize = 1200;
/// Contrast at which the values of a part are cut, in standard deviations: sparkles.
const MOST_DEVIATIONS: f64 = 3.0;

impl Spectrum {
    /// The mean of the power spectra of overlapping parts. Wrinkles move threads about within a
    /// photograph, and hardly within a part; strong ones hardly within a `small` part.
    pub fn local(photograph: &Photograph, small: bool) -> Spectrum {
        let [width, height] = photograph.size();
        let short = width.min(height);
        let part = if short < LARGE { PART } else { 2 * PART };
        let part = (if small { part / 2 } else { part }).min(short);
        let side = 2 * part.next_power_of_two();
        let contrast = photograph.contrast();
        let window: Vec<f64> = (0..part).map(|i| hann(i, part)).collect();
        let fft = FftPlanner::new().plan_fft_forward(side);
        let starts = |n: usize| (0..=(n - part) / (part / 4)).map(move |k| k * (part / 4));
        let mut power = vec![0.0; side * side];
        for y0 in starts(height) {
            for x0 in starts(width) {
                let at = |x: usize, y: usize| contrast[(y0 + y) * width + x0 + x];
                let all = || (0..part * part).map(|i| at(i % part, i / part));
                let mean = all().sum::<f64>() / (part * part) as f64;
                let square = all().map(|v| (v - mean).powi(2)).sum::<f64>();
                let scale = (square / (part * part) as f64).sqrt().max(1e-12);
                let value = |x: usize, y: usize| {
                    let deviations = (at(x, y) - mean) / scale;
                    deviations.clamp(-MOST_DEVIATIONS, MOST_DEVIATIONS) * window[x] * window[y]
                };
                let found = power_of(side, [part; 2], &*fft, value);
                power.iter_mut().zip(found).for_each(|(p, f)| *p += f);
            }
        }
        let range = [4.0 / part as f64, 0.49];
        Spectrum::of_power(side, power, range, 3.0)
    }

    /// The spectrum of a photograph.
    pub fn new(photograph: &Photograph) -> Spectrum {
        let [width, height] = photograph.size();
        let (w, h) = (width.min(MAX_SIDE), height.min(MAX_SIDE));
        let (x0, y0) = ((width - w) / 2, (height - h) / 2);
        let side = 2 * w.max(h).next_power_of_two();
        let contrast = photograph.contrast();
        let value =
            |x: usize, y: usize| contrast[(y0 + y) * width + x0 + x] * hann(x, w) * hann(y, h);
        let fft = FftPlanner::new().plan_fft_forward(side);
        let power = power_of(side, [w, h], &*fft, value);
        let range = [6.0 / w.min(h) as f64, 0.4];
        Spectrum::of_power(side, power, range, 30.0)
    }

    fn of_power(side: usize, power: Vec<f64>, range: [f64; 2], stands_out: f64) -> Spectrum {
        let mut sorted: Vec<f64> = power.iter().step_by(7).copied().collect();
        sorted.sort_by(f64::total_cmp);
        Spectrum {
            side,
            median: sorted[sorted.len() / 2].max(1e-20),
            power,
            range,
            stands_out,
        }
    }

    fn bin(&self, x: i64, y: i64) -> f64 {
        let n = self.side as i64;
        self.power[(y.rem_euclid(n) * n + x.rem_euclid(n)) as usize]
    }

    /// The strength near a frequency: the largest within a bin and a half.
    pub fn strength_near(&self, frequency: DVec2) -> f64 {
        let bin = (frequency * self.side as f64).round().as_i64vec2();
        let near = (-2..=2).flat_map(|j| (-2..=2).map(move |i| (i, j)));
        let most = near.map(|(i, j)| self.bin(bin.x + i, bin.y + j));
        (most.fold(0.0, f64::max) / self.median).sqrt()
    }

    /// How often the power near a frequency is that which half the waves of about its length have. Of
    /// blurred noise none stands out among those, however far they are above finer ones.
    pub fn over_its_like(&self, frequency: DVec2) -> f64 {
        let own = self.strength_near(frequency).powi(2) * self.median;
        let length = frequency.length();
        let (low, high) = (length * (1.0 - LIKE), length * (1.0 + LIKE));
        let half = (high * self.side as f64).ceil() as i64;
        let mut around: Vec<f64> = (-half..=half)
            .flat_map(|y| (0..=half).map(move |x| (x, y)))
            .filter(|&(x, y)| {
                let at = DVec2::new(x as f64, y as f64).length() / self.side as f64;
                (low..=high).contains(&at)
            })
            .map(|(x, y)| self.bin(x, y))
            .collect();
        let middle = around.len() / 2;
        if around.is_empty() {
            return 0.0;
        }
        let median = *around.select_nth_unstable_by(middle, f64::total_cmp).1;
        own / median.max(1e-20)
    }

    /// The mean logarithm of the power over that of the noise along a direction, up to a quarter of a
    /// cycle per pixel; what is far stronger than the noise counts as strong.
    pub fn along(&self, direction: DVec2) -> f64 {
        let n = self.side as f64;
        let (first, last) = ((self.range[0] * n) as i64, (0.25 * n) as i64);
        let power = |k: i64| {
            let at = (direction * k as f64).round().as_i64vec2();
            (self.bin(at.x, at.y) / self.median).ln().min(4.0)
        };
        (first..=last).map(power).sum::<f64>() / (last - first + 1) as f64
    }

    /// The strongest peaks that stand out of the noise, the strongest first, at most `count`.
    pub fn peaks(&self, count: usize) -> Vec<Peak> {
        let n = self.side as i64;
        let [least, most] = self.range;
        let half = (most * n as f64) as i64;
        let mut list = Vec::new();
        for y in -half..=half {
            for x in 0..=half {
                let at = DVec2::new(x as f64, y as f64) / n as f64;
                let here = self.bin(x, y);
                let is_seen = (least..=most).contains(&at.length());
                if !is_seen || here < self.stands_out * self.median {
                    continue;
                }
                let around = (-3..=3).flat_map(|j| (-3..=3).map(move |i| (i, j)));
                if around
                    .into_iter()
                    .any(|(i, j)| self.bin(x + i, y + j) > here)
                {
                    continue;
                }
                // The logarithm of a Hann window's peak is a parabola near its top.
                let l = |i, j| self.bin(x + i, y + j).max(1e-30).ln();
                let vertex = |a: f64, b: f64, c: f64| {
                    let bend = a - 2.0 * b + c;
                    if bend < 0.0 {
                        (0.5 * (a - c) / bend).clamp(-1.0, 1.0)
                    } else {
                        0.0
                    }
                };
                let middle = l(0, 0);
                let shift = DVec2::new(
                    vertex(l(-1, 0), middle, l(1, 0)),
                    vertex(l(0, -1), middle, l(0, 1)),
                );
                list.push(Peak {
                    frequency: at + shift / n as f64,
                    strength: (here / self.median).sqrt(),
                });
            }
        }
        list.sort_by(|a, b| b.strength.total_cmp(&a.strength));
        list.truncate(count);
        list
    }
}

/// A Hann window of `n` values.
fn hann(i: usize, n: usize) -> f64 {
    let phase = std::f64::consts::TAU * (i as f64 + 0.5) / n as f64;
    0.5 - 0.5 * phase.cos()
}

/// The power spectrum of values on a part of a square, which are zero elsewhere.
fn power_of(
    side: usize,
    [w, h]: [usize; 2],
    fft: &dyn Fft<f32>,
    value: impl Fn(usize, usize) -> f64,
) -> Vec<f64> {
    let mut data = vec![Complex::new(0.0f32, 0.0); side * side];
    for y in 0..h {
        for x in 0..w {
            data[y * side + x].re = value(x, y) as f32;
        }
    }
    for row in data.chunks_exact_mut(side) {
        fft.process(row);
    }
    let mut column = vec![Complex::new(0.0f32, 0.0); side];
    for x in 0..side {
        for (y, c) in column.iter_mut().enumerate() {
            *c = data[y * side + x];
        }
        fft.process(&mut column);
        for (y, c) in column.iter().enumerate() {
            data[y * side + x] = *c;
        }
    }
    data.iter().map(|c| f64::from(c.norm_sqr())).collect()
}
