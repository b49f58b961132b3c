//! The error of films.

use crate::Film;
use crate::pixel_sums::variance_of_mean;
use rayon::prelude::*;

/// Relative standard errors of single pixels, over the pixels that met matter
/// and are lit: background seen past the cloth has none and is left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelErrors {
    /// Half the pixels have less.
    pub median: f64,
    /// All but a hundredth have less.
    pub worst_hundredth: f64,
}

/// How much of the noise of a film the brightest sample and the noisiest pixel have.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tail {
    /// The share of the brightest sample in the squares of all.
    pub sample: f64,
    /// The largest share of a pixel in the variances of all.
    pub pixel: f64,
}

impl Tail {
    /// Above this share in both, others as bright may not have been met, and the standard errors
    /// are too small. Where samples have no variance, the largest has a good part of the squares
    /// however many there are; where they have one, its share goes to zero.
    const HEAVY: f64 = 0.05;

    /// Whether standard errors cannot be trusted.
    pub fn is_heavy(&self) -> bool {
        self.sample > Tail::HEAVY && self.pixel > Tail::HEAVY
    }
}

impl Film {
    /// The tail of the samples, of which the brightest channel of any is
    /// [`Stats::brightest`](crate::Stats::brightest); `None` of fewer than a thousand.
    pub fn tail(&self, brightest: f32) -> Option<Tail> {
        let samples: u64 = self.pixels().iter().map(|p| p.count()).sum();
        if samples < 1000 {
            return None;
        }
        let (mut squares, mut tail) = (0.0f64, Tail::default());
        for channel in 0..3 {
            let (mut of_channel, mut sum, mut most) = (0.0, 0.0, 0.0f64);
            for m in self.pixels().iter().map(|p| p.moments(channel)) {
                of_channel += m.sum_sq_dev + m.count as f64 * m.mean * m.mean;
                let variance = variance_of_mean(&m);
                sum += variance;
                most = most.max(variance);
            }
            squares = squares.max(of_channel);
            if sum > 0.0 {
                tail.pixel = tail.pixel.max(most / sum);
            }
        }
        if squares > 0.0 {
            tail.sample = f64::from(brightest).powi(2) / squares;
        }
        Some(tail)
    }

    /// Standard error of a pixel, root mean square over pixels and channels,
    /// over the mean of the picture. A black picture has none: zero.
    pub fn relative_error(&self) -> f64 {
        let (mut mean, mut variance) = (0.0, 0.0);
        for m in self
            .pixels()
            .iter()
            .flat_map(|p| [0, 1, 2].map(|c| p.moments(c)))
        {
            mean += m.mean;
            variance += variance_of_mean(&m);
        }
        let values = 3.0 * self.pixels().len().max(1) as f64;
        if mean > 0.0 {
            (variance / values).sqrt() / (mean / values)
        } else {
            0.0
        }
    }

    /// Standard error of each pixel, root mean square over channels, over the
    /// mean of its channels. Zero where no pixel counts.
    pub fn pixel_errors(&self) -> PixelErrors {
        let error = |p: &crate::Pixel| {
            let moments = [0, 1, 2].map(|c| p.moments(c));
            let mean: f64 = moments.iter().map(|m| m.mean).sum();
            let variance: f64 = moments.iter().map(variance_of_mean).sum();
            let counts = p.straight_through() < 1.0 && mean > 0.0;
            counts.then(|| (3.0 * variance).sqrt() / mean)
        };
        let mut errors: Vec<f64> = self.pixels().par_iter().filter_map(error).collect();
        let mut below = |share: f64| {
            let place = (share * errors.len() as f64) as usize;
            if place < errors.len() {
                *errors.select_nth_unstable_by(place, f64::total_cmp).1
            } else {
                0.0
            }
        };
        PixelErrors {
            median: below(0.5),
            worst_hundredth: below(0.99),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FirstEvent, PathSample, SiteInfo};
    use glam::{UVec2, Vec3};
    use organza_basis::Rgb;

    #[test]
    fn the_relative_error_falls_with_the_root_of_the_samples() {
        let film = |n: u32| {
            let mut film = Film::new(UVec2::new(2, 1));
            for i in 0..n {
                for (pixel, level) in film.pixels_mut().iter_mut().zip([1.0, 3.0]) {
                    let sample = PathSample {
                        radiance: Rgb::splat(level * (i % 2) as f32),
                        ..PathSample::default()
                    };
                    pixel.add(&sample, i);
                }
            }
            film.relative_error()
        };
        // Variances 1/4 and 9/4 over n, mean 1.
        for n in [100, 400] {
            let expected = (1.25 / f64::from(n - 1)).sqrt();
            assert!((film(n) / expected - 1.0).abs() < 4.0 * f64::EPSILON);
        }
        assert_eq!(Film::new(UVec2::ONE).relative_error(), 0.0);
    }

    /// Powers of a uniform number, one with a variance and one without, and a lamp that all
    /// samples of a pixel see.
    #[test]
    fn samples_without_a_variance_have_a_heavy_tail() {
        let tail = |power: f32, lamp: f32| {
            let mut film = Film::new(UVec2::new(30, 30));
            let mut rng = organza_basis::PathRng::from_seed(5);
            let mut brightest = 0.0f32;
            for i in 0..16 {
                for (place, pixel) in film.pixels_mut().iter_mut().enumerate() {
                    let drawn = (1.0 - rng.unit()).powf(power);
                    let level = if place == 0 { lamp + drawn } else { drawn };
                    brightest = brightest.max(level);
                    let sample = PathSample {
                        radiance: Rgb::splat(level),
                        ..PathSample::default()
                    };
                    pixel.add(&sample, i);
                }
            }
            film.tail(brightest).unwrap()
        };
        assert!(tail(-0.9, 0.0).is_heavy(), "{:?}", tail(-0.9, 0.0));
        for (power, lamp) in [(-0.2, 0.0), (1.0, 0.0), (1.0, 1000.0)] {
            assert!(!tail(power, lamp).is_heavy(), "{power} {lamp}");
        }
        assert!(Film::new(UVec2::ONE).tail(1.0).is_none());
    }

    /// Pixel i has errors i times as large; dark ones and those beside the cloth
    /// do not count.
    #[test]
    fn the_median_pixel_is_one_that_is_lit_and_met_matter() {
        let mut film = Film::new(UVec2::new(301, 1));
        let info = SiteInfo::new(Vec3::X, None);
        let first = Some(FirstEvent {
            info,
            depth_mm: 1.0,
        });
        for (i, pixel) in film.pixels_mut().iter_mut().enumerate() {
            for sample in 0..100 {
                let sign = if sample % 2 == 0 { 1.0 } else { -1.0 };
                let (level, first) = match i {
                    0..101 => (1.0 + sign * i as f32 / 1000.0, first),
                    101..201 => (0.0, first),
                    _ => (1.0 + sign, None),
                };
                let path = PathSample {
                    radiance: Rgb::splat(level),
                    bounces: 1,
                    first,
                    ..PathSample::default()
                };
                pixel.add(&path, sample);
            }
        }
        let errors = film.pixel_errors();
        let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-4, "{a}, {b}");
        near(errors.median, 0.050 / 99f64.sqrt());
        near(errors.worst_hundredth, 0.099 / 99f64.sqrt());
        let nothing = Film::new(UVec2::ONE).pixel_errors();
        assert_eq!(nothing, PixelErrors::default());
    }
}
