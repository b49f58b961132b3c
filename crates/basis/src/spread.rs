//! The distribution of fibre tangents about their mean axis.
//!
//! The polar angle from the axis is half-normal with deviation `spread_rad`,
//! cut at 90 degrees: its density in the angle (not in solid angle) is
//! proportional to `exp(-theta^2 / (2 s^2))` on `[0, pi/2]`, with uniform
//! azimuth `[Schroeder2011]`. A spread of zero is a bundle of parallel fibres;
//! as the spread grows without bound the angle becomes uniform and the mean
//! squared cosine falls to one half.

use crate::quadrature::{gauss_legendre, integrate_rule};
use std::f64::consts::FRAC_PI_2;
use std::sync::LazyLock;

/// The greatest spread that differs from "no preferred polar angle":
/// there the density at 90 degrees is 0.98 of that at the axis.
pub const MAX_SPREAD_RAD: f32 = 8.0;

/// Smooth integrands over at most eight deviations: 40 nodes reach 1e-14.
static RULE: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| gauss_legendre(40));

/// Mean of `f(theta)` over the distribution of the polar angle, for a smooth f.
///
/// Spreads outside `[0, MAX_SPREAD_RAD]` are clamped.
pub fn mean_over_angle(spread_rad: f32, f: impl Fn(f64) -> f64) -> f64 {
    let s = f64::from(spread_rad.clamp(0.0, MAX_SPREAD_RAD));
    if s < 1e-9 {
        return f(0.0);
    }
    // Beyond eight and a half deviations lie 2e-17 of the weight.
    let end = FRAC_PI_2.min(8.5 * s);
    let weight = |theta: f64| (-0.5 * (theta / s).powi(2)).exp();
    integrate_rule(&RULE, 0.0, end, |t| weight(t) * f(t)) / integrate_rule(&RULE, 0.0, end, weight)
}

/// Mean squared cosine between a tangent and the axis, in `[0.5, 1]`: the
/// greatest eigenvalue of the population's second-moment tensor of unit trace.
///
/// Spreads outside `[0, MAX_SPREAD_RAD]` are clamped.
pub fn mean_cos_sq(spread_rad: f32) -> f32 {
    mean_over_angle(spread_rad, |t| t.cos().powi(2)) as f32
}

/// The spread whose tangents have this mean squared sine to the axis, which is one minus
/// [`mean_cos_sq`]: zero for zero and below, [`MAX_SPREAD_RAD`] for a value that only a wider
/// distribution could have. The sine keeps its precision for narrow populations, where the
/// squared cosine is one to rounding.
pub fn spread_from_mean_sin_sq(mean_sin_sq: f32) -> f32 {
    let goal = f64::from(mean_sin_sq);
    let sin_sq = |s: f32| mean_over_angle(s, |t| t.sin().powi(2));
    if goal <= 0.0 || goal.is_nan() {
        return 0.0;
    }
    if goal >= sin_sq(MAX_SPREAD_RAD) {
        return MAX_SPREAD_RAD;
    }
    let (mut low, mut high) = (0.0, MAX_SPREAD_RAD);
    // Bisection down to neighbouring floats near s = 1e-4 and up.
    for _ in 0..44 {
        let mid = 0.5 * (low + high);
        if sin_sq(mid) < goal {
            low = mid;
        } else {
            high = mid;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::integrate;
    use crate::{PathRng, Sym3, warp};
    use glam::Vec3;

    fn adaptive(s: f64, f: impl Fn(f64) -> f64) -> f64 {
        let weight = |t: f64| (-0.5 * (t / s).powi(2)).exp();
        // Split so that a narrow peak at zero is never stepped over.
        let cuts = [0.0, s, 3.0 * s, 9.0 * s].map(|c| FRAC_PI_2.min(c));
        let over = |g: &dyn Fn(f64) -> f64| -> f64 {
            let piece = |c: &[f64]| integrate(c[0], c[1], 1e-13, g);
            cuts.windows(2).filter(|c| c[1] > c[0]).map(piece).sum()
        };
        over(&|t| weight(t) * f(t)) / over(&weight)
    }

    #[test]
    fn moments_agree_with_adaptive_quadrature() {
        for s in [1e-3, 0.01, 0.1, 0.3, 0.7, 1.0, 2.0, 8.0f32] {
            let s64 = f64::from(s);
            let c = adaptive(s64, |t| t.cos().powi(2));
            assert!((f64::from(mean_cos_sq(s)) - c).abs() < 1e-7, "{s}");
        }
    }

    #[test]
    fn inverse_returns_the_planted_spread() {
        for i in 1..=160 {
            let s = 0.005 * 1.045f32.powi(i);
            if s > 4.0 {
                break;
            }
            let sin_sq = mean_over_angle(s, |t| t.sin().powi(2)) as f32;
            let back = spread_from_mean_sin_sq(sin_sq);
            // d(sin^2)/ds falls as s^-3: one unit in the last place of sin^2
            // moves a wide spread by that much more.
            let tolerance = 1e-5 * s * s.powi(2).max(1.0);
            assert!((back - s).abs() < tolerance, "{s} -> {back}");
        }
        assert_eq!(spread_from_mean_sin_sq(0.0), 0.0);
        assert_eq!(spread_from_mean_sin_sq(2.0 / 3.0), MAX_SPREAD_RAD);
        assert_eq!(spread_from_mean_sin_sq(f32::NAN), 0.0);
    }

    #[test]
    fn limits_are_parallel_and_uniform_angle() {
        assert_eq!(mean_cos_sq(0.0), 1.0);
        assert!((mean_cos_sq(MAX_SPREAD_RAD) - 0.5).abs() < 2e-3);
        let small = 0.01f32;
        assert!((1.0 - mean_cos_sq(small) - small * small).abs() < 1e-7);
    }

    #[test]
    fn sampled_tangents_have_the_stated_tensor() {
        // Rejection from the definition; the tensor must be axial with mean_cos_sq on top.
        let (s, n) = (0.6f32, 200_000);
        let mut rng = PathRng::from_seed(3);
        let mut sum = [0.0f64; 6];
        for _ in 0..n {
            let theta = loop {
                let t = (s * rng.normal2().x).abs();
                if t <= std::f32::consts::FRAC_PI_2 {
                    break t;
                }
            };
            let t = warp::direction_from_angles(theta, std::f32::consts::TAU * rng.unit());
            for (a, b) in sum.iter_mut().zip(Sym3::outer(t).to_array()) {
                *a += f64::from(b) / f64::from(n);
            }
        }
        let got = Sym3::from_array(sum.map(|x| x as f32));
        let c = mean_cos_sq(s);
        let want = Sym3::axial(Vec3::Z, 0.5 * (1.0 - c), c);
        // Variance of any entry is below 1/4.
        let tolerance = 4.0 * 0.5 / f64::from(n).sqrt();
        for (a, b) in got.to_array().iter().zip(want.to_array()) {
            assert!(f64::from((a - b).abs()) < tolerance, "seed 3");
        }
    }
}
