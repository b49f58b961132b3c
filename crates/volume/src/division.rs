//! Division by a number that is known in advance.

/// Divides numbers of 32 bits by one of them, without the processor's division, which takes many
/// times as long as a product [Granlund1994].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Divisor {
    /// `2^SHIFT / divisor`, rounded down, and one.
    multiplier: u64,
}

const SHIFT: u32 = 63;

impl Divisor {
    /// For divisors from 1 to `2^31`.
    pub fn new(divisor: u32) -> Divisor {
        Divisor {
            multiplier: (1 << SHIFT) / u64::from(divisor) + 1,
        }
    }

    /// `number / divisor`, rounded down.
    ///
    /// The multiplier is at most one too large, which adds less than `2^32 / 2^63` to the
    /// quotient; the next whole number is at least `1 / 2^31` away.
    #[inline]
    pub fn quotient(self, number: u32) -> u32 {
        ((u128::from(number) * u128::from(self.multiplier)) >> SHIFT) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    #[test]
    fn quotients_are_those_of_the_processor() {
        let mut rng = PathRng::from_seed(7);
        let mut drawn = || (rng.unit() * 32.0).exp2() as u32;
        let some: Vec<u32> = (0..300).map(|_| drawn()).collect();
        let edges = (0..32).flat_map(|bit| [(1u32 << bit) - 1, 1 << bit, (1 << bit) + 1]);
        let numbers: Vec<u32> = some.into_iter().chain(edges).chain([u32::MAX]).collect();
        for &divisor in numbers.iter().filter(|d| (1..=1 << 31).contains(*d)) {
            let by = Divisor::new(divisor);
            for &number in &numbers {
                for n in [number, (number / divisor).wrapping_mul(divisor)] {
                    assert_eq!(by.quotient(n), n / divisor, "seed 7: {n} / {divisor}");
                }
                let before = (number / divisor).wrapping_mul(divisor).wrapping_sub(1);
                assert_eq!(by.quotient(before), before / divisor, "seed 7: {before}");
            }
        }
    }
}
