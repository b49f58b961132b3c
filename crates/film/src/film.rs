//! Films: rectangles of pixels.

use crate::Pixel;
use crate::pixel_sums::variance_of_mean;
use glam::UVec2;

/// A rectangle of pixels, row by row from the upper left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Film {
    size: UVec2,
    pixels: Vec<Pixel>,
}

impl Film {
    /// An empty film.
    pub fn new(size: UVec2) -> Film {
        Film {
            size,
            pixels: vec![Pixel::default(); size.x as usize * size.y as usize],
        }
    }

    /// Bytes that a film of this size takes.
    pub fn memory_bytes(size: UVec2) -> u64 {
        u64::from(size.x) * u64::from(size.y) * size_of::<Pixel>() as u64
    }

    /// Pixels in x and y.
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// All pixels.
    pub fn pixels(&self) -> &[Pixel] {
        &self.pixels
    }

    /// All pixels, to be added to.
    pub fn pixels_mut(&mut self) -> &mut [Pixel] {
        &mut self.pixels
    }

    /// Mean radiance over the whole film and its standard error, per channel.
    pub fn mean(&self) -> [(f64, f64); 3] {
        [0, 1, 2].map(|c| {
            let n = self.pixels.len().max(1) as f64;
            let moments = || self.pixels.iter().map(|p| p.moments(c));
            let sum: f64 = moments().map(|m| m.mean).sum();
            let var: f64 = moments().map(|m| variance_of_mean(&m)).sum();
            (sum / n, var.sqrt() / n)
        })
    }
}
