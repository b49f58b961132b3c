//! Untwisted yarn: the highlight lies at one inclination u, across the yarn.

use crate::real::{Direction, Real};
use crate::segment::{Pair, YarnSegment};

/// The ring of the yarn that mirrors one direction into the other. There the spine is
/// perpendicular to the half vector.
#[derive(Clone, Copy)]
pub(crate) struct Ring<T> {
    /// Inclination, and the tangent of its half.
    pub u: T,
    tan_half_u: T,
    pub sin_u: T,
    pub cos_u: T,
    /// One over the length of `w_in + w_out` in the plane of the spine.
    pub inv_p: T,
}

impl<T: Real> Ring<T> {
    /// For directions above the cloth, whose sum is never perpendicular to that plane.
    #[inline(always)]
    pub fn new(pair: &Pair<T>) -> Self {
        let p = (pair.s.y * pair.s.y + pair.s.z * pair.s.z).sqrt();
        let (inv_p, tan_half_u) = (T::one() / p, pair.s.y / (p + pair.s.z));
        Ring {
            u: T::of(2.0) * tan_half_u.atan_unit(),
            tan_half_u,
            sin_u: pair.s.y * inv_p,
            cos_u: pair.s.z * inv_p,
            inv_p,
        }
    }

    /// Integrals over v of the attenuation and of the attenuation times cos v,
    /// where the ring faces both directions and the viewer; in closed form.
    ///
    /// With `w.n = |w'| cos(v - b)` for both directions (w' the part across the fibre), the
    /// attenuation is a product of two cosines over a third about a known angle c: a quadratic
    /// form in the sine and cosine of v - c, over the cosine. The ends lie at a right angle
    /// from the outermost of b_i, b_r and 0, the angle of the viewer, so everything except
    /// their distance is algebraic. The computation is in `f64`, because the contributions of
    /// the two ends cancel where little of the ring faces both directions.
    pub fn attenuation_integrals(&self, pair: &Pair<T>) -> (T, T) {
        let wide = |x: T| x.to_f64().unwrap_or(f64::NAN);
        let (sin_u, cos_u) = (wide(self.sin_u), wide(self.cos_u));
        let across = |w: Direction<T>| (wide(w.x), wide(w.y) * sin_u + wide(w.z) * cos_u);
        let ((x_i, z_i), (x_r, z_r)) = (across(pair.w_in), across(pair.w_out));
        // Sine and cosine of b beside the tangent of b/2, which orders angles.
        let angle = |x: f64, z: f64| {
            let r = (x * x + z * z).sqrt();
            (x / (r + z), x / r, z / r)
        };
        let (b_i, b_r, viewer) = (angle(x_i, z_i), angle(x_r, z_r), (0.0, 0.0, 1.0));
        let in_order = b_i.0 < b_r.0;
        let (less, more) = if in_order { (b_i, b_r) } else { (b_r, b_i) };
        let least = if less.0 < 0.0 { less } else { viewer };
        let most = if more.0 > 0.0 { more } else { viewer };
        // Perpendicular to both, less than half a turn apart.
        let (apart, together) = (most.0 - least.0, 1.0 + most.0 * least.0);
        if !(together > 0.0) {
            return (T::zero(), T::zero());
        }
        let v = 2.0 * together.atan2(apart);
        let (x, z) = (x_i + x_r, z_i + z_r);
        let m2 = x * x + z * z;
        let inv_m = 1.0 / m2.sqrt();
        let (sin_c, cos_c) = (x * inv_m, z * inv_m);
        // Parts of the directions along and across the axis c.
        let (i1, r1) = (x_i * sin_c + z_i * cos_c, x_r * sin_c + z_r * cos_c);
        let i2 = (x_i * z_r - z_i * x_r) * inv_m;
        let (cc, cs, ss) = (i1 * r1, i2 * (r1 - i1), -i2 * i2);
        // Sine and cosine of v - c at the ends, b - c turned by a right angle.
        let turned = |(_, sin_b, cos_b): (f64, f64, f64)| {
            (cos_b * cos_c + sin_b * sin_c, cos_b * sin_c - sin_b * cos_c)
        };
        let (sin1, cos1) = turned(least);
        let (sin0, cos0) = turned(most);
        let (sin0, cos0) = (-sin0, -cos0);
        // Arguments of the logarithms. `ss` vanishes where the ring ends at
        // cos = 0 and they do not.
        let arguments = |sin: f64, cos: f64| {
            if !(cos > 1e-12) {
                (1.0, 1.0)
            } else if sin > 0.0 {
                ((1.0 + sin) / cos, cos)
            } else {
                (cos / (1.0 - sin), cos)
            }
        };
        let ((e0, l0), (e1, l1)) = (arguments(sin0, cos0), arguments(sin1, cos1));
        let (secant, tangent) = ((e1 / e0).ln(), (l0 / l1).ln());
        let (sin, cos) = (sin1 - sin0, cos1 - cos0);
        let square = 0.5 * (sin1 * sin1 - sin0 * sin0);
        let even = 0.5 * (v + sin1 * cos1 - sin0 * cos0);
        let flat = cc * sin - cs * cos + ss * (secant - sin);
        let by_cos = cc * even + cs * square + ss * (v - even);
        let by_sin = cc * square + cs * (v - even) + ss * (tangent - square);
        let positive = |x: f64| T::of((x * inv_m).max(0.0));
        (positive(flat), positive(by_cos * cos_c - by_sin * sin_c))
    }
}

impl<T: Real> YarnSegment<T> {
    /// True when the ring lies on the segment.
    #[inline(always)]
    pub(crate) fn holds(&self, ring: &Ring<T>) -> bool {
        ring.tan_half_u.abs() < self.tan_half_u_max
    }

    /// Smoothstep from one to zero over the last `smoothing` share before
    /// u_max (equation 7.10).
    #[inline(always)]
    pub(crate) fn fade(&self, u: T) -> T {
        let x = (u.abs() * self.fade_slope + self.fade_start)
            .larger(T::zero())
            .smaller(T::one());
        T::one() - x * x * (T::of(3.0) - T::of(2.0) * x)
    }

    /// Integral of the highlight over v, mm^2, given the integrals of the attenuation, which
    /// are the same for every spine. Zero where the segment does not contain the ring.
    #[inline(always)]
    pub(crate) fn filament_reflectance(&self, ring: &Ring<T>, integrals: (T, T)) -> T {
        let spine = self.spine.radius_mm(ring.sin_u, ring.cos_u);
        let value = self.radius_mm
            * self.fade(ring.u)
            * ring.inv_p
            * (spine * integrals.0 + self.radius_mm * integrals.1);
        if self.holds(ring) { value } else { T::zero() }
    }

    /// The value of the texture over the phase function: a band of constant width along the
    /// yarn around the ring, inside the rectangle.
    #[inline(always)]
    pub(crate) fn filament_texture(&self, pair: &Pair<T>, x: T, y: T) -> T {
        let ring = Ring::new(pair);
        let (low, high) = self.u_band.angles(y);
        let (sin_v, cos_v) = self.v_band.angle(x).sin_cos_acute();
        let toward = |w: Direction<T>| w.x * sin_v + (w.y * ring.sin_u + w.z * ring.cos_u) * cos_v;
        let (n_i, n_r) = (toward(pair.w_in), toward(pair.w_out));
        let drawn =
            self.holds(&ring) && ring.u > low && ring.u < high && n_i.smaller(n_r) > T::zero();
        if !drawn {
            return T::zero();
        }
        let spine = self.spine.radius_mm(ring.sin_u, ring.cos_u);
        self.fade(ring.u) * ring.inv_p * (spine + self.radius_mm * cos_v) * n_i * n_r / (n_i + n_r)
            * self.texture_factor
    }
}
