//! Ray optics of a smooth cylinder in lanes: [`organza_scatter::cylinder`].
// Loops over lobes go by index: the compiler may leave iterators of vectors without
// the back end's instructions.
#![allow(clippy::needless_range_loop)]

use super::optics::LOBES;
use organza_lanes::Floats;
use organza_lanes::math::{V3, exp2, turns_of};
use std::f32::consts::{LOG2_E, PI, TAU};

/// Least cosine of the inclination that angles are computed with.
const MIN_COS: f32 = 1e-4;

/// How a ray passes a fibre.
pub struct Crossing<F: Floats> {
    gamma_t: F,
    fresnel: F,
    path_radii: F,
}

/// `e^x` of numbers that are not positive.
#[inline(always)]
pub fn exp<F: Floats>(x: F) -> F {
    exp2(x * F::splat(LOG2_E))
}

/// The angle of (x, y), radians.
#[inline(always)]
pub fn atan2<F: Floats>(y: F, x: F) -> F {
    turns_of(y, x) * F::splat(TAU)
}

impl<F: Floats> Crossing<F> {
    /// For the index of refraction, the cosine of the inclination and the offset.
    #[inline(always)]
    pub fn new(ior: F, cos: F, offset: F) -> Crossing<F> {
        let (zero, one, least) = (F::splat(0.0), F::splat(1.0), F::splat(MIN_COS));
        let cos = cos.max(least).min(one);
        let cos_squared = cos * cos;
        let ior_squared = ior * ior;
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

    /// Part of the light that leaves in each lobe.
    #[inline(always)]
    pub fn attenuations(&self, absorption: V3<F>) -> [V3<F>; LOBES] {
        let x = self.channel(absorption.x);
        let y = self.channel(absorption.y);
        let z = self.channel(absorption.z);
        let mut all = [absorption; LOBES];
        for p in 0..LOBES {
            all[p] = V3 {
                x: x[p],
                y: y[p],
                z: z[p],
            };
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
        let again = f * t;
        let rest = trt * again / (one - again).max(F::splat(1e-6));
        [f, tt, trt, rest]
    }

    /// Angle of the surface normal where light of lobe `p` leaves, from the
    /// ray's direction across the fibre.
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

/// Unpolarised reflectance for the cosine of the angle of incidence.
#[inline(always)]
fn fresnel<F: Floats>(cos_i: F, ior: F) -> F {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let cos_i = cos_i.max(zero).min(one);
    let cos_t = (one - (one - cos_i * cos_i) / (ior * ior)).max(zero).sqrt();
    let least = F::splat(1e-12);
    let across = (cos_i - ior * cos_t) / ior.mul_add(cos_t, cos_i).max(least);
    let along = (ior * cos_i - cos_t) / ior.mul_add(cos_i, cos_t).max(least);
    F::splat(0.5) * across.mul_add(across, along * along)
}
