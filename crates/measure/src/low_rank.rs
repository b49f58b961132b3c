//! The structure in a matrix of measurements whose noise is known.
//!
//! For a matrix of low rank plus independent noise of variance one, the singular values of the
//! noise alone end at `sqrt(rows) + sqrt(columns)`. A component above has the measured
//! singular value `y` where that of the structure is smaller; the shrinkage of
//! [GavishDonoho2017] (Frobenius loss) gives the best estimate.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use organza_basis::PathRng;

/// A part of a matrix: `left` times `right`, one number for each row and column.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// For each row; a unit vector.
    pub left: Vec<f32>,
    /// For each column, with the shrunk singular value.
    pub right: Vec<f32>,
    /// The measured singular value over the largest that noise alone has.
    pub strength: f64,
}

/// Directions that are tried beyond those wanted.
const SPARE: usize = 8;
/// Times that the directions are multiplied by the matrix and its transpose.
const ROUNDS: usize = 4;

/// At most `most` components of a matrix with noise of variance one that stand out of the noise,
/// strongest first, by subspace iteration [Halko2011]. Equal seeds give equal components.
pub fn components(matrix: &DMatrix<f32>, most: usize, seed: u64) -> Vec<Component> {
    let (rows, columns) = matrix.shape();
    let tried = (most + SPARE).min(rows).min(columns);
    if tried == 0 {
        return Vec::new();
    }
    let mut rng = PathRng::from_seed(seed);
    let mut basis = DMatrix::from_fn(rows, tried, |_, _| rng.normal2().x)
        .qr()
        .q();
    for _ in 0..ROUNDS {
        let across = matrix.tr_mul(&basis).qr().q();
        basis = (matrix * across).qr().q();
    }
    // tried x columns
    let small = basis.tr_mul(matrix);
    let square = (&small * small.transpose()).map(f64::from);
    let eigen = SymmetricEigen::new(square);
    let mut order: Vec<usize> = (0..tried).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let (short, long) = (rows.min(columns) as f64, rows.max(columns) as f64);
    let edge = short.sqrt() + long.sqrt();
    let mut found = Vec::new();
    for k in order.into_iter().take(most) {
        let measured = eigen.eigenvalues[k].max(0.0).sqrt();
        let Some(shrunk) = shrunk(measured / long.sqrt(), short / long) else {
            break;
        };
        let weights: DVector<f32> = eigen.eigenvectors.column(k).map(|v| v as f32);
        let left = &basis * &weights;
        // The matrix's own right vector has the length of the measured singular value.
        let length = (shrunk * long.sqrt() / measured) as f32;
        let right = small.tr_mul(&weights) * length;
        found.push(Component {
            left: left.iter().copied().collect(),
            right: right.iter().copied().collect(),
            strength: measured / edge,
        });
    }
    found
}

/// The singular value of the structure behind a measured one, both over the root of the longer
/// side; `None` when it is noise. `ratio` is that of the shorter side to the longer.
fn shrunk(measured: f64, ratio: f64) -> Option<f64> {
    let square = measured * measured;
    let inside = (square - ratio - 1.0).powi(2) - 4.0 * ratio;
    (measured > 1.0 + ratio.sqrt() && inside > 0.0).then(|| inside.sqrt() / measured)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two planted components in noise of variance one.
    fn planted(strengths: [f32; 2], seed: u64) -> (DMatrix<f32>, DMatrix<f32>) {
        const ROWS: usize = 120;
        const COLUMNS: usize = 400;
        let mut rng = PathRng::from_seed(seed);
        let unit = |count: usize, step: f32| {
            let v = DVector::from_fn(count, |i, _| (step * i as f32).sin());
            v.normalize()
        };
        let mut structure = DMatrix::zeros(ROWS, COLUMNS);
        for (strength, step) in strengths.into_iter().zip([0.3, 1.7]) {
            structure += unit(ROWS, step) * unit(COLUMNS, 0.7 * step).transpose() * strength;
        }
        let noise = DMatrix::from_fn(ROWS, COLUMNS, |_, _| rng.normal2().x);
        (structure.clone(), structure + noise)
    }

    #[test]
    fn planted_components_are_found_and_noise_is_not() {
        // The edge of the noise is at 31.
        let (structure, noisy) = planted([200.0, 80.0], 3);
        let found = components(&noisy, 8, 1);
        assert_eq!(found.len(), 2, "seed 3");
        let mut rebuilt = DMatrix::zeros(structure.nrows(), structure.ncols());
        for c in &found {
            let left = DVector::from_column_slice(&c.left);
            rebuilt += left * DVector::from_column_slice(&c.right).transpose();
        }
        let error = (&rebuilt - &structure).norm() / structure.norm();
        // Of a rank-two fit to so many numbers: sqrt(2 (rows + columns)) over 215 is 0.15.
        assert!(error < 0.18, "seed 3: {error}");
        // Without shrinkage the strengths would be too large by the noise; noise alone has none.
        let (_, noise) = planted([0.0, 0.0], 4);
        assert!(components(&noise, 8, 1).is_empty(), "seed 4");
        // A threshold that is too low would take noise for structure.
        assert!(shrunk(0.9 * (1.0 + 0.3f64.sqrt()), 0.3).is_none());
    }
}
