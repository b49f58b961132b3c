//! The equations of a turn of a search: which change of the unknowns explains residuals.

use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

/// Least eigenvalue of the products of different cloths, as a share of the noise in the same
/// eigenvalue of their mean: such a step is too short, where one by a smaller eigenvalue, made by noise, would have no
/// limit.
const NOISE: f64 = 0.3;

/// The equations of a turn.
pub struct Equations {
    /// Eigenvalues and vectors of the products of the columns, in units of the ranges. No eigenvalue
    /// is below what noise may make of it.
    eigen: SymmetricEigen<f64, Dyn>,
    /// What residuals are multiplied with, in the same units.
    right: DMatrix<f64>,
    ranges: DVector<f64>,
}

impl Equations {
    /// Those of the derivatives that several cloths give, and the changes that are expected. Products
    /// of different cloths have no bias of noise; a single cloth has only those with itself.
    pub fn new(cloths: &[&DMatrix<f64>], ranges: &[f64]) -> Equations {
        let ranges = DVector::from_column_slice(ranges);
        let scale = DMatrix::from_diagonal(&ranges);
        let cloths: Vec<DMatrix<f64>> = cloths.iter().map(|c| *c * &scale).collect();
        let n = cloths.len() as f64;
        let mean = cloths.iter().sum::<DMatrix<f64>>() / n;
        let own: DMatrix<f64> = cloths.iter().map(|c| c.transpose() * c).sum();
        let pairs = (n * (n - 1.0)).max(1.0);
        let square = mean.transpose() * &mean * (n * n);
        let mut eigen = if cloths.len() > 1 {
            ((square - own) / pairs).symmetric_eigen()
        } else {
            own.symmetric_eigen()
        };
        // The noise of the mean, from what the cloths differ by.
        for (k, value) in eigen.eigenvalues.iter_mut().enumerate() {
            let vector = eigen.eigenvectors.column(k);
            let noise = |c: &DMatrix<f64>| ((c - &mean) * vector).norm_squared() / pairs;
            *value = value.max(NOISE * cloths.iter().map(noise).sum::<f64>());
        }
        Equations {
            eigen,
            right: mean.transpose(),
            ranges,
        }
    }

    /// The change that explains residuals best, none longer than `reach` times its range. What the
    /// pictures do not determine does not change.
    pub fn change(&self, rest: &DVector<f64>, reach: f64) -> DVector<f64> {
        let along = self.eigen.eigenvectors.transpose() * (&self.right * rest);
        let with = |damping: f64| -> DVector<f64> {
            let values = self.eigen.eigenvalues.iter().zip(along.iter());
            let solved = values.map(|(v, a)| a / (v + damping));
            &self.eigen.eigenvectors * DVector::from_iterator(along.len(), solved)
        };
        // A unit is one deviation of the photographs for a change over the whole range.
        let mut damping = 1.0;
        let mut change = with(damping);
        while change.amax() > reach {
            damping *= 1.5;
            change = with(damping);
        }
        change.component_mul(&self.ranges)
    }

    /// The change to which so many turns add up: what the pictures hardly determine still
    /// moves then, but has moved further, and by more of the noise, than in one turn.
    pub fn settled(&self, rest: &DVector<f64>, turns: u32) -> DVector<f64> {
        let along = self.eigen.eigenvectors.transpose() * (&self.right * rest);
        let values = self.eigen.eigenvalues.iter().zip(along.iter());
        let solved = values.map(|(v, a)| a * moved(*v, turns));
        let change = &self.eigen.eigenvectors * DVector::from_iterator(along.len(), solved);
        change.component_mul(&self.ranges)
    }

    /// Variances of the unknowns from what so many turns leave of the first guess's errors, which
    /// are expected to be the ranges.
    pub fn unsettled(&self, turns: u32) -> DVector<f64> {
        let left = |v: f64| (1.0 + v).powi(-(turns as i32)).powi(2);
        let squares = self.eigen.eigenvectors.map(|e| e * e);
        let left = self.eigen.eigenvalues.map(left);
        (squares * left).component_mul(&self.ranges.component_mul(&self.ranges))
    }
}

/// By how much so many turns move a direction of eigenvalue `v`, as a share of its product with the
/// residuals: the sum of `1 / (1 + v)^k` for `k` from 1.
fn moved(v: f64, turns: u32) -> f64 {
    (1..=turns as i32).map(|k| (1.0 + v).powi(-k)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Derivatives with noise; the noise of the photographs is one.
    fn noisy(seed: u64) -> DMatrix<f64> {
        let mut rng = organza_basis::PathRng::new(seed, 0, 0);
        DMatrix::from_fn(600, 3, |i, k| {
            let exact = 4.0 * ((i * (k + 1)) as f64 * 0.37).sin();
            exact + 4.0 * f64::from(rng.normal2().x)
        })
    }

    /// What is planted comes back although the derivatives are half noise, because products of
    /// two cloths have no bias; the twin, products of one cloth with itself, gives half of it.
    #[test]
    fn noise_of_derivatives_does_not_shorten_changes() {
        let exact = DMatrix::from_fn(600, 3, |i, k| 4.0 * ((i * (k + 1)) as f64 * 0.37).sin());
        let planted = DVector::from_vec(vec![0.3, -0.2, 0.1]);
        let rest = &exact * &planted;
        let [a, b] = [noisy(1), noisy(2)];
        let found = Equations::new(&[&a, &b], &[1.0; 3]).change(&rest, f64::INFINITY);
        // The products have a relative error of about 1.5 / sqrt(300).
        let error = (&found - &planted).norm() / planted.norm();
        assert!(error < 0.3, "seeds 1, 2: {error}");
        let one = Equations::new(&[&a], &[1.0; 3]).change(&rest, f64::INFINITY);
        let error = (&one - &planted).norm() / planted.norm();
        assert!(error > 0.4, "seed 1: {error}");
    }

    /// No change is longer than its reach, and a direction without derivatives does not change.
    #[test]
    fn changes_stay_within_their_reach() {
        let columns = DMatrix::from_fn(40, 2, |i, k| if k == 0 { 0.1 * i as f64 } else { 0.0 });
        let rest = DVector::from_element(40, 100.0);
        let ranges = [0.5, 0.25];
        let change = Equations::new(&[&columns], &ranges).change(&rest, 0.8);
        assert!(change[0] > 0.2 && change[0] <= 0.8 * 0.5, "{change}");
        assert_eq!(change[1], 0.0);
    }

    /// Many turns find all of what is planted, one turn what its damping leaves of it, and the rest of
    /// the range counts as its error.
    #[test]
    fn turns_add_up_to_what_is_planted() {
        // Along the first unknown a unit is four deviations of the photographs, along the second a half.
        let columns = DMatrix::from_fn(2, 2, |i, k| match (i, k) {
            (0, 0) => 4.0,
            (1, 1) => 0.5,
            _ => 0.0,
        });
        let planted = DVector::from_vec(vec![0.1, 0.2]);
        let rest = &columns * &planted;
        let equations = Equations::new(&[&columns], &[1.0; 2]);
        let one = equations.settled(&rest, 1);
        assert!(
            (&one - equations.change(&rest, 10.0)).norm() < 4.0 * f64::EPSILON,
            "{one}"
        );
        assert!(
            (one[1] / planted[1] - 0.2).abs() < 4.0 * f64::EPSILON,
            "{one}"
        );
        let all = equations.settled(&rest, 200);
        assert!((all - planted).norm() < 4.0 * f64::EPSILON);
        let left = equations.unsettled(1).map(f64::sqrt);
        assert!(
            (left[0] - 1.0 / 17.0).abs() < 1e-12 && (left[1] - 0.8).abs() < 1e-12,
            "{left}"
        );
    }
}
