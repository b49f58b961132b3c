//! The error of the cache, by further paths that the tables did not learn from.

use super::error_map::PairSums;
use super::learn::{Go, VISIT, VISITS};
use super::place::Places;
use super::table::RadianceTable;
use glam::{DVec2, Vec3};

/// Blocks of a picture whose errors are mapped: of 16384 x 16384 pixels.
const MOST_MAPPED: u64 = 1 << 20;
/// Noises of bins that are kept for their median.
const MOST_NOISES: usize = 1 << 20;

/// What paths found beyond what a table says, by blocks of the picture: a pair of visits to a
/// block are two estimates of the error there.
#[derive(Default)]
pub struct ErrorOfBlocks {
    /// By blocks of the picture.
    pub blocks: Vec<PairSums>,
    pairs: u64,
    sum: f64,
    squares: f64,
    products: f64,
    products_squared: f64,
    noise_squares: f64,
    records: u64,
    /// Light that records read, and that their paths found instead.
    read: f64,
    found: f64,
    /// Of the bins at first fibres that were read, over their value.
    noises: Vec<f32>,
}

impl ErrorOfBlocks {
    /// Of a picture of so many blocks.
    pub fn new(blocks: u64) -> ErrorOfBlocks {
        ErrorOfBlocks {
            blocks: match blocks <= MOST_MAPPED {
                true => vec![PairSums::default(); blocks as usize],
                false => Vec::new(),
            },
            ..ErrorOfBlocks::default()
        }
    }

    pub fn restart(&mut self) {
        let mut blocks = std::mem::take(&mut self.blocks);
        blocks.fill(PairSums::default());
        *self = ErrorOfBlocks {
            blocks,
            ..ErrorOfBlocks::default()
        };
    }

    /// Takes paths that noted all fibres, from the first one on where a table is read there.
    pub fn add(&mut self, go: &Go, tables: [Option<&RadianceTable>; 2], places: &Places) {
        let from = usize::from(tables[0].is_none());
        // Where a path would have ended, what it would have read there, and with what noise.
        let read = |path: usize| {
            let (light, notes) = go.of_path(path)?;
            notes.iter().enumerate().find_map(|(order, note)| {
                let order = (order + from).min(1);
                let levels = places.levels(order as u32);
                let table = tables[order]?;
                let bin = table.find(&note.place, levels)?;
                let added = note.carried * table.radiance_of(bin);
                let noise = if order == 0 { table.noise_of(bin) } else { 0.0 };
                Some((added, light - note.found, noise))
            })
        };
        let mean_of = |v: Vec3| f64::from(v.element_sum()) / 3.0;
        // What paths would have read, and what they found instead.
        let mut both = vec![DVec2::ZERO; go.lights.len()];
        for (path, both) in both.iter_mut().enumerate() {
            if let Some((added, found, noise)) = read(path) {
                *both = DVec2::new(mean_of(added), mean_of(found));
                self.read += both.x;
                self.found += both.y;
                self.records += 1;
                if from == 0 && self.noises.len() < MOST_NOISES {
                    self.noises.push(noise);
                }
                self.noise_squares += (mean_of(added) * f64::from(noise)).powi(2);
            }
        }
        for pair in 0..VISITS as usize / 2 {
            let of = |half: usize| {
                let visit = (2 * pair + half) * VISIT as usize;
                let range = visit..visit + VISIT as usize;
                let count = go.lights[range.clone()].iter().flatten().count();
                let sum: DVec2 = both[range].iter().sum();
                (count > 0).then(|| sum / count as f64)
            };
            if let (Some(one), Some(other)) = (of(0), of(1)) {
                let (a, b) = (one.x - one.y, other.x - other.y);
                if let Some(block) = self.blocks.get_mut(go.tiles[pair]) {
                    block.add([one.x, other.x], [one.y, other.y]);
                }
                self.pairs += 1;
                self.sum += 0.5 * (a + b);
                self.squares += 0.25 * (a + b) * (a + b);
                self.products += a * b;
                self.products_squared += (a * b) * (a * b);
            }
        }
    }

    /// Light that paths found over that which they would have read.
    pub fn gain(&self) -> f64 {
        match self.read > 0.0 {
            true => self.found / self.read,
            false => 1.0,
        }
    }

    /// Root mean square of the noise of bins where paths read them.
    pub fn noise(&self, mean: f32) -> f64 {
        let noise = (self.noise_squares / self.records.max(1) as f64).sqrt();
        if mean > 0.0 {
            noise / f64::from(mean)
        } else {
            0.0
        }
    }

    /// The noise over the value that half the bins have less of, and all but a hundredth.
    pub fn noises_of_value(&mut self) -> [f64; 2] {
        let count = self.noises.len();
        [count / 2, count * 99 / 100].map(|at| match at < count {
            true => f64::from(*self.noises.select_nth_unstable_by(at, f32::total_cmp).1),
            false => 0.0,
        })
    }

    /// Mean and mean square, each with its standard error.
    pub fn relative_to(&self, mean: f64) -> [[f64; 2]; 2] {
        let n = self.pairs.max(1) as f64;
        let of = |sum: f64, squares: f64| {
            let m = sum / n;
            let variance = (squares / n - m * m).max(0.0);
            [m, (variance / (n - 1.0).max(1.0)).sqrt()]
        };
        let scale = if mean > 0.0 { 1.0 / mean } else { 0.0 };
        [
            of(self.sum, self.squares).map(|x| x * scale),
            of(self.products, self.products_squared).map(|x| x * scale * scale),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The errors of a picture without light are zero and not unknown.
    #[test]
    fn the_dark_has_no_noise() {
        let error = ErrorOfBlocks::default();
        assert_eq!(error.noise(0.0), 0.0);
        assert_eq!(ErrorOfBlocks::default().noises_of_value(), [0.0; 2]);
        assert_eq!(error.relative_to(0.0), [[0.0; 2]; 2]);
        assert_eq!(error.gain(), 1.0);
    }

    /// Where paths find more than they would read, the light of bins is to grow.
    #[test]
    fn what_is_found_and_not_read_is_gained() {
        let error = ErrorOfBlocks {
            read: 2.0,
            found: 3.0,
            ..ErrorOfBlocks::default()
        };
        assert_eq!(error.gain(), 1.5);
    }
}
