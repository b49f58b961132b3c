//! Twisted yarn: the highlight is a curve v(u) and the segment's reflection an
//! integral over u.

use crate::quadrature::Rule;
use crate::real::{Direction, Real};
use crate::segment::{Pair, YarnSegment};
use crate::stretches::{Facing, search};

/// The angle u as sine and cosine, and the components of `s = w_in + w_out`
/// there: along the spine and out of it.
#[derive(Clone, Copy)]
pub(crate) struct Inclination<T> {
    pub sin_u: T,
    pub cos_u: T,
    along: T,
    out: T,
}

impl<T: Real> Inclination<T> {
    #[inline(always)]
    pub fn new(pair: &Pair<T>, sin_u: T, cos_u: T) -> Self {
        Inclination {
            sin_u,
            cos_u,
            along: pair.s.y * cos_u - pair.s.z * sin_u,
            out: pair.s.y * sin_u + pair.s.z * cos_u,
        }
    }
}

/// The spine by the angle `d = phi - u` from where `s` lies across it, with
/// `phi = atan2(s_y, s_z)`; p is the length of `s` in the plane of the spine.
struct FromMirror<T> {
    p: T,
    sin_phi: T,
    cos_phi: T,
}

impl<T: Real> FromMirror<T> {
    /// The place at `t = tan(d / 2)`, and `1 / (1 + t^2)`.
    #[inline(always)]
    fn inclination(&self, t: T) -> (Inclination<T>, T) {
        let (one, two) = (T::one(), T::of(2.0));
        let k = one / (one + t * t);
        let (sin_d, cos_d) = (two * t * k, (one - t * t) * k);
        let at = Inclination {
            sin_u: self.sin_phi * cos_d - self.cos_phi * sin_d,
            cos_u: self.cos_phi * cos_d + self.sin_phi * sin_d,
            along: self.p * sin_d,
            out: self.p * cos_d,
        };
        (at, k)
    }
}

/// The place on the ring at u where the fibres mirror one direction into the other.
#[derive(Clone, Copy)]
pub(crate) struct Mirror<T> {
    pub sin_v: T,
    pub cos_v: T,
    /// Cosines of the directions to the normal there.
    pub n_i: T,
    pub n_r: T,
}

impl<T: Real> YarnSegment<T> {
    /// The one solution v = v0 - asin(D) that can be lit and seen, without an inverse function.
    /// Where `|D|` exceeds one, there is no solution, and it is clamped to one.
    #[inline(always)]
    pub(crate) fn mirror(&self, pair: &Pair<T>, at: &Inclination<T>) -> Mirror<T> {
        let one = T::one();
        let rho2 = pair.s.x * pair.s.x + at.out * at.out;
        let inv_rho = one / rho2.larger(T::of(1e-30)).sqrt();
        let d = at.along * self.cot_psi * inv_rho;
        let d = d.larger(-one).smaller(one);
        let e = (one - d * d).sqrt();
        let sin_v = (pair.s.x * e - at.out * d) * inv_rho;
        let cos_v = (at.out * e + pair.s.x * d) * inv_rho;
        let toward = |w: Direction<T>| w.x * sin_v + (w.y * at.sin_u + w.z * at.cos_u) * cos_v;
        Mirror {
            sin_v,
            cos_v,
            n_i: toward(pair.w_in),
            n_r: toward(pair.w_out),
        }
    }

    /// Geometry factor times attenuation, over the shared factor, mm, at a
    /// place that faces both directions. With `|s| (n.h) = w_in.n + w_out.n` no
    /// half vector is normalised and the quotient is at most a quarter:
    /// `a (R + a cos v) (w_in.n)(w_out.n) / ((w_in.n + w_out.n)^2 |sin psi|)`.
    #[inline(always)]
    fn staple_strength(&self, at: &Inclination<T>, m: &Mirror<T>) -> T {
        let sum = m.n_i + m.n_r;
        let spine = self.spine.radius_mm(at.sin_u, at.cos_u);
        (spine + self.radius_mm * m.cos_v) * m.n_i * m.n_r / (sum * sum)
    }

    /// Integral of the highlight over u, mm^2.
    ///
    /// Fibres can mirror where `|D| <= 1`: with `d = phi - u` and `phi = atan2(s_y, s_z)` that
    /// is `|sin d| <= |sin psi| |s| / hypot(s_y, s_z)`. Integrating over d keeps s along the
    /// spine free of cancellation when psi is small, and in the tangent of d/2 a node costs
    /// arithmetic alone.
    pub(crate) fn staple_reflectance(&self, pair: &Pair<T>, rule: &Rule<T>) -> T {
        let (zero, one) = (T::zero(), T::one());
        let p = (pair.s.y * pair.s.y + pair.s.z * pair.s.z).sqrt();
        // Tangents of half angles add without an inverse function.
        let (phi, reach) = (pair.s.y / (p + pair.s.z), self.tan_half_u_max);
        let (mut low, mut high) = (
            (phi - reach) / (one + phi * reach),
            (phi + reach) / (one - phi * reach).larger(T::of(1e-6)),
        );
        // Beyond a right angle the same computation is repeated; few directions need it.
        let mut beyond = [(zero, zero); 2];
        let sin_limit = self.sin_psi.abs() * pair.s2.sqrt() / p;
        if sin_limit < one {
            let limit = sin_limit / (one + (one - sin_limit * sin_limit).sqrt());
            if (low * limit).smaller(-high * limit) < -one {
                let far = one / limit;
                beyond = [(low, high.smaller(-far)), (low.larger(far), high)];
            }
            low = low.larger(-limit);
            high = high.smaller(limit);
        }
        let spine = FromMirror {
            p,
            sin_phi: pair.s.y / p,
            cos_phi: pair.s.z / p,
        };
        let mut total = zero;
        if low < high {
            let facing = |t: T| self.facing(pair, &spine, t);
            for &(t0, t1) in rule.support(low, high, facing).as_slice() {
                total = total + self.staple_integral(pair, &spine, t0, t1, rule);
            }
        }
        for (low, high) in beyond {
            if low < high {
                total = self.add_beyond(total, pair, &spine, low, high, rule);
            }
        }
        total
    }

    /// What must be positive at a place.
    #[inline(always)]
    fn facing(&self, pair: &Pair<T>, spine: &FromMirror<T>, t: T) -> Facing<T> {
        let m = self.mirror(pair, &spine.inclination(t).0);
        [m.n_i, m.n_r, m.cos_v]
    }

    /// The integral between two places that face both directions.
    #[inline(always)]
    fn staple_integral(
        &self,
        pair: &Pair<T>,
        spine: &FromMirror<T>,
        t0: T,
        t1: T,
        rule: &Rule<T>,
    ) -> T {
        let (zero, two, half) = (T::zero(), T::of(2.0), T::of(0.5));
        let (mid, span) = ((t0 + t1) * half, (t1 - t0) * half);
        // Four at a time and without branches, so that the compiler vectorises the loop.
        let mut sums = [zero; 4];
        for (xs, ws) in rule.nodes() {
            for lane in 0..4 {
                let (at, k) = spine.inclination(mid + span * xs[lane]);
                let m = self.mirror(pair, &at);
                let faces = m.n_i.smaller(m.n_r).smaller(m.cos_v) > zero;
                let strength = ws[lane] * k * self.staple_strength(&at, &m);
                sums[lane] = sums[lane] + if faces { strength } else { zero };
            }
        }
        let sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
        two * span * sum * self.staple_factor
    }

    /// Adds the integral over an interval beyond a right angle to a sum. Apart from the
    /// rest: inlined, it would keep the usual case from the vector unit.
    #[cold]
    #[inline(never)]
    fn add_beyond(
        &self,
        total: T,
        pair: &Pair<T>,
        spine: &FromMirror<T>,
        low: T,
        high: T,
        rule: &Rule<T>,
    ) -> T {
        let every = search(low, high, |t| self.facing(pair, spine, t));
        let stretches = every.as_slice().iter();
        stretches.fold(total, |sum, &(t0, t1)| {
            sum + self.staple_integral(pair, spine, t0, t1, rule)
        })
    }

    /// The texture's value over the phase function.
    #[inline(always)]
    pub(crate) fn staple_texture(&self, pair: &Pair<T>, x: T, y: T) -> T {
        let zero = T::zero();
        let (sin_u, cos_u) = self.u_band.angle(y).sin_cos_acute();
        let at = Inclination::new(pair, sin_u, cos_u);
        let m = self.mirror(pair, &at);
        let v = m.angle();
        let (low, high) = self.v_band.angles(x);
        let drawn = m.n_i.smaller(m.n_r).smaller(m.cos_v) > zero && v > low && v < high;
        if drawn {
            self.staple_strength(&at, &m) * self.texture_factor
        } else {
            zero
        }
    }
}

impl<T: Real> Mirror<T> {
    /// The angle v where `cos_v` is positive.
    #[inline(always)]
    pub fn angle(&self) -> T {
        T::of(2.0) * (self.sin_v / (T::one() + self.cos_v)).atan_unit()
    }
}
