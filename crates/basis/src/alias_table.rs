//! Drawing from a finite distribution in constant time.

use crate::PathRng;

/// Walker's alias table, built [Walker1977].
#[derive(Clone, Debug, PartialEq)]
pub struct AliasTable {
    /// Part of a slot that is its own, and who has the rest.
    slots: Vec<(f32, u32)>,
    probabilities: Vec<f32>,
}

impl AliasTable {
    /// Probabilities in proportion to `weights`, finite and at least zero.
    /// `None` when they sum to zero, or are too many to count in 32 bits.
    pub fn new(weights: &[f64]) -> Option<AliasTable> {
        let count = u32::try_from(weights.len()).ok()?;
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mean = total / f64::from(count);
        let mut left: Vec<f64> = weights.iter().map(|w| w / mean).collect();
        let mut slots: Vec<(f32, u32)> = (0..count).map(|i| (1.0, i)).collect();
        let (mut poor, mut rich): (Vec<u32>, Vec<u32>) =
            (0..count).partition(|&i| left[i as usize] < 1.0);
        while let (Some(&to), Some(from)) = (rich.last(), poor.pop()) {
            slots[from as usize] = (left[from as usize] as f32, to);
            left[to as usize] -= 1.0 - left[from as usize];
            if left[to as usize] < 1.0 {
                rich.pop();
                poor.push(to);
            }
        }
        // Slots left over miss nothing but rounding and stay whole, as built.
        let probabilities = weights.iter().map(|w| (w / total) as f32).collect();
        Some(AliasTable {
            slots,
            probabilities,
        })
    }

    /// An index.
    pub fn sample(&self, rng: &mut PathRng) -> usize {
        let slot = rng.below(self.slots.len() as u32);
        let (own, other) = self.slots[slot as usize];
        if rng.unit() < own {
            slot as usize
        } else {
            other as usize
        }
    }

    /// For every index, how much of its slot is its own, and who has the rest:
    /// for drawing where [`AliasTable::sample`] cannot go.
    pub fn slots(&self) -> &[(f32, u32)] {
        &self.slots
    }

    /// Probability of an index.
    pub fn probability(&self, index: usize) -> f32 {
        self.probabilities[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_come_as_often_as_they_weigh() {
        let weights = [0.0, 3.0, 1.0, 0.0, 0.5, 5.5, 0.0];
        let table = AliasTable::new(&weights).unwrap();
        let mut rng = PathRng::from_seed(11);
        let n = 200_000;
        let mut counts = [0u32; 7];
        for _ in 0..n {
            counts[table.sample(&mut rng)] += 1;
        }
        for (i, (&count, w)) in counts.iter().zip(weights).enumerate() {
            let p = w / 10.0;
            assert!(
                (f64::from(table.probability(i)) - p).abs() <= 0.5 * f64::from(f32::EPSILON) * p
            );
            let se = (p * (1.0 - p) / f64::from(n)).sqrt();
            let got = f64::from(count) / f64::from(n);
            assert!((got - p).abs() <= 4.0 * se, "seed 11, {i}: {got} for {p}");
        }
    }

    #[test]
    fn nothing_to_draw_from_is_no_table() {
        assert!(AliasTable::new(&[]).is_none());
        assert!(AliasTable::new(&[0.0, 0.0]).is_none());
        assert!(AliasTable::new(&[f64::INFINITY]).is_none());
    }
}
