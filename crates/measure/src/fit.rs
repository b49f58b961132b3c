//! Search within bounds and what the data says of the answer.

use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;
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

/// A parameter with what the data says of it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Determined {
    /// Its name.
    pub name: String,
    /// The best value.
    pub value: f64,
    /// Standard error, from the curvature at the best value and the range
    /// taken for a flat prior of the same variance.
    pub se: f64,
    /// Whether the data narrows the range to less than half; if not, the data
    /// does not fix this parameter.
    pub is_fixed: bool,
}

/// How long to search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// Places looked at all over the range before the descent.
    pub scan: u32,
    /// Steps of each of the two descents.
    pub steps: u64,
}

/// The cost of a place.
type Cost<'a> = dyn FnMut(&[f64]) -> f64 + 'a;

/// What a search needs of its problem. Costs are remembered by the caller, who
/// may so go on where an earlier search ended.
struct Problem<'a, 'b> {
    bounds: &'a [Bound],
    cost: RefCell<&'a mut Cost<'b>>,
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

impl CostFunction for Problem<'_, '_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let values: Vec<f64> = self
            .bounds
            .iter()
            .zip(x)
            .map(|(b, &x)| b.value(x))
            .collect();
        let cost = (self.cost.borrow_mut())(&values);
        Ok(if cost.is_finite() { cost } else { f64::MAX })
    }
}

/// Least cost within bounds: a look at places spread evenly over the range
/// [Roberts2018], then two descents [NelderMead1965], from the start and from
/// the best place seen. Deterministic.
///
/// # Errors
/// What the optimiser says.
pub fn search(
    bounds: &[Bound],
    patience: &Patience,
    cost: &mut Cost<'_>,
) -> Result<(Vec<f64>, f64), String> {
    let start: Vec<f64> = bounds.iter().map(|b| b.start).collect();
    if bounds.is_empty() {
        let value = cost(&start);
        return Ok((start, value));
    }
    // The root above one of x^(d + 1) = x + 1 gives the additive sequence.
    let power = bounds.len() as i32 + 1;
    let root = (0..60).fold(2.0f64, |x, _| (1.0 + x).powf(1.0 / f64::from(power)));
    let mut seen = (start.clone(), cost(&start));
    for k in 1..=patience.scan {
        let place: Vec<f64> = bounds
            .iter()
            .enumerate()
            .map(|(d, b)| {
                let share = (0.5 + f64::from(k) * root.powi(-(d as i32 + 1))).fract();
                b.low + (b.high - b.low) * (0.05 + 0.9 * share)
            })
            .collect();
        let value = cost(&place);
        if value < seen.1 {
            seen = (place, value);
        }
    }
    let mut best = seen.clone();
    let mut places = vec![seen.0];
    if places[0] != start {
        places.push(start);
    }
    for place in places {
        let origin: Vec<f64> = bounds
            .iter()
            .zip(&place)
            .map(|(b, &v)| b.coordinate(v))
            .collect();
        let mut simplex = vec![origin.clone()];
        for d in 0..origin.len() {
            let mut corner = origin.clone();
            if let Some(x) = corner.get_mut(d) {
                *x += if *x > 0.0 { -0.7 } else { 0.7 };
            }
            simplex.push(corner);
        }
        let problem = Problem {
            bounds,
            cost: RefCell::new(&mut *cost),
        };
        let failed = |e: argmin::core::Error| e.to_string();
        let solver = NelderMead::new(simplex)
            .with_sd_tolerance(1e-9)
            .map_err(failed)?;
        let result = Executor::new(problem, solver)
            .configure(|s| s.max_iters(patience.steps))
            .run()
            .map_err(failed)?;
        let state = result.state();
        if let Some(x) = state.get_best_param()
            && state.get_best_cost() < best.1
        {
            let values = bounds.iter().zip(x).map(|(b, &x)| b.value(x)).collect();
            best = (values, state.get_best_cost());
        }
    }
    Ok(best)
}

/// What the data says of parameters at the best value, from the derivatives of
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
    // Curvature in units of the prior's deviation, so that it is well scaled.
    let mut matrix = vec![vec![0.0; n]; n];
    for (i, (a, p)) in columns.iter().zip(bounds).enumerate() {
        for (j, (b, q)) in columns.iter().zip(bounds).enumerate() {
            let product: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
            let unit = if i == j { 1.0 } else { 0.0 };
            matrix[i][j] = unit + product / variance * (prior(p) * prior(q)).sqrt();
        }
    }
    let inverse = inverse(matrix);
    bounds
        .iter()
        .zip(values)
        .enumerate()
        .map(|(k, (b, &value))| {
            let share = inverse[k][k].max(0.0).sqrt();
            Determined {
                name: b.name.clone(),
                value,
                se: share * prior(b).sqrt(),
                is_fixed: share < 0.5,
            }
        })
        .collect()
}

/// The inverse of a positive definite matrix, by elimination with the largest
/// pivot.
fn inverse(mut a: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n = a.len();
    for (k, row) in a.iter_mut().enumerate() {
        row.extend((0..n).map(|j| if j == k { 1.0 } else { 0.0 }));
    }
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()));
        a.swap(k, pivot.unwrap_or(k));
        let scale = 1.0 / a[k][k];
        a[k].iter_mut().for_each(|x| *x *= scale);
        let row = a[k].clone();
        for (i, other) in a.iter_mut().enumerate() {
            if i != k {
                let factor = other[k];
                other
                    .iter_mut()
                    .zip(&row)
                    .for_each(|(x, y)| *x -= factor * y);
            }
        }
    }
    a.into_iter().map(|row| row[n..].to_vec()).collect()
}

/// Non-negative least squares of a few columns, exactly: the best of all
/// choices of columns whose own solution is positive [Lawson1974].
pub fn non_negative(columns: &[Vec<f64>], target: &[f64]) -> (Vec<f64>, f64) {
    let n = columns.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let gram: Vec<Vec<f64>> = columns
        .iter()
        .map(|a| columns.iter().map(|b| dot(a, b)).collect())
        .collect();
    let right: Vec<f64> = columns.iter().map(|a| dot(a, target)).collect();
    let own = dot(target, target);
    let mut best = (vec![0.0; n], own);
    for choice in 1u32..1 << n {
        let chosen: Vec<usize> = (0..n).filter(|k| choice >> k & 1 == 1).collect();
        let usable = chosen.iter().all(|&k| gram[k][k] > 0.0);
        if !usable {
            continue;
        }
        let matrix = chosen
            .iter()
            .map(|&i| {
                let entry = |&j: &usize| {
                    // Columns that are the same share the weight.
                    let ridge = if i == j { 1.0 + 1e-10 } else { 1.0 };
                    gram[i][j] * ridge
                };
                chosen.iter().map(entry).collect()
            })
            .collect();
        let inverse = inverse(matrix);
        let solution: Vec<f64> = inverse
            .iter()
            .map(|row| row.iter().zip(&chosen).map(|(x, &k)| x * right[k]).sum())
            .collect();
        if !solution.iter().all(|&x| x >= 0.0 && x.is_finite()) {
            continue;
        }
        let gained: f64 = solution
            .iter()
            .zip(&chosen)
            .map(|(x, &k)| x * right[k])
            .sum();
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
            steps: 400,
        };
        let mut cost = |v: &[f64]| (1.0 - v[0]).powi(2) + 100.0 * (v[1] - v[0] * v[0]).powi(2);
        let (at, least) = search(&bounds, &patience, &mut cost).unwrap();
        assert!(least < 1e-8 && (at[0] - 1.0).abs() < 1e-3, "{at:?} {least}");
        // The least lies outside: the search ends at the edge.
        let (at, _) = search(&bounds, &patience, &mut |v| (v[0] - 5.0).powi(2)).unwrap();
        assert!(at[0] > 1.9 && at[0] <= 2.0, "{at:?}");
    }

    #[test]
    fn what_the_data_does_not_say_is_named() {
        // Two columns that are the same, one of its own, one that is nothing.
        let mut rng = PathRng::from_seed(4);
        let a: Vec<f64> = (0..200).map(|_| rng.unit().into()).collect();
        let b: Vec<f64> = (0..200).map(|_| rng.unit().into()).collect();
        let bounds = ["p", "q", "r", "s"].map(|n| bound(n, 0.0, 1.0, 0.5));
        let columns = [a.clone(), a, b, vec![0.0; 200]];
        let told = determine(&bounds, &[0.5; 4], &columns, 1e-4);
        let fixed: Vec<bool> = told.iter().map(|d| d.is_fixed).collect();
        assert_eq!(fixed, [false, false, true, false], "{told:?}");
        assert!(told[2].se < 0.003 && (told[3].se - 12f64.powf(-0.5)).abs() < 1e-9);
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
