//! Consecutive slices of a volume in memory, free of noise.

use crate::input::Slices;
use crate::smooth::{gaussian, reach, smooth_slices};
use crate::{Denoise, ScanError};
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Slices `first .. first + count` of a volume after its noise filter, where slices before the
/// first and after the last equal those.
pub(crate) struct Window {
    pub first: i64,
    pub nx: usize,
    pub ny: usize,
    /// Slices of the whole volume.
    pub nz: usize,
    pub data: Vec<f32>,
}

/// Slices that the noise filter reaches to either side.
fn filter_reach(denoise: Denoise) -> usize {
    match denoise {
        Denoise::None => 0,
        Denoise::Gaussian(sigma) => reach(&gaussian(sigma)),
        Denoise::Median => 1,
    }
}

/// Bytes that reading `count` slices takes: the slices with those that the filter needs, and the
/// filtered ones.
pub(crate) fn window_bytes(nx: u32, ny: u32, count: usize, denoise: Denoise) -> u64 {
    let slices = match filter_reach(denoise) {
        0 => count,
        r => 2 * count + 2 * r,
    };
    u64::from(nx) * u64::from(ny) * 4 * slices as u64
}

impl Window {
    /// Reads and filters slices; `range` may leave the volume at both ends.
    ///
    /// # Errors
    /// Those of the reader, and values that are not finite.
    pub fn read(
        slices: &mut dyn Slices,
        range: Range<i64>,
        denoise: Denoise,
    ) -> Result<Window, ScanError> {
        let shape = slices.shape();
        let (nx, ny) = (shape.dims.x as usize, shape.dims.y as usize);
        let (plane, nz) = (nx * ny, i64::from(shape.dims.z));
        let r = filter_reach(denoise);
        let first = range.start - r as i64;
        let count = (range.end - range.start) as usize;
        let mut raw = vec![0.0f32; plane * (count + 2 * r)];
        let mut last_read = None;
        for i in 0..count + 2 * r {
            let z = (first + i as i64).clamp(0, nz - 1) as u32;
            let (before, rest) = raw.split_at_mut(i * plane);
            let slice = &mut rest[..plane];
            if last_read == Some(z) {
                slice.copy_from_slice(&before[(i - 1) * plane..]);
                continue;
            }
            slices.read(z, slice)?;
            if let Some(at) = slice.iter().position(|v| !v.is_finite()) {
                return Err(ScanError::Content(format!(
                    "slice {}, row {}, column {}: the value is {}; expected finite numbers",
                    z + 1,
                    at / nx + 1,
                    at % nx + 1,
                    slice[at]
                )));
            }
            last_read = Some(z);
        }
        let data = match denoise {
            Denoise::None => raw,
            Denoise::Gaussian(_) if r == 0 => raw,
            Denoise::Gaussian(sigma) => {
                let kernel = gaussian(sigma);
                smooth_slices(&mut raw, nx, ny, [&kernel, &kernel]);
                let mut out = vec![0.0f32; plane * count];
                out.par_chunks_mut(plane).enumerate().for_each(|(z, o)| {
                    for (k, &w) in kernel.iter().enumerate() {
                        let from = &raw[(z + k) * plane..][..plane];
                        for (o, v) in o.iter_mut().zip(from) {
                            *o += w * v;
                        }
                    }
                });
                out
            }
            Denoise::Median => {
                let mut out = vec![0.0f32; plane * count];
                out.par_chunks_mut(plane)
                    .enumerate()
                    .for_each(|(z, o)| median_slice(&raw[z * plane..][..3 * plane], nx, ny, o));
                out
            }
        };
        Ok(Window {
            first: range.start,
            nx,
            ny,
            nz: nz as usize,
            data,
        })
    }

    /// Number of slices.
    pub fn count(&self) -> usize {
        self.data.len() / (self.nx * self.ny)
    }

    /// The value of a voxel of the window.
    pub fn voxel(&self, p: IVec3) -> Option<f32> {
        let z = i64::from(p.z) - self.first;
        let is_inside = p.x >= 0 && p.y >= 0 && z >= 0;
        let (x, y) = (p.x as usize, p.y as usize);
        if !is_inside || x >= self.nx || y >= self.ny {
            return None;
        }
        self.data
            .get(x + self.nx * (y + self.ny * z as usize))
            .copied()
    }

    /// The value at a place in voxels, where voxel centres have whole coordinates, by linear
    /// interpolation; `None` outside the slices.
    pub fn at(&self, p: Vec3) -> Option<f32> {
        let z = p.z - self.first as f32;
        let (x, y) = (p.x, p.y);
        let most = [self.nx - 1, self.ny - 1, self.count() - 1];
        if !(x >= 0.0 && y >= 0.0 && z >= 0.0)
            || x > most[0] as f32
            || y > most[1] as f32
            || z > most[2] as f32
        {
            return None;
        }
        let (i, j, k) = (x as usize, y as usize, z as usize);
        let (fx, fy, fz) = (x - i as f32, y - j as f32, z - k as f32);
        // Steps to the neighbours, none at the far border. This is where a survey spends its time.
        let dx = usize::from(i < most[0]);
        let dy = self.nx * usize::from(j < most[1]);
        let dz = self.nx * self.ny * usize::from(k < most[2]);
        let at = i + self.nx * (j + self.ny * k);
        let v = &self.data[at..=at + dx + dy + dz];
        let a = v[0] + fx * (v[dx] - v[0]);
        let b = v[dy] + fx * (v[dy + dx] - v[dy]);
        let c = v[dz] + fx * (v[dz + dx] - v[dz]);
        let d = v[dz + dy] + fx * (v[dz + dy + dx] - v[dz + dy]);
        let (low, high) = (a + fy * (b - a), c + fy * (d - c));
        Some(low + fz * (high - low))
    }
}

/// The medians of 3 x 3 x 3 values of the middle of three slices.
fn median_slice(three: &[f32], nx: usize, ny: usize, out: &mut [f32]) {
    let plane = nx * ny;
    for y in 0..ny {
        for x in 0..nx {
            let mut values = [0.0f32; 27];
            let mut n = 0;
            for dz in 0..3 {
                for dy in 0..3usize {
                    let row = (y + dy).saturating_sub(1).min(ny - 1);
                    for dx in 0..3usize {
                        let column = (x + dx).saturating_sub(1).min(nx - 1);
                        values[n] = three[dz * plane + row * nx + column];
                        n += 1;
                    }
                }
            }
            out[y * nx + x] = *values.select_nth_unstable_by(13, f32::total_cmp).1;
        }
    }
}
