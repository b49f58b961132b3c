//! Search within bounds, and the uncertainty of the result.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};
use std::cell::RefCell;

/// A parameter's range.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Bound {
    /// Its name, as in files.
    pub name: String,
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
    /// Where the search begins.
    pub start: f64,
}

/// A parameter with its uncertainty.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Determined {
    /// Its name.
    pub name: String,
    /// The best value.
    pub value: f64,
    /// Standard error, from the curvature at the best value and a normal prior with the
    /// variance of a uniform distribution over the range.
    pub se: f64,
    /// Whether the data narrows the range to less than half; if not, the data does not
    /// determine this parameter.
    pub is_fixed: bool,
}

/// The length and steps of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patience {
    /// Places evaluated all over the range before the descents.
    pub scan: u32,
    /// Maximum number of places that each descent evaluates.
    pub steps: u32,
    /// Step of difference quotients as a share of the range: large enough to
    /// stand out from the noise of residuals.
    pub stride: f64,
}

/// Descents: one from the start, the others from the best places of the scan.
const DESCENTS: usize = 4;

/// Change of the cost or of the place below which a descent ends.
const TOLERANCE: f64 = 1e-5;

/// Weighted residuals at a point; `None` where the model fails.
pub type Residuals<'a> = dyn FnMut(&[f64]) -> Option<Vec<f64>> + 'a;

fn square(list: &[f64]) -> f64 {
    list.iter().map(|r| r * r).sum()
}

impl Bound {
    /// The value at a coordinate without bounds.
    fn value(&self, x: f64) -> f64 {
        self.low + (self.high - self.low) / (1.0 + (-x).exp())
    }

    fn coordinate(&self, value: f64) -> f64 {
        let share = (value - self.low) / (self.high - self.low);
        let share = share.clamp(1e-3, 1.0 - 1e-3);
        (share / (1.0 - share)).ln()
    }
}

/// The best place so far and its sum of squares.
type Best = (Vec<f64>, f64);

/// One descent, in the form that the library requires.
struct Descent<'a, 'b> {
    bounds: &'a [Bound],
    residuals: RefCell<&'a mut Residuals<'b>>,
    best: RefCell<&'a mut Best>,
    /// Number of places that may still be evaluated.
    left: RefCell<u32>,
    stride: f64,
    x: DVector<f64>,
    /// Residuals at `x`, or those of the previous place if the model fails at `x`.
    at_x: Option<DVector<f64>>,
}

impl Descent<'_, '_> {
    fn values(&self, x: &DVector<f64>) -> Vec<f64> {
        let pairs = self.bounds.iter().zip(x.iter());
        pairs.map(|(b, &x)| b.value(x)).collect()
    }

    fn look(&self, x: &DVector<f64>) -> Option<DVector<f64>> {
        let mut left = self.left.borrow_mut();
        *left = left.checked_sub(1)?;
        let values = self.values(x);
        let list = (self.residuals.borrow_mut())(&values)?;
        let cost = square(&list);
        let mut best = self.best.borrow_mut();
        if cost < best.1 {
            **best = (values, cost);
        }
        cost.is_finite().then(|| DVector::from_vec(list))
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Descent<'_, '_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.x.copy_from(x);
        // A place where the model fails counts as a bad one, which shortens the step.
        let found = self.look(x);
        self.at_x = found.or_else(|| self.at_x.take().map(|r| r * 1e3));
    }

    fn params(&self) -> DVector<f64> {
        self.x.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        self.at_x.clone()
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let base = self.at_x.as_ref()?;
        if *self.left.borrow() < self.x.len() as u32 {
            return None;
        }
        let mut matrix = DMatrix::zeros(base.len(), self.x.len());
        for (k, b) in self.bounds.iter().enumerate() {
            // A step in the coordinate that changes the value by the stride, inwards.
            let value = b.value(self.x[k]);
            let stride = self.stride * (b.high - b.low);
            let is_low = value < 0.5 * (b.low + b.high);
            let inward = if is_low { stride } else { -stride };
            let mut moved = self.x.clone();
            moved[k] = b.coordinate(value + inward);
            if let Some(there) = self.look(&moved) {
                matrix.set_column(k, &((there - base) / (moved[k] - self.x[k])));
            }
        }
        Some(matrix)
    }
}

/// Least squares within bounds: a scan of places spread evenly over the range [Roberts2018],
/// then descents [Marquardt1963] from the start and from the best places of the scan.
/// Deterministic. Returns the best place and its sum of squares, which is infinite when the
/// model failed everywhere.
pub fn search(
    bounds: &[Bound],
    patience: &Patience,
    residuals: &mut Residuals<'_>,
) -> (Vec<f64>, f64) {
    let start: Vec<f64> = bounds.iter().map(|b| b.start).collect();
    let mut cost = |place: &[f64]| residuals(place).map_or(f64::INFINITY, |r| square(&r));
    let mut best = (start.clone(), cost(&start));
    // The root above one of x^(d + 1) = x + 1 gives the additive sequence.
    let power = bounds.len() as i32 + 1;
    let root = (0..60).fold(2.0f64, |x, _| (1.0 + x).powf(1.0 / f64::from(power)));
    let mut seen = Vec::new();
    for k in 1..=patience.scan {
        let coordinate = |(d, b): (usize, &Bound)| {
            let share = (0.5 + f64::from(k) * root.powi(-(d as i32 + 1))).fract();
            b.low + (b.high - b.low) * (0.05 + 0.9 * share)
        };
        let place: Vec<f64> = bounds.iter().enumerate().map(coordinate).collect();
        let value = cost(&place);
        seen.push((place, value));
    }
    seen.sort_by(|a, b| a.1.total_cmp(&b.1));
    seen.truncate(DESCENTS - 1);
    let mut places = vec![start];
    for (place, cost) in seen {
        if cost < best.1 {
            best = (place.clone(), cost);
        }
        places.push(place);
    }
    if bounds.is_empty() || patience.steps == 0 {
        return best;
    }
    for place in places {
        let pairs = bounds.iter().zip(&place);
        let x = DVector::from_iterator(bounds.len(), pairs.map(|(b, &v)| b.coordinate(v)));
        let mut descent = Descent {
            bounds,
            residuals: RefCell::new(&mut *residuals),
            best: RefCell::new(&mut best),
            left: RefCell::new(patience.steps),
            stride: patience.stride,
            x: x.clone(),
            at_x: None,
        };
        descent.set_params(&x);
        // The outcome does not matter: the best place is recorded on the way.
        let _ = LevenbergMarquardt::new()
            .with_ftol(TOLERANCE)
            .with_xtol(TOLERANCE)
            .with_gtol(TOLERANCE)
            .minimize(descent);
    }
    best
}

/// Uncertainty of the parameters at the best value, from the derivatives of
/// weighted residuals by each of them (`columns`) and the variance of one
/// residual.
pub fn determine(
    bounds: &[Bound],
    values: &[f64],
    columns: &[Vec<f64>],
    variance: f64,
) -> Vec<Determined> {
    let n = bounds.len();
    let prior = |b: &Bound| (b.high - b.low).powi(2) / 12.0;
    // Curvature in units of the standard deviation of the prior, so that it is well scaled.
    let mut matrix = DMatrix::<f64>::identity(n, n);
    for (i, (a, p)) in columns.iter().zip(bounds).enumerate() {
        for (j, (b, q)) in columns.iter().zip(bounds).enumerate() {
            let product: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
            matrix[(i, j)] += product / variance * (prior(p) * prior(q)).sqrt();
        }
    }
    let inverse = matrix
        .try_inverse()
        .unwrap_or_else(|| DMatrix::identity(n, n));
    bounds
        .iter()
        .zip(values)
        .enumerate()
        .map(|(k, (b, &value))| {
            let share = inverse[(k, k)].max(0.0).sqrt();
            Determined {
                name: b.name.clone(),
                value,
                se: share * prior(b).sqrt(),
                is_fixed: share < 0.5,
            }
        })
        .collect()
}

/// Exact non-negative least squares of a few columns: the best of all choices of columns whose
/// solution is positive [Lawson1974].
pub fn non_negative(columns: &[Vec<f64>], target: &[f64]) -> (Vec<f64>, f64) {
    let n = columns.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let row = |a: &Vec<f64>| columns.iter().map(|b| dot(a, b)).collect();
    let gram: Vec<Vec<f64>> = columns.iter().map(row).collect();
    let right: Vec<f64> = columns.iter().map(|a| dot(a, target)).collect();
    let own = dot(target, target);
    let mut best = (vec![0.0; n], own);
    for choice in 1u32..1 << n {
        let chosen: Vec<usize> = (0..n).filter(|k| choice >> k & 1 == 1).collect();
        let usable = chosen.iter().all(|&k| gram[k][k] > 0.0);
        if !usable {
            continue;
        }
        // Columns that are the same share the weight.
        let ridge = |i, j| if i == j { 1.0 + 1e-10 } else { 1.0 };
        let count = chosen.len();
        let matrix = DMatrix::from_fn(count, count, |i, j| {
            gram[chosen[i]][chosen[j]] * ridge(i, j)
        });
        let side = DVector::from_fn(count, |i, _| right[chosen[i]]);
        let Some(solution) = matrix.cholesky().map(|c| c.solve(&side)) else {
            continue;
        };
        if !solution.iter().all(|&x| x >= 0.0 && x.is_finite()) {
            continue;
        }
        let gains = solution.iter().zip(&chosen).map(|(x, &k)| x * right[k]);
        let gained: f64 = gains.sum();
        if own - gained < best.1 {
            let mut full = vec![0.0; n];
            for (x, &k) in solution.iter().zip(&chosen) {
                full[k] = *x;
            }
            best = (full, own - gained);
        }
    }
    (best.0, best.1.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    fn bound(name: &str, low: f64, high: f64, start: f64) -> Bound {
        let name = name.to_owned();
        Bound {
            name,
            low,
            high,
            start,
        }
    }

    #[test]
    fn the_least_of_a_curved_valley_is_found_within_its_bounds() {
        let bounds = [bound("x", -2.0, 2.0, -1.2), bound("y", -1.0, 3.0, 1.0)];
        let patience = Patience {
            scan: 20,
            steps: 200,
            stride: 1e-5,
        };
        let valley = |v: &[f64]| Some(vec![1.0 - v[0], 10.0 * (v[1] - v[0] * v[0])]);
        let (at, least) = search(&bounds, &patience, &mut |v| valley(v));
        assert!(least < 1e-8 && (at[0] - 1.0).abs() < 1e-3, "{at:?} {least}");
        // Half of the range without an answer does not hold it up.
        let (at, least) = search(&bounds, &patience, &mut |v| {
            (v[0] > 0.0).then(|| valley(v)).flatten()
        });
        assert!(least < 4.0 * f64::EPSILON, "{at:?} {least}");
        // The least lies outside: the search ends at the edge.
        let (at, _) = search(&bounds, &patience, &mut |v| Some(vec![v[0] - 5.0, 0.0]));
        assert!(at[0] > 1.9 && at[0] <= 2.0, "{at:?}");
        // No more places than allowed are looked at.
        let mut count = 0;
        let few = Patience {
            scan: 7,
            steps: 10,
            stride: 1e-5,
        };
        search(&bounds, &few, &mut |v| {
            count += 1;
            valley(v)
        });
        assert!(count <= 1 + 7 + 10 * DESCENTS, "{count}");
    }

    #[test]
    fn what_the_data_does_not_say_is_named() {
        // Two columns that are the same, one of its own, one that is nothing.
        let mut rng = PathRng::from_seed(4);
        let a: Vec<f64> = (0..200).map(|_| rng.unit().into()).collect();
        let b: Vec<f64> = (0..200).map(|_| rng.unit().into()).collect();
        let bounds = ["p", "q", "r", "s"].map(|n| bound(n, 0.0, 1.0, 0.5));
        let columns = [a.clone(), a, b, vec![0.0; 200]];
        let determined = determine(&bounds, &[0.5; 4], &columns, 1e-4);
        let fixed: Vec<bool> = determined.iter().map(|d| d.is_fixed).collect();
        assert_eq!(fixed, [false, false, true, false], "{determined:?}");
        assert!(determined[2].se < 0.003 && (determined[3].se - 12f64.powf(-0.5)).abs() < 1e-9);
    }

    #[test]
    fn non_negative_solutions_are_the_best_ones() {
        let mut rng = PathRng::from_seed(5);
        for _ in 0..50 {
            let column = |rng: &mut PathRng| -> Vec<f64> {
                (0..12).map(|_| f64::from(rng.normal2().x)).collect()
            };
            let columns: Vec<Vec<f64>> = (0..4).map(|_| column(&mut rng)).collect();
            let target = column(&mut rng);
            let (x, cost) = non_negative(&columns, &target);
            let residual = |x: &[f64]| -> f64 {
                (0..12)
                    .map(|i| {
                        let sum: f64 = columns.iter().zip(x).map(|(c, x)| c[i] * x).sum();
                        (target[i] - sum).powi(2)
                    })
                    .sum()
            };
            assert!((residual(&x) - cost).abs() < 1e-6 * (1.0 + cost));
            // No small step within the quadrant is better.
            for k in 0..4 {
                for step in [-1e-3, 1e-3] {
                    let mut y = x.clone();
                    y[k] = (y[k] + step).max(0.0);
                    assert!(residual(&y) >= residual(&x) - 1e-12);
                }
            }
        }
    }
}
