//! The scalar type of the model: `f32` for rendering, `f64` for validation.
//!
//! The few transcendental functions of an evaluation are called on small ranges, where single
//! precision needs no argument reduction. There they are minimax polynomials without branches,
//! so that the compiler vectorises loops over nodes and steps. Double precision uses the
//! standard library.

use num_traits::{Float, FloatConst};
use std::fmt::Debug;
use std::iter::Sum;

/// A floating-point number with the constants and functions that the model needs.
pub trait Real: Float + FloatConst + Debug + Sum + Send + Sync + 'static {
    /// From a literal or a parameter.
    fn of(x: f64) -> Self;

    /// Sine and cosine of an angle in `[-pi/2, pi/2]`; the cosine is not
    /// negative. Relative error of the sine and absolute of the cosine 1e-7 in
    /// `f32`.
    fn sin_cos_acute(self) -> (Self, Self);

    /// Arc tangent of a number in `[-1, 1]`; relative error 3e-7 in `f32`.
    fn atan_unit(self) -> Self;

    /// Exponential of a number that is not positive; in `f32` with a relative
    /// error of 1e-7 (1 + |x|), and at least 2^-126.
    fn exp_decay(self) -> Self;

    /// The larger, for operands that are numbers: one instruction.
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    /// The smaller, for operands that are numbers.
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
}

impl Real for f32 {
    #[inline(always)]
    fn of(x: f64) -> f32 {
        x as f32
    }

    #[inline(always)]
    fn sin_cos_acute(self) -> (f32, f32) {
        let x = self * self;
        let sin = 2.605_750_6e-6 * x - 1.980_959e-4;
        let sin = (sin * x + 8.333_066e-3) * x - 0.166_666_6;
        let cos = -2.619_354_8e-7 * x + 2.476_929_1e-5;
        let cos = ((cos * x - 1.388_856_9e-3) * x + 4.166_665_6e-2) * x - 0.5;
        (self + self * x * sin, (1.0 + x * cos).larger(0.0))
    }

    #[inline(always)]
    fn atan_unit(self) -> f32 {
        let x = self * self;
        let p = -4.822_527_7e-3 * x + 2.473_404_2e-2;
        let p = (p * x - 6.020_31e-2) * x + 9.968_471_5e-2;
        let p = ((p * x - 0.140_413_27) * x + 0.199_742_14) * x - 0.333_323_92;
        self + self * x * p
    }

    #[inline(always)]
    fn exp_decay(self) -> f32 {
        let x = (self * std::f32::consts::LOG2_E).larger(-126.0);
        // Adding and subtracting 1.5 * 2^23 rounds to an integer, which the low bits of the sum
        // contain. The fitted slope is the logarithm to the last bit.
        const LN_2: f32 = std::f32::consts::LN_2;
        const ROUND: f32 = 12_582_912.0;
        let sum = x + ROUND;
        let f = x - (sum - ROUND);
        let p = 1.326_472_7e-3 * f + 9.671_513e-3;
        let p = ((p * f + 5.550_734e-2) * f + 0.240_222_42) * f + LN_2;
        let bits = (sum.to_bits() << 23).wrapping_add(0x3f80_0000);
        (1.0 + p * f) * f32::from_bits(bits)
    }
}

impl Real for f64 {
    fn of(x: f64) -> f64 {
        x
    }

    fn sin_cos_acute(self) -> (f64, f64) {
        self.sin_cos()
    }

    fn atan_unit(self) -> f64 {
        self.atan()
    }

    fn exp_decay(self) -> f64 {
        self.exp()
    }
}

/// A unit vector in the frame of a yarn segment: x across the yarn, y along
/// it, z out of the cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction<T> {
    /// Across the yarn.
    pub x: T,
    /// Along the yarn.
    pub y: T,
    /// Out of the cloth.
    pub z: T,
}

impl<T: Real> Direction<T> {
    /// From its coordinates, which the caller has normalised.
    #[inline(always)]
    pub fn new(x: T, y: T, z: T) -> Self {
        Direction { x, y, z }
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> T {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn polynomials_follow_the_library() {
        let (mut sin_cos, mut atan, mut exp) = (0.0f64, 0.0f64, 0.0f64);
        for i in -20_000..=20_000 {
            let t = i as f32 / 20_000.0;
            let x = t * FRAC_PI_2;
            let (sin, cos) = x.sin_cos_acute();
            let wide = f64::from(x);
            sin_cos = sin_cos.max((f64::from(sin) - wide.sin()).abs());
            sin_cos = sin_cos.max((f64::from(cos) - wide.cos()).abs());
            assert!(cos >= 0.0);
            atan = atan.max((f64::from(t.atan_unit()) - f64::from(t).atan()).abs());
            let x = 43.0 * (t - 1.0);
            exp = exp.max((f64::from(x.exp_decay()) / f64::from(x).exp() - 1.0).abs());
        }
        println!("errors: sine and cosine {sin_cos:.1e}, arc tangent {atan:.1e}, exp {exp:.1e}");
        // The argument of exp is scaled in f32: 86 steps of rounding in it.
        assert!(sin_cos < 2e-7 && atan < 3e-7 && exp < 1e-5);
        assert_eq!(0.0f32.exp_decay(), 1.0);
        assert!((-1e30f32).exp_decay() < 2e-38 && f32::NEG_INFINITY.exp_decay() < 2e-38);
    }
}
