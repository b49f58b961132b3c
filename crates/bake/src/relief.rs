//! Smoothing of periodic maps, and slopes of a height map.

use glam::{UVec2, Vec2};
use rayon::prelude::*;

/// Weights of a Gaussian of standard deviation `sigma`, in texels, from the middle outwards.
fn weights(sigma: f32, longest: usize) -> Vec<f32> {
    let reach = ((3.0 * sigma).ceil() as usize).min(longest);
    let value = |k: usize| (-0.5 * (k as f32 / sigma.max(1e-3)).powi(2)).exp();
    let half: Vec<f32> = (0..=reach).map(value).collect();
    let sum = 2.0 * half.iter().sum::<f32>() - half.first().copied().unwrap_or(0.0);
    half.into_iter().map(|w| w / sum).collect()
}

/// A map smoothed by a Gaussian of standard deviations `sigma`, in texels along x and y, as if
/// it were repeated without end.
pub fn smooth(map: &[f32], size: UVec2, sigma: Vec2) -> Vec<f32> {
    let (w, h) = (size.x as usize, size.y as usize);
    let along_x = weights(sigma.x, 16 * w);
    let along_y = weights(sigma.y, 16 * h);
    let at = |list: &[f32], k: usize| list.get(k).copied().unwrap_or(0.0);
    // One line of sums: the middle once, the others on both sides.
    let mut rows = vec![0.0; map.len()];
    rows.par_chunks_mut(w)
        .zip(map.par_chunks(w))
        .for_each(|(out, row)| {
            for (x, sum) in out.iter_mut().enumerate() {
                *sum = along_x
                    .iter()
                    .enumerate()
                    .map(|(k, weight)| {
                        let right = at(row, (x + k) % w);
                        let left = at(row, (x + w * (k / w + 1) - k) % w);
                        weight * if k == 0 { right } else { right + left }
                    })
                    .sum();
            }
        });
    let mut columns = vec![0.0; map.len()];
    columns.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
        for (k, weight) in along_y.iter().enumerate() {
            let below = (y + k) % h * w;
            let above = (y + h * (k / h + 1) - k) % h * w;
            for (x, sum) in out.iter_mut().enumerate() {
                let pair = at(&rows, below + x) + if k == 0 { 0.0 } else { at(&rows, above + x) };
                *sum += weight * pair;
            }
        }
    });
    columns
}

/// The quotient of two smoothed maps, with the mean quotient where there is no weight.
pub fn smooth_mean(sums: &[f32], counts: &[f32], size: UVec2, sigma: Vec2) -> Vec<f32> {
    let (top, bottom) = (smooth(sums, size, sigma), smooth(counts, size, sigma));
    let total = |list: &[f32]| list.iter().map(|&v| f64::from(v)).sum::<f64>();
    let mean = (total(sums) / total(counts).max(1e-9)) as f32;
    let floor = 1e-4 * (total(counts) / counts.len().max(1) as f64) as f32;
    top.iter()
        .zip(&bottom)
        .map(|(t, b)| if *b > floor { t / b } else { mean })
        .collect()
}

/// Slopes along x and y of a periodic height map whose first row has the largest y, by
/// central differences.
pub fn slopes(height_mm: &[f32], size: UVec2, texel_mm: Vec2) -> Vec<Vec2> {
    let (w, h) = (size.x as usize, size.y as usize);
    let at = |x: usize, y: usize| height_mm.get(y % h * w + x % w).copied().unwrap_or(0.0);
    (0..w * h)
        .map(|k| {
            let (x, y) = (k % w, k / w);
            let along_x = at(x + 1, y) - at(x + w - 1, y);
            let along_y = at(x, y + h - 1) - at(x, y + 1);
            Vec2::new(along_x, along_y) / (2.0 * texel_mm)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_keeps_the_mean_and_knows_no_edge() {
        let size = UVec2::new(12, 7);
        let mut map = vec![0.0; 84];
        map[0] = 84.0;
        for sigma in [0.5, 2.0, 30.0] {
            let soft = smooth(&map, size, Vec2::splat(sigma));
            let sum: f32 = soft.iter().sum();
            assert!((sum - 84.0).abs() < 0.01, "{sigma}: {sum}");
            // The neighbours over the edges are like those within.
            assert!((soft[1] - soft[11]).abs() < 1e-4 && (soft[12] - soft[72]).abs() < 1e-4);
        }
        let flat = smooth(&map, size, Vec2::splat(30.0));
        assert!(flat.iter().all(|v| (v - 1.0).abs() < 0.02), "{flat:?}");
    }

    #[test]
    fn slopes_of_waves_are_known() {
        let size = UVec2::new(64, 32);
        let texel_mm = Vec2::new(0.5, 0.25);
        let wave = |k: usize| {
            let (x, y) = (k % 64, 31 - k / 64);
            let x = std::f32::consts::TAU * x as f32 / 64.0;
            let y = std::f32::consts::TAU * y as f32 / 32.0;
            x.sin() + 2.0 * y.sin()
        };
        let map: Vec<f32> = (0..64 * 32).map(wave).collect();
        // At x = 0, y = 0 (the first of the last row): difference quotients of the sines.
        let s = slopes(&map, size, texel_mm)[31 * 64];
        let tau = std::f32::consts::TAU;
        assert!(
            (s.x - (tau / 64.0).sin() / 0.5).abs() < 8.0 * f32::EPSILON,
            "{s}"
        );
        assert!(
            (s.y - 2.0 * (tau / 32.0).sin() / 0.25).abs() < 8.0 * f32::EPSILON,
            "{s}"
        );
    }
}
