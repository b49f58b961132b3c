//! The inclinations of two directions about a fibre, as a blur sees them.

use organza_lanes::Floats;

/// What the scattering of a fibre needs of two inclinations theta_in and theta_out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InclinationPair<N> {
    /// Sine and cosine of theta_in + theta_out: the sine is zero on the specular cone.
    pub sum: [N; 2],
    /// Sine and cosine of the same after one fold at the nearer end.
    pub folded: [N; 2],
    /// Cosine of the mean inclination (theta_out - theta_in) / 2, at which light
    /// passes the fibre.
    pub mean_cos: N,
}

impl<N: Floats> InclinationPair<N> {
    /// From sines and cosines of both inclinations.
    #[inline(always)]
    pub fn new([sin_in, cos_in]: [N; 2], [sin_out, cos_out]: [N; 2]) -> InclinationPair<N> {
        let (cosines, sines) = (cos_out * cos_in, sin_out * sin_in);
        let (oi, io) = (sin_out * cos_in, cos_out * sin_in);
        let (cos_difference, sin_difference) = (cosines + sines, (oi - io).abs());
        // The half angle's cosine, from whichever form does not cancel.
        let half = N::splat(0.5);
        let root = half.mul_add(cos_difference.abs(), half).sqrt();
        let behind = half * sin_difference / root;
        InclinationPair {
            sum: [oi + io, cosines - sines],
            folded: [sin_difference, -cos_difference],
            mean_cos: behind.or_where_not(cos_difference.below(N::splat(0.0)), root),
        }
    }
}
