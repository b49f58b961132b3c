//! Ray optics of a smooth dielectric cylinder, after [Marschner2003].
//!
//! A ray at inclination theta (from the plane across the axis) meets the cylinder at offset
//! h in `[-1, 1]`. Seen along the axis it refracts with the effective index
//! `sqrt(eta^2 - sin^2 theta) / cos theta`; the Fresnel reflectance is that of the true
//! angle of incidence, whose cosine is `cos(theta) sqrt(1 - h^2)`, with the true index.
// Loops over lobes go by index: the compiler may leave iterators of vectors without
// the back end's instructions.
#![allow(clippy::needless_range_loop)]

use super::LOBES;
use organza_lanes::Floats;
use organza_lanes::math::{V3, asin, atan2, exp};
use std::f32::consts::PI;

/// Least cosine of the inclination that angles are computed with.
pub(crate) const MIN_COS: f32 = 1e-4;

/// How a ray passes a fibre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing<F> {
    /// Angle of refraction seen along the axis, radians.
    pub gamma_t: F,
    /// Reflectance at each surface.
    pub fresnel: F,
    /// Length of one passage inside, in radii.
    path_radii: F,
}

/// Angle of incidence seen along the axis of a ray at an offset, radians.
#[inline(always)]
pub fn incidence<F: Floats>(offset: F) -> F {
    asin(offset)
}

impl<F: Floats> Crossing<F> {
    /// For the index of refraction, the cosine of the inclination and the offset.
    #[inline(always)]
    pub fn new(ior: F, cos: F, offset: F) -> Crossing<F> {
        let (zero, one, least) = (F::splat(0.0), F::splat(1.0), F::splat(MIN_COS));
        let cos = cos.max(least).min(one);
        let cos_squared = cos * cos;
        let ior_squared = ior * ior;
        // Which must not round to zero for an empty cylinder.
        let index = (ior_squared - one + cos_squared).sqrt() / cos;
        let sin_t = (offset / index).max(-one).min(one);
        let cos_t = (one - sin_t * sin_t).sqrt();
        let cos_i = (one - offset * offset).max(zero).sqrt();
        let inside = (one - (one - cos_squared) / ior_squared).max(zero).sqrt();
        Crossing {
            gamma_t: atan2(sin_t, cos_t),
            fresnel: fresnel(cos * cos_i, ior),
            path_radii: (cos_t + cos_t) / inside.max(least),
        }
    }

    /// Part of the light that leaves in each lobe, the last being the sum of the whole series
    /// after TRT. `absorption` is absorption times radius, per channel.
    #[inline(always)]
    pub fn attenuations(&self, absorption: V3<F>) -> [V3<F>; LOBES] {
        let x = self.channel(absorption.x);
        let y = self.channel(absorption.y);
        let z = self.channel(absorption.z);
        let mut all = [absorption; LOBES];
        for p in 0..LOBES {
            all[p] = V3::new(x[p], y[p], z[p]);
        }
        all
    }

    #[inline(always)]
    fn channel(&self, absorption: F) -> [F; LOBES] {
        let one = F::splat(1.0);
        let f = self.fresnel;
        let t = exp(-(absorption * self.path_radii));
        let tt = (one - f) * (one - f) * t;
        let trt = f * t * tt;
        // Each further inner reflection multiplies by f t; f < 1 unless grazing, where tt
        // vanishes faster than 1 - f t.
        let again = f * t;
        let rest = trt * again / (one - again).max(F::splat(1e-6));
        [f, tt, trt, rest]
    }

    /// Angle of the surface normal where light of lobe `p` leaves, about the axis from the
    /// ray's direction across the fibre, for the angle of incidence.
    #[inline(always)]
    pub fn exit_normal(&self, p: usize, gamma_i: F) -> F {
        let pi = F::splat(PI);
        let inside = pi - (self.gamma_t + self.gamma_t);
        pi - gamma_i - F::splat(p as f32) * inside
    }

    /// Azimuth into which lobe `p` leaves.
    #[inline(always)]
    pub fn exit_azimuth(&self, p: usize, gamma_i: F) -> F {
        self.exit_normal(p, gamma_i) - gamma_i
    }
}

/// Unpolarised Fresnel reflectance for the cosine of the angle of incidence and the index of
/// refraction behind the interface, at least 1.
#[inline(always)]
pub fn fresnel<F: Floats>(cos_i: F, ior: F) -> F {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let cos_i = cos_i.max(zero).min(one);
    let cos_t = (one - (one - cos_i * cos_i) / (ior * ior)).max(zero).sqrt();
    // Both sums vanish when a ray grazes an interface between equals.
    let least = F::splat(1e-12);
    let across = (cos_i - ior * cos_t) / ior.mul_add(cos_t, cos_i).max(least);
    let along = (ior * cos_i - cos_t) / ior.mul_add(cos_i, cos_t).max(least);
    F::splat(0.5) * across.mul_add(across, along * along)
}
