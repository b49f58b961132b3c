//! Films: what every pixel has gathered.

use crate::integrator::PathSample;
use glam::{DVec3, UVec2};
use organza_basis::{Moments, Rgb};

/// Everything a pixel knows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Mean and variance of the samples, per channel.
    pub radiance: [Moments; 3],
    /// Sum over samples with an event of the fibre axis met first, signed to
    /// agree with the first one found (an axis has no sign).
    pub axis_sum: DVec3,
    /// Sum over samples with an event of the distance to it.
    pub depth_sum_mm: f64,
    /// Samples with at least one event.
    pub hits: u64,
    /// Sum of the numbers of scattering events.
    pub bounces: u64,
    /// Yarn met first by the first sample that met one.
    pub yarn: Option<u32>,
}

impl Pixel {
    /// Adds a sample.
    pub fn add(&mut self, s: &PathSample) {
        for (channel, value) in self.radiance.iter_mut().zip(s.radiance.0.to_array()) {
            channel.add(f64::from(value));
        }
        self.bounces += u64::from(s.bounces);
        if let Some(first) = s.first {
            let axis = first.info.axis.as_dvec3();
            self.axis_sum += if self.axis_sum.dot(axis) < 0.0 {
                -axis
            } else {
                axis
            };
            self.depth_sum_mm += first.depth_mm;
            self.hits += 1;
            self.yarn = self.yarn.or(first.info.yarn);
        }
    }

    /// Samples taken.
    pub fn count(&self) -> u64 {
        self.radiance[0].count
    }

    /// Estimated radiance.
    pub fn mean(&self) -> Rgb {
        Rgb::from(self.radiance.map(|m| m.mean as f32))
    }

    /// Estimated variance of [`Pixel::mean`], per channel.
    pub fn variance_of_mean(&self) -> Rgb {
        Rgb::from(self.radiance.map(|m| {
            if m.count < 2 {
                0.0
            } else {
                (m.variance() / m.count as f64) as f32
            }
        }))
    }

    /// Fraction of samples that met nothing.
    pub fn straight_through(&self) -> f32 {
        if self.count() == 0 {
            return 0.0;
        }
        (1.0 - self.hits as f64 / self.count() as f64) as f32
    }
}

/// A rectangle of pixels, row by row from the upper left.
#[derive(Clone, Debug, PartialEq)]
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
            let sum: f64 = self.pixels.iter().map(|p| p.radiance[c].mean).sum();
            let var: f64 = self
                .pixels
                .iter()
                .map(|p| p.radiance[c])
                .filter(|m| m.count > 1)
                .map(|m| m.variance() / m.count as f64)
                .sum();
            (sum / n, var.sqrt() / n)
        })
    }
}
