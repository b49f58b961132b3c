//! Directions about a fibre.

use glam::{Vec2, Vec3};

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
        let sin_out = tangent.dot(w_out).clamp(-1.0, 1.0);
        let side = w_out.cross(tangent);
        let cos_out = side.length();
        let side = if cos_out > 0.03 {
            side / cos_out
        } else if cos_out > 1e-7 {
            // Rounding has tilted the short product toward the tangent.
            let side = side / cos_out;
            (side - tangent * tangent.dot(side)).normalize()
        } else {
            tangent.any_orthonormal_vector()
        };
        FibreFrame {
            tangent,
            forward: side.cross(tangent),
            side,
            sin_out,
            cos_out: cos_out.min(1.0),
        }
    }

    /// Sine and cosine of the inclination and the azimuth of a unit direction.
    pub fn angles(&self, w: Vec3) -> FibreAngles {
        let across = Vec2::new(w.dot(self.forward), w.dot(self.side));
        FibreAngles {
            sin: w.dot(self.tangent).clamp(-1.0, 1.0),
            cos: across.length().min(1.0),
            azimuth_rad: quick_atan2(across.y, across.x),
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

const COEFFICIENTS: [f32; 8] = [
    0.999999882,
    -0.333318127,
    0.199669618,
    -0.140032902,
    0.098688655,
    -0.058829753,
    0.023780519,
    -0.004559792,
];

/// `y.atan2(x)` to within 2e-6, in a quarter of its time: far below the narrowest
/// blur, and the scattering functions spend most of their time on angles. Zero
/// for (0, 0).
pub(crate) fn quick_atan2(y: f32, x: f32) -> f32 {
    let (ax, ay) = (x.abs(), y.abs());
    let t = ax.min(ay) / ax.max(ay).max(f32::MIN_POSITIVE);
    let s = t * t;
    // Odd polynomial through the Chebyshev nodes of [0, 1], summed in pairs:
    // callers wait for it, and pairs are ready in half of the time.
    let [c0, c1, c2, c3, c4, c5, c6, c7] = COEFFICIENTS;
    let s2 = s * s;
    let low = (c0 + c1 * s) + (c2 + c3 * s) * s2;
    let high = (c4 + c5 * s) + (c6 + c7 * s) * s2;
    let p = (low + high * (s2 * s2)) * t;
    let p = if ay > ax {
        std::f32::consts::FRAC_PI_2 - p
    } else {
        p
    };
    let p = if x < 0.0 { std::f32::consts::PI - p } else { p };
    p.copysign(y)
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
    fn quick_angles_are_accurate() {
        for i in -20_000..=20_000 {
            let a = i as f32 / 20_000.0 * std::f32::consts::PI;
            let (y, x) = a.sin_cos();
            let error = (quick_atan2(3.0 * y, 3.0 * x) - y.atan2(x)).abs();
            assert!(error < 2e-6, "{a}: {error}");
        }
        assert_eq!(quick_atan2(0.0, 0.0), 0.0);
        assert_eq!(quick_atan2(0.0, -1.0), std::f32::consts::PI);
    }

    #[test]
    fn angles_round_trip_and_travel_is_forward() {
        for t in oblique() {
            for w_out in hard_directions(t) {
                let f = FibreFrame::new(t, w_out);
                assert!((f.forward.cross(f.side) - t).length() < 1e-5, "{t} {w_out}");
                let travel = -w_out - t * t.dot(-w_out);
                assert!(
                    (f.forward * f.cos_out - travel).length() < 1e-5,
                    "{t} {w_out}"
                );
                for w in hard_directions(t) {
                    let a = f.angles(w);
                    let back = f.direction(&a);
                    assert!((back - w).length() < 1e-5, "{t} {w}: {back}");
                }
            }
        }
    }
}
