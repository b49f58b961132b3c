//! Statistical tests: does a sampler follow its density, is a mean what theory
//! says, are two estimates of one number?
//!
//! A test answers with a p-value: how often a right program would look at least
//! this wrong. Reject below a level alpha; when a family of n tests is read
//! together, give each the level [`sidak`]`(alpha, n)`.
//!
//! ```
//! use organza_basis::hypothesis::{SphereGrid, sidak};
//! use organza_basis::{PathRng, warp};
//! use glam::Vec3;
//!
//! let mut rng = PathRng::from_seed(3);
//! let grid = SphereGrid::new(Vec3::Z, 10, 20);
//! let test = grid.chi_square(
//!     50_000,
//!     || Some(warp::cosine_hemisphere(rng.unit2())),
//!     |w| f64::from(warp::cosine_hemisphere_pdf(w.z)),
//! );
//! assert!(test.p_value > sidak(0.01, 1), "seed 3: {test:?}");
//! ```

mod grids;

pub use grids::{LineGrid, SphereGrid};

use crate::Moments;

/// What a test found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// Chi-square, t or z.
    pub statistic: f64,
    /// Degrees of freedom (infinite for z).
    pub degrees: f64,
    /// Probability of a statistic at least this extreme if the hypothesis holds.
    pub p_value: f64,
}

/// Level of each of `tests` independent tests so that all pass with probability
/// `1 - alpha` when every hypothesis holds [Sidak1967].
pub fn sidak(alpha: f64, tests: usize) -> f64 {
    -((-alpha).ln_1p() / tests.max(1) as f64).exp_m1()
}

/// Two-sided test that a normal estimate with known standard error has the mean
/// `expected`.
pub fn z_test(value: f64, expected: f64, standard_error: f64) -> Verdict {
    let z = deviation(value - expected, standard_error);
    Verdict {
        statistic: z,
        degrees: f64::INFINITY,
        p_value: puruspe::erfc(z.abs() / std::f64::consts::SQRT_2),
    }
}

/// Two-sided Student test that values have the mean `expected`.
pub fn t_test(values: &Moments, expected: f64) -> Verdict {
    let n = values.count as f64;
    student(
        deviation(values.mean - expected, (values.variance() / n).sqrt()),
        n - 1.0,
    )
}

/// Two-sided test that two sequences of unequal variance have one mean
/// [Welch1947].
pub fn welch_test(a: &Moments, b: &Moments) -> Verdict {
    let (na, nb) = (a.count as f64, b.count as f64);
    let (va, vb) = (a.variance() / na, b.variance() / nb);
    let degrees = (va + vb) * (va + vb) / (va * va / (na - 1.0) + vb * vb / (nb - 1.0));
    student(deviation(a.mean - b.mean, (va + vb).sqrt()), degrees)
}

/// `difference / error`, where no error at all makes equal exactly equal.
fn deviation(difference: f64, error: f64) -> f64 {
    if difference == 0.0 {
        0.0
    } else {
        difference / error
    }
}

fn student(t: f64, degrees: f64) -> Verdict {
    let p_value = if t == 0.0 {
        1.0
    } else if !t.is_finite() {
        0.0
    } else if degrees >= 1.0 && t * t < 1.0 {
        // Of a small share of the variance the other share is one to rounding.
        1.0 - puruspe::betai(0.5, 0.5 * degrees, t * t / (degrees + t * t))
    } else if degrees >= 1.0 {
        puruspe::betai(0.5 * degrees, 0.5, degrees / (degrees + t * t))
    } else {
        // Zero variance makes the degrees NaN only together with an infinite t;
        // fewer than two values have no information.
        1.0
    };
    Verdict {
        statistic: t,
        degrees,
        p_value,
    }
}

/// Regularised upper incomplete gamma function Q(a, x): the series below the
/// mean and Lentz's continued fraction above, as in [Press2007]. (The quadrature
/// that puruspe uses beyond a = 100 returns NaN for some arguments near the mean.)
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - puruspe::ln_gamma(a)).exp();
    // Both converge within a few times sqrt(a) terms; the cap is for NaN.
    let terms = 1000 + 20 * a.sqrt() as usize;
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for k in 1..terms {
            term *= x / (a + k as f64);
            sum += term;
            if term < 1e-16 * sum {
                break;
            }
        }
        return (1.0 - front * sum).clamp(0.0, 1.0);
    }
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut product = d;
    for k in 1..terms {
        let k = k as f64;
        let numerator = k * (a - k);
        b += 2.0;
        d = 1.0 / (numerator * d + b);
        c = b + numerator / c;
        product *= c * d;
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    (front * product).clamp(0.0, 1.0)
}

/// Cells with fewer expected counts are pooled: below about five the statistic
/// no longer follows the chi-square distribution.
const MIN_EXPECTED: f64 = 5.0;

/// Pearson's test that counts follow expectations of the same length.
///
/// Cells that expect fewer than five counts are pooled, smallest first, until
/// the pool reaches five; counts where (nearly) none can fall therefore still
/// weigh in. Both lists must cover all draws.
pub fn chi_square(observed: &[u64], expected: &[f64]) -> Verdict {
    let mut cells: Vec<(f64, f64)> = expected
        .iter()
        .zip(observed)
        .map(|(&e, &o)| (e.max(0.0), o as f64))
        .collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut statistic = 0.0;
    let mut kept = 0u32;
    let (mut pool_e, mut pool_o) = (0.0, 0.0);
    for (e, o) in cells {
        pool_e += e;
        pool_o += o;
        if pool_e >= MIN_EXPECTED {
            statistic += (pool_o - pool_e).powi(2) / pool_e;
            kept += 1;
            (pool_e, pool_o) = (0.0, 0.0);
        }
    }
    // Only reached with a remainder when everything expects less than five.
    let impossible = pool_e <= 0.0 && pool_o > 0.0;
    let degrees = f64::from(kept) - 1.0;
    let p_value = if impossible || !statistic.is_finite() {
        0.0
    } else if degrees < 1.0 {
        1.0
    } else {
        upper_gamma(0.5 * degrees, 0.5 * statistic)
    };
    Verdict {
        statistic,
        degrees,
        p_value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PathRng, warp};
    use glam::Vec3;
    use std::f64::consts::TAU;

    #[test]
    fn tails_match_tables() {
        for degrees in [3.0, 1e3, 1e5, 1e8] {
            assert!(student(1e-6, degrees).p_value > 1.0 - 1e-5, "{degrees}");
            let around = [0.999_999, 1.000_001].map(|t| student(t, degrees).p_value);
            assert!((around[0] - around[1]).abs() < 1e-5, "{degrees}");
        }
        assert!((z_test(1.959_964, 0.0, 1.0).p_value - 0.05).abs() < 1e-6);
        let t = student(2.228_139, 10.0);
        assert!((t.p_value - 0.05).abs() < 1e-6);
        // Tabulated points of the chi-square distribution.
        for (degrees, point, p) in [
            (9.0, 16.918_978, 0.05),
            (100.0, 124.342_113, 0.05),
            (1000.0, 1_074.679_449, 0.05),
            (1000.0, 898.912_447, 0.99),
        ] {
            let got = upper_gamma(0.5 * degrees, 0.5 * point);
            assert!((got - p).abs() < 1e-6, "{degrees} {point}: {got}");
        }
        let mut last = 1.0;
        for i in 0..2000 {
            let p = upper_gamma(219.5, 0.5 * f64::from(i));
            assert!(p <= last && p >= 0.0, "not falling at {i}");
            last = p;
        }
        let expected = [10.0; 10];
        let mut observed = [10u64; 10];
        (observed[0], observed[1]) = (19, 1);
        let at_81 = chi_square(&observed, &expected);
        assert!((at_81.statistic - 16.2).abs() <= 32.0 * f64::EPSILON);
        assert!((at_81.p_value - 0.062_6).abs() < 5e-4, "{at_81:?}");
        assert!((sidak(0.01, 10) - 0.001_004_53).abs() < 1e-7);
    }

    #[test]
    fn p_values_of_true_hypotheses_are_uniform() {
        // 400 p-values against ten equal cells: itself a chi-square test.
        let mut rng = PathRng::from_seed(21);
        let mut counts = [[0u64; 10]; 2];
        let cell = |p: f64| ((10.0 * p) as usize).min(9);
        let grid = SphereGrid::new(Vec3::new(0.6, 0.0, 0.8), 6, 8);
        for _ in 0..400 {
            let m: Moments = (0..200).map(|_| f64::from(rng.unit())).collect();
            counts[0][cell(t_test(&m, 0.5).p_value)] += 1;
            let v = grid.chi_square(
                4000,
                || Some(warp::cosine_hemisphere(rng.unit2())),
                |w| f64::from(warp::cosine_hemisphere_pdf(w.z)),
            );
            counts[1][cell(v.p_value)] += 1;
        }
        for c in counts {
            let v = chi_square(&c, &[40.0; 10]);
            assert!(v.p_value > sidak(0.001, 2), "seed 21: {c:?} {v:?}");
        }
    }

    #[test]
    fn wrong_densities_are_rejected() {
        let mut rng = PathRng::from_seed(22);
        let grid = SphereGrid::new(Vec3::Y, 12, 24);
        let cosine = |w: Vec3| f64::from(warp::cosine_hemisphere_pdf(w.z));
        let mut p = |pdf: &dyn Fn(Vec3) -> f64| {
            let sample = || Some(warp::cosine_hemisphere(rng.unit2()));
            grid.chi_square(100_000, sample, pdf).p_value
        };
        assert!(p(&cosine) > 1e-3, "seed 22");
        assert!(p(&|w| 1.02 * cosine(w)) < 1e-9, "2 % too much");
        assert!(p(&|w| 0.98 * cosine(w)) < 1e-9, "2 % too little");
        assert!(p(&|w| cosine(w) * (1.0 + 0.1 * f64::from(w.x))) < 1e-9);
        assert!(
            p(&|w| f64::from(u8::from(w.z > 0.0)) / TAU) < 1e-9,
            "no cosine"
        );
    }

    #[test]
    fn draws_that_find_nothing_are_counted() {
        let mut rng = PathRng::from_seed(23);
        let line = LineGrid {
            from: 0.0,
            to: 1.0,
            cells: 16,
        };
        let mut half = |missing: f32| {
            let sample = || {
                let keep = rng.unit() >= missing;
                keep.then(|| f64::from(rng.unit()))
            };
            line.chi_square(20_000, sample, |_| 0.7).p_value
        };
        assert!(half(0.3) > 1e-3, "seed 23");
        // Margin: the smaller, the clearer is the rejection.
        assert!(half(0.25) < 1e-9, "seed 23");
    }
}
