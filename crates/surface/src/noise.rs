//! Irregularity of real yarn: grain along fibres and slow changes of tension.
//!
//! Everything is a function of identifiers (seed, yarn, place), so that a cloth looks the same
//! on every thread of the program.

use crate::weave::floor;
use glam::Vec2;
use organza_basis::rng::mix64;

/// A uniform number in (0, 1] from an identifier.
#[inline]
fn unit(name: u64) -> f32 {
    ((name >> 40) + 1) as f32 * (1.0 / 16_777_216.0)
}

/// One identifier from several small whole numbers, which odd factors spread before they are
/// mixed.
#[inline]
pub(crate) fn name(seed: u64, parts: [i64; 3]) -> u64 {
    const SPREAD: [u64; 3] = [
        0x9e37_79b9_7f4a_7c15,
        0xc2b2_ae3d_27d4_eb4f,
        0x1656_67b1_9e37_79f9,
    ];
    let spread = parts.iter().zip(SPREAD);
    mix64(spread.fold(seed, |h, (&p, k)| {
        h.rotate_left(23) ^ (p as u64).wrapping_mul(k)
    }))
}

/// Exponential with mean one: the brightness of one grain \[Irawan2008] (8.2.1). Because its
/// mean is one, the reflectance is unchanged.
pub(crate) fn exponential(name: u64) -> f32 {
    -unit(name).ln()
}

/// Slow changes of tension along every yarn of a cloth: gradient noise [Perlin2002] with slopes
/// from a table. Each yarn reads the table from its own start with its own step.
#[derive(Debug)]
pub(crate) struct TensionNoise {
    seed: u64,
    slopes: Vec<f32>,
    cells_per_mm: f32,
    yarns_per_mm: Vec2,
}

/// Number of slopes in the table, after which a yarn repeats.
const SLOPES: usize = 1024;

impl TensionNoise {
    /// Noise that changes over `period_mm`, for yarns of the given pitch.
    pub fn new(seed: u64, period_mm: f32, pitch_mm: Vec2) -> TensionNoise {
        TensionNoise {
            seed,
            slopes: (0..SLOPES as i64)
                .map(|i| 2.0 * unit(name(seed, [i, 1, 3])) - 1.0)
                .collect(),
            cells_per_mm: 1.0 / period_mm,
            yarns_per_mm: pitch_mm.recip(),
        }
    }

    /// Noise of the warp and of the weft yarn that cross at a place, in
    /// `[-1, 1]`.
    #[inline]
    pub fn at(&self, place_mm: Vec2) -> [f32; 2] {
        // A place may lie on the boundary between yarns, where rounding would choose. A quarter
        // pitch further it does not.
        let number = |x: f32, per_mm: f32| i64::from(floor(x * per_mm + 0.25));
        let (end, pick) = (
            number(place_mm.x, self.yarns_per_mm.x),
            number(place_mm.y, self.yarns_per_mm.y),
        );
        [
            self.along(name(self.seed, [end, 0, 1]), place_mm.y),
            self.along(name(self.seed, [pick, 1, 1]), place_mm.x),
        ]
    }

    /// One slope per cell. The noise is zero at whole cells, which the offset of each yarn
    /// hides.
    #[inline]
    fn along(&self, line: u64, place_mm: f32) -> f32 {
        let offset = (line >> 40) as f32 * (1.0 / 16_777_216.0);
        let x = place_mm * self.cells_per_mm + offset;
        let cell = floor(x);
        let (start, step) = (line as u32, (line >> 16) as u32 | 1);
        let slope = |i: i32| {
            let k = start.wrapping_add((i as u32).wrapping_mul(step)) as usize % SLOPES;
            self.slopes.get(k).copied().unwrap_or(0.0)
        };
        interpolate(x - cell as f32, slope(cell), slope(cell.wrapping_add(1)))
    }
}

/// Gradient noise at `t` in `[0, 1]` between two slopes in `[-1, 1]`.
#[inline]
fn interpolate(t: f32, left: f32, right: f32) -> f32 {
    let fade = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    // The largest value, one half, is scaled to one.
    2.0 * (left * t * (1.0 - fade) + right * (t - 1.0) * fade)
}

/// The frequency of each of `count` equal steps over `[-(own + cross), own + cross]` in the sum
/// of two independent noises with these amplitudes.
pub(crate) fn step_shares(own: f32, cross: f32, count: usize) -> Vec<f32> {
    // A six-dimensional low-discrepancy sequence: powers of the inverse of the
    // root of x^7 = x + 1 [Roberts2018].
    const ROOT: f64 = 1.112_775_684_278_705_5;
    const SAMPLES: u32 = 1 << 16;
    let mut shares = vec![0.0; count];
    let mut point = [0.5f64; 6];
    for _ in 0..SAMPLES {
        let mut step = 1.0;
        for x in &mut point {
            step /= ROOT;
            *x = (*x + step).fract();
        }
        let p = point.map(|x| x as f32);
        let n = |k: usize| interpolate(p[k], 2.0 * p[k + 1] - 1.0, 2.0 * p[k + 2] - 1.0);
        let level = nearest_step(own * n(0) + cross * n(3), own + cross, count);
        shares[level] += 1.0 / SAMPLES as f32;
    }
    shares
}

/// Which of `count` equal steps over `[-reach, reach]` is nearest.
#[inline]
pub(crate) fn nearest_step(value: f32, reach: f32, count: usize) -> usize {
    let place = (value / reach + 1.0) * 0.5 * (count - 1) as f32;
    ((place + 0.5) as i32).clamp(0, count as i32 - 1) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grains_have_mean_one_and_variance_one() {
        // Variance of the mean 1/n, of the second moment (E x^4 - 4)/n = 20/n.
        let n = 200_000;
        let (mut first, mut second) = (0.0f64, 0.0f64);
        for i in 0..n {
            let x = f64::from(exponential(name(5, [i, 0, 0])));
            first += x;
            second += x * x;
        }
        let n = n as f64;
        assert!((first / n - 1.0).abs() < 4.0 / n.sqrt(), "seed 5");
        assert!((second / n - 2.0).abs() < 4.0 * (20.0 / n).sqrt(), "seed 5");
    }

    #[test]
    fn shares_are_those_of_the_noise_itself() {
        let (own, cross, count) = (0.2, 0.1, 9);
        let shares = step_shares(own, cross, count);
        assert!((shares.iter().sum::<f32>() - 1.0).abs() < 4.0 * f32::EPSILON);
        let mut seen = vec![0.0f32; count];
        // Places on yarns far apart, each with its own offset.
        let noise = TensionNoise::new(9, 1.0, Vec2::ONE);
        let n = 100_000;
        for i in 0..n {
            let x = |line: i64| (1e4 * unit(name(9, [i, line, 7]))).floor() + 0.5;
            let [warp, weft] = noise.at(Vec2::new(x(0), x(1)));
            seen[nearest_step(own * warp + cross * weft, own + cross, count)] += 1.0 / n as f32;
        }
        for (s, e) in seen.iter().zip(&shares) {
            let sigma = (e * (1.0 - e) / n as f32).sqrt();
            assert!((s - e).abs() < 4.0 * sigma + 5e-4, "{seen:?} {shares:?}");
        }
    }

    #[test]
    fn noise_is_continuous_and_bounded() {
        let noise = TensionNoise::new(3, 1.0, Vec2::ONE);
        let at = |i: i32| noise.at(Vec2::new(0.5, -5.0 + i as f32 * 1e-3))[0];
        let mut before = at(0);
        for i in 1..10_000 {
            let here = at(i);
            assert!(here.abs() <= 1.0 && (here - before).abs() < 1e-2);
            before = here;
        }
    }
}
