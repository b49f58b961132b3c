//! Parts of a film, and the order in which their pixels are walked.

use glam::UVec2;
use organza_film::Pixel;
use std::ops::Range;

/// Pixels across a strip of neighbours.
const STRIP: u32 = 8;

/// A part of the film and the samples to take in it.
pub struct Block<'a> {
    /// Whole rows.
    pub pixels: &'a mut [Pixel],
    /// Pixels in a row.
    pub width: u32,
    /// The first pixel's place in the whole picture.
    pub min: UVec2,
    /// Sample indices to take of every pixel.
    pub samples: Range<u32>,
}

impl Block<'_> {
    /// The pixel that is walked as number `turn`, and its column and row in the
    /// whole picture. Neighbours in the picture follow each other in strips, so
    /// that the lanes look at the same part of the matter.
    pub(crate) fn pixel(&self, turn: usize) -> Option<(usize, u32, u32)> {
        if turn >= self.pixels.len() {
            return None;
        }
        let (turn, width) = (turn as u32, self.width);
        let rows = self.pixels.len() as u32 / width;
        let strip = turn / (STRIP * rows);
        let across = STRIP.min(width - strip * STRIP);
        let within = turn - strip * STRIP * rows;
        let (x, y) = (strip * STRIP + within % across, within / across);
        let index = (y * width + x) as usize;
        Some((index, self.min.x + x, self.min.y + y))
    }
}
