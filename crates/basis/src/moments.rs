//! Running mean and variance.

/// Count, mean and sum of squared deviations of a sequence, kept so that
/// neither long runs nor large means lose the variance [Welford1962], and
/// merged pairwise without order mattering beyond rounding [Chan1983].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// How many values were added.
    pub count: u64,
    /// Their mean (zero when there are none).
    pub mean: f64,
    /// Their summed squared deviation from the mean.
    pub sum_sq_dev: f64,
}

impl Moments {
    /// Adds one value.
    pub fn add(&mut self, x: f64) {
        self.count += 1;
        let d = x - self.mean;
        self.mean += d / self.count as f64;
        self.sum_sq_dev += d * (x - self.mean);
    }

    /// Adds all values of another sequence.
    pub fn merge(&mut self, o: &Moments) {
        if o.count == 0 {
            return;
        }
        let n = (self.count + o.count) as f64;
        let d = o.mean - self.mean;
        self.mean += d * o.count as f64 / n;
        self.sum_sq_dev += o.sum_sq_dev + d * d * self.count as f64 * o.count as f64 / n;
        self.count += o.count;
    }

    /// Unbiased variance of one value; zero for fewer than two.
    pub fn variance(&self) -> f64 {
        if self.count < 2 {
            0.0
        } else {
            self.sum_sq_dev / (self.count - 1) as f64
        }
    }

    /// Standard error of the mean; infinite for fewer than two values.
    pub fn standard_error(&self) -> f64 {
        if self.count < 2 {
            f64::INFINITY
        } else {
            (self.variance() / self.count as f64).sqrt()
        }
    }
}

impl Extend<f64> for Moments {
    fn extend<I: IntoIterator<Item = f64>>(&mut self, values: I) {
        for x in values {
            self.add(x);
        }
    }
}

impl FromIterator<f64> for Moments {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Moments {
        let mut m = Moments::default();
        m.extend(values);
        m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merged_halves_equal_the_whole_far_from_zero() {
        let xs: Vec<f64> = (0..1000).map(|i| 1e9 + f64::from(i % 7)).collect();
        let whole: Moments = xs.iter().copied().collect();
        let mut halves: Moments = xs[..317].iter().copied().collect();
        halves.merge(&xs[317..].iter().copied().collect());
        assert_eq!(whole.count, halves.count);
        assert!((whole.mean - halves.mean).abs() < 1e-6);
        assert!((whole.variance() - halves.variance()).abs() < 1e-6);
        assert!((whole.variance() - 3.994_991 / 0.999).abs() < 1.3e-8);
    }
}
