//! The distribution of light around the cone of a fibre.

use crate::real::Real;

/// The circular phase function `alpha + g` of \[Irawan2008] (equation 7.8): a constant and a
/// von Mises lobe about straight on. Unlike in the source, `beta` may be negative: then the
/// lobe points straight back, as for fibres that only mirror.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircularPhase<T> {
    alpha: T,
    beta: T,
    /// One, or minus one for a lobe about straight back.
    sign: T,
    /// `1 / (2 pi I0(beta) exp(-beta))`: scaled, so that no beta overflows.
    peak: T,
}

impl<T: Real> CircularPhase<T> {
    /// A phase function with the uniform part `alpha`, not negative, and the concentration
    /// `beta`.
    pub fn new(alpha: f64, beta: f64) -> Self {
        let scaled_bessel = pxfm::f_i0e(beta.abs());
        CircularPhase {
            alpha: T::of(alpha),
            beta: T::of(beta.abs()),
            sign: T::of(if beta < 0.0 { -1.0 } else { 1.0 }),
            peak: T::of(1.0 / (std::f64::consts::TAU * scaled_bessel)),
        }
    }

    /// Its value for two directions that point away from the yarn, whose cosine is `cos_io`:
    /// the cosine of light that passes straight on is -1.
    #[inline(always)]
    pub fn eval(&self, cos_io: T) -> T {
        let off = (T::one() + self.sign * cos_io).larger(T::zero());
        self.alpha + self.peak * (-self.beta * off).exp_decay()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_negative_beta_turns_the_lobe_about() {
        for beta in [0.0, 0.7, 4.0, 300.0] {
            let (on, back) = (
                CircularPhase::new(0.1, beta),
                CircularPhase::new(0.1, -beta),
            );
            for k in 0..=20 {
                let cos = -1.0 + 0.1 * f64::from(k);
                let (a, b): (f64, f64) = (on.eval(cos), back.eval(-cos));
                let rounding = 4.0 * f64::EPSILON * a;
                assert!((a - b).abs() < rounding, "{beta} {cos}: {a} {b}");
            }
        }
    }
}
