//! Random wandering of one fibre among its neighbours.

use crate::spec::WanderSpec;
use crate::spline::closed_spline;
use glam::{DVec2, Vec2};
use organza_basis::PathRng;

/// The fewest turning points along a fibre.
const MIN_KNOTS: usize = 4;
/// The most: two for each of a million pieces of the shortest tile would be beyond any use.
const MAX_KNOTS: f64 = 65_536.0;
/// Root mean square of the spline between independent knots of deviation one.
const SPLINE_RMS: f64 = 0.9;

/// Displacements of a fibre that is closed over all its windings.
pub(crate) struct Wander {
    /// Radial and tangential, mm.
    knots_mm: Vec<Vec2>,
}

impl Wander {
    /// Draws the displacements of a fibre of the given length.
    pub fn new(spec: &WanderSpec, fibre_mm: f64, ply_radius_mm: f64, rng: &mut PathRng) -> Wander {
        let knots = (fibre_mm / spec.length_mm).round().min(MAX_KNOTS) as usize;
        let size = (spec.amplitude * ply_radius_mm / SPLINE_RMS) as f32;
        Wander {
            knots_mm: (0..knots.max(MIN_KNOTS))
                .map(|_| size * rng.normal2().clamp(Vec2::splat(-2.5), Vec2::splat(2.5)))
                .collect(),
        }
    }

    /// Radial and tangential displacement at the share `run` of all windings, mm.
    pub fn at(&self, run: f64) -> DVec2 {
        closed_spline(&self.knots_mm, run)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displacements_have_their_amplitude_and_length_and_close() {
        let spec = WanderSpec {
            amplitude: 0.2,
            length_mm: 0.5,
        };
        let (mut square, mut product, n) = (0.0, 0.0, 4000);
        for i in 0..n {
            let wander = Wander::new(&spec, 20.0, 0.1, &mut PathRng::new(9, i, 0));
            let run = i as f64 / n as f64;
            assert!(wander.at(run).distance(wander.at(run + 1.0)) < 4.0 * f64::from(f32::EPSILON));
            square += wander.at(run).length_squared();
            // Three lengths on, another place.
            product += wander.at(run).dot(wander.at(run + 3.0 * 0.5 / 20.0));
        }
        let rms = (0.5 * square / n as f64).sqrt();
        // Four standard errors over 8000 normal deviates are 3 %; clamped deviates take 1 %.
        // Margin: four standard errors, here and below.
        assert!((rms / 0.02 - 1.0).abs() < 0.05, "{rms}");
        assert!((product / square).abs() < 0.07, "{}", product / square);
    }
}
