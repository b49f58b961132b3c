//! Broyden's method: what the turns of a search show of its derivatives.

use nalgebra::{DMatrix, DVector};

/// Deviation that is expected of a derivative.
const EXPECTED: f64 = 0.33;

/// How the change that equations ask for depends on the unknowns, as the places that were visited
/// show. Equations with exact derivatives ask for a unit less where an unknown is a unit greater; those
/// whose derivatives were taken elsewhere do so by another factor, and in directions where two
/// unknowns nearly make up for each other the factor may be two, which never ends. All values are in units of the
/// ranges of the unknowns. This is the first of the methods of [Broyden1965], with differences that
/// count the less the more of them is noise.
pub struct Broyden {
    /// Derivatives of the change that is asked for.
    matrix: DMatrix<f64>,
}

impl Broyden {
    /// For so many unknowns with exact derivatives.
    pub fn new(unknowns: usize) -> Broyden {
        Broyden {
            matrix: -DMatrix::identity(unknowns, unknowns),
        }
    }

    /// Learns from two places `moved` apart what was asked for `before` and `after`, whose difference has a
    /// square of `noise` by itself.
    pub fn learn(
        &mut self,
        moved: &DVector<f64>,
        before: &DVector<f64>,
        after: &DVector<f64>,
        noise: f64,
    ) {
        let length = moved.norm_squared() + noise / (EXPECTED * EXPECTED);
        if length > 0.0 {
            let error = after - before - &self.matrix * moved;
            self.matrix += error * moved.transpose() / length;
        }
    }

    /// The change after which nothing more would be asked for.
    pub fn change(&self, asked: &DVector<f64>) -> DVector<f64> {
        let solved = self.matrix.clone().lu().solve(asked);
        -solved.unwrap_or_else(|| -asked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Changes that are twice too long in one direction come to rest; the twin, which does not
    /// learn, never does.
    #[test]
    fn changes_that_are_too_long_come_to_rest() {
        let answer = DVector::from_vec(vec![0.3, -0.2, 0.1]);
        let along = DVector::from_vec(vec![0.6, -0.8, 0.0]);
        let asked = |x: &DVector<f64>| {
            let rest = &answer - x;
            let more = along.dot(&rest);
            rest + &along * more
        };
        let error = |is_learning: bool| {
            let mut broyden = Broyden::new(3);
            let mut at = DVector::zeros(3);
            for _ in 0..6 {
                let before = asked(&at);
                let moved = broyden.change(&before);
                at += &moved;
                if is_learning {
                    broyden.learn(&moved, &before, &asked(&at), 0.0);
                }
            }
            (at - &answer).norm()
        };
        assert!(error(true) < 32.0 * f64::EPSILON, "{}", error(true));
        assert!(error(false) > 0.3, "{}", error(false));
    }

    /// Differences that are noise teach nothing.
    #[test]
    fn noise_is_not_learned() {
        let mut broyden = Broyden::new(2);
        let moved = DVector::from_vec(vec![1e-3, 0.0]);
        let noise = DVector::from_vec(vec![0.1, 0.1]);
        broyden.learn(&moved, &DVector::zeros(2), &noise, 2.0 * 0.01);
        let asked = DVector::from_vec(vec![0.2, 0.1]);
        assert!((broyden.change(&asked) - &asked).norm() < 0.01);
    }
}
