//! Polynomial texture maps [Malzbender2001]: for each texel of the cloth and each colour, a
//! polynomial of second degree in the direction of the light, for a viewer above the cloth.

use crate::{Angles, MeasureError, Pair, PatchResponse, TexelGrid, measure_texture};
use glam::{DVec2, UVec2};
use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use organza_basis::Watch;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Terms of the polynomial in the light's components along weft and warp, `u` and `v`:
/// `u^2, v^2, u v, u, v, 1`.
pub const TERMS: usize = 6;

/// The fewest lamps: twice as many as terms, so that the residual says something.
pub const LEAST_LAMPS: u32 = 12;

/// The steepest lamp, degrees from the normal.
const RIM_DEG: f64 = 75.0;

/// A polynomial texture map. Values are radiance over that of a white diffuse sheet under light
/// along the normal.
#[derive(Clone, Debug, PartialEq)]
pub struct PolynomialMap {
    /// Texels in x and y.
    pub texels: UVec2,
    /// Coefficients of each texel, by channel and term, the row of the largest y first.
    pub coefficients: Vec<[[f32; TERMS]; 3]>,
    /// The same of polynomials whose values are display values: sRGB, 255 is white. They are
    /// fitted to what `coefficients` show at the lamps, and not to the measured values, whose
    /// noise would darken them: the display value of a mean is not the mean of display values.
    pub display_coefficients: Vec<[[f32; TERMS]; 3]>,
    /// Root of the mean squared difference between measured and fitted values.
    pub residual: f64,
    /// The part of the residual that the noise of the measurement explains.
    pub noise: f64,
    /// Mean of the measured values.
    pub mean: f64,
}

/// The work of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapEffort {
    /// Positions of the lamp, at least [`LEAST_LAMPS`].
    pub lamps: u32,
    /// Paths per texel and lamp, at least 2.
    pub paths: u64,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Lamps that fill the disk of the light's components evenly, out to 75 degrees: a sunflower
/// spiral, which turns by the golden angle.
fn lamps(count: u32) -> Vec<Angles> {
    let golden_rad = PI * (3.0 - 5f64.sqrt());
    let lamp = |k: u32| {
        let share = (f64::from(k) + 0.5) / f64::from(count);
        let sine = RIM_DEG.to_radians().sin() * share.sqrt();
        Angles::new(
            sine.asin().to_degrees(),
            (f64::from(k) * golden_rad).rem_euclid(TAU).to_degrees(),
        )
    };
    (0..count).map(lamp).collect()
}

/// The terms of the polynomial.
fn terms(lamp: &Angles) -> Vector6<f64> {
    let DVec2 { x: u, y: v } =
        DVec2::from_angle(lamp.phi_deg.to_radians()) * lamp.theta_deg.to_radians().sin();
    Vector6::new(u * u, v * v, u * v, u, v, 1.0)
}

/// The sRGB display value of a linear one, without a limit above.
fn display_value(linear: f64) -> f64 {
    let x = linear.max(0.0);
    if x <= 0.003_130_8 {
        255.0 * 12.92 * x
    } else {
        255.0 * (1.055 * x.powf(1.0 / 2.4) - 0.055)
    }
}

/// What lamps have added to a texel's channel so far.
#[derive(Clone, Copy, Default)]
struct Fit {
    coefficients: [f64; TERMS],
    square: f64,
    variance: f64,
    sum: f64,
}

/// Memory of a map while it is measured, bytes.
pub fn memory_bytes(texels: UVec2) -> u64 {
    let picture = size_of::<[f32; 6]>() * 2;
    let held = size_of::<[Fit; 3]>() + picture + 2 * size_of::<[[f32; TERMS]; 3]>();
    texels.as_u64vec2().element_product() * held as u64
}

/// Measures a map of the reflection that a viewer on the normal sees, lamp after lamp, and fits
/// the polynomials by least squares. `watch` gets the number of paths
/// traced since its last call.
///
/// # Errors
/// See [`MeasureError`].
///
/// # Panics
/// With fewer lamps than [`LEAST_LAMPS`].
pub fn measure_polynomial_map(
    patch: &impl PatchResponse,
    grid: &TexelGrid,
    effort: &MapEffort,
    watch: Watch<'_>,
) -> Result<PolynomialMap, MeasureError> {
    assert!(effort.lamps >= LEAST_LAMPS, "too few lamps");
    let lamps = lamps(effort.lamps);
    let rows: Vec<Vector6<f64>> = lamps.iter().map(terms).collect();
    let design = DMatrix::from_fn(rows.len(), TERMS, |r, c| rows[r][c]);
    // Every texel has the same lamps, so one inverse serves all. It exists: the lamps fill a disk.
    let solve = design
        .pseudo_inverse(0.0)
        .unwrap_or_else(|_| DMatrix::zeros(TERMS, rows.len()));
    let count = grid.texels.element_product();
    let mut fits = vec![[Fit::default(); 3]; count as usize];
    for (k, &incident) in lamps.iter().enumerate() {
        let exitant = Angles::NORMAL;
        let pair = Pair { incident, exitant };
        // Each lamp has random numbers of its own, so that the fit averages their noise.
        let seed = effort.seed.wrapping_add((k as u64) << 32);
        let picture = measure_texture(patch, pair, grid, effort.paths, seed, watch)?;
        // Of a BSDF: what a white diffuse sheet under light along the normal sends back is 1.
        let to_linear = PI * incident.theta_deg.to_radians().cos();
        let weights: Vector6<f64> = solve.column(k).fixed_rows::<TERMS>(0).into();
        for (fit, (mean, se)) in fits.iter_mut().zip(picture.mean.iter().zip(&picture.se)) {
            for (c, fit) in fit.iter_mut().enumerate() {
                let value = to_linear * f64::from(mean[c]);
                for (sum, weight) in fit.coefficients.iter_mut().zip(&weights) {
                    *sum += weight * value;
                }
                fit.sum += value;
                fit.square += value * value;
                fit.variance += (to_linear * f64::from(se[c])).powi(2);
            }
        }
    }
    Ok(fitted(grid.texels, &fits, &rows, &solve))
}

fn fitted(
    texels: UVec2,
    fits: &[[Fit; 3]],
    rows: &[Vector6<f64>],
    solve: &DMatrix<f64>,
) -> PolynomialMap {
    let normal: Matrix6<f64> = rows.iter().map(|t| t * t.transpose()).sum();
    let lamps = rows.len() as f64;
    let (mut left, mut noise, mut sum) = (0.0, 0.0, 0.0);
    for fit in fits.iter().flatten() {
        // A least-squares fit is orthogonal to its residual.
        let c = Vector6::from(fit.coefficients);
        left += (fit.square - c.dot(&(normal * c))).max(0.0);
        // The fit follows the noise with as many values as it has terms.
        noise += fit.variance * (1.0 - TERMS as f64 / lamps);
        sum += fit.sum;
    }
    let values = 3.0 * lamps * fits.len() as f64;
    let single = |c: [f64; TERMS]| c.map(|c| c as f32);
    let display = |fit: &Fit| {
        let linear = Vector6::from(fit.coefficients);
        let shown = rows.iter().map(|t| display_value(t.dot(&linear)));
        let shown = DVector::from_iterator(rows.len(), shown);
        let c = solve * shown;
        single(std::array::from_fn(|term| c[term]))
    };
    PolynomialMap {
        texels,
        coefficients: fits
            .iter()
            .map(|f| f.map(|f| single(f.coefficients)))
            .collect(),
        display_coefficients: fits.par_iter().map(|f| f.map(|f| display(&f))).collect(),
        residual: (left / values).sqrt(),
        noise: (noise / values).sqrt(),
        mean: sum / values,
    }
}
