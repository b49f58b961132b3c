//! The grid of threads: spacing and direction of both systems, from the spectrum.

use crate::{Photograph, PhotographError, Spectrum};
use glam::{DMat2, DVec2};
use std::f64::consts::TAU;

/// The warp may lean so far from the vertical of the picture, and the weft from its horizontal,
/// degrees.
const MAX_LEAN_DEG: f64 = 20.0;
/// The systems may differ so far from a right angle, degrees.
pub(crate) const MAX_SKEW_DEG: f64 = 6.0;
/// How often the power of threads is that of half the waves of their length: of noise the greatest
/// of a thousand is about ten times as strong.
const OVER_ITS_LIKE: f64 = 30.0;
/// Harmonics that count for a system.
const HARMONICS: u32 = 3;

/// The grid of threads of a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreadGrid {
    /// Threads per pixel across the warp and across the weft, as vectors in the picture.
    pub frequency: [DVec2; 2],
    /// Place of the crossing (0, 0), pixels.
    pub origin: DVec2,
}

/// The lean of the warp (0) from the vertical or of the weft (1) from the horizontal, by the frequency
/// across it; counter-clockwise, degrees.
pub(crate) fn lean_deg(frequency: DVec2, axis: usize) -> f64 {
    let angle = match axis {
        0 => frequency.y.atan2(frequency.x),
        _ => (-frequency.x).atan2(frequency.y),
    };
    angle.to_degrees()
}

impl ThreadGrid {
    /// The grid of the strongest waves near both axes, for a photograph that was
    /// [levelled](Photograph::levelled); `None` if they do not cross at nearly a right angle.
    pub fn strongest(levelled: &Photograph) -> Option<ThreadGrid> {
        let peaks = Spectrum::new(levelled).peaks(60);
        let [warp, weft] = [0, 1].map(|axis| {
            let near = peaks.iter().map(|p| match axis {
                1 if p.frequency.y < 0.0 => -p.frequency,
                _ => p.frequency,
            });
            let mut near = near.map(|f| (f, lean_deg(f, axis)));
            near.find(|(_, lean)| lean.abs() < MAX_LEAN_DEG)
        });
        let ((warp, a), (weft, b)) = (warp?, weft?);
        let grid = ThreadGrid {
            frequency: [warp, weft],
            origin: DVec2::ZERO,
        };
        ((a - b).abs() <= MAX_SKEW_DEG).then(|| grid.refined(levelled))
    }

    /// Finds the grid.
    ///
    /// # Errors
    /// No two systems of threads in the spectrum.
    pub fn find(photograph: &Photograph) -> Result<ThreadGrid, PhotographError> {
        let spectrum = Spectrum::new(photograph);
        let peaks = spectrum.peaks(60);
        let near = |axis: usize| {
            peaks.iter().filter_map(move |p| {
                // Upwards for the weft, to the right for the warp.
                let f = if axis == 1 && p.frequency.y < 0.0 {
                    -p.frequency
                } else {
                    p.frequency
                };
                let angle = lean_deg(f, axis);
                (angle.abs() < MAX_LEAN_DEG).then_some((f, angle))
            })
        };
        let threads = |f: DVec2| -> f64 {
            let along = |h: u32| spectrum.strength_near(f * f64::from(h)) * f64::from(h);
            let all = (1..=HARMONICS).filter(|h| (f * f64::from(*h)).length() < 0.45);
            // Threads are at least as strong at their own frequency as anything between them.
            let between = spectrum.strength_near(f * 0.5);
            // Threads that weave in pairs look like one thread whose second harmonic is stronger.
            let first = spectrum.strength_near(f);
            let paired = (spectrum.strength_near(f * 2.0) - first).max(0.0);
            all.map(along).sum::<f64>() - between - 3.0 * paired
        };
        let mut best: Option<(f64, [DVec2; 2])> = None;
        for (warp, warp_deg) in near(0) {
            for (weft, weft_deg) in near(1) {
                let skew = (warp_deg - weft_deg).abs();
                if skew > MAX_SKEW_DEG {
                    continue;
                }
                // Cloth is rarely skewed, and threads are rarely far from the picture's axes.
                let slant = (skew / 3.0).powi(2) + (warp_deg.abs() + weft_deg.abs()) / 60.0;
                let score = (threads(warp).max(1e-9) * threads(weft).max(1e-9)).ln() - slant;
                if best.is_none_or(|(s, _)| score > s) {
                    best = Some((score, [warp, weft]));
                }
            }
        }
        let Some((_, frequency)) = best else {
            let seen = match peaks.len() {
                0 => "the spectrum has no peaks".to_owned(),
                n => format!(
                    "none of the {n} peaks of the spectrum are those of two crossing systems"
                ),
            };
            return Err(PhotographError::NoThreads { seen });
        };
        for f in frequency {
            let times = spectrum.over_its_like(f);
            if times < OVER_ITS_LIKE {
                let seen = format!(
                    "the strongest waves of threads, of {:.1} pixels, are {times:.1} times as strong as \
                     half of those of that length, expected {OVER_ITS_LIKE}",
                    1.0 / f.length()
                );
                return Err(PhotographError::NoThreads { seen });
            }
        }
        Ok(ThreadGrid {
            frequency,
            origin: DVec2::ZERO,
        }
        .refined(photograph))
    }

    /// The place of a crossing in thread coordinates, pixels.
    pub fn place(&self, thread: DVec2) -> DVec2 {
        let [warp, weft] = self.frequency;
        self.origin + DMat2::from_cols(warp, weft).transpose().inverse() * thread
    }

    /// Thread coordinates of a place in the picture.
    pub fn thread(&self, place: DVec2) -> DVec2 {
        let from = place - self.origin;
        DVec2::new(self.frequency[0].dot(from), self.frequency[1].dot(from))
    }

    /// Distances between neighbouring threads, measured across them: warp, weft, pixels.
    pub fn spacing_px(&self) -> [f64; 2] {
        self.frequency.map(|f| 1.0 / f.length())
    }

    /// The directions of the warp, from the vertical, and of the weft, from the horizontal;
    /// counter-clockwise, degrees.
    pub fn angles_deg(&self) -> [f64; 2] {
        [0, 1].map(|axis| lean_deg(self.frequency[axis], axis))
    }

    /// The grid whose phase is the same all over the picture: each frequency follows the phase
    /// from one part of the picture to the next, and the brightest places are crossings. `self`
    /// may be the grid of another picture of the same cloth from the same place.
    pub fn refined(self, photograph: &Photograph) -> ThreadGrid {
        const PARTS: usize = 6;
        let [width, height] = photograph.size();
        let contrast = photograph.contrast();
        let mut grid = self;
        let mut phases = [0.0; 2];
        let middle = DVec2::new(width as f64, height as f64) / 2.0;
        for (k, phase) in phases.iter_mut().enumerate() {
            // The peak is right within a cycle of the picture: what moves farther follows noise.
            let most = 1.0 / width.min(height) as f64;
            for _ in 0..4 {
                let f = grid.frequency[k];
                let mut parts = [[(0.0f64, 0.0f64); PARTS]; PARTS];
                for y in 0..height {
                    for x in 0..width {
                        let from = DVec2::new(x as f64, y as f64) - middle;
                        let (s, c) = (TAU * f.dot(from)).sin_cos();
                        let v = contrast[y * width + x];
                        let part = &mut parts[y * PARTS / height][x * PARTS / width];
                        part.0 += v * c;
                        part.1 -= v * s;
                    }
                }
                // Products of neighbours have the phase difference, weighted by strength.
                let turn = |pairs: &mut dyn Iterator<Item = ((f64, f64), (f64, f64))>| {
                    let (mut re, mut im) = (0.0, 0.0);
                    for (a, b) in pairs {
                        re += a.0 * b.0 + a.1 * b.1;
                        im += a.0 * b.1 - a.1 * b.0;
                    }
                    im.atan2(re) / TAU
                };
                let mut right = (0..PARTS)
                    .flat_map(|j| (1..PARTS).map(move |i| (i, j)))
                    .map(|(i, j)| (parts[j][i - 1], parts[j][i]));
                let mut up = (1..PARTS)
                    .flat_map(|j| (0..PARTS).map(move |i| (i, j)))
                    .map(|(i, j)| (parts[j - 1][i], parts[j][i]));
                let step = DVec2::new(width as f64, height as f64) / PARTS as f64;
                let change = DVec2::new(turn(&mut right), turn(&mut up)) / step;
                let moved = f + change;
                if (moved - self.frequency[k]).length() < most {
                    grid.frequency[k] = moved;
                }
                let (re, im) = parts
                    .iter()
                    .flatten()
                    .fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
                *phase = im.atan2(re) / TAU;
            }
        }
        // Contrast is brightest where frequency . (place - middle) + phase is whole.
        let [warp, weft] = grid.frequency;
        let columns = DMat2::from_cols(warp, weft).transpose();
        grid.origin = middle - columns.inverse() * DVec2::from_array(phases);
        grid
    }
}
