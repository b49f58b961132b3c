//! Random numbers: one stream per path, so that a picture does not depend on
//! the number of threads or the order of pixels.

use glam::Vec2;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// The random numbers of one path.
///
/// A path is identified by a seed, a stream (a pixel, a pair, a yarn) and an index in the
/// stream. Equal identifiers give equal numbers; the state of one path never depends on
/// another.
#[derive(Clone, Debug)]
pub struct PathRng {
    pcg: Pcg32,
}

/// Mixes 64 bits so that every input bit reaches every output bit (the
/// finaliser of SplitMix64, [Steele2014]).
pub fn mix64(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

impl PathRng {
    /// The numbers of path `index` of `stream` under `seed`.
    pub fn new(seed: u64, stream: u64, index: u64) -> PathRng {
        let a = mix64(seed ^ mix64(stream ^ mix64(index)));
        let b = mix64(a ^ stream.rotate_left(32));
        PathRng {
            pcg: Pcg32::new(a, b),
        }
    }

    /// A stream for a seed alone, where one sequence is enough.
    pub fn from_seed(seed: u64) -> PathRng {
        PathRng {
            pcg: Pcg32::seed_from_u64(seed),
        }
    }

    /// Uniform in `[0, 1)` on the 24-bit grid: never one.
    #[inline]
    pub fn unit(&mut self) -> f32 {
        (self.pcg.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in `(0, 1]`: never zero, so that its logarithm is finite.
    #[inline]
    pub fn positive_unit(&mut self) -> f32 {
        ((self.pcg.next_u32() >> 8) + 1) as f32 * (1.0 / 16_777_216.0)
    }

    /// Two independent uniform numbers in `[0, 1)`.
    #[inline]
    pub fn unit2(&mut self) -> Vec2 {
        let x = self.unit();
        Vec2::new(x, self.unit())
    }

    /// Exponentially distributed with mean one.
    pub fn exponential(&mut self) -> f32 {
        -self.positive_unit().ln()
    }

    /// Uniform integer in `0..n`; `n` must not be zero. The bias of the
    /// multiply-shift form is below `n / 2^32`.
    pub fn below(&mut self, n: u32) -> u32 {
        ((u64::from(self.pcg.next_u32()) * u64::from(n)) >> 32) as u32
    }

    /// Two independent standard normal numbers (Box-Muller).
    pub fn normal2(&mut self) -> Vec2 {
        let r = (2.0 * self.exponential()).sqrt();
        let (sin, cos) = (std::f32::consts::TAU * self.unit()).sin_cos();
        Vec2::new(r * cos, r * sin)
    }

    /// 32 random bits.
    pub fn bits(&mut self) -> u32 {
        self.pcg.next_u32()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_names_give_equal_numbers_and_others_do_not() {
        let take = |seed, stream, index| {
            let mut r = PathRng::new(seed, stream, index);
            [r.bits(), r.bits(), r.bits()]
        };
        assert_eq!(take(1, 2, 3), take(1, 2, 3));
        let names = [(1, 2, 4), (1, 3, 3), (2, 2, 3), (3, 2, 1), (2, 1, 3)];
        for (a, b, c) in names {
            assert_ne!(take(1, 2, 3), take(a, b, c));
        }
    }

    #[test]
    fn first_numbers_of_neighbouring_paths_are_uncorrelated() {
        // Correlation of 100,000 pairs has standard deviation 1/sqrt(n) = 0.0032.
        let n = 100_000u64;
        let mut sum = 0.0f64;
        for i in 0..n {
            let a = f64::from(PathRng::new(7, i, 0).unit()) - 0.5;
            let b = f64::from(PathRng::new(7, i + 1, 0).unit()) - 0.5;
            sum += 12.0 * a * b;
        }
        assert!((sum / n as f64).abs() < 4.0 / (n as f64).sqrt(), "seed 7");
    }

    #[test]
    fn units_stay_in_their_intervals() {
        let mut r = PathRng::from_seed(1);
        for _ in 0..100_000 {
            let u = r.unit();
            assert!((0.0..1.0).contains(&u));
            let p = r.positive_unit();
            assert!(p > 0.0 && p <= 1.0);
        }
    }
}
