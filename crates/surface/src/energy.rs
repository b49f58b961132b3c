//! A bound on the light that the cloth returns.
//!
//! The model of the thesis does not conserve energy: towards grazing angles the specular part
//! grows, and wool gabardine as published returns a percent more light there than it receives.
//! Where the albedo rho(w) of a direction exceeds one, values are divided by `max(m(w_in),
//! m(w_out))` with `m = max(1, rho)`. The result is symmetric, other directions are unchanged,
//! and the albedo is at most one.

use glam::{Vec2, Vec3};
use organza_basis::warp;

/// Cells along each side of the table.
const SIDE: usize = 24;

/// The divisor m(w) for directions above a face.
#[derive(Debug)]
pub(crate) struct EnergyBound {
    /// Values at the corners of the cells; empty when all are one.
    divisors: Vec<f32>,
    largest: f32,
}

/// Unit square to hemisphere by the octahedron [Cigolle2014], which resolves the rim as well as
/// it resolves the pole and needs no trigonometry.
fn direction(u: Vec2) -> Vec3 {
    let p = 2.0 * u - Vec2::ONE;
    let (x, y) = (0.5 * (p.x + p.y), 0.5 * (p.x - p.y));
    Vec3::new(x, y, (1.0 - x.abs() - y.abs()).max(0.0)).normalize()
}

fn square(w: Vec3) -> Vec2 {
    let p = w.truncate() / (w.x.abs() + w.y.abs() + w.z);
    0.5 * (Vec2::new(p.x + p.y, p.x - p.y) + Vec2::ONE)
}

impl EnergyBound {
    /// Tabulates an albedo, given with its number of quadrature points.
    pub fn new(albedo: impl Fn(Vec3, usize) -> f32) -> EnergyBound {
        // A first estimate suffices for most cloth, which returns far less than it receives.
        let rim = (0..24).map(|i| warp::direction_from_angles(1.5, i as f32 * 0.262));
        let steep = (0..24).map(|i| warp::direction_from_angles(1.2, i as f32 * 0.262));
        if rim.chain(steep).all(|w| albedo(w, 64) < 0.7) {
            return EnergyBound {
                divisors: Vec::new(),
                largest: 1.0,
            };
        }
        let mut divisors = Vec::with_capacity((SIDE + 1) * (SIDE + 1));
        for j in 0..=SIDE {
            for i in 0..=SIDE {
                let mut w = direction(Vec2::new(i as f32, j as f32) / SIDE as f32);
                // Just above the horizon, where the model is defined.
                w.z = w.z.max(1e-3);
                divisors.push(albedo(w.normalize(), 128).max(1.0));
            }
        }
        let largest = divisors.iter().copied().fold(1.0, f32::max);
        if largest <= 1.0 {
            divisors.clear();
        }
        EnergyBound { divisors, largest }
    }

    /// The largest albedo found, or one.
    pub fn largest(&self) -> f32 {
        self.largest
    }

    /// The smallest divisor of values for the direction.
    pub fn divisor(&self, w: Vec3) -> f32 {
        if self.divisors.is_empty() {
            return 1.0;
        }
        let p = square(w) * SIDE as f32;
        let cell = |x: f32| (x as usize).min(SIDE - 1);
        let (i, j) = (cell(p.x), cell(p.y));
        let (fx, fy) = (p.x - i as f32, p.y - j as f32);
        let row = |j: usize| {
            let k = j * (SIDE + 1) + i;
            self.divisors[k] + (self.divisors[k + 1] - self.divisors[k]) * fx
        };
        row(j) + (row(j + 1) - row(j)) * fy
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    #[test]
    fn the_square_and_the_hemisphere_map_to_each_other() {
        let mut rng = PathRng::from_seed(61);
        for _ in 0..2000 {
            let w = warp::cosine_hemisphere(rng.unit2());
            assert!((direction(square(w)) - w).length() < 8.0 * f32::EPSILON);
        }
    }

    #[test]
    fn an_albedo_above_one_is_brought_to_one() {
        let albedo = |w: Vec3| 0.6 + 0.8 * (1.0 - w.z) * w.x.abs();
        let bound = EnergyBound::new(|w, _| albedo(w));
        for k in 0..500 {
            let w = warp::direction_from_angles(k as f32 * 3.1e-3, k as f32);
            let left = albedo(w) / bound.divisor(w);
            let least = albedo(w).min(1.0) - 0.03;
            assert!(left < 1.01 && left > least, "{w} {left}");
        }
        assert_eq!(EnergyBound::new(|_, _| 0.9).divisor(Vec3::X), 1.0);
    }
}
