//! Vignetting: by how much a lens darkens a photograph away from its middle.

use crate::Photograph;
use glam::DVec2;
use nalgebra::{Matrix3, Vector3};

/// Parts of a photograph along a side whose means show vignetting.
const PARTS: usize = 12;

/// The brightness at a distance `r` from the middle, as a share of half the diagonal, is that of the
/// middle times `1 + a r^2 + b r^4`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vignetting {
    /// Coefficient of the square.
    pub a: f64,
    /// Coefficient of the fourth power.
    pub b: f64,
}

impl Vignetting {
    /// The factor at a distance, never less than a twentieth.
    pub fn factor(self, r: f64) -> f64 {
        let square = r * r;
        (1.0 + square * (self.a + square * self.b)).max(0.05)
    }

    /// The vignetting of a photograph of an even cloth without shading: that of least squares for the
    /// means of 12 x 12 parts. `counts` are the pixels that are looked at.
    pub fn find(photograph: &Photograph, counts: impl Fn(usize, usize) -> bool) -> Vignetting {
        let [w, h] = photograph.size();
        let mut parts = vec![(0.0, 0.0, DVec2::ZERO); PARTS * PARTS];
        for y in 0..h {
            for x in (0..w).filter(|x| counts(*x, y)) {
                let part = &mut parts[y * PARTS / h * PARTS + x * PARTS / w];
                part.0 += photograph.pixel(x, y).iter().sum::<f64>();
                part.1 += 1.0;
                part.2 += photograph.place(x, y);
            }
        }
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (sum, count, at) in parts.into_iter().filter(|p| p.1 > 0.0) {
            let square = (at / count).length_squared();
            let row = Vector3::new(1.0, square, square * square);
            normal += count * row * row.transpose();
            right += row * sum;
        }
        let found = normal.lu().solve(&right).unwrap_or_default();
        if found[0] > 0.0 {
            let [a, b] = [found[1] / found[0], found[2] / found[0]];
            Vignetting { a, b }
        } else {
            Vignetting::default()
        }
    }

    /// A photograph without it.
    pub fn removed(self, photograph: &Photograph) -> Photograph {
        photograph.scaled(|x, y| [1.0 / self.factor(photograph.place(x, y).length()); 3])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Planted values come back from a picture with threads, and its photograph is even without them.
    #[test]
    fn planted_vignetting_is_found_and_removed() {
        let planted = Vignetting { a: -0.35, b: 0.08 };
        let drawn = |with: Vignetting| {
            let value = |i: usize| {
                let (x, y) = (i % 240, 179 - i / 240);
                let threads = 1.0 + 0.5 * (x as f64 * 0.9).sin() * (y as f64 * 0.7).cos();
                let at = DVec2::new(x as f64 - 119.5, y as f64 - 89.5);
                0.4 * threads * with.factor(at.length() / (0.5 * 240f64.hypot(180.0)))
            };
            let rows: Vec<[f32; 3]> = (0..240 * 180).map(|i| [value(i) as f32; 3]).collect();
            Photograph::new(240, 180, &rows).unwrap()
        };
        let photograph = drawn(planted);
        let error = |found: Vignetting| (found.factor(1.0) / planted.factor(1.0) - 1.0).abs();
        // Threads do not divide the parts evenly: 0.2 % of their means.
        let found = Vignetting::find(&photograph, |_, _| true);
        assert!(error(found) < 0.01, "{found:?}");
        // Three quarters of it say as much.
        let found = Vignetting::find(&photograph, |x, _| x >= 60);
        assert!(error(found) < 0.02, "{found:?}");
        let flat = drawn(Vignetting::default());
        let removed = planted.removed(&photograph);
        for (x, y) in [(0, 0), (120, 90), (239, 17)] {
            let (a, b) = (removed.pixel(x, y)[0], flat.pixel(x, y)[0]);
            assert!(
                (a / b - 1.0).abs() < 4.0 * f64::from(f32::EPSILON),
                "{a} {b}"
            );
        }
        // The known-bad twin: a photograph without vignetting.
        let none = Vignetting::find(&flat, |_, _| true);
        assert!(error(none) > 0.2, "{none:?}");
    }
}
