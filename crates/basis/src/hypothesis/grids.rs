//! Domains that chi-square tests cut into cells.

use super::{Verdict, chi_square};
use crate::Frame;
use crate::quadrature::gauss_legendre;
use glam::Vec3;
use std::f64::consts::TAU;

/// A chi-square domain: the sphere, cut into cells by cosine and azimuth about
/// a pole.
///
/// Put the pole on the axis of a narrow lobe, or give cosine edges that follow
/// it; tilt it against the model's own axes to catch wrong frames.
#[derive(Clone, Debug)]
pub struct SphereGrid {
    frame: Frame,
    cosine_edges: Vec<f64>,
    azimuths: usize,
    norm_tolerance: f64,
}

/// How far the integral of a density may differ from one by default: single precision
/// carries about 1e-6, and a hundred parts in 10^6
/// are below what any test here could otherwise see.
const NORM_TOLERANCE: f64 = 1e-4;

impl SphereGrid {
    /// Equal cells about the unit vector `pole`.
    pub fn new(pole: Vec3, cosines: usize, azimuths: usize) -> SphereGrid {
        let edges = (0..=cosines)
            .map(|i| 2.0 * i as f64 / cosines as f64 - 1.0)
            .collect();
        SphereGrid::with_edges(pole, edges, azimuths)
    }

    /// Cells between rising cosines from -1 to 1.
    pub fn with_edges(pole: Vec3, cosine_edges: Vec<f64>, azimuths: usize) -> SphereGrid {
        SphereGrid {
            frame: Frame::from_normal(pole),
            cosine_edges,
            azimuths,
            norm_tolerance: NORM_TOLERANCE,
        }
    }

    /// Admits densities whose integral is known to stray from one by up to
    /// `tolerance` (1e-4 otherwise), because they are tabulated.
    pub fn admitting(mut self, tolerance: f64) -> SphereGrid {
        self.norm_tolerance = tolerance;
        self
    }

    fn direction(&self, polar: f64, turn: f64) -> Vec3 {
        let (sine, cosine) = polar.sin_cos();
        let (s, c) = (TAU * turn).sin_cos();
        let v = glam::DVec3::new(sine * c, sine * s, cosine);
        self.frame.world_from_frame(v.as_vec3())
    }

    fn cell(&self, w: Vec3) -> usize {
        let v = self.frame.frame_from_world(w);
        let row = self.cosine_edges[1..]
            .partition_point(|&edge| edge <= f64::from(v.z))
            .min(self.cosine_edges.len() - 2);
        let turn = (f64::from(v.y).atan2(f64::from(v.x)) / TAU).rem_euclid(1.0);
        let column = ((turn * self.azimuths as f64) as usize).min(self.azimuths - 1);
        row * self.azimuths + column
    }

    /// Integral of `f` over each cell, scaled by `scale`, and the accumulated
    /// estimate of its error; divides cells until that is a small part of the
    /// counting noise.
    fn integrals(&self, scale: f64, f: &mut dyn FnMut(Vec3) -> f64) -> (Vec<f64>, f64) {
        let mut error = 0.0;
        let mut cells = Vec::with_capacity((self.cosine_edges.len() - 1) * self.azimuths);
        for row in self.cosine_edges.windows(2) {
            for column in 0..self.azimuths {
                let turn = |k: usize| k as f64 / self.azimuths as f64;
                // Over the polar angle, in which densities that are infinite
                // along the pole stay tame.
                let polar = |cosine: f64| cosine.clamp(-1.0, 1.0).acos();
                let cell = [polar(row[1]), polar(row[0]), turn(column), turn(column + 1)];
                let (value, e) = integrate_cell(cell, scale * TAU, &mut |polar, turn| {
                    polar.sin() * f(self.direction(polar, turn))
                });
                cells.push(value);
                error += e;
            }
        }
        (cells, error)
    }

    /// Integral of `f` over the sphere, to about one part in 10^4 of what
    /// counting 10^6 samples would resolve in each cell.
    pub fn integrate(&self, mut f: impl FnMut(Vec3) -> f64) -> f64 {
        self.integrals(1e6, &mut f).0.iter().sum::<f64>() / 1e6
    }

    /// Tests that `sample` draws directions with density `pdf` per steradian.
    ///
    /// `None` from the sampler must happen as often as the density falls short
    /// of a unit integral. An integral above one, beyond quadrature error, is
    /// rejected outright (p-value zero), as is a shortfall that never shows.
    pub fn chi_square(
        &self,
        samples: u32,
        mut sample: impl FnMut() -> Option<Vec3>,
        mut pdf: impl FnMut(Vec3) -> f64,
    ) -> Verdict {
        let n = f64::from(samples);
        let (mut expected, error) = self.integrals(n, &mut pdf);
        let mut observed = vec![0u64; expected.len() + 1];
        for _ in 0..samples {
            let cell = sample().map_or(expected.len(), |w| self.cell(w));
            observed[cell] += 1;
        }
        close(&mut expected, &observed, n, error + self.norm_tolerance * n)
    }
}

/// A chi-square domain: an interval cut into equal cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineGrid {
    /// Lower end.
    pub from: f64,
    /// Upper end.
    pub to: f64,
    /// Number of cells.
    pub cells: usize,
}

impl LineGrid {
    /// Tests that `sample` draws numbers with density `pdf`; see
    /// [`SphereGrid::chi_square`]. Numbers outside the interval count as `None`.
    pub fn chi_square(
        &self,
        samples: u32,
        mut sample: impl FnMut() -> Option<f64>,
        mut pdf: impl FnMut(f64) -> f64,
    ) -> Verdict {
        let n = f64::from(samples);
        let width = (self.to - self.from) / self.cells as f64;
        let mut error = 0.0;
        let mut expected: Vec<f64> = (0..self.cells)
            .map(|i| {
                let a = self.from + width * i as f64;
                let (value, e) = integrate_cell([a, a + width, 0.0, 1.0], n, &mut |u, _| pdf(u));
                error += e;
                value
            })
            .collect();
        let mut observed = vec![0u64; self.cells + 1];
        for _ in 0..samples {
            let inside = sample().filter(|x| (self.from..=self.to).contains(x));
            let cell = inside.map_or(self.cells, |x| {
                (((x - self.from) / width) as usize).min(self.cells - 1)
            });
            observed[cell] += 1;
        }
        close(&mut expected, &observed, n, error + NORM_TOLERANCE * n)
    }
}

/// Adds the cell of draws that returned `None`, and tests.
fn close(expected: &mut Vec<f64>, observed: &[u64], n: f64, tolerance: f64) -> Verdict {
    let missing = n - expected.iter().sum::<f64>();
    if missing < -tolerance || missing.is_nan() {
        return Verdict {
            statistic: f64::INFINITY,
            degrees: expected.len() as f64,
            p_value: 0.0,
        };
    }
    expected.push(if missing > tolerance { missing } else { 0.0 });
    chi_square(observed, expected)
}

/// Integral over a rectangle `[u0, u1, v0, v1]` times `scale`, with an estimate
/// of its error, by halving until the error is a twentieth of the counting
/// noise of the rectangle that was asked for.
fn integrate_cell(cell: [f64; 4], scale: f64, f: &mut dyn FnMut(f64, f64) -> f64) -> (f64, f64) {
    let rule = gauss_legendre(4);
    let mut once = |[u0, u1, v0, v1]: [f64; 4]| {
        let mut sum = 0.0;
        for &(x, wx) in &rule {
            for &(y, wy) in &rule {
                let u = 0.5 * (u0 + u1) + 0.5 * (u1 - u0) * x;
                let v = 0.5 * (v0 + v1) + 0.5 * (v1 - v0) * y;
                sum += wx * wy * f(u, v);
            }
        }
        0.25 * (u1 - u0) * (v1 - v0) * scale * sum
    };
    let whole = once(cell);
    let mut pending = vec![(cell, whole, 0u32)];
    let (mut total, mut error) = (0.0, 0.0);
    while let Some(([u0, u1, v0, v1], rough, depth)) = pending.pop() {
        let (um, vm) = (0.5 * (u0 + u1), 0.5 * (v0 + v1));
        let parts = [
            [u0, um, v0, vm],
            [um, u1, v0, vm],
            [u0, um, vm, v1],
            [um, u1, vm, v1],
        ]
        .map(|part| (part, once(part)));
        let fine: f64 = parts.iter().map(|p| p.1).sum();
        let allowed = 0.05 * whole.abs().max(1.0).sqrt() * 0.5f64.powi(depth as i32);
        if (fine - rough).abs() <= allowed || depth >= 7 {
            total += fine;
            // Halving gains a factor of more than ten on anything smooth.
            error += 0.1 * (fine - rough).abs();
        } else {
            pending.extend(parts.map(|(part, value)| (part, value, depth + 1)));
        }
    }
    (total, error)
}
