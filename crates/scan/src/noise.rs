//! The noise of a scan, and what the orientation says of noise alone: the distribution that fibre
//! must differ from.

use crate::levels::Levels;
use crate::orientation::{Core, Scales, analyse};
use crate::smooth::{ValueBox, gaussian, reach};
use crate::window::Window;
use glam::{DVec3, Vec3};
use organza_basis::PathRng;

/// Radius of the grains of smoothed noise, in deviations of the Gaussian that smoothed it.
///
/// The survey measures 1.3 to 1.8 as radius of fibre in noise that was smoothed over 0.7 to 5
/// voxels.
const GRAIN_RADII: f32 = 1.6;

/// Edge of the noise's core, and the greatest edge with what the filters reach, voxels.
const CORE: usize = 24;
const WHOLE: usize = 96;

/// Seed of the noise.
const SEED: u64 = 1;

/// Deviation of the noise: grey values below that of air are nothing else.
pub(crate) fn deviation(window: &Window, air: f32) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0u64);
    for v in window.data.iter().filter(|v| **v < air) {
        sum += f64::from(v - air).powi(2);
        count += 1;
    }
    (sum / count.max(1) as f64).sqrt() as f32
}

/// Sorted residues (least eigenvalue over the trace) of smoothed Gaussian noise, whose grains
/// are as wide as fibres of a radius and lie on both sides of the threshold.
pub(crate) fn residues(
    levels: &Levels,
    scales: &Scales,
    voxel_mm: DVec3,
    radius_mm: f32,
) -> Vec<f32> {
    let margin = scales.reach().into_iter().max().unwrap_or(0);
    let edge = (CORE + 2 * margin).min(WHOLE);
    let sigma = Vec3::splat(radius_mm / GRAIN_RADII) / voxel_mm.as_vec3();
    let kernels = sigma.min(Vec3::splat(8.0)).to_array().map(gaussian);
    let around = [0, 1, 2].map(|a| reach(&kernels[a]));
    let mut noise = ValueBox::zeros(around.map(|r| edge + 2 * r));
    let mut rng = PathRng::from_seed(SEED);
    noise.data.fill_with(|| rng.normal2().x);
    let [x, y, z] = &kernels;
    let mut data = noise.smoothed([x, y, z]).data;
    let square: f64 = data.iter().map(|v| f64::from(*v).powi(2)).sum();
    let deviation = (square / data.len() as f64).sqrt() as f32;
    let contrast = levels.threshold - levels.air;
    for v in &mut data {
        *v = levels.threshold + contrast / deviation * *v;
    }
    let window = Window {
        first: 0,
        nx: edge,
        ny: edge,
        nz: edge,
        data,
    };
    let cut = (edge - CORE) / 2;
    let core = Core {
        x: cut,
        y: cut,
        z: cut as i64,
        size: [CORE; 3],
    };
    let mut found = analyse(&window, core, levels, scales, 0.0).residues;
    found.sort_by(f32::total_cmp);
    found
}
