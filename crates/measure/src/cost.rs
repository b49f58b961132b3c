//! The cost of a picture, and the choice among several ways to make it.

/// Pixels of the picture for which costs are stated.
pub const PICTURE_PIXELS: u64 = 1 << 17;

/// The cost of one way to make a picture of [`PICTURE_PIXELS`].
///
/// The squared relative noise of a picture falls with the time spent on it, so one number
/// describes the speed of a way: the seconds that bring it to 1, the inverse of the efficiency.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Cost {
    /// Seconds before the first sample: geometry, voxels, tables, light that is learned.
    pub setup_s: f64,
    /// Seconds of tracing times the squared relative noise of the result.
    pub noise_s: f64,
    /// Peak memory.
    pub memory_bytes: u64,
}

impl Cost {
    /// From the seconds before the first sample of a picture of so many pixels, those of
    /// its samples, and the noise that these left.
    pub fn of_picture(
        pixels: u64,
        setup_s: f64,
        tracing_s: f64,
        noise: f64,
        memory_bytes: u64,
    ) -> Cost {
        let pictures = PICTURE_PIXELS as f64 / pixels.max(1) as f64;
        Cost {
            setup_s,
            noise_s: pictures * tracing_s * noise * noise,
            memory_bytes,
        }
    }

    /// The cost of a picture of so many pixels, whose set-up is the same.
    pub fn for_pixels(&self, pixels: u64) -> Cost {
        Cost {
            noise_s: self.noise_s * pixels as f64 / PICTURE_PIXELS as f64,
            ..*self
        }
    }

    /// Seconds until the error, the root of the summed squares of model error and noise, is at
    /// most `tolerance`; `None` when the model error alone is not below it.
    pub fn seconds_within(&self, tolerance: f64, model_error: f64) -> Option<f64> {
        let left = tolerance * tolerance - model_error * model_error;
        (left > 0.0 && model_error >= 0.0).then(|| self.setup_s + self.noise_s / left)
    }

    /// The error after some seconds; `None` before the first path.
    pub fn error_after(&self, seconds: f64, model_error: f64) -> Option<f64> {
        let tracing_s = seconds - self.setup_s;
        (tracing_s > 0.0).then(|| (model_error * model_error + self.noise_s / tracing_s).sqrt())
    }
}

/// The Pareto front: the points for which no other point is at most as large in every
/// coordinate and smaller in one. Points with a NaN coordinate are never in the front.
pub fn pareto_front<const N: usize>(points: &[[f64; N]]) -> Vec<bool> {
    let valid = |p: &[f64; N]| p.iter().all(|x| !x.is_nan());
    let beats =
        |a: &[f64; N], b: &[f64; N]| valid(a) && a.iter().zip(b).all(|(x, y)| x <= y) && a != b;
    let is_beaten = |p| points.iter().any(|other| beats(other, p));
    points.iter().map(|p| valid(p) && !is_beaten(p)).collect()
}

/// The growth of a cost with a size: as `size ^ exponent`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Growth {
    /// The exponent that fits all sizes best.
    pub exponent: f64,
    /// Its standard error, from the distances of the costs from the fitted line; unknown for
    /// two points.
    pub standard_error: Option<f64>,
    /// The exponent between the two largest sizes, where constant costs matter least.
    pub last_exponent: f64,
}

/// The exponent of costs over sizes, by least squares in their logarithms; `None` for a single
/// size, or values that are not positive. Sizes must increase.
pub fn growth(points: &[(f64, f64)]) -> Option<Growth> {
    let usable = |&(x, y): &(f64, f64)| x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite();
    let [.., before, last] = points else {
        return None;
    };
    if !points.iter().all(usable) || before.0 >= last.0 {
        return None;
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let (x0, y0) = logs
        .iter()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let xx: f64 = logs.iter().map(|(x, _)| (x - x0).powi(2)).sum();
    let xy: f64 = logs.iter().map(|(x, y)| (x - x0) * (y - y0)).sum();
    let exponent = xy / xx;
    let residuals = logs.iter().map(|(x, y)| y - y0 - exponent * (x - x0));
    let off: f64 = residuals.map(|r| r.powi(2)).sum();
    Some(Growth {
        exponent,
        standard_error: (n > 2.0).then(|| (off / (n - 2.0) / xx).sqrt()),
        last_exponent: (last.1 / before.1).ln() / (last.0 / before.0).ln(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_and_errors_are_each_others_inverse() {
        let cost = Cost {
            setup_s: 2.0,
            noise_s: 0.01,
            memory_bytes: 0,
        };
        let seconds = cost.seconds_within(0.05, 0.03).unwrap();
        assert!((seconds - (2.0 + 0.01 / 0.0016)).abs() < 16.0 * f64::EPSILON);
        assert!((cost.error_after(seconds, 0.03).unwrap() - 0.05).abs() < 4.0 * f64::EPSILON);
        assert_eq!(cost.seconds_within(0.03, 0.03), None, "never reached");
        assert_eq!(cost.seconds_within(0.03, f64::NAN), None);
        assert_eq!(cost.error_after(1.0, 0.0), None);
    }

    #[test]
    fn costs_are_those_of_a_picture_of_one_size() {
        let small = Cost::of_picture(256, 2.0, 3.0, 0.1, 0);
        let expected = 3.0 * 0.01 * 512.0;
        // Some roundings of each.
        let near = |a: f64, b: f64| (a - b).abs() < 8.0 * f64::EPSILON * b;
        assert!(near(small.noise_s, expected));
        let back = small.for_pixels(256);
        assert!(near(back.noise_s, 0.03));
        assert_eq!(back.setup_s, 2.0);
    }

    /// Against the front by sorting, over random points, and a twin whose front
    /// has lost a point.
    #[test]
    fn the_front_is_that_of_a_sweep() {
        let mut rng = organza_basis::PathRng::new(3, 0, 0);
        let points: Vec<[f64; 2]> = (0..200)
            .map(|_| [rng.unit(), rng.unit()].map(f64::from))
            .collect();
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]));
        let (mut swept, mut best) = (vec![false; points.len()], f64::INFINITY);
        for i in order {
            if points[i][1] < best {
                (swept[i], best) = (true, points[i][1]);
            }
        }
        assert_eq!(pareto_front(&points), swept, "seed 3");
        let first = swept.iter().position(|&s| s).unwrap();
        let mut without = points.clone();
        without[first] = [2.0, 2.0];
        assert_ne!(pareto_front(&without), swept);
    }

    #[test]
    fn equals_share_the_front_and_what_is_no_number_is_not_on_it() {
        let points = [
            [1.0, 2.0],
            [1.0, 2.0],
            [2.0, 1.0],
            [2.0, 2.0],
            [f64::NAN, 0.0],
        ];
        assert_eq!(pareto_front(&points), [true, true, true, false, false]);
        assert_eq!(pareto_front::<2>(&[]), [false; 0]);
        let points = [[f64::INFINITY, 0.0], [1.0, 1.0]];
        assert_eq!(pareto_front(&points), [true, true]);
    }

    #[test]
    fn planted_exponents_are_found_and_what_stays_is_told_apart_from_what_grows() {
        let sizes = [1.0f64, 2.0, 4.0, 8.0];
        for planted in [0.0, 0.5, 1.0, 2.0] {
            let found = growth(&sizes.map(|x| (x, 3.0 * x.powf(planted)))).unwrap();
            assert!((found.exponent - planted).abs() < 4.0 * f64::EPSILON);
            assert!(found.standard_error.unwrap() < 4.0 * f64::EPSILON);
        }
        let with_start = growth(&sizes.map(|x| (x, 5.0 + x * x))).unwrap();
        assert!(with_start.exponent < with_start.last_exponent && with_start.last_exponent < 2.0);
        assert!(with_start.standard_error.unwrap() > 0.1);
        let of_two = growth(&[(1.0, 1.0), (2.0, 2.0)]).unwrap();
        assert_eq!((of_two.exponent, of_two.standard_error), (1.0, None));
        assert_eq!(growth(&[(1.0, 1.0)]), None);
        assert_eq!(growth(&[(1.0, 1.0), (1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(growth(&[(1.0, 1.0), (2.0, 0.0), (3.0, 3.0)]), None);
    }
}
