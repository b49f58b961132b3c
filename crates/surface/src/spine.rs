//! The curve of the axis of a yarn over one visible segment.

use crate::error::Error;
use crate::real::Real;

/// Radius of curvature of the conic that carries a segment \[Irawan2008] (6.4),
/// as a function of the inclination u of its tangent.
///
/// One formula serves ellipse, circle, parabola and hyperbola. With the axis ratio `r = 1 +
/// kappa (1 + cot u_max)` and `q = r |r|`, the conic's radius is proportional to `(cos^2 u + q
/// sin^2 u)^(-3/2)`, and requiring that the curve cover the half length `c` between its ends
/// fixes the factor. It is continuous in kappa, also at the parabola and the circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spine<T> {
    q: T,
    scale_mm: T,
    /// The smallest value of `cos^2 u + q sin^2 u` on the spine, which rounding
    /// must not undercut.
    floor: T,
}

impl<T: Real> Spine<T> {
    /// The spine that covers `half_length_mm` to each side and ends at
    /// inclination `u_max_rad`.
    ///
    /// # Errors When `kappa` gives a hyperbola whose asymptotes are less steep than
    /// `u_max_rad`.
    pub fn new(half_length_mm: f64, u_max_rad: f64, kappa: f64) -> Result<Self, Error> {
        let (sin, cos) = u_max_rad.sin_cos();
        // r sin u_max, which stays finite as u_max goes to zero.
        let r_sin = sin + kappa * (sin + cos);
        let q_sin2 = r_sin * r_sin.abs();
        let under = cos * cos + q_sin2;
        if under <= 0.0 {
            // The smallest kappa has r sin u_max = -cos u_max.
            return Err(Error::Curvature {
                key: "kappa".into(),
                kappa,
                smallest: -1.0,
            });
        }
        Ok(Spine {
            q: T::of(q_sin2 / (sin * sin)),
            scale_mm: T::of(half_length_mm / sin * under.sqrt()),
            floor: T::of(under.min(1.0)),
        })
    }

    /// Radius of curvature, mm, where the tangent is inclined by u.
    #[inline(always)]
    pub fn radius_mm(&self, sin_u: T, cos_u: T) -> T {
        if self.q == T::one() {
            return self.scale_mm; // a circle
        }
        let k = (cos_u * cos_u + self.q * sin_u * sin_u).larger(self.floor);
        self.scale_mm / (k * k.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equations 6.5 to 6.8 as printed, one case for each conic.
    fn by_cases(c: f64, u_max: f64, kappa: f64, u: f64) -> f64 {
        let r = 1.0 + kappa * (1.0 + 1.0 / u_max.tan());
        if r > 0.0 {
            let b = c / (r * u_max.tan()).atan().sin();
            let (a, t) = (b / r, (r * u.tan()).atan());
            ((b * t.cos()).powi(2) + (a * t.sin()).powi(2)).powf(1.5) / (a * b)
        } else if r < 0.0 {
            let b = c / (-(r * u_max.tan()).atanh()).sinh();
            let (a, t) = (b / r, -(r * u.tan()).atanh());
            -((b * t.cosh()).powi(2) + (a * t.sinh()).powi(2)).powf(1.5) / (a * b)
        } else {
            let b = c / (2.0 * u_max.tan());
            2.0 * b * (1.0 + u.tan().powi(2)).powf(1.5)
        }
    }

    #[test]
    fn one_formula_is_every_conic() {
        let u_max = 0.5f64;
        let parabola = -1.0 / (1.0 + 1.0 / u_max.tan());
        for kappa in [-0.6, -0.4, parabola, -0.1, 0.0, 0.7, 3.0] {
            let spine = Spine::<f64>::new(0.8, u_max, kappa).unwrap();
            for i in 0..20 {
                let u = u_max * (f64::from(i) / 10.0 - 0.95);
                let expected = by_cases(0.8, u_max, kappa, u);
                let got = spine.radius_mm(u.sin(), u.cos());
                let rounding = 16.0 * f64::EPSILON * expected;
                assert!((got - expected).abs() < rounding, "{kappa} {u}");
            }
        }
    }

    #[test]
    fn the_spine_covers_its_length() {
        // dy/du = R cos u, integrated between the ends, is the whole length.
        for (u_max, kappa) in [(0.3, -0.5), (1.2, 0.0), (0.02, 2.0), (1.5, -0.9)] {
            let spine = Spine::<f64>::new(0.8, u_max, kappa).unwrap();
            let covered = organza_basis::quadrature::integrate(-u_max, u_max, 1e-10, |u| {
                spine.radius_mm(u.sin(), u.cos()) * u.cos()
            });
            let off = (covered - 1.6).abs();
            assert!(off < 32.0 * f64::EPSILON, "{u_max} {kappa}: {covered}");
        }
    }

    #[test]
    fn a_hyperbola_past_its_asymptote_is_refused() {
        assert!(Spine::<f64>::new(0.8, 0.5, -1.0).is_err());
        assert!(Spine::<f64>::new(0.8, 0.5, -0.999_999).is_ok());
    }
}
