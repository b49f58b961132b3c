//! Directions about a fibre.

use crate::near::Frame;
use glam::{Vec2, Vec3};
use organza_lanes::V3;
use organza_lanes::math::atan2;

/// The frame of a fibre as a walk meets it: tangent t, the walk's direction of
/// travel projected across it (d), and the side n = t x d.
///
/// Inclinations theta are measured from the plane across t, positive toward t.
/// Azimuths are measured about t from d toward n: light that goes straight on
/// has azimuth zero, light that is sent back has pi. A ray at offset h meets the
/// fibre of unit radius at the point `h n - sqrt(1 - h^2) d` from its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FibreFrame {
    /// Unit tangent.
    pub tangent: Vec3,
    /// Unit direction of travel across the tangent.
    pub forward: Vec3,
    /// Unit `tangent x forward`.
    pub side: Vec3,
    /// Sine of the inclination of `w_out`.
    pub sin_out: f32,
    /// Cosine of the inclination of `w_out`, not negative.
    pub cos_out: f32,
}

impl FibreFrame {
    /// From a unit tangent and the unit direction back along the walk. A walk
    /// along the fibre has no direction across it and gets any.
    pub fn new(tangent: Vec3, w_out: Vec3) -> FibreFrame {
        let frame = Frame::new(V3::splat(tangent), V3::splat(w_out));
        FibreFrame {
            tangent,
            forward: frame.forward.into(),
            side: frame.side.into(),
            sin_out: frame.sin_out,
            cos_out: frame.cos_out,
        }
    }

    /// The same for lanes.
    pub(crate) fn lanes(&self) -> Frame<f32> {
        Frame {
            tangent: V3::splat(self.tangent),
            forward: V3::splat(self.forward),
            side: V3::splat(self.side),
            sin_out: self.sin_out,
            cos_out: self.cos_out,
        }
    }

    /// Sine and cosine of the inclination and the azimuth of a unit direction.
    pub fn angles(&self, w: Vec3) -> FibreAngles {
        let across = Vec2::new(w.dot(self.forward), w.dot(self.side));
        FibreAngles {
            sin: w.dot(self.tangent).clamp(-1.0, 1.0),
            cos: across.length().min(1.0),
            azimuth_rad: atan2(across.y, across.x),
        }
    }

    /// The unit direction of such angles.
    pub fn direction(&self, a: &FibreAngles) -> Vec3 {
        self.tangent * a.sin + self.across(a.azimuth_rad) * a.cos
    }

    /// The unit vector across the fibre at an azimuth.
    pub fn across(&self, azimuth_rad: f32) -> Vec3 {
        let (sin, cos) = azimuth_rad.sin_cos();
        self.forward * cos + self.side * sin
    }

    /// Offset in `[-1, 1]` of a ray that meets the fibre's surface where its
    /// unit outward normal is `normal`.
    pub fn offset(&self, normal: Vec3) -> f32 {
        normal.dot(self.side).clamp(-1.0, 1.0)
    }
}

/// A direction about a fibre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FibreAngles {
    /// Sine of the inclination.
    pub sin: f32,
    /// Cosine of the inclination, not negative.
    pub cos: f32,
    /// Azimuth in `(-pi, pi]`.
    pub azimuth_rad: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proofs::{hard_directions, oblique};

    #[test]
    fn angles_round_trip_and_travel_is_forward() {
        for t in oblique() {
            for w_out in hard_directions(t) {
                let f = FibreFrame::new(t, w_out);
                assert!((f.forward.cross(f.side) - t).length() < 1e-5, "{t} {w_out}");
                let travel = -w_out - t * t.dot(-w_out);
                let off = (f.forward * f.cos_out - travel).length();
                assert!(off < 1e-5, "{t} {w_out}");
                for w in hard_directions(t) {
                    let a = f.angles(w);
                    let back = f.direction(&a);
                    assert!((back - w).length() < 1e-5, "{t} {w}: {back}");
                }
            }
        }
    }
}
