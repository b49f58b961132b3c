//! Elementary functions and random numbers of lanes against second ways.

use super::lanes::{Floats, Ints, Mask};
use super::math::{LaneRng, exp2, minus_ln, pixel_key, sin_cos_of_turns, turns_of};
use super::one;

#[test]
fn elementary_functions_are_those_of_the_library() {
    let of = |f: fn(one::F) -> one::F, x: f32| f(one::F::splat(x)).0;
    for i in 1..=100_000u32 {
        let u = i as f32 / 100_000.0;
        let ln = of(minus_ln, u);
        assert!((ln + u.ln()).abs() <= 3e-7 * u.ln().abs() + 1e-9, "{u}");
        let x = -20.0 * u;
        let e = of(exp2, x);
        assert!((e / x.exp2() - 1.0).abs() < 2.0 * f32::EPSILON, "{x}");
        let turns = u - 1e-5;
        let (s, c) = sin_cos_of_turns(one::F::splat(turns));
        let (sin, cos) = (std::f64::consts::TAU * f64::from(turns)).sin_cos();
        assert!(
            (f64::from(s.0) - sin).abs() < 1.5 * f64::from(f32::EPSILON),
            "{turns}"
        );
        assert!(
            (f64::from(c.0) - cos).abs() < 1.5 * f64::from(f32::EPSILON),
            "{turns}"
        );
        let back = turns_of(s, c).0;
        let apart = back - turns;
        assert!(
            (apart - apart.round()).abs() < 0.5 * f32::EPSILON,
            "{turns}: {back}"
        );
    }
    assert_eq!(of(exp2, -1e9), f32::MIN_POSITIVE);
    assert_eq!(of(minus_ln, 1.0), 0.0);
}

/// First numbers of neighbouring pixels and samples are uncorrelated, and means
/// are those of uniform numbers.
#[test]
fn random_numbers_of_lanes_are_uniform_and_independent() {
    let n = 60_000u32;
    let first = |pixel: u32, sample: u32| {
        let (a, b) = pixel_key(3, u64::from(pixel));
        let mut rng = LaneRng::new((one::U::splat(a), one::U::splat(b)), one::U::splat(sample));
        rng.units(Mask::from_bits(1)).map(|f| f64::from(f.0) - 0.5)
    };
    let (mut mean, mut of_samples, mut of_pixels, mut of_three) = (0.0, 0.0, 0.0, 0.0);
    for i in 0..n {
        let own = first(7, i);
        mean += own.iter().sum::<f64>() / 3.0;
        of_samples += own[0] * first(7, i + 1)[0];
        of_pixels += first(i, 5)[1] * first(i + 1, 5)[1];
        of_three += own[0] * own[1] + own[1] * own[2] + own[0] * own[2];
    }
    let n = f64::from(n);
    let four = |sum: f64, variance: f64| assert!(sum.abs() < 4.0 * (variance * n).sqrt(), "{sum}");
    four(mean, 1.0 / 36.0);
    four(of_samples, 1.0 / 144.0);
    four(of_pixels, 1.0 / 144.0);
    four(of_three, 3.0 / 144.0);
}
