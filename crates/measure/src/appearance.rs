//! Optics of a volume that match what was observed of it: single-scattering albedo, width of
//! the flakes and a factor of density.
//!
//! [Zhao2011] matches mean and deviation of a photograph by two nested binary searches at a
//! density that was chosen beforehand: the mean increases with the albedo, and the deviation
//! decreases with the width of the flakes. The statistics here are the same. All parameters are
//! found together by damped least squares [Marquardt1963], so that the density can be fitted as
//! well, and the curvature at the end says what the data determine.
//!
//! A channel sees no albedo but its own. The derivatives by the three albedos of a material
//! therefore cost one simulation.
//!
//! More than 450 lines: one search, whose steps share its coordinates and its errors.

use crate::Measured;
use crate::fit::Determined;
use nalgebra::{DMatrix, DVector};

/// Optics of a volume of micro-flakes.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Appearance {
    /// Single-scattering albedo of each material, each channel in `[0, 1]`.
    pub albedo: Vec<[f64; 3]>,
    /// Deviation of the flakes' normals from the plane across the fibre, as `gamma` of
    /// Gaussian flakes.
    pub gamma: f64,
    /// Factor of the density.
    pub density: f64,
}

/// Where a search begins, its ranges, and its end.
#[derive(Clone, Debug, PartialEq)]
pub struct AppearanceSearch {
    /// Names of the materials.
    pub names: Vec<String>,
    /// Least and greatest `gamma`, above zero.
    pub gamma: [f64; 2],
    /// Least and greatest factor of density, above zero; equal ends keep it.
    pub density: [f64; 2],
    /// Where the search begins.
    pub start: Appearance,
    /// Maximum number of steps of the descent.
    pub steps: u32,
}

/// The result of a search.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct AppearanceFit {
    /// The best optics.
    pub appearance: Appearance,
    /// Its values with their standard errors: albedos of each material, `gamma`, and `density`
    /// where it was fitted.
    pub parameters: Vec<Determined>,
    /// The observed statistics at the best optics.
    pub simulated: Vec<Measured>,
    /// Differences from the target in expected errors, channel by channel.
    pub residuals: Vec<[f64; 3]>,
    /// Number of simulations.
    pub simulations: u32,
    /// Whether no difference exceeds three expected errors.
    pub is_met: bool,
}

/// Simulates the observed statistics of a volume with these optics. Random numbers are the same
/// in every call, so that differences are not noise.
pub type Simulate<'a, E> = dyn FnMut(&Appearance) -> Result<Vec<Measured>, E> + 'a;

/// Share of a value that is always counted as its error: a match to half a percent ends the
/// search whatever the noise.
const FLOOR: f64 = 0.005;

/// Share of a value that counts as its error while starts are compared.
const COARSE: f64 = 0.03;

/// Least and greatest coordinate of an albedo: the root of what is absorbed. Reflectance is
/// nearly linear in it [vanDeHulst1980]. The least is an albedo of 0.9996.
const ROOT: [f64; 2] = [0.02, 1.0];

/// Steps of difference quotients: of a root of absorption, and of a logarithm.
const STRIDE: [f64; 2] = [0.05, 0.35];

/// A step of a logarithm that changes nothing but the noise.
const NUDGE: f64 = 0.004;

/// A step shorter than this share of the standard error ends the search.
const SHORT: f64 = 0.05;

/// The greatest difference in expected errors that counts as met.
const MET: f64 = 3.0;

/// One coordinate: its range and where the search began.
#[derive(Clone, Copy, Debug)]
struct Axis {
    low: f64,
    high: f64,
    start: f64,
}

impl Axis {
    /// Variance of a uniform distribution over the range.
    fn prior(&self) -> f64 {
        (self.high - self.low).powi(2) / 12.0
    }
}

struct Search<'a, 'b, E> {
    search: &'a AppearanceSearch,
    target: &'a [Measured],
    axes: Vec<Axis>,
    errors: Vec<[f64; 3]>,
    simulate: &'a mut Simulate<'b, E>,
    simulations: u32,
}

/// A place with its statistics.
#[derive(Clone)]
struct Place {
    x: Vec<f64>,
    found: Vec<Measured>,
    cost: f64,
}

/// Finds the optics at which `simulate` gives the statistics `target`, which are a mean and
/// deviation of pixels, or values of pairs, channel by channel.
///
/// # Errors
/// Those of `simulate`.
pub fn fit_appearance<E>(
    target: &[Measured],
    search: &AppearanceSearch,
    simulate: &mut Simulate<'_, E>,
) -> Result<AppearanceFit, E> {
    let mut at = Search::new(target, search, simulate);
    let mut best = at.coarse()?;
    at.expect_errors_of(&best.found);
    best.cost = at.cost(&best.x, &best.found);
    best = at.descend(best)?;
    let columns = at.columns(&best)?;
    let noise = at.noise(&best)?;
    Ok(at.result(&best, &columns, noise))
}

impl<'a, 'b, E> Search<'a, 'b, E> {
    fn new(
        target: &'a [Measured],
        search: &'a AppearanceSearch,
        simulate: &'a mut Simulate<'b, E>,
    ) -> Search<'a, 'b, E> {
        let root = |albedo: f64| (1.0 - albedo).max(0.0).sqrt().clamp(ROOT[0], ROOT[1]);
        let mut axes: Vec<Axis> = search
            .start
            .albedo
            .iter()
            .flatten()
            .map(|&albedo| Axis {
                low: ROOT[0],
                high: ROOT[1],
                start: root(albedo),
            })
            .collect();
        for ([low, high], start) in [
            (search.gamma, search.start.gamma),
            (search.density, search.start.density),
        ] {
            if low < high {
                axes.push(Axis {
                    low: low.ln(),
                    high: high.ln(),
                    start: start.clamp(low, high).ln(),
                });
            }
        }
        let coarse = |m: &Measured| {
            std::array::from_fn(|c| m.se[c].hypot(COARSE * m.mean[c]).max(f64::MIN_POSITIVE))
        };
        Search {
            search,
            target,
            axes,
            errors: target.iter().map(coarse).collect(),
            simulate,
            simulations: 0,
        }
    }

    /// Number of materials.
    fn materials(&self) -> usize {
        self.search.start.albedo.len()
    }

    fn appearance(&self, x: &[f64]) -> Appearance {
        let count = 3 * self.materials();
        let colours = x[..count].chunks_exact(3);
        let albedo = colours.map(|u| std::array::from_fn(|c| 1.0 - u[c] * u[c]));
        let albedo = albedo.collect();
        let mut rest = x[count..].iter().map(|v| v.exp());
        let mut value = |[low, high]: [f64; 2], fixed: f64| {
            let own = if low < high { rest.next() } else { None };
            own.unwrap_or(fixed)
        };
        Appearance {
            albedo,
            gamma: value(self.search.gamma, self.search.start.gamma),
            density: value(self.search.density, self.search.start.density),
        }
    }

    fn look(&mut self, x: &[f64]) -> Result<Place, E> {
        self.simulations += 1;
        let optics = self.appearance(x);
        let found = (self.simulate)(&optics)?;
        Ok(Place {
            cost: self.cost(x, &found),
            x: x.to_vec(),
            found,
        })
    }

    /// Differences of a channel in expected errors.
    fn residuals(&self, found: &[Measured], c: usize) -> Vec<f64> {
        let both = found.iter().zip(self.target).zip(&self.errors);
        both.map(|((f, t), e)| (f.mean[c] - t.mean[c]) / e[c])
            .collect()
    }

    fn cost(&self, x: &[f64], found: &[Measured]) -> f64 {
        let residuals = (0..3).flat_map(|c| self.residuals(found, c));
        let data: f64 = residuals.map(|r| r * r).sum();
        let prior = self.axes.iter().zip(x);
        data + prior
            .map(|(a, x)| (x - a.start).powi(2) / a.prior())
            .sum::<f64>()
    }

    /// Errors of target and simulation together, and the floor.
    fn expect_errors_of(&mut self, found: &[Measured]) {
        let both = found.iter().zip(self.target);
        let one = |(f, t): (&Measured, &Measured)| {
            std::array::from_fn(|c| {
                let largest = (0..3).fold(0.0f64, |m, c| m.max(t.mean[c].abs()));
                let floor = FLOOR * t.mean[c].abs().max(0.1 * largest);
                f.se[c].hypot(t.se[c]).hypot(floor).max(f64::MIN_POSITIVE)
            })
        };
        self.errors = both.map(one).collect();
    }

    /// The best of some widths and densities, each with albedos that were brought near.
    fn coarse(&mut self) -> Result<Place, E> {
        let albedos = 3 * self.materials();
        let mut x: Vec<f64> = self.axes.iter().map(|a| a.start).collect();
        let tries: &[[f64; 2]] = match self.axes.len() - albedos {
            0 => &[[0.5; 2]],
            1 => &[[0.5; 2], [0.2; 2], [0.8; 2]],
            _ => &[[0.5; 2], [0.2; 2], [0.2, 0.8], [0.8, 0.2], [0.8; 2]],
        };
        let mut best: Option<Place> = None;
        for shares in tries {
            for ((a, share), x) in self.axes[albedos..]
                .iter()
                .zip(shares)
                .zip(&mut x[albedos..])
            {
                *x = a.low + share * (a.high - a.low);
            }
            let mut here = self.look(&x)?;
            let rounds = if best.is_none() { 2 } else { 1 };
            for _ in 0..rounds {
                let columns = self.albedo_columns(&here)?;
                let Some(next) = self.step(&here, &columns, 1e-3) else {
                    break;
                };
                let next = self.look(&next)?;
                if next.cost >= here.cost {
                    break;
                }
                here = next;
            }
            // The albedos are a good start for the next try.
            x[..albedos].copy_from_slice(&here.x[..albedos]);
            if best.as_ref().is_none_or(|b| here.cost < b.cost) {
                best = Some(here);
            }
        }
        match best {
            Some(best) => Ok(best),
            None => self.look(&x),
        }
    }

    fn descend(&mut self, mut here: Place) -> Result<Place, E> {
        let mut damping = 1e-3;
        for _ in 0..self.search.steps {
            let columns = self.columns(&here)?;
            let error = self.errors_of(&columns, 0.0);
            let mut is_short = true;
            let mut has_moved = false;
            for _ in 0..4 {
                let Some(next) = self.step(&here, &columns, damping) else {
                    break;
                };
                let moved = || next.iter().zip(&here.x).zip(&error);
                is_short = moved().all(|((a, b), e)| (a - b).abs() < SHORT * e);
                if is_short {
                    break;
                }
                let next = self.look(&next)?;
                if next.cost < here.cost {
                    let gain = (here.cost - next.cost) / here.cost;
                    (here, has_moved) = (next, true);
                    damping *= 0.2;
                    is_short = gain < 1e-3;
                    break;
                }
                damping *= 8.0;
            }
            if is_short || !has_moved {
                break;
            }
        }
        Ok(here)
    }

    /// Derivatives of the differences by every coordinate: for each channel one list.
    fn columns(&mut self, here: &Place) -> Result<Vec<[Vec<f64>; 3]>, E> {
        let mut columns = self.albedo_columns(here)?;
        for k in 3 * self.materials()..self.axes.len() {
            let mut x = here.x.clone();
            let step = self.inward(k, x[k], STRIDE[1]);
            x[k] += step;
            let there = self.look(&x)?;
            columns.push([0, 1, 2].map(|c| self.quotient(here, &there, c, step)));
        }
        Ok(columns)
    }

    fn albedo_columns(&mut self, here: &Place) -> Result<Vec<[Vec<f64>; 3]>, E> {
        let mut columns = Vec::new();
        for material in 0..self.materials() {
            let mut x = here.x.clone();
            let steps = [0, 1, 2].map(|c| {
                let k = 3 * material + c;
                let step = self.inward(k, x[k], STRIDE[0]);
                x[k] += step;
                step
            });
            let there = self.look(&x)?;
            for c in 0..3 {
                let none = || vec![0.0; self.target.len()];
                let mut column = [none(), none(), none()];
                column[c] = self.quotient(here, &there, c, steps[c]);
                columns.push(column);
            }
        }
        Ok(columns)
    }

    fn inward(&self, k: usize, x: f64, stride: f64) -> f64 {
        if x > 0.5 * (self.axes[k].low + self.axes[k].high) {
            -stride
        } else {
            stride
        }
    }

    fn quotient(&self, here: &Place, there: &Place, c: usize, step: f64) -> Vec<f64> {
        let both = || there.found.iter().zip(&here.found).zip(&self.errors);
        both()
            .map(|((a, b), e)| (a.mean[c] - b.mean[c]) / (e[c] * step))
            .collect()
    }

    /// Curvature of the cost by the coordinates that have columns, prior included.
    fn curvature(&self, columns: &[[Vec<f64>; 3]]) -> DMatrix<f64> {
        let dot = |a: &[Vec<f64>; 3], b: &[Vec<f64>; 3]| -> f64 {
            let products = a.iter().flatten().zip(b.iter().flatten());
            products.map(|(x, y)| x * y).sum()
        };
        DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
            let own = 1.0 / self.axes[i].prior();
            let prior = if i == j { own } else { 0.0 };
            dot(&columns[i], &columns[j]) + prior
        })
    }

    /// Squared differences, in expected errors, between places that are all but the same.
    fn noise(&mut self, here: &Place) -> Result<f64, E> {
        let mut x = here.x.clone();
        for (k, x) in x.iter_mut().enumerate().skip(3 * self.materials()) {
            *x += self.inward(k, *x, NUDGE);
        }
        let there = self.look(&x)?;
        let differences = (0..3).flat_map(|c| self.quotient(here, &there, c, 1.0));
        Ok(differences.map(|d| d * d).sum())
    }

    /// Errors of the coordinates. Noise of simulations looks like a derivative and would
    /// promise too much: squared differences that are noise are taken off.
    fn errors_of(&self, columns: &[[Vec<f64>; 3]], noise: f64) -> Vec<f64> {
        let mut matrix = self.curvature(columns);
        for k in 3 * self.materials()..columns.len() {
            let own = matrix[(k, k)];
            let left = (own - noise / STRIDE[1].powi(2)).max(1.0 / self.axes[k].prior());
            let share = (left / own).min(1.0).sqrt();
            for i in 0..columns.len() {
                matrix[(i, k)] *= share;
                matrix[(k, i)] *= share;
            }
        }
        let inverse = matrix.try_inverse();
        (0..columns.len())
            .map(|k| {
                let own = inverse.as_ref().map(|m| m[(k, k)].max(0.0).sqrt());
                own.unwrap_or_else(|| self.axes[k].prior().sqrt())
            })
            .collect()
    }

    /// The next place, with the coordinates that have columns moved.
    fn step(&self, here: &Place, columns: &[[Vec<f64>; 3]], damping: f64) -> Option<Vec<f64>> {
        let mut matrix = self.curvature(columns);
        let residuals: Vec<f64> = (0..3)
            .flat_map(|c| self.residuals(&here.found, c))
            .collect();
        let slope = DVector::from_fn(columns.len(), |k, _| {
            let own = columns[k].iter().flatten().zip(&residuals);
            let prior = (here.x[k] - self.axes[k].start) / self.axes[k].prior();
            own.map(|(a, r)| a * r).sum::<f64>() + prior
        });
        for k in 0..columns.len() {
            matrix[(k, k)] *= 1.0 + damping;
        }
        let change = matrix.cholesky()?.solve(&slope);
        let mut x = here.x.clone();
        for (k, d) in change.iter().enumerate() {
            let axis = self.axes[k];
            // No more than a third of the range at once: the model is not linear.
            let most = (axis.high - axis.low) / 3.0;
            x[k] = (x[k] - d.clamp(-most, most)).clamp(axis.low, axis.high);
        }
        x.iter().all(|v| v.is_finite()).then_some(x)
    }

    fn result(&self, best: &Place, columns: &[[Vec<f64>; 3]], noise: f64) -> AppearanceFit {
        let residuals: [Vec<f64>; 3] = [0, 1, 2].map(|c| self.residuals(&best.found, c));
        let square: f64 = residuals.iter().flatten().map(|r| r * r).sum();
        let freedom = (3 * self.target.len())
            .saturating_sub(self.axes.len())
            .max(1);
        // A poor match says less than its errors promise.
        let widen = (square / freedom as f64).max(1.0).sqrt();
        let errors = self.errors_of(columns, noise);
        let appearance = self.appearance(&best.x);
        let mut names = Vec::new();
        for name in &self.search.names {
            names.extend(["r", "g", "b"].map(|c| format!("{name}.albedo.{c}")));
        }
        let [low, high] = self.search.gamma;
        if low < high {
            names.push("gamma".to_owned());
        }
        names.push("density".to_owned());
        let count = 3 * self.materials();
        let parameters = (0..self.axes.len()).map(|k| {
            let (axis, x) = (self.axes[k], best.x[k]);
            let prior = axis.prior().sqrt();
            let se = (errors[k] * widen).min(prior);
            let (value, slope) = if k < count {
                // Near white the square of the error counts.
                (1.0 - x * x, (2.0 * x).max(se))
            } else {
                (x.exp(), x.exp())
            };
            let edge = 1e-6 * (axis.high - axis.low);
            // White and black are answers; the ends of the other ranges are not.
            let is_inside = k < count || (x > axis.low + edge && x < axis.high - edge);
            Determined {
                name: names[k].clone(),
                value,
                se: se * slope,
                is_fixed: se < 0.5 * prior && is_inside,
            }
        });
        let residuals: Vec<[f64; 3]> = (0..self.target.len())
            .map(|i| [0, 1, 2].map(|c| residuals[c][i]))
            .collect();
        AppearanceFit {
            parameters: parameters.collect(),
            appearance,
            simulated: best.found.clone(),
            is_met: residuals.iter().flatten().all(|r| r.abs() <= MET),
            residuals,
            simulations: self.simulations,
        }
    }
}
