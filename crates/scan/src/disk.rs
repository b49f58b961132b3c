//! The fibre whose blurred disk is a measured section.
//!
//! Blur lowers the grey value in the middle of a thin fibre and moves its outline. The mean
//! section (value in the middle, slope at the outline, radius at the threshold) is that of a
//! blurred disk, whose true radius, blur and grey value follow from the three.

use crate::rays::FibreSection;
use std::f32::consts::TAU;

/// What the mean section says of fibres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fibre {
    pub radius_mm: f32,
    /// Grey value of a voxel full of fibre.
    pub grey: f32,
    /// Deviation of the blur, mm, with that of the noise filter.
    pub blur_mm: f32,
}

impl Fibre {
    /// Distance by which blur moves the outline inward, mm: where half of the grey value is left.
    pub fn shrunk_mm(&self) -> f32 {
        let r = self.radius_mm;
        let half = bisect(0.5 * r, 1.5 * r, |at| {
            blurred_disk(at, r, self.blur_mm) > 0.5
        });
        (r - half).max(0.0)
    }
}

/// Least share of the grey value that blur may leave in the middle of a fibre.
const LEAST_MIDDLE: f32 = 0.5;

/// The fibre whose blurred disk is the mean section: of a radius at the threshold, grey values
/// of air, threshold and middle, and the slope at the outline. A given grey value of fibre stays.
pub(crate) fn unblurred(
    section: &FibreSection,
    air: f32,
    threshold: f32,
    grey: Option<f32>,
) -> Fibre {
    let mut fibre = Fibre {
        radius_mm: section.radius_mm,
        grey: grey.unwrap_or(section.middle),
        blur_mm: 0.0,
    };
    // Each equation determines one of the three, and changes the others little.
    for _ in 0..12 {
        let contrast = (fibre.grey - air).max(f32::MIN_POSITIVE);
        let slope = section.slope_per_mm.max(0.0) / contrast;
        let delta = 0.02 * fibre.radius_mm;
        let falls = |blur: f32| {
            let at = |r: f32| blurred_disk(r, fibre.radius_mm, blur);
            (at(section.radius_mm - delta) - at(section.radius_mm + delta)) / (2.0 * delta)
        };
        // Slopes fall as blur grows.
        fibre.blur_mm = bisect(0.02 * fibre.radius_mm, 0.8 * fibre.radius_mm, |b| {
            falls(b) > slope
        });
        if grey.is_none() {
            let left = blurred_disk(0.0, fibre.radius_mm, fibre.blur_mm).max(LEAST_MIDDLE);
            fibre.grey = air + (section.middle - air) / left;
        }
        let share = (threshold - air) / (fibre.grey - air).max(f32::MIN_POSITIVE);
        let r = section.radius_mm;
        fibre.radius_mm = bisect(0.5 * r, 1.5 * r, |radius| {
            blurred_disk(r, radius, fibre.blur_mm) < share
        });
    }
    fibre
}

/// Where `is_below` changes from true to false, between two numbers.
fn bisect(mut low: f32, mut high: f32, is_below: impl Fn(f32) -> bool) -> f32 {
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if is_below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Value at a distance from the middle of a disk of value one that is blurred with a Gaussian:
/// strips of the disk, each with its integral across.
fn blurred_disk(distance: f32, radius: f32, blur: f32) -> f32 {
    const STRIPS: usize = 64;
    let scale = 1.0 / (std::f32::consts::SQRT_2 * blur);
    // What the blur takes from beyond each end of a strip.
    let edge = |x: f32| normal_below(x * std::f32::consts::SQRT_2 * scale);
    let width = 2.0 * radius / STRIPS as f32;
    let mut sum = 0.0;
    for k in 0..STRIPS {
        let x = -radius + (k as f32 + 0.5) * width;
        let half = (radius * radius - x * x).max(0.0).sqrt();
        let share = edge(x + 0.5 * width - distance) - edge(x - 0.5 * width - distance);
        sum += share * (2.0 * edge(half) - 1.0);
    }
    sum
}

/// The share of a standard normal distribution below a value, within 1e-7
/// `[AbramowitzStegun1964]`, 26.2.17.
fn normal_below(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let series = t
        * (0.319_381_53
            + t * (-0.356_563_782
                + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let tail = (-0.5 * x * x).exp() * series / TAU.sqrt();
    if x < 0.0 { tail } else { 1.0 - tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blurred_disk_keeps_its_value_and_gives_its_parameters_back() {
        assert!((normal_below(0.0) - 0.5).abs() < 4.0 * f32::EPSILON);
        assert!((normal_below(1.96) - 0.975).abs() < 32.0 * f32::EPSILON);
        // In the middle of a disk the blur leaves 1 - exp(-r^2 / 2 s^2).
        let middle = blurred_disk(0.0, 2.0, 1.1);
        assert!(
            (middle - (1.0 - (-2.0f32 / 1.21).exp())).abs() < 2e-3,
            "{middle}"
        );
        assert!((blurred_disk(10.0, 10.0, 0.3) - 0.5).abs() < 4.0 * f32::EPSILON);
        for (radius, blur) in [(2.0f32, 1.2f32), (3.0, 0.8), (8.0, 0.5)] {
            let (air, grey, threshold) = (60.0, 160.0, 100.0);
            let at = |r: f32| air + (grey - air) * blurred_disk(r, radius, blur);
            let r = bisect(0.1, 2.0 * radius, |r| at(r) > threshold);
            let section = FibreSection {
                radius_mm: r,
                length_mm: 0.0,
                unroundness: 0.0,
                is_free: true,
                inner_covariance: None,
                middle: at(0.0),
                slope_per_mm: (at(r - 0.05) - at(r + 0.05)) / 0.1,
            };
            let f = unblurred(&section, air, threshold, None);
            assert!((f.radius_mm / radius - 1.0).abs() < 0.02, "{f:?}");
            assert!((f.blur_mm / blur - 1.0).abs() < 0.1, "{f:?}");
            // Of wide fibres, the square of the blur over the diameter; strips move an outline by
            // less than half their width.
            let shrunk = f.shrunk_mm();
            let wanted = 0.5 * blur * blur / radius;
            let most = 0.2 * wanted + radius / 64.0;
            assert!(
                (shrunk - wanted).abs() < most,
                "{f:?}: {shrunk}, not {wanted}"
            );
            assert!((f.grey / grey - 1.0).abs() < 0.02, "{f:?}");
        }
    }
}
