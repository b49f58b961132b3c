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

impl Film {
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
                        bounces: 0,
                        first: None,
                        absorbed: Rgb::BLACK,
                        escape: None,
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

    /// Pixel i has errors i times as large; dark ones and those beside the cloth
    /// do not count.
    #[test]
    fn the_median_pixel_is_one_that_is_lit_and_met_matter() {
        let mut film = Film::new(UVec2::new(301, 1));
        let info = SiteInfo {
            axis: Vec3::X,
            yarn: None,
        };
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
                    absorbed: Rgb::BLACK,
                    escape: None,
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
