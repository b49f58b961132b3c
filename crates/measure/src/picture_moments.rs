//! The moments of a picture by which the optics of a volume are matched [Zhao2011]: means of
//! the pixels that show each material, and deviations of pixels and of averages of pixels.

use crate::Measured;

/// A rectangle of linear pixels, in rows.
#[derive(Clone, Debug, PartialEq)]
pub struct MatchedPicture {
    /// Pixels in a row.
    pub width: usize,
    /// Pixels, each channel.
    pub pixels: Vec<[f32; 3]>,
    /// Variances of their noise.
    pub variance: Vec<[f32; 3]>,
}

/// Blocks along each side that are left out in turn for the errors of moments.
const BLOCKS: usize = 4;

/// Pixels along each side of an average.
const AVERAGED: usize = 4;

/// Least pixels along each side of a picture that has moments.
pub const MIN_SIDE: usize = BLOCKS * AVERAGED;

impl MatchedPicture {
    /// Rows.
    pub fn height(&self) -> usize {
        self.pixels.len() / self.width.max(1)
    }

    /// The picture as a lens out of focus shows it: a Gaussian of `deviation_px` pixels.
    /// Noise is made before the blur, so that its variance decreases.
    pub fn blurred(&self, deviation_px: f64) -> MatchedPicture {
        let reach = (3.0 * deviation_px).ceil() as i64;
        let weight = |d: i64| (-0.5 * (d as f64 / deviation_px).powi(2)).exp();
        let blur = |list: &[[f32; 3]], along_x: bool, power: i32| -> Vec<[f32; 3]> {
            let (w, h) = (self.width as i64, self.height() as i64);
            let at = |x: i64, y: i64| list[(y * w + x) as usize];
            let one = |x: i64, y: i64| {
                let (mut sum, mut all) = ([0.0f64; 3], 0.0);
                for d in -reach..=reach {
                    let (x, y) = if along_x { (x + d, y) } else { (x, y + d) };
                    if (0..w).contains(&x) && (0..h).contains(&y) {
                        let weight = weight(d);
                        all += weight;
                        for (s, v) in sum.iter_mut().zip(at(x, y)) {
                            *s += weight.powi(power) * f64::from(v);
                        }
                    }
                }
                sum.map(|s| (s / all.powi(power)) as f32)
            };
            let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
            pixels.map(|(x, y)| one(x, y)).collect()
        };
        let both = |list: &[[f32; 3]], power| blur(&blur(list, true, power), false, power);
        MatchedPicture {
            width: self.width,
            pixels: both(&self.pixels, 1),
            variance: both(&self.variance, 2),
        }
    }

    /// Mean of the pixels of each class, then the deviation of all pixels, then, if `averages`,
    /// the deviation of averages over squares of 4 x 4 pixels. `class_of` names the class of a
    /// pixel, if it has one; a class that no pixel has gives nothing at its place. Noise of
    /// known variance is subtracted from deviations.
    ///
    /// Errors are those of another piece of the same cloth: sixteen blocks of the picture are
    /// left out in turn [Efron1993].
    pub fn moments(
        &self,
        classes: usize,
        class_of: &dyn Fn(usize) -> Option<usize>,
        averages: bool,
    ) -> Vec<Option<Measured>> {
        let mut list = Vec::new();
        for class in 0..classes {
            let mut sums = Blocks::default();
            self.each(|k, block| {
                if class_of(k) == Some(class) {
                    sums.add(block, self.pixels[k], self.variance[k], 1.0);
                }
            });
            list.push(sums.measured(Sums::mean));
        }
        let mut sums = Blocks::default();
        self.each(|k, block| sums.add(block, self.pixels[k], self.variance[k], 1.0));
        list.push(sums.measured(Sums::deviation));
        if averages {
            list.push(self.averages().measured(Sums::deviation));
        }
        list
    }

    /// Calls `visit` with every pixel and its block.
    fn each(&self, mut visit: impl FnMut(usize, usize)) {
        let (w, h) = (self.width, self.height());
        for k in 0..w * h {
            let (x, y) = (k % w, k / w);
            visit(k, y * BLOCKS / h * BLOCKS + x * BLOCKS / w);
        }
    }

    fn averages(&self) -> Blocks {
        let (w, h) = (self.width / AVERAGED, self.height() / AVERAGED);
        let mut sums = Blocks::default();
        let count = (AVERAGED * AVERAGED) as f32;
        for k in 0..w * h {
            let (x, y) = (k % w, k / w);
            let (mut mean, mut variance) = ([0.0f32; 3], [0.0f32; 3]);
            for d in 0..AVERAGED * AVERAGED {
                let (i, j) = (d % AVERAGED, d / AVERAGED);
                let at = (y * AVERAGED + j) * self.width + x * AVERAGED + i;
                for c in 0..3 {
                    mean[c] += self.pixels[at][c] / count;
                    variance[c] += self.variance[at][c] / (count * count);
                }
            }
            let block = y * BLOCKS / h * BLOCKS + x * BLOCKS / w;
            sums.add(block, mean, variance, 1.0);
        }
        sums
    }
}

/// Sums over pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    values: [f64; 3],
    squares: [f64; 3],
    noise: [f64; 3],
}

impl Sums {
    fn mean(&self) -> [f64; 3] {
        self.values.map(|v| v / self.count)
    }

    fn deviation(&self) -> [f64; 3] {
        let mean = self.mean();
        std::array::from_fn(|c| {
            let own = self.squares[c] / self.count - mean[c] * mean[c];
            (own - self.noise[c] / self.count).max(0.0).sqrt()
        })
    }

    fn plus(&self, o: &Sums, sign: f64) -> Sums {
        let sum = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|c| a[c] + sign * b[c]);
        Sums {
            count: self.count + sign * o.count,
            values: sum(self.values, o.values),
            squares: sum(self.squares, o.squares),
            noise: sum(self.noise, o.noise),
        }
    }
}

/// Sums of each block.
#[derive(Clone, Debug, Default)]
struct Blocks([Sums; BLOCKS * BLOCKS]);

impl Blocks {
    fn add(&mut self, block: usize, value: [f32; 3], variance: [f32; 3], count: f64) {
        let value = value.map(f64::from);
        self.0[block] = self.0[block].plus(
            &Sums {
                count,
                values: value,
                squares: value.map(|v| v * v),
                noise: variance.map(f64::from),
            },
            1.0,
        );
    }

    fn measured(&self, of: fn(&Sums) -> [f64; 3]) -> Option<Measured> {
        let all = self.0.iter().fold(Sums::default(), |s, b| s.plus(b, 1.0));
        if all.count < 1.0 {
            return None;
        }
        // Blocks without pixels of a class say nothing, and neither does what is left when all
        // pixels are in one.
        let kept = self.0.iter().filter(|b| b.count > 0.0);
        let left = kept.map(|b| all.plus(b, -1.0)).filter(|s| s.count > 0.5);
        let without: Vec<[f64; 3]> = left.map(|s| of(&s)).collect();
        let n = without.len() as f64;
        let value = of(&all);
        let se = std::array::from_fn(|c| {
            if without.len() < 2 {
                return value[c].abs();
            }
            let mean = without.iter().map(|v| v[c]).sum::<f64>() / n;
            let square: f64 = without.iter().map(|v| (v[c] - mean).powi(2)).sum();
            (square * (n - 1.0) / n).sqrt()
        });
        Some(Measured { mean: value, se })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    /// White noise of known deviation about a value, and variance as told.
    fn noise(width: usize, deviation: f32, told: f32, seed: u64) -> MatchedPicture {
        let mut rng = PathRng::from_seed(seed);
        let pixels = (0..width * width)
            .map(|_| [1.0, 2.0, 0.5].map(|m: f32| m + deviation * rng.normal2().x))
            .collect();
        MatchedPicture {
            width,
            pixels,
            variance: vec![[told * told; 3]; width * width],
        }
    }

    #[test]
    fn moments_of_white_noise_and_their_errors_are_known() {
        let all = |_: usize| Some(0);
        // Over many pictures, the errors told are those that occur.
        let (mut chi2, mut count) = ([0.0; 2], 0.0);
        for seed in 0..40 {
            let list = noise(64, 0.1, 0.0, seed).moments(1, &all, true);
            let truth = [[1.0, 2.0, 0.5], [0.1; 3], [0.025; 3]];
            for (measured, (truth, which)) in list.iter().zip(truth.iter().zip([0, 1, 1])) {
                let m = measured.unwrap();
                for (c, t) in truth.iter().enumerate() {
                    chi2[which] += ((m.mean[c] - t) / m.se[c]).powi(2);
                    count += 1.0 / 3.0;
                }
            }
        }
        // The square of Student's t of 15 degrees has a mean of 15 / 13 = 1.15 and a fourth
        // moment of 3 * 15^2 / (13 * 11) = 4.72, so a deviation of 1.84. The mean of 120 of
        // them has a standard error of 0.168, that of 240 one of 0.119. The margin is that of
        // chance: 3 and 3.8 of these.
        let mean = chi2[0] / count;
        assert!((mean - 1.15).abs() < 0.5, "{chi2:?}, seeds 0..40");
        let ratio = chi2[1] / (2.0 * count);
        assert!((ratio - 1.15).abs() < 0.45, "{chi2:?}, seeds 0..40");
        // Noise of the stated size adds no deviation; the twin states half of it.
        // Over 4096 pixels a variance has a relative standard error of sqrt(2 / 4096) = 0.022.
        // The margin is that of chance: the root of four of these, times 0.1, is 0.03.
        let told = noise(64, 0.1, 0.1, 7).moments(1, &all, false)[1].unwrap();
        assert!(told.mean[0] < 0.03, "{told:?}");
        let half = noise(64, 0.1, 0.05, 7).moments(1, &all, false)[1].unwrap();
        assert!(half.mean[0] > 0.07, "{half:?}");
    }

    #[test]
    fn classes_have_means_of_their_own() {
        let mut picture = noise(32, 0.01, 0.0, 3);
        for (k, p) in picture.pixels.iter_mut().enumerate() {
            if k % 3 == 0 {
                p[1] = 5.0;
            }
        }
        let class = |k: usize| (k % 3 != 2).then_some(k % 3);
        let list = picture.moments(3, &class, false);
        assert!((list[0].unwrap().mean[1] - 5.0).abs() < 4.0 * f64::from(f32::EPSILON));
        assert!((list[1].unwrap().mean[1] - 2.0).abs() < 0.01);
        assert!(list[2].is_none() && list.len() == 4);
    }

    #[test]
    fn a_blur_keeps_the_mean_and_lowers_noise_as_told() {
        let picture = noise(48, 0.1, 0.1, 5).blurred(1.5);
        let mean = |list: &[[f32; 3]]| list.iter().map(|p| p[0]).sum::<f32>() / list.len() as f32;
        assert!((mean(&picture.pixels) - 1.0).abs() < 0.01);
        // A Gaussian of 1.5 pixels keeps 1 / (4 pi 1.5^2) of the variance.
        let kept = mean(&picture.variance) / 0.01;
        assert!((kept / 0.0354 - 1.0).abs() < 0.15, "{kept}");
        let left = picture.moments(1, &|_| Some(0), false)[1].unwrap();
        assert!(left.mean[0] < 4.0 * f64::from(f32::EPSILON), "{left:?}");
    }
}
