//! A photograph as linear colours, and its brightness without the unevenness of the light.

use crate::PhotographError;
use glam::DVec2;

/// The least side of a photograph, pixels.
pub const MIN_SIDE: usize = 64;

/// Scatter of the roots of brightness that is taken for noise where a photograph is levelled.
const LEAST_SCATTER: f64 = 0.01;

/// A photograph: linear colours. Places count pixels from the centre of the lower left one, x to
/// the right and y upwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    width: usize,
    height: usize,
    /// Rows from the bottom.
    pixels: Vec<[f32; 3]>,
}

impl Photograph {
    /// A photograph from rows of linear colours, the top row first. Values below zero count as
    /// zero.
    ///
    /// # Errors
    /// A side of fewer than [`MIN_SIDE`] pixels, another number of pixels than the size states,
    /// a value that is not finite.
    pub fn new(width: usize, height: usize, rows: &[[f32; 3]]) -> Result<Self, PhotographError> {
        if width < MIN_SIDE || height < MIN_SIDE || rows.len() != width * height {
            return Err(PhotographError::TooSmall { width, height });
        }
        if !rows.iter().flatten().all(|v| v.is_finite()) {
            return Err(PhotographError::NotFinite);
        }
        let pixels = rows.chunks_exact(width).rev().flatten();
        let pixels = pixels.map(|p| p.map(|v| v.max(0.0))).collect();
        Ok(Photograph {
            width,
            height,
            pixels,
        })
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The colour of a pixel, counted from the lower left one.
    pub fn pixel(&self, x: usize, y: usize) -> [f64; 3] {
        self.pixels[y * self.width + x].map(f64::from)
    }

    /// The place of a pixel, counted from the lower left one: zero is the middle of the photograph, and
    /// half its diagonal is one.
    pub fn place(&self, x: usize, y: usize) -> DVec2 {
        let size = DVec2::new(self.width as f64, self.height as f64);
        let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        (at - 0.5 * size) / (0.5 * size.length())
    }

    /// The colour between pixels, by cubic curves through them [Catmull1974]; beyond the border
    /// that of the border.
    pub fn between(&self, place: DVec2) -> [f32; 3] {
        let low = place.floor();
        let weights = (place - low).to_array().map(|t| {
            [
                ((2.0 - t) * t - 1.0) * t,
                (3.0 * t - 5.0) * t * t + 2.0,
                ((4.0 - 3.0 * t) * t + 1.0) * t,
                (t - 1.0) * t * t,
            ]
            .map(|w| 0.5 * w)
        });
        let mut sum = [0.0; 3];
        for (j, wy) in (-1..).zip(weights[1]) {
            for (i, wx) in (-1..).zip(weights[0]) {
                let x = (low.x as i64 + i).clamp(0, self.width as i64 - 1) as usize;
                let y = (low.y as i64 + j).clamp(0, self.height as i64 - 1) as usize;
                let pixel = self.pixels[y * self.width + x];
                (0..3).for_each(|c| sum[c] += wx * wy * f64::from(pixel[c]));
            }
        }
        sum.map(|v| v.max(0.0) as f32)
    }

    /// The photograph with the channels of pixels, counted from the lower left one, times factors.
    pub fn scaled(&self, factors: impl Fn(usize, usize) -> [f64; 3]) -> Photograph {
        let place = |i: usize| (i % self.width, i / self.width);
        let pixels = self.pixels.iter().enumerate().map(|(i, p)| {
            let (x, y) = place(i);
            let factors = factors(x, y);
            std::array::from_fn(|c| p[c] * factors[c] as f32)
        });
        Photograph {
            pixels: pixels.collect(),
            ..*self
        }
    }

    /// Its middle, of sides of at most so many pixels.
    pub(crate) fn middle(&self, most: usize) -> Photograph {
        let [width, height] = self.size().map(|n| n.min(most));
        let (x, y) = ((self.width - width) / 2, (self.height - height) / 2);
        let rows = self.pixels.chunks_exact(self.width).skip(y).take(height);
        Photograph {
            width,
            height,
            pixels: rows.flat_map(|row| &row[x..x + width]).copied().collect(),
        }
    }

    /// The photograph as it is under even light: each channel over its mean in squares of about four
    /// radii, pixels, times the mean of all.
    pub fn evened(&self, radius: usize) -> Photograph {
        let mut even = self.clone();
        for c in 0..3 {
            let values: Vec<f64> = self.pixels.iter().map(|p| f64::from(p[c])).collect();
            let whole = values.iter().sum::<f64>() / values.len() as f64;
            let mut mean = values;
            for _ in 0..2 {
                mean = box_mean(&mean, self.width, self.height, radius);
            }
            for (pixel, mean) in even.pixels.iter_mut().zip(mean) {
                pixel[c] = (f64::from(pixel[c]) * whole / mean.max(1e-6)) as f32;
            }
        }
        even
    }

    /// Its brightness, grey, over its local scatter in squares of about four radii: threads of any colour, and
    /// the gaps beside them, look alike.
    pub fn levelled(&self, radius: usize) -> Photograph {
        let [w, h] = self.size();
        let root = |p: &[f32; 3]| f64::from(p[0].max(p[1]).max(p[2])).sqrt();
        let roots: Vec<f64> = self.pixels.iter().map(root).collect();
        let squares: Vec<f64> = roots.iter().map(|v| v * v).collect();
        let local = |values: &[f64]| box_mean(&box_mean(values, w, h, radius), w, h, radius);
        let (means, squares) = (local(&roots), local(&squares));
        let all = roots.iter().zip(means.iter().zip(&squares));
        let grey = all.map(|(root, (mean, square))| {
            let scatter = (square - mean * mean).max(0.0).sqrt();
            let level = (root - mean) / (scatter + LEAST_SCATTER);
            [(1.0 + level.clamp(-3.0, 3.0) / 4.0).powi(2) as f32; 3]
        });
        Photograph {
            pixels: grey.collect(),
            ..*self
        }
    }

    /// Square roots of the luminances as shares of their local mean, less one: rows from the
    /// bottom. The root keeps highlights from outweighing all else, and the local mean takes out
    /// gradients of light and vignetting.
    pub fn contrast(&self) -> Vec<f64> {
        let roots: Vec<f64> = (self.pixels.iter())
            .map(|p| f64::from(0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]).sqrt())
            .collect();
        let radius = self.width.min(self.height) / 8;
        let mut mean = roots.clone();
        for _ in 0..2 {
            mean = box_mean(&mean, self.width, self.height, radius);
        }
        let values = roots.iter().zip(&mean);
        values
            .map(|(r, m)| {
                if *m > 0.0 {
                    (r / m - 1.0).min(3.0)
                } else {
                    0.0
                }
            })
            .collect()
    }
}

/// Means over squares that end at the border.
pub(crate) fn box_mean(values: &[f64], width: usize, height: usize, radius: usize) -> Vec<f64> {
    let stride = width + 1;
    let mut sums = vec![0.0; stride * (height + 1)];
    for y in 0..height {
        let mut row = 0.0;
        for x in 0..width {
            row += values[y * width + x];
            sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
        }
    }
    let mean = |x: usize, y: usize| {
        let (x0, x1) = (x.saturating_sub(radius), (x + radius + 1).min(width));
        let (y0, y1) = (y.saturating_sub(radius), (y + radius + 1).min(height));
        let s = |x: usize, y: usize| sums[y * stride + x];
        (s(x1, y1) - s(x0, y1) - s(x1, y0) + s(x0, y0)) / ((x1 - x0) * (y1 - y0)) as f64
    };
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| mean(x, y))
        .collect()
}
