//! The difference between two pictures, without the noise of either.

use crate::Figure;
use organza_transport::Film;

/// A picture with known noise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NoisyPicture {
    /// Radiance per pixel and channel.
    pub mean: Vec<[f64; 3]>,
    /// Variance of [`NoisyPicture::mean`].
    pub variance: Vec<[f64; 3]>,
}

impl From<&Film> for NoisyPicture {
    fn from(film: &Film) -> NoisyPicture {
        let channels = |p: &organza_transport::Pixel| [0, 1, 2].map(|c| p.moments(c));
        let of = |m: organza_basis::Moments| m.variance() / m.count.max(1) as f64;
        NoisyPicture {
            mean: film
                .pixels()
                .iter()
                .map(|p| channels(p).map(|m| m.mean))
                .collect(),
            variance: film.pixels().iter().map(|p| channels(p).map(of)).collect(),
        }
    }
}

impl NoisyPicture {
    /// Mean over pixels and channels, and its variance.
    pub fn brightness(&self) -> (f64, f64) {
        let values = (3 * self.mean.len()).max(1) as f64;
        let mean = self.mean.iter().flatten().sum::<f64>() / values;
        // The channels of a path are correlated.
        let roots = self.variance.iter().map(|v| v.map(f64::sqrt));
        let deviations = roots.map(|v| v.iter().sum::<f64>().powi(2));
        (mean, deviations.sum::<f64>() / (values * values))
    }

    /// Mean variance of a pixel.
    pub fn mean_variance(&self) -> f64 {
        self.variance.iter().flatten().sum::<f64>() / (3 * self.variance.len()).max(1) as f64
    }
}

/// The difference between a picture and the reference, as shares of the mean of the reference
/// over pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PictureError {
    /// Root mean square over pixels and channels of the difference that would remain if neither
    /// picture had noise.
    pub rmse: Figure,
    /// Mean of the difference.
    pub bias: Figure,
    /// Noise of the picture itself: standard error of a pixel, root mean square.
    pub noise: f64,
}

/// Standard errors on each side of a 95 % interval.
const SIDE: f64 = 1.96;

/// Compares a picture with the reference; `None` for pictures of different or zero size and for
/// a black reference.
///
/// The mean squared difference of two independent pictures is that of their expectations plus
/// both variances, which are subtracted. The estimate is unbiased, so that it may be negative;
/// then it is clamped to zero. For normal noise of variance `v` about a difference `d`, the
/// variance of the squared difference is `4 d^2 v + 2 v^2`. Channels are assumed to be fully
/// correlated, which makes intervals too wide rather than too narrow.
pub fn picture_error(picture: &NoisyPicture, truth: &NoisyPicture) -> Option<PictureError> {
    let pixels = truth.mean.len();
    let same = [
        picture.mean.len(),
        picture.variance.len(),
        truth.variance.len(),
    ] == [pixels; 3];
    let (brightness, _) = truth.brightness();
    if !same || pixels == 0 || !(brightness > 0.0 && brightness.is_finite()) {
        return None;
    }
    let (mut square, mut deviation) = (0.0, 0.0);
    for c in 0..3 {
        let (mut sum, mut variance) = (0.0, 0.0);
        for i in 0..pixels {
            let v = picture.variance[i][c] + truth.variance[i][c];
            let d2 = (picture.mean[i][c] - truth.mean[i][c]).powi(2) - v;
            sum += d2;
            variance += 4.0 * d2 * v + 2.0 * v * v;
        }
        square += sum / 3.0;
        deviation += variance.max(0.0).sqrt() / 3.0;
    }
    let n = pixels as f64;
    let root = |x: f64| (x / n).max(0.0).sqrt() / brightness;
    let ((mean, variance), (truth_mean, truth_variance)) =
        (picture.brightness(), truth.brightness());
    let bias = (mean - truth_mean) / brightness;
    let side = SIDE * (variance + truth_variance).sqrt() / brightness;
    // A root mean square is at least the mean, so a lower bound of the mean is one of the root
    // mean square. It is the better bound where errors are alike all over the picture.
    let least = (bias.abs() - side).max(0.0);
    Some(PictureError {
        rmse: Figure {
            value: root(square).max(least),
            low: root(square - SIDE * deviation).max(least),
            high: root(square + SIDE * deviation).max(bias.abs() + side),
        },
        bias: Figure {
            value: bias,
            low: bias - side,
            high: bias + side,
        },
        noise: picture.mean_variance().sqrt() / brightness,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    /// A normal deviate (Box and Muller).
    fn normal(rng: &mut PathRng) -> f64 {
        let (u, v) = (f64::from(1.0 - rng.unit()), f64::from(rng.unit()));
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    fn noisy(exact: &[[f64; 3]], variance: f64, rng: &mut PathRng) -> NoisyPicture {
        let noise = |v: f64, rng: &mut PathRng| v + variance.sqrt() * normal(rng);
        NoisyPicture {
            mean: exact.iter().map(|p| p.map(|v| noise(v, rng))).collect(),
            variance: vec![[variance; 3]; exact.len()],
        }
    }

    /// A pattern of mean 1, and the same with a planted error.
    fn planted(error: f64) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
        let truth: Vec<[f64; 3]> = (0..400)
            .map(|i| [0.5 + f64::from(i % 3) / 2.0; 3])
            .collect();
        let wrong =
            |(i, p): (usize, &[f64; 3])| p.map(|v| v + if i % 2 == 0 { error } else { -error });
        let other = truth.iter().enumerate().map(wrong).collect();
        (truth, other)
    }

    /// Planted errors below the noise are recovered, and the intervals contain them about as
    /// often as their level; those of the twin, which keeps the noise, do not.
    #[test]
    fn planted_errors_are_found_beneath_the_noise() {
        for (planted_error, variance) in [(0.0, 0.01), (0.05, 0.01), (0.2, 0.01), (0.02, 1e-4)] {
            let (truth, wrong) = planted(planted_error);
            let (mut held, mut twin_held, mut squares) = (0, 0, 0.0);
            let runs = 200;
            for seed in 0..runs {
                let mut rng = PathRng::new(seed, 0, 0);
                let a = noisy(&wrong, variance, &mut rng);
                let b = noisy(&truth, variance, &mut rng);
                let found = picture_error(&a, &b).unwrap();
                held +=
                    u64::from(found.rmse.low <= planted_error && planted_error <= found.rmse.high);
                squares += found.rmse.value.powi(2) / runs as f64;
                let certain = |p: &NoisyPicture| NoisyPicture {
                    variance: vec![[0.0; 3]; p.mean.len()],
                    ..p.clone()
                };
                let twin = picture_error(&certain(&a), &certain(&b)).unwrap();
                twin_held +=
                    u64::from(twin.rmse.low <= planted_error && planted_error <= twin.rmse.high);
                assert!((found.noise / variance.sqrt() - 1.0).abs() < 0.02);
            }
            let case = format!("seeds 0..{runs}, error {planted_error}, variance {variance}");
            assert!(held >= runs * 9 / 10, "{case}: held {held}");
            assert_eq!(twin_held, 0, "{case}: the twin's interval");
            // Clamped at zero, the mean square is too large by less than its noise, sqrt(2 /
            // 1200) of 2 v.
            let slack = 2.0 * variance * (2.0f64 / 1200.0).sqrt() + 0.1 * planted_error.powi(2);
            let off = (squares - planted_error.powi(2)).abs();
            assert!(off < slack, "{case}: {squares}");
        }
    }

    /// The second way: the product of two differences with noise of their own has no noise to
    /// subtract.
    #[test]
    fn the_mean_square_agrees_with_the_product_of_independent_differences() {
        let (truth, wrong) = planted(0.1);
        let (mut own, mut other) = (
            organza_basis::Moments::default(),
            organza_basis::Moments::default(),
        );
        for seed in 0..100 {
            let mut rng = PathRng::new(seed, 1, 0);
            let mut draw = |exact: &[[f64; 3]]| noisy(exact, 0.02, &mut rng);
            let (a, b) = ([draw(&wrong), draw(&wrong)], [draw(&truth), draw(&truth)]);
            own.add(picture_error(&a[0], &b[0]).unwrap().rmse.value.powi(2));
            let difference = |k: usize| {
                let pairs = a[k].mean.iter().flatten().zip(b[k].mean.iter().flatten());
                pairs.map(|(x, y)| x - y).collect::<Vec<f64>>()
            };
            let pairs = difference(0).into_iter().zip(difference(1));
            let products = pairs.map(|(x, y)| x * y);
            // The noisy mean of the reference is the unit of one and not of the other.
            other.add(products.sum::<f64>() / 1200.0 / b[0].brightness().0.powi(2));
        }
        let verdict = organza_basis::hypothesis::welch_test(&own, &other);
        assert!(verdict.p_value > 1e-3, "seeds 0..100: {verdict:?}");
    }

    /// A picture that is brighter everywhere has a significant error, though no pixel alone
    /// shows it.
    #[test]
    fn the_error_is_no_less_than_the_bias() {
        let (truth, _) = planted(0.0);
        let brighter: Vec<[f64; 3]> = truth.iter().map(|p| p.map(|v| v + 0.1)).collect();
        let mut held = 0;
        for seed in 0..40 {
            let mut rng = PathRng::new(seed, 2, 0);
            let a = noisy(&brighter, 0.25, &mut rng);
            let found = picture_error(&a, &noisy(&truth, 0.25, &mut rng)).unwrap();
            let (rmse, bias) = (found.rmse, found.bias);
            let is_above = rmse.low >= bias.low && rmse.value >= bias.low && rmse.high >= bias.high;
            assert!(is_above, "seed {seed}: {found:?}");
            held += usize::from(rmse.low <= 0.1 && 0.1 <= rmse.high);
        }
        assert!(held >= 34, "seeds 0..40: the interval held {held} times");
    }

    #[test]
    fn bias_has_an_interval_and_pictures_that_do_not_fit_are_refused() {
        let (truth, _) = planted(0.0);
        let brighter: Vec<[f64; 3]> = truth.iter().map(|p| p.map(|v| 1.1 * v)).collect();
        let mut rng = PathRng::new(5, 0, 0);
        let (a, b) = (
            noisy(&brighter, 0.01, &mut rng),
            noisy(&truth, 0.01, &mut rng),
        );
        let bias = picture_error(&a, &b).unwrap().bias;
        assert!(bias.low < 0.1 && 0.1 < bias.high, "{bias:?}");
        assert!(bias.high - bias.low < 0.06, "{bias:?}");
        let none = NoisyPicture::default();
        assert_eq!(picture_error(&none, &none), None);
        assert_eq!(picture_error(&none, &b), None);
        let black = NoisyPicture {
            mean: vec![[0.0; 3]],
            variance: vec![[0.0; 3]],
        };
        assert_eq!(picture_error(&black, &black), None);
    }
}
