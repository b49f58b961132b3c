//! Untwisted yarn: the highlight lies at one inclination u, across the yarn.

use crate::real::{Direction, Real};
use crate::segment::{Pair, YarnSegment};
use crate::staple::band;

/// The ring of the yarn that mirrors one direction into the other: where the
/// spine is square to the half vector.
#[derive(Clone, Copy)]
pub(crate) struct Ring<T> {
    /// Tangent of its inclination u.
    tan_u: T,
    pub sin_u: T,
    pub cos_u: T,
    /// Length of `w_i + w_r` in the plane of the spine.
    pub p: T,
}

impl<T: Real> Ring<T> {
    /// Not a number throughout when `w_i + w_r` has no part in that plane.
    pub fn new(pair: &Pair<T>) -> Self {
        let p = (pair.s.y * pair.s.y + pair.s.z * pair.s.z).sqrt();
        Ring {
            tan_u: pair.s.y / pair.s.z,
            sin_u: pair.s.y / p,
            cos_u: pair.s.z / p,
            p,
        }
    }

    /// Its inclination.
    pub fn u(&self) -> T {
        self.tan_u.atan()
    }

    /// Integrals over v of the attenuation and of the attenuation times cos v,
    /// where the ring faces both directions and the viewer; in closed form.
    ///
    /// With `w.n = |w'| cos(v - b)` for both directions (w' the part across the
    /// fibre), the attenuation is a product of two cosines over a third about a
    /// known angle c: a quadratic form in the sine and cosine of v - c, over
    /// the cosine. Taken in `f64`, since the two ends cancel where little of
    /// the ring faces both.
    pub fn attenuation_integrals(&self, pair: &Pair<T>) -> (T, T) {
        let wide = |x: T| x.to_f64().unwrap_or(f64::NAN);
        let (sin_u, cos_u) = (wide(self.sin_u), wide(self.cos_u));
        let across = |w: Direction<T>| (wide(w.x), wide(w.y) * sin_u + wide(w.z) * cos_u);
        let ((x_i, z_i), (x_r, z_r)) = (across(pair.w_i), across(pair.w_r));
        let (b_i, b_r) = (x_i.atan2(z_i), x_r.atan2(z_r));
        let right = std::f64::consts::FRAC_PI_2;
        let low = b_i.max(b_r).max(0.0) - right;
        let high = b_i.min(b_r).min(0.0) + right;
        if !(low < high) {
            return (T::zero(), T::zero());
        }
        let (x, z) = (x_i + x_r, z_i + z_r);
        let m = x.hypot(z);
        let (sin_c, cos_c, c) = (x / m, z / m, x.atan2(z));
        // Parts of the directions along and across the axis c.
        let (i1, i2) = (x_i * sin_c + z_i * cos_c, x_i * cos_c - z_i * sin_c);
        let (r1, r2) = (x_r * sin_c + z_r * cos_c, x_r * cos_c - z_r * sin_c);
        let (cc, cs, ss) = (i1 * r1, i1 * r2 + i2 * r1, i2 * r2);
        let antiderivative = |v: f64| {
            let (sin, cos) = (v - c).sin_cos();
            let (square, even) = (0.5 * sin * sin, 0.5 * (v + sin * cos));
            // ss vanishes where the ring ends at cos = 0 and the logarithms do not.
            let (secant, tangent) = if cos > 1e-12 {
                (((1.0 + sin.abs()) / cos).ln().copysign(sin), -cos.ln())
            } else {
                (0.0, 0.0)
            };
            let flat = cc * sin - cs * cos + ss * (secant - sin);
            let by_cos = cc * even + cs * square + ss * (v - even);
            let by_sin = cc * square + cs * (v - even) + ss * (tangent - square);
            (flat, by_cos * cos_c - by_sin * sin_c)
        };
        let ((flat0, round0), (flat1, round1)) = (antiderivative(low), antiderivative(high));
        let positive = |x: f64| T::of((x / m).max(0.0));
        (positive(flat1 - flat0), positive(round1 - round0))
    }
}

impl<T: Real> YarnSegment<T> {
    /// True when the ring lies on the segment; false when there is no ring.
    pub(crate) fn holds(&self, ring: &Ring<T>) -> bool {
        ring.tan_u.abs() < self.tan_u_max
    }

    /// Smoothstep from one to zero over the last `smoothing` share before
    /// u_max (equation 7.10).
    fn fade(&self, u: T) -> T {
        let x = (u.abs() / self.u_max - T::one() + self.smoothing) / self.smoothing;
        if !(x > T::zero()) {
            return T::one();
        }
        let x = x.min(T::one());
        T::one() - x * x * (T::of(3.0) - T::of(2.0) * x)
    }

    /// Integral of the highlight over v, mm^2, for a ring that the segment
    /// holds, given the integrals of the attenuation, which segments of any
    /// spine share.
    pub(crate) fn filament_reflectance(&self, ring: &Ring<T>, integrals: (T, T)) -> T {
        let fade = self.fade(ring.u());
        let spine = self.spine.radius_mm(ring.sin_u, ring.cos_u);
        self.radius_mm * fade / ring.p * (spine * integrals.0 + self.radius_mm * integrals.1)
    }

    /// The inclinations u whose highlight is drawn at y.
    pub(crate) fn filament_band(&self, y: T) -> (T, T) {
        band(y, self.length_mm, self.highlight_width, self.u_max)
    }

    /// The angle v at a distance x across the rectangle (equation 8.2).
    pub(crate) fn angle_at(&self, x: T) -> T {
        T::PI() * x / self.width_mm
    }

    /// The texture's value over the phase function: a band of constant width
    /// along the yarn about the ring, kept inside the rectangle.
    pub(crate) fn filament_texture(&self, pair: &Pair<T>, x: T, y: T) -> T {
        let ring = Ring::new(pair);
        if !self.holds(&ring) {
            return T::zero();
        }
        let u = ring.u();
        let (low, high) = self.filament_band(y);
        if !(u > low && u < high) {
            return T::zero();
        }
        let fade = self.fade(u);
        let (sin_v, cos_v) = self.angle_at(x).sin_cos();
        let toward = |w: Direction<T>| w.x * sin_v + (w.y * ring.sin_u + w.z * ring.cos_u) * cos_v;
        let (n_i, n_r) = (toward(pair.w_i), toward(pair.w_r));
        if !(n_i > T::zero() && n_r > T::zero()) {
            return T::zero();
        }
        let spine = self.spine.radius_mm(ring.sin_u, ring.cos_u);
        let band_mm = self.highlight_width * self.length_mm;
        self.radius_mm * fade / ring.p * (spine + self.radius_mm * cos_v) * n_i * n_r / (n_i + n_r)
            * T::PI()
            / (self.width_mm * band_mm)
    }
}
