//! How light spreads around the cone of a fibre.

use crate::real::Real;

/// The circular phase function `alpha + g` of \[Irawan2008] (equation 7.8): a
/// constant and a von Mises lobe about straight on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircularPhase<T> {
    alpha: T,
    beta: T,
    /// `1 / (2 pi I0(beta) exp(-beta))`: scaled, so that no beta overflows.
    forward_peak: T,
}

impl<T: Real> CircularPhase<T> {
    /// From the uniform part `alpha` and the concentration `beta`, neither
    /// negative.
    pub fn new(alpha: f64, beta: f64) -> Self {
        let scaled_bessel = pxfm::f_i0e(beta);
        CircularPhase {
            alpha: T::of(alpha),
            beta: T::of(beta),
            forward_peak: T::of(1.0 / (std::f64::consts::TAU * scaled_bessel)),
        }
    }

    /// Its value for two directions that point away from the yarn, whose
    /// cosine is `cos_io`: light that goes straight on has -1.
    #[inline(always)]
    pub fn eval(&self, cos_io: T) -> T {
        self.alpha
            + self.forward_peak * (-self.beta * (T::one() + cos_io).larger(T::zero())).exp_decay()
    }
}
