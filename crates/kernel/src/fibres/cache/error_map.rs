//! Where in the picture the cache errs, and how much.

use super::plan::CacheReport;
use glam::{DVec3, UVec2};

/// Pairs of visits that an estimate weighs together, about. What is left of the noise of a visit is
/// its fourth root: a third.
const PAIRS: f64 = 128.0;
/// Widest neighbourhood of an estimate, as a deviation in blocks.
const WIDEST: f64 = 16.0;

/// What pairs of visits to one block would have read and what they found instead, as sums of
/// products: of both reads, of what one read and the other found, and of what both found.
#[derive(Clone, Copy, Debug, Default)]
pub struct PairSums {
    products: DVec3,
    pairs: f64,
}

impl PairSums {
    /// Adds a pair: light a path, by the table and by the paths.
    pub fn add(&mut self, read: [f64; 2], found: [f64; 2]) {
        let crossed = read[0] * found[1] + read[1] * found[0];
        self.products += DVec3::new(read[0] * read[1], crossed, found[0] * found[1]);
        self.pairs += 1.0;
    }
}

/// Root mean square errors in blocks of [`CacheReport::BLOCK`] pixels over a picture, in units of
/// its radiance. The visits of a pair err alike only where the cache does, so that their product is
/// the square of its error there; neighbours are weighed in until noise is hardly left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ErrorMap {
    columns: u32,
    errors: Vec<f32>,
}

impl ErrorMap {
    /// Of blocks in rows of so many, where what is read is multiplied by `factor`.
    pub(super) fn new(blocks: &[PairSums], columns: u32, factor: f64) -> ErrorMap {
        let columns_usize = (columns as usize).max(1);
        let of = |b: &PairSums| {
            let weights = DVec3::new(factor * factor, -factor, 1.0);
            [b.products.dot(weights), b.pairs]
        };
        let sums: Vec<[f64; 2]> = blocks.iter().map(of).collect();
        let density = sums.iter().map(|s| s[1]).sum::<f64>() / sums.len().max(1) as f64;
        // Weights of a Gaussian sum to this many blocks.
        let deviation = (PAIRS / (4.0 * std::f64::consts::PI * density.max(1e-9))).sqrt();
        let deviation = deviation.min(WIDEST);
        let rows = sums.len().div_ceil(columns_usize);
        let across = smoothed(&sums, deviation, |i, by| {
            let x = (i % columns_usize) as i64 + by;
            (0..columns_usize as i64)
                .contains(&x)
                .then(|| (i as i64 + by) as usize)
        });
        let all = smoothed(&across, deviation, |i, by| {
            let y = (i / columns_usize) as i64 + by;
            let is_inside = (0..rows as i64).contains(&y);
            is_inside.then(|| (i as i64 + by * columns_usize as i64) as usize)
        });
        let error = |[squares, pairs]: &[f64; 2]| match *pairs > 0.0 {
            true => (squares / pairs).max(0.0).sqrt() as f32,
            false => f32::NAN,
        };
        ErrorMap {
            columns,
            errors: all.iter().map(error).collect(),
        }
    }

    /// The error about a pixel; not a number where it is not known.
    pub fn at(&self, pixel: UVec2) -> f32 {
        let block = pixel / CacheReport::BLOCK;
        let at = block.y as usize * self.columns as usize + block.x as usize;
        self.errors.get(at).copied().unwrap_or(f32::NAN)
    }
}

/// Sums weighed by a Gaussian along one axis; `beside` gives the number of the block some steps on.
fn smoothed(
    sums: &[[f64; 2]],
    deviation: f64,
    beside: impl Fn(usize, i64) -> Option<usize>,
) -> Vec<[f64; 2]> {
    let reach = (3.0 * deviation).ceil() as i64;
    let weights: Vec<(i64, f64)> = (-reach..=reach)
        .map(|by| (by, (-0.5 * (by as f64 / deviation).powi(2)).exp()))
        .collect();
    let one = |i: usize| {
        let mut sum = [0.0; 2];
        for &(by, weight) in &weights {
            if let Some([squares, pairs]) = beside(i, by).and_then(|at| sums.get(at)) {
                sum[0] += weight * squares;
                sum[1] += weight * pairs;
            }
        }
        sum
    };
    (0..sums.len()).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    const SEED: u64 = 41;

    /// A cache that errs by 0.2 in the left half and not at all in the right, seen by noisy visits:
    /// each half gets its own; the noise of single visits, 0.2, does not pass for error.
    #[test]
    fn errors_are_found_where_they_are() {
        let (columns, rows) = (24u32, 16u32);
        let mut rng = PathRng::from_seed(SEED);
        let mut blocks = vec![PairSums::default(); (columns * rows) as usize];
        for (i, block) in blocks.iter_mut().enumerate() {
            let is_left = i as u32 % columns < columns / 2;
            for _ in 0..4 {
                let mut found = || 1.0 + 0.2 * 3f64.sqrt() * (2.0 * f64::from(rng.unit()) - 1.0);
                let sign = if i / 5 % 2 == 0 { 1.0 } else { -1.0 };
                let read = if is_left { 1.0 + 0.2 * sign } else { 1.0 };
                block.add([read / 0.8; 2], [found(), found()]);
            }
        }
        let error_at =
            |map: &ErrorMap, x: u32| map.at(UVec2::new(x, rows / 2) * CacheReport::BLOCK);
        let map = ErrorMap::new(&blocks, columns, 0.8);
        let (left, right) = (error_at(&map, 4), error_at(&map, columns - 5));
        assert!((0.15..0.25).contains(&left), "seed {SEED}: {left}");
        assert!(right < 0.1, "seed {SEED}: {right}");
        // The twin: without the factor all would be off by a quarter.
        let twin = ErrorMap::new(&blocks, columns, 1.0);
        assert!(error_at(&twin, columns - 5) > 0.2, "seed {SEED}");
        assert!(ErrorMap::default().at(UVec2::ZERO).is_nan());
    }
}
