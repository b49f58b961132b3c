//! Sums that do not depend on the order of their terms.

/// A whole number of `64 N` bits, the lowest limb first, counted in a unit
/// that its owner chooses.
///
/// Every term becomes a whole number by itself and whole numbers add without
/// rounding, so any order and any grouping gives the same bits. Terms are at
/// most `2^(64 N - 32)` and there are fewer than `2^32`: no sum overflows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WideSum<const N: usize>([u64; N]);

impl<const N: usize> Default for WideSum<N> {
    fn default() -> WideSum<N> {
        WideSum([0; N])
    }
}

impl<const N: usize> WideSum<N> {
    /// A sum from its limbs.
    pub fn from_limbs(limbs: [u64; N]) -> WideSum<N> {
        WideSum(limbs)
    }

    /// Its limbs, the lowest first.
    pub fn limbs(&self) -> [u64; N] {
        self.0
    }

    /// Adds another sum of the same unit.
    pub fn merge(&mut self, o: &WideSum<N>) {
        let mut carry = false;
        for (a, b) in self.0.iter_mut().zip(o.0) {
            let (sum, first) = a.overflowing_add(b);
            let (sum, second) = sum.overflowing_add(u64::from(carry));
            *a = sum;
            carry = first | second;
        }
    }

    /// Adds `mantissa * 2^shift` units; what lies below one unit is cut off.
    #[inline]
    pub fn add_scaled(&mut self, mantissa: u64, shift: i32) {
        let mut term = [0; N];
        if shift < 0 {
            term[0] = mantissa.checked_shr(shift.unsigned_abs()).unwrap_or(0);
        } else {
            let wide = u128::from(mantissa) << (shift % 64);
            let limb = (shift / 64) as usize;
            for (slot, part) in term
                .iter_mut()
                .skip(limb)
                .zip([wide as u64, (wide >> 64) as u64])
            {
                *slot = part;
            }
        }
        self.merge(&WideSum(term));
    }

    /// As [`WideSum::add_scaled`] for a term of either sign. The sum is then to
    /// be read by [`WideSum::to_f64_signed`].
    pub fn add_signed(&mut self, mantissa: i64, shift: i32) {
        let mut term = WideSum::default();
        term.add_scaled(mantissa.unsigned_abs(), shift);
        self.merge(&if mantissa < 0 { term.negated() } else { term });
    }

    /// The number that gives zero together with this one, modulo `2^(64 N)`.
    fn negated(mut self) -> WideSum<N> {
        let mut carry = true;
        for limb in &mut self.0 {
            (*limb, carry) = (!*limb).overflowing_add(u64::from(carry));
        }
        self
    }

    /// As [`WideSum::to_f64`] when the topmost bit is a sign.
    pub fn to_f64_signed(self) -> f64 {
        if self.0.last().is_some_and(|&top| top >> 63 != 0) {
            -self.negated().to_f64()
        } else {
            self.to_f64()
        }
    }

    /// The nearest `f64`, but for a few units in its last place.
    pub fn to_f64(self) -> f64 {
        let limb = 2f64.powi(64);
        self.0
            .iter()
            .rev()
            .fold(0.0, |sum, &l| sum * limb + l as f64)
    }
}

/// Mantissa and exponent of a finite `x >= 0`: `x = m 2^e` with `m < 2^24`.
#[inline]
pub fn mantissa_and_exponent(x: f32) -> (u32, i32) {
    let bits = x.to_bits();
    let (fraction, exponent) = (bits & 0x007f_ffff, ((bits >> 23) & 0xff) as i32);
    if exponent == 0 {
        (fraction, -149)
    } else {
        (fraction | 0x0080_0000, exponent - 150)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    #[test]
    fn floats_are_taken_apart_exactly() {
        let mut rng = PathRng::from_seed(5);
        for _ in 0..10_000 {
            let x = f32::from_bits(rng.bits() & 0x7fff_ffff);
            if x.is_finite() {
                let (m, e) = mantissa_and_exponent(x);
                assert_eq!(f64::from(m) * 2f64.powi(e), f64::from(x));
            }
        }
    }

    /// Against 128-bit integers of the language.
    #[test]
    fn carries_reach_the_upper_limbs() {
        let mut rng = PathRng::from_seed(6);
        let mut sum = WideSum::<2>::default();
        let mut plain = 0u128;
        for _ in 0..10_000 {
            let m = (u64::from(rng.bits()) << 16) | u64::from(rng.bits() >> 16);
            let shift = rng.below(110) as i32 - 50;
            sum.add_scaled(m, shift);
            plain += if shift < 0 {
                u128::from(m) >> -shift
            } else {
                u128::from(m) << shift
            };
        }
        let [low, high] = sum.limbs();
        assert_eq!(u128::from(low) | (u128::from(high) << 64), plain);
        assert!((sum.to_f64() / plain as f64 - 1.0).abs() <= 2.0 * f64::EPSILON);
    }

    /// Against 128-bit integers of the language.
    #[test]
    fn terms_of_either_sign_cancel() {
        let mut rng = PathRng::from_seed(7);
        let (mut sum, mut plain) = (WideSum::<2>::default(), 0i128);
        for _ in 0..10_000 {
            let m = i64::from(rng.bits() as i32) << 20;
            let shift = rng.below(60) as i32;
            sum.add_signed(m, shift);
            plain += i128::from(m) << shift;
        }
        let [low, high] = sum.limbs();
        assert_eq!((u128::from(low) | (u128::from(high) << 64)) as i128, plain);
        assert!((sum.to_f64_signed() / plain as f64 - 1.0).abs() <= 2.0 * f64::EPSILON);
        let mut little = WideSum::<2>::default();
        little.add_signed(-3, 0);
        assert_eq!(little.to_f64_signed(), -3.0);
    }

    #[test]
    fn far_shifts_fall_off_either_end() {
        let mut sum = WideSum::<3>::default();
        sum.add_scaled(u64::MAX, -200);
        assert_eq!(sum, WideSum::default());
        sum.add_scaled(1, 191);
        assert_eq!(sum.limbs(), [0, 0, 1 << 63]);
    }
}
