//! The crossings of a photograph, each as a few means.

use crate::{Photograph, ThreadGrid};
use glam::DVec2;

/// Samples along a side of a crossing while repeats are sought: a quarter of a crossing keeps
/// the texture of the fibres out.
const COARSE: usize = 4;
/// Share of the pixels of a crossing that make it a whole one.
const WHOLE: f64 = 0.8;
/// The most crossings that are looked at for the repeat.
const MOST: usize = 6400;

/// The crossings of a photograph, each as a few means.
pub(crate) struct Crossings {
    list: Vec<(i64, i64)>,
    /// Square roots of brightness, and colour differences, of `COARSE * COARSE` parts of each.
    parts: Vec<Vec<f64>>,
}

impl Crossings {
    pub fn new(photograph: &Photograph, grid: &ThreadGrid) -> Crossings {
        let [width, height] = photograph.size();
        let (w, h) = (width as f64, height as f64);
        let corners =
            [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(x, y)| grid.thread(DVec2::new(x, y)));
        let low = corners.iter().copied().fold(DVec2::MAX, DVec2::min).floor();
        let high = corners.iter().copied().fold(DVec2::MIN, DVec2::max).ceil();
        let (low, high) = (low.as_i64vec2(), high.as_i64vec2());
        let columns = (high.x - low.x + 1) as usize;
        let rows = (high.y - low.y + 1) as usize;
        let n = COARSE * COARSE;
        let mut sums = vec![[0.0f64; 4]; columns * rows * n];
        for y in 0..height {
            for x in 0..width {
                let at = grid.thread(DVec2::new(x as f64, y as f64)) + 0.5;
                let cell = at.floor();
                let part = ((at - cell) * COARSE as f64)
                    .as_u64vec2()
                    .min(glam::U64Vec2::splat(COARSE as u64 - 1));
                let (i, j) = (cell.x as i64 - low.x, cell.y as i64 - low.y);
                if i < 0 || j < 0 || i as usize >= columns || j as usize >= rows {
                    continue;
                }
                let cell = j as usize * columns + i as usize;
                let k = cell * n + part.y as usize * COARSE + part.x as usize;
                let c = photograph.pixel(x, y).map(|v| v.sqrt());
                let sum = &mut sums[k];
                (0..3).for_each(|k| sum[k] += c[k]);
                sum[3] += 1.0;
            }
        }
        // Whole crossings only: every part has a pixel, and all have nearly as many as they should.
        let whole = WHOLE / grid.frequency[0].perp_dot(grid.frequency[1]).abs();
        let (mut list, mut parts) = (Vec::new(), Vec::new());
        for (k, cell) in sums.chunks_exact(n).enumerate() {
            let count: f64 = cell.iter().map(|s| s[3]).sum();
            if count < whole || cell.iter().any(|s| s[3] < 0.5) || list.len() >= MOST {
                continue;
            }
            let (i, j) = ((k % columns) as i64, (k / columns) as i64);
            list.push((low.x + i, low.y + j));
            let means = |s: &[f64; 4]| [s[0] / s[3], s[1] / s[3], s[2] / s[3]];
            parts.push(cell.iter().flat_map(means).collect());
        }
        Crossings { list, parts }
    }

    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// The variance that is left within classes of crossings; `None` if a class is empty.
    pub fn unexplained(&self, class: impl Fn(i64, i64) -> usize, count: usize) -> Option<f64> {
        let n = 3 * COARSE * COARSE;
        let mut sums = vec![0.0; count * n];
        let mut counts = vec![0usize; count];
        for (&(e, p), v) in self.list.iter().zip(&self.parts) {
            let k = class(e, p);
            counts[k] += 1;
            let sum = &mut sums[k * n..(k + 1) * n];
            sum.iter_mut().zip(v).for_each(|(s, v)| *s += v);
        }
        if counts.contains(&0) || self.list.len() <= count {
            return None;
        }
        let mut rest = 0.0;
        for (&(e, p), v) in self.list.iter().zip(&self.parts) {
            let k = class(e, p);
            let mean = sums[k * n..(k + 1) * n]
                .iter()
                .map(|s| s / counts[k] as f64);
            rest += v
                .iter()
                .zip(mean)
                .map(|(v, m)| (v - m).powi(2))
                .sum::<f64>();
        }
        Some(rest / (self.list.len() - count) as f64)
    }
}
