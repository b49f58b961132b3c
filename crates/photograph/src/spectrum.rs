//! The power spectrum of a photograph and its peaks.

use crate::Photograph;
use glam::DVec2;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

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
    /// Least frequency of which the picture shows six cycles, per pixel.
    least: f64,
}

impl Spectrum {
    /// The spectrum of a photograph.
    pub fn new(photograph: &Photograph) -> Spectrum {
        let [width, height] = photograph.size();
        let (w, h) = (width.min(MAX_SIDE), height.min(MAX_SIDE));
        let (x0, y0) = ((width - w) / 2, (height - h) / 2);
        let side = 2 * w.max(h).next_power_of_two();
        let contrast = photograph.contrast();
        let hann = |i: usize, n: usize| {
            let phase = std::f64::consts::TAU * (i as f64 + 0.5) / n as f64;
            0.5 - 0.5 * phase.cos()
        };
        let mut data = vec![Complex::new(0.0f32, 0.0); side * side];
        for y in 0..h {
            for x in 0..w {
                let value = contrast[(y0 + y) * width + x0 + x] * hann(x, w) * hann(y, h);
                data[y * side + x].re = value as f32;
            }
        }
        let fft = FftPlanner::new().plan_fft_forward(side);
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
        let power: Vec<f64> = data.iter().map(|c| f64::from(c.norm_sqr())).collect();
        let mut sorted: Vec<f64> = power.iter().step_by(7).copied().collect();
        sorted.sort_by(f64::total_cmp);
        Spectrum {
            side,
            median: sorted[sorted.len() / 2].max(1e-20),
            power,
            least: 6.0 / w.min(h) as f64,
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

    /// The strongest peaks that stand out of the noise, the strongest first, at most `count`.
    pub fn peaks(&self, count: usize) -> Vec<Peak> {
        let n = self.side as i64;
        let half = (0.4 * n as f64) as i64;
        let mut list = Vec::new();
        for y in -half..=half {
            for x in 0..=half {
                let at = DVec2::new(x as f64, y as f64) / n as f64;
                let here = self.bin(x, y);
                if at.length() < self.least || at.length() > 0.4 || here < 30.0 * self.median {
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
