//! Parts of a film, and the order in which their pixels are walked.

use glam::UVec2;
use organza_film::Pixel;
use std::ops::Range;

/// Pixels across a strip of neighbours.
const STRIP: u32 = 8;

/// Whether a sample of a pixel of the whole picture is taken.
pub type Takes<'a> = dyn Fn(UVec2, u32) -> bool + Sync + 'a;

/// A part of the film and the samples to take in it.
pub struct Block<'a> {
    /// Whole rows.
    pub pixels: &'a mut [Pixel],
    /// The same pixels of a film of direct light ([`PathSample::direct`](organza_film::PathSample::direct)),
    /// if that is asked for. Engines for processors fill it; the graphics engine does not.
    pub direct: Option<&'a mut [Pixel]>,
    /// Pixels in a row.
    pub width: u32,
    /// The first pixel's place in the whole picture.
    pub min: UVec2,
    /// Sample indices to take of every pixel.
    pub samples: Range<u32>,
    /// Which of these samples are taken; all if none. The graphics engine takes all.
    pub takes: Option<&'a Takes<'a>>,
}

impl Block<'_> {
    /// The number of the pixel at a column and row of the block among those that are
    /// walked: see [`Block::pixel`].
    #[cfg(feature = "gpu")] // others go by turns
    pub(crate) fn turn(x: usize, y: usize, width: usize, rows: usize) -> usize {
        let strip_width = STRIP as usize;
        let strip = x / strip_width;
        let across = strip_width.min(width - strip * strip_width);
        strip * strip_width * rows + y * across + x % strip_width
    }

    /// The first sample from `sample` on and before `end` to take of a pixel of the picture.
    pub(crate) fn next_sample(&self, x: u32, y: u32, sample: u32, end: u32) -> Option<u32> {
        let pixel = UVec2::new(x, y);
        (sample..end).find(|&s| self.takes.is_none_or(|takes| takes(pixel, s)))
    }

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

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;

    #[test]
    fn turns_lead_to_pixels_and_back() {
        for (width, rows) in [(7, 5), (8, 3), (21, 4)] {
            let mut pixels = vec![Pixel::default(); width * rows];
            let block = Block {
                pixels: &mut pixels,
                direct: None,
                width: width as u32,
                min: UVec2::ZERO,
                samples: 0..1,
                takes: None,
            };
            for turn in 0..width * rows {
                let (index, x, y) = block.pixel(turn).unwrap();
                assert_eq!(index, y as usize * width + x as usize);
                assert_eq!(Block::turn(x as usize, y as usize, width, rows), turn);
            }
        }
    }
}
