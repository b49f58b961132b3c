//! What the fibres of a ply do not settle about it, as factors that a fit may find.
//!
//! The model fills a ply evenly with fibres that follow helices, and forgets by which way light
//! came once it was scattered twice. Real plies have gaps and fibres out of line, and send
//! some light back through the gap by which it came. [Montazeri2020] leaves such freedom in
//! colours and weights of single lobes; here every factor keeps what is known: no light is
//! made, and a ply of clear fibres still returns all of it.

use super::sent::Sent;
use glam::Vec3;
use organza_basis::{PathRng, Rgb};

/// Corrections of a ply; those by default change nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlyCorrection {
    /// Factor of the extinction of the fibres, above zero.
    pub extinction: f32,
    /// Factor of the absorption of light that is scattered more than once, by channel, from
    /// zero. What remains of it is raised to this power, as a share of what would remain
    /// without absorption.
    pub absorption: Rgb,
    /// Factor of the odds that light that is scattered more than once leaves on the side away
    /// from where it came in, above zero.
    pub through_odds: f32,
    /// Standard deviation of the fibres' direction from their helix, about each of two axes
    /// across them, radians, from zero.
    pub spread_rad: f32,
}

impl Default for PlyCorrection {
    fn default() -> PlyCorrection {
        PlyCorrection {
            extinction: 1.0,
            absorption: Rgb::WHITE,
            through_odds: 1.0,
            spread_rad: 0.0,
        }
    }
}

/// Directions are drawn so often at most until one is met.
const TRIES: u32 = 64;

impl PlyCorrection {
    /// Whether a ply can have them: all finite and in range.
    pub fn is_valid(&self) -> bool {
        let positive = |x: f32| x.is_finite() && x > 0.0;
        let from_zero = |x: f32| x.is_finite() && x >= 0.0;
        positive(self.extinction)
            && positive(self.through_odds)
            && from_zero(self.spread_rad)
            && self.absorption.0.to_array().into_iter().all(from_zero)
    }

    /// Sine of the angle between light along `w` and fibres that follow `fibre` on average,
    /// root mean square over their directions: those of a heat kernel on the sphere, whose
    /// second Legendre moment falls by `exp(-3 variance)`.
    pub(super) fn sine(&self, fibre: Vec3, w: Vec3) -> f32 {
        let square = fibre.cross(w).length_squared();
        if self.spread_rad == 0.0 {
            return fibre.cross(w).length();
        }
        let kept = (-3.0 * self.spread_rad * self.spread_rad).exp();
        (2.0 / 3.0 * (1.0 - kept) + kept * square).max(0.0).sqrt()
    }

    /// Direction of a fibre that light along `w` meets, among those that follow `fibre` on
    /// average: in proportion to the width that it shows.
    pub(super) fn met(&self, fibre: Vec3, w: Vec3, rng: &mut PathRng) -> Vec3 {
        if self.spread_rad == 0.0 {
            return fibre;
        }
        let mut met = fibre;
        for _ in 0..TRIES {
            met = self.drawn(fibre, rng);
            if rng.unit() < met.cross(w).length() {
                break;
            }
        }
        met
    }

    /// Direction of a fibre, whether or not it is met.
    fn drawn(&self, fibre: Vec3, rng: &mut PathRng) -> Vec3 {
        let (turn, aside) = (
            self.spread_rad * rng.normal2(),
            fibre.any_orthonormal_vector(),
        );
        // A step along a great circle.
        let across = turn.x * aside + turn.y * fibre.cross(aside);
        let angle = across.length();
        let (sin, cos) = angle.sin_cos();
        (fibre * cos + across * (sin / angle.max(f32::MIN_POSITIVE))).normalize()
    }

    /// Changes what leaves after more than one event; `once` is what leaves after one.
    pub(super) fn apply(&self, once: Rgb, sent: &mut Sent) {
        if self.absorption != Rgb::WHITE {
            let total = sent.total();
            let channel = |c: usize| {
                let total = total.0[c];
                let most = (1.0 - once.0[c]).max(total).max(f32::MIN_POSITIVE);
                let left = most * (total / most).powf(self.absorption.0[c]);
                if total > 0.0 { left / total } else { 0.0 }
            };
            let scale = Rgb::from([0, 1, 2].map(channel));
            sent.scale(|_| scale);
        }
        if self.through_odds != 1.0 {
            let (total, through) = (sent.total(), sent.through());
            let share = |c: usize| through.0[c] / total.0[c].max(f32::MIN_POSITIVE);
            let over = |c: usize| 1.0 / (1.0 + (self.through_odds - 1.0) * share(c));
            let over = Rgb::from([0, 1, 2].map(over));
            sent.scale(|is_through| match is_through {
                true => over * self.through_odds,
                false => over,
            });
        }
    }
}

#[cfg(test)]
mod tests;
