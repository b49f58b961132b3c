//! Separable smoothing of boxes of grey values.

use rayon::prelude::*;

/// Where a Gaussian is cut, in deviations: beyond lies a part in 400 of its weight.
const CUT: f32 = 3.0;

/// A Gaussian of this deviation in voxels, cut and of sum one: `2 radius + 1` weights. No
/// smoothing for a deviation of zero.
pub(crate) fn gaussian(sigma: f32) -> Vec<f32> {
    let radius = (CUT * sigma).ceil() as i32;
    let weight = |i: i32| (-0.5 * (i as f32 / sigma).powi(2)).exp();
    if radius == 0 {
        return vec![1.0];
    }
    let weights: Vec<f32> = (-radius..=radius).map(weight).collect();
    let sum: f32 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

/// Voxels that a kernel reaches to either side.
pub(crate) fn reach(kernel: &[f32]) -> usize {
    kernel.len() / 2
}

/// A box of values, x fastest, then y, z.
#[derive(Clone, Debug)]
pub(crate) struct ValueBox {
    pub dims: [usize; 3],
    pub data: Vec<f32>,
}

impl ValueBox {
    pub fn zeros(dims: [usize; 3]) -> ValueBox {
        ValueBox {
            dims,
            data: vec![0.0; dims.iter().product()],
        }
    }

    pub fn index(&self, x: usize, y: usize, z: usize) -> usize {
        x + self.dims[0] * (y + self.dims[1] * z)
    }

    /// Smoothed by one kernel per axis. The result is smaller by the reach of each kernel at
    /// both ends, so that no value depends on what lies outside.
    pub fn smoothed(&self, kernels: [&[f32]; 3]) -> ValueBox {
        self.along_z(kernels[2])
            .along_y(kernels[1])
            .along_x(kernels[0])
    }

    fn along_z(&self, kernel: &[f32]) -> ValueBox {
        let [nx, ny, nz] = self.dims;
        let mut out = ValueBox::zeros([nx, ny, nz + 1 - kernel.len()]);
        let plane = nx * ny;
        for (z, o) in out.data.chunks_exact_mut(plane).enumerate() {
            for (k, &w) in kernel.iter().enumerate() {
                add(o, &self.data[(z + k) * plane..][..plane], w);
            }
        }
        out
    }

    fn along_y(&self, kernel: &[f32]) -> ValueBox {
        let [nx, ny, nz] = self.dims;
        let my = ny + 1 - kernel.len();
        let mut out = ValueBox::zeros([nx, my, nz]);
        let planes = self.data.chunks_exact(nx * ny);
        for (o, plane) in out.data.chunks_exact_mut(nx * my).zip(planes) {
            for (k, &w) in kernel.iter().enumerate() {
                add(o, &plane[k * nx..][..nx * my], w);
            }
        }
        out
    }

    fn along_x(&self, kernel: &[f32]) -> ValueBox {
        let [nx, ny, nz] = self.dims;
        let mx = nx + 1 - kernel.len();
        let mut out = ValueBox::zeros([mx, ny, nz]);
        let rows = self.data.chunks_exact(nx);
        for (o, row) in out.data.chunks_exact_mut(mx).zip(rows) {
            for (k, &w) in kernel.iter().enumerate() {
                add(o, &row[k..][..mx], w);
            }
        }
        out
    }
}

fn add(to: &mut [f32], from: &[f32], weight: f32) {
    for (o, v) in to.iter_mut().zip(from) {
        *o += weight * v;
    }
}

/// Smooths the slices of a window along x and y, in place; values beyond an edge equal those
/// at the edge.
pub(crate) fn smooth_slices(data: &mut [f32], nx: usize, ny: usize, kernels: [&[f32]; 2]) {
    data.par_chunks_mut(nx * ny).for_each(|slice| {
        let mut line = Vec::new();
        let r = reach(kernels[0]);
        if r > 0 {
            for row in slice.chunks_exact_mut(nx) {
                line.clear();
                line.extend((0..nx + 2 * r).map(|i| row[i.saturating_sub(r).min(nx - 1)]));
                row.fill(0.0);
                for (k, &w) in kernels[0].iter().enumerate() {
                    add(row, &line[k..][..nx], w);
                }
            }
        }
        let r = reach(kernels[1]);
        if r > 0 {
            let before = slice.to_vec();
            slice.fill(0.0);
            for (y, row) in slice.chunks_exact_mut(nx).enumerate() {
                for (k, &w) in kernels[1].iter().enumerate() {
                    let from = (y + k).saturating_sub(r).min(ny - 1);
                    add(row, &before[from * nx..][..nx], w);
                }
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_have_their_deviation_and_smoothing_keeps_a_slope() {
        for sigma in [0.7f32, 1.0, 2.5] {
            let g = gaussian(sigma);
            let r = reach(&g) as f32;
            let variance: f32 = g
                .iter()
                .zip(0..)
                .map(|(w, i)| w * (i as f32 - r).powi(2))
                .sum();
            // The cut takes up to 3 % of the variance.
            let share = variance / (sigma * sigma);
            assert!((0.95..1.02).contains(&share), "{sigma}: {share}");
        }
        let mut b = ValueBox::zeros([12, 11, 10]);
        for z in 0..10 {
            for y in 0..11 {
                for x in 0..12 {
                    let i = b.index(x, y, z);
                    b.data[i] = x as f32 + 10.0 * y as f32 + 100.0 * z as f32;
                }
            }
        }
        let kernels = [0.5, 0.7, 1.0].map(gaussian);
        let out = b.smoothed([&kernels[0], &kernels[1], &kernels[2]]);
        assert_eq!(out.dims, [8, 5, 4]);
        for (x, y, z) in [(0, 0, 0), (7, 4, 3), (3, 2, 1)] {
            let want = (x + 2) as f32 + 10.0 * (y + 3) as f32 + 100.0 * (z + 3) as f32;
            assert!((out.data[out.index(x, y, z)] - want).abs() < 1e-3);
        }
    }
}
