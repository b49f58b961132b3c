//! From a measured matrix to the bytes of a table whose rows add up to the measured shares.

use super::rings::Rings;
use super::{TableParts, decoded, place};

/// A matrix and what its rows should add up to.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredMatrix {
    /// The nodes.
    pub rings: Rings,
    /// Values of the pairs of nodes `(a, b)` with `b <= a`, at `a (a + 1) / 2 + b`, 1/sr.
    pub values: Vec<[f64; 3]>,
    /// Scattered share of light from every node.
    pub shares: Vec<[f64; 3]>,
    /// Share of light straight through for the nodes of the front.
    pub gaps: Vec<f64>,
}

/// The parts of a table, and how well its rows add up.
#[derive(Clone, Debug, PartialEq)]
pub struct Balanced {
    /// The parts.
    pub parts: TableParts,
    /// The largest difference between a row's sum and its share.
    pub residual: f64,
}

/// Passes over the matrix, at most.
const PASSES: usize = 400;
/// Differences of a row that are small enough.
const ENOUGH: f64 = 2e-5;
/// The share of all light in values that are too small for their byte.
const LOST: f64 = 1e-5;
/// The widest range of a byte, as the natural logarithm of a ratio.
const WIDEST: f64 = 12.0;

/// Factors `d` of the nodes for which `d_a M_ab d_b` times the weights adds up to `wanted` in
/// every row, by the symmetric iteration of [Knight2014], and the largest difference that
/// remains.
fn factors(
    value: &dyn Fn(usize) -> f64,
    weights: &[f64],
    wanted: &dyn Fn(usize) -> f64,
) -> (Vec<f64>, f64) {
    let n = weights.len();
    let mut d: Vec<f64> = (0..n)
        .map(|a| f64::from(u8::from(wanted(a) > 0.0)))
        .collect();
    let mut worst = f64::INFINITY;
    for _ in 0..PASSES {
        let mut rows = vec![0.0; n];
        for a in 0..n {
            let start = place(a, 0);
            let mut row = 0.0;
            for b in 0..a {
                let v = value(start + b);
                row += v * d[b] * weights[b];
                rows[b] += v * d[a] * weights[a];
            }
            rows[a] += row + value(start + a) * d[a] * weights[a];
        }
        worst = 0.0;
        for a in 0..n {
            let found = rows[a] * d[a];
            worst = f64::max(worst, (found - wanted(a)).abs());
            if found > 0.0 {
                d[a] *= (wanted(a) / found).sqrt();
            }
        }
        if worst < ENOUGH {
            break;
        }
    }
    (d, worst)
}

/// The parts of the table whose rows add up to the shares.
pub fn balance(matrix: &MeasuredMatrix) -> Balanced {
    let MeasuredMatrix {
        rings,
        values,
        shares,
        gaps,
    } = matrix;
    let n = rings.sphere();
    let weights: Vec<f64> = (0..n).map(|k| rings.weight(k)).collect();
    let mut codes = vec![[0u8; 3]; values.len()];
    let mut range = [[0.0f32; 2]; 3];
    let mut all = vec![[0.0f32; 3]; n];
    let mut residual = 0.0f64;
    for c in 0..3 {
        // Without what belongs to single nodes, values differ less, and their bytes are finer.
        let one = |a: usize| f64::from(u8::from(shares[a][c] > 0.0));
        let (even, _) = factors(&|k| values[k][c], &weights, &one);
        let mut list = Vec::with_capacity(values.len());
        for a in 0..n {
            for b in 0..=a {
                let value = values[place(a, b)][c] * even[a] * even[b];
                list.push((value, value * weights[a] * weights[b]));
            }
        }
        let limits = limits(&list);
        range[c] = limits.map(|v| v as f32);
        let [low, high] = range[c].map(f64::from);
        for (code, (value, _)) in codes.iter_mut().zip(&list) {
            code[c] = byte(*value, low, high);
        }
        let table = decoded(range[c]);
        let of_byte = |k: usize| f64::from(table[usize::from(codes[k][c])]);
        let (found, worst) = factors(&of_byte, &weights, &|a| shares[a][c]);
        residual = residual.max(worst);
        for (factor, f) in all.iter_mut().zip(found) {
            factor[c] = f as f32;
        }
    }
    Balanced {
        parts: TableParts {
            rings: rings.clone(),
            gaps: gaps.iter().map(|g| *g as f32).collect(),
            range,
            factors: all,
            codes,
        },
        residual,
    }
}

/// Logarithms of the least and the greatest value that need a byte.
fn limits(list: &[(f64, f64)]) -> [f64; 2] {
    let mut sorted: Vec<(f64, f64)> = list.iter().copied().filter(|v| v.0 > 0.0).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some(high) = sorted.last().map(|v| v.0.ln()) else {
        return [0.0, 0.0];
    };
    let total: f64 = sorted.iter().map(|v| v.1).sum();
    let mut below = 0.0;
    let first = sorted.iter().find(|v| {
        below += v.1;
        below > LOST * total
    });
    let low = first.map_or(high, |v| v.0.ln());
    [low.max(high - WIDEST), high]
}

/// The byte of a value.
fn byte(value: f64, low: f64, high: f64) -> u8 {
    if !(value > 0.5 * low.exp()) {
        return 0;
    }
    let share = if high > low {
        (value.ln() - low) / (high - low)
    } else {
        0.0
    };
    1 + (254.0 * share.clamp(0.0, 1.0)).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::FarTable;
    use glam::Vec3;
    use organza_scatter::Surface;

    #[test]
    fn rows_add_up_to_the_shares_whatever_the_bytes_lose() {
        let rings = Rings::new(&[
            (0.0, 1),
            (0.5, 8),
            (1.1, 12),
            (std::f32::consts::FRAC_PI_2, 8),
        ]);
        let rings = rings.unwrap();
        let n = rings.sphere();
        // A matrix of no particular shape, over five decades.
        let value = |k: usize, c: usize| (((k * 7919 + c * 31) % 97) as f64 / 8.0).exp() * 1e-5;
        let matrix = MeasuredMatrix {
            values: (0..n * (n + 1) / 2)
                .map(|k| std::array::from_fn(|c| value(k, c)))
                .collect(),
            shares: (0..n)
                .map(|a| [0.75, 0.5 + 0.002 * a as f64, 0.0])
                .collect(),
            gaps: vec![0.25; rings.hemisphere()],
            rings,
        };
        let balanced = balance(&matrix);
        assert!(balanced.residual < 1e-4, "{}", balanced.residual);
        let table = FarTable::new(balanced.parts).unwrap();
        for w in [
            Vec3::Z,
            Vec3::new(0.6, 0.0, -0.8),
            Vec3::new(0.48, 0.6, 0.64),
        ] {
            let albedo = table.albedo(w).0;
            assert!((albedo.x - 0.75).abs() < 1.2e-5, "{albedo}");
            let gap = table.gap(w, organza_scatter::Footprint::FAR);
            assert!((gap - 0.25).abs() < 4.0 * f32::EPSILON);
            assert_eq!(albedo.z, 0.0);
        }
    }

    #[test]
    fn bytes_are_near_their_values() {
        let (low, high) = (-8.0, 1.0);
        let table = decoded([low as f32, high as f32]);
        for k in 0..1000 {
            let value = (low + (high - low) * f64::from(k) / 999.0).exp();
            let back = f64::from(table[usize::from(byte(value, low, high))]);
            assert!((back / value - 1.0).abs() < 0.02, "{back} for {value}");
        }
        assert_eq!(byte(0.0, low, high), 0);
    }
}
