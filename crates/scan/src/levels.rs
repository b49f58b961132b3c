//! Grey values of air and fibre: the histogram and the threshold between them.

use crate::ScanError;

/// Classes of a histogram.
const CLASSES: usize = 4096;

/// How often grey values occur.
pub(crate) struct Histogram {
    least: f32,
    width: f32,
    counts: Vec<u64>,
}

/// The grey values that tell fibre from air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// Least grey value.
    pub least: f32,
    /// Greatest grey value.
    pub greatest: f32,
    /// Between air and fibre: the outline of fibres.
    pub threshold: f32,
    /// The threshold of `[Otsu1979]`, from which the levels were found, or the given one.
    pub first_threshold: f32,
    /// Grey value of air.
    pub air: f32,
    /// Grey value of a voxel full of fibre.
    pub fibre: f32,
}

impl Levels {
    /// Share of a voxel that is fibre, not yet limited to `[0, 1]`.
    pub fn fill(&self, grey: f32) -> f32 {
        (grey - self.air) / (self.fibre - self.air)
    }
}

impl Histogram {
    pub fn new(least: f32, greatest: f32) -> Histogram {
        Histogram {
            least,
            width: (greatest - least) / CLASSES as f32,
            counts: vec![0; CLASSES],
        }
    }

    pub fn add(&mut self, values: &[f32]) {
        let per_width = 1.0 / self.width;
        for v in values {
            let class = ((v - self.least) * per_width) as usize;
            self.counts[class.min(CLASSES - 1)] += 1;
        }
    }

    fn centre(&self, class: usize) -> f32 {
        self.least + (class as f32 + 0.5) * self.width
    }

    /// The threshold that makes the variance between both classes greatest `[Otsu1979]`.
    fn otsu(&self) -> f32 {
        let total: f64 = self.counts.iter().map(|&c| c as f64).sum();
        let moment = |i: usize, c: u64| i as f64 * c as f64;
        let all: f64 = self
            .counts
            .iter()
            .enumerate()
            .map(|(i, &c)| moment(i, c))
            .sum();
        let (mut below, mut sum) = (0.0, 0.0);
        let (mut best, mut first, mut last) = (-1.0, 0, 0);
        for (i, &c) in self.counts.iter().enumerate().take(CLASSES - 1) {
            below += c as f64;
            sum += moment(i, c);
            if below == 0.0 || below == total {
                continue;
            }
            let apart = sum / below - (all - sum) / (total - below);
            let between = below * (total - below) * apart * apart;
            // Empty classes between both modes give the same variance: the middle of them.
            if between > best {
                (best, first, last) = (between, i, i);
            } else if between == best {
                last = i;
            }
        }
        self.least + (0.5 * (first + last) as f32 + 1.0) * self.width
    }

    /// The most frequent value of the classes `from..to`, after smoothing over a 64th of the
    /// whole range.
    fn mode(&self, from: usize, to: usize) -> f32 {
        const HALF: usize = CLASSES / 128;
        let near = |i: usize| -> u64 {
            let (a, b) = (i.saturating_sub(HALF).max(from), (i + HALF + 1).min(to));
            self.counts[a..b].iter().sum()
        };
        let best = (from..to).fold((from, 0), |best, i| match near(i) {
            n if n > best.1 => (i, n),
            _ => best,
        });
        // The centre of weight of what was counted: many classes have the same count.
        let (a, b) = (
            best.0.saturating_sub(HALF).max(from),
            (best.0 + HALF + 1).min(to),
        );
        let weight = |i: usize| self.counts[i] as f64;
        let sum: f64 = (a..b).map(weight).sum();
        let moment: f64 = (a..b).map(|i| weight(i) * f64::from(self.centre(i))).sum();
        (moment / sum.max(1.0)) as f32
    }

    /// The levels, of which some may be given.
    ///
    /// # Errors
    /// A threshold that all values exceed or none does; given levels on the wrong side.
    pub fn levels(
        &self,
        threshold: Option<f32>,
        air: Option<f32>,
        fibre: Option<f32>,
    ) -> Result<Levels, ScanError> {
        let greatest = self.least + self.width * CLASSES as f32;
        let threshold = match (threshold, air, fibre) {
            (Some(t), _, _) => t,
            (None, Some(a), Some(f)) => 0.5 * (a + f),
            _ => self.otsu(),
        };
        let class = ((threshold - self.least) / self.width).clamp(0.0, CLASSES as f32) as usize;
        let above: u64 = self.counts[class.min(CLASSES)..].iter().sum();
        let below: u64 = self.counts[..class.min(CLASSES)].iter().sum();
        if above == 0 || below == 0 {
            let side = if above == 0 { "above" } else { "below" };
            return Err(ScanError::Content(format!(
                "no voxel is {side} the threshold of {threshold}; after the noise filter grey \
                 values lie from {} to {greatest}",
                self.least
            )));
        }
        let air = air.unwrap_or_else(|| self.mode(0, class));
        let fibre = fibre.unwrap_or_else(|| self.mode(class, CLASSES));
        if !(air < threshold && threshold < fibre) {
            return Err(ScanError::Settings(format!(
                "grey values of air ({air}), threshold ({threshold}) and fibre ({fibre}) do not \
                 rise in this order"
            )));
        }
        Ok(Levels {
            least: self.least,
            greatest,
            threshold,
            first_threshold: threshold,
            air,
            fibre,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    #[test]
    fn two_modes_are_found_with_the_threshold_between_them() {
        let mut rng = PathRng::from_seed(3);
        let mut h = Histogram::new(-20.0, 120.0);
        for i in 0..200_000 {
            let mean = if i % 3 == 0 { 80.0 } else { 10.0 };
            h.add(&[mean + 8.0 * rng.normal2().x]);
        }
        let l = h.levels(None, None, None).unwrap();
        assert!((l.air - 10.0).abs() < 1.5, "seed 3: {l:?}");
        assert!((l.fibre - 80.0).abs() < 1.5, "seed 3: {l:?}");
        assert!((l.threshold - 45.0).abs() < 2.0, "seed 3: {l:?}");
        assert!(h.levels(Some(500.0), None, None).is_err());
        assert!(h.levels(None, Some(90.0), None).is_err());
    }

    #[test]
    fn two_values_without_noise_are_their_own_modes() {
        let mut h = Histogram::new(0.0, 200.0);
        h.add(&[0.0; 700]);
        h.add(&[200.0; 300]);
        let l = h.levels(None, None, None).unwrap();
        assert!((l.threshold - 100.0).abs() < 4.0 * f32::EPSILON, "{l:?}");
        assert!(l.air.abs() < 0.1 && (l.fibre - 200.0).abs() < 0.1, "{l:?}");
    }
}
