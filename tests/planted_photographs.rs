//! Planted photographs: organza's own pictures of a cloth, blurred and with noise.

use crate::program::{exr_channels, succeed};
use organza_testing::sized;
use std::path::Path;

/// Value of white paper in the pictures.
const WHITE: f64 = 0.8;
/// Standard deviation of the noise, as a share of each pixel.
const NOISE: f32 = 0.03;
/// How photographs are taken.
#[derive(Clone, Copy)]
pub struct Camera {
    /// Directions towards the lamps in front and behind, degrees, as the photograph has them.
    pub lights: [[f64; 2]; 2],
    /// Distances of camera and lamps from the middle of the cloth; parallel rays if none.
    pub near_mm: Option<f64>,
    /// By how much the cloth is turned counter-clockwise in the photograph, degrees.
    pub turn_deg: f64,
    /// Brightness in the corners as a share of the middle, in proportion to the square of the distance.
    pub corners: f64,
}

/// Parallel light and rays, and a lens that darkens nothing.
pub const DISTANT: Camera = Camera {
    lights: [[30.0, 45.0], [150.0, 45.0]],
    near_mm: None,
    turn_deg: 0.0,
    corners: 1.0,
};

/// A number from 0 to 1 that seed and place decide.
pub fn uniform(seed: u64, i: u64) -> f32 {
    let mut z = (seed << 40 ^ i).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ z >> 31) >> 40) as f32 / (1u64 << 24) as f32
}

/// About normal, of variance one.
fn normal(seed: u64, i: u64) -> f32 {
    let sum: f32 = (0..12).map(|k| uniform(seed, 12 * i + k)).sum();
    sum - 6.0
}

/// Writes rows of linear colours, the top row first.
pub fn write(path: &Path, [width, height]: [usize; 2], rows: &[[f32; 3]]) {
    let pixel = |x: usize, y: usize| {
        let [r, g, b] = rows[y * width + x].map(|v| v.max(0.0));
        (r, g, b)
    };
    exr::prelude::write_rgb_file(path, width, height, pixel).unwrap();
}

/// A direction from angles in degrees.
fn direction([theta, phi]: [f64; 2]) -> [f64; 3] {
    let (st, ct) = theta.to_radians().sin_cos();
    let (sp, cp) = phi.to_radians().sin_cos();
    [st * cp, st * sp, ct]
}

impl Camera {
    /// Photographs of `truth.toml` in a folder, as `front.exr` and, of two sides, `back.exr`: rendered
    /// without the cache of radiance, whose error a fit would take for texture, then darkened,
    /// blurred and with noise.
    pub fn photograph(
        &self,
        folder: &Path,
        sides: usize,
        size_mm: [f64; 2],
        size: [usize; 2],
        seed: u64,
    ) {
        let middle = size_mm.map(|s| 0.5 * s);
        let far_mm = self.near_mm.unwrap_or(100.0);
        let kind = match self.near_mm {
            None => format!("kind = \"orthographic\"\nwidth_mm = {}", size_mm[0]),
            Some(d) => {
                let fov = 2.0 * (middle[0] / d).atan().to_degrees();
                format!("kind = \"perspective\"\nfov_deg = {fov}")
            }
        };
        // The cloth lies along the axes, so the camera is turned.
        let up = direction([90.0, 90.0 - self.turn_deg]);
        for (k, name) in ["front", "back"][..sides].iter().enumerate() {
            let [theta, phi] = self.lights[k];
            let towards = direction([theta, phi - self.turn_deg]);
            // White paper in the middle has the stated value.
            let strength = std::f64::consts::PI * WHITE / towards[2].abs();
            let light = match self.near_mm {
                None => format!(
                    "kind = \"directional\"\ndirection = {:?}\nirradiance = {:?}",
                    towards.map(|v| -v),
                    [strength; 3]
                ),
                Some(d) => {
                    let [x, y, z] = towards.map(|v| v * d);
                    format!(
                        "kind = \"spot\"\nposition_mm = {:?}\nintensity = {:?}",
                        [x + middle[0], y + middle[1], z],
                        [strength * d * d; 3]
                    )
                }
            };
            let scene = format!(
                "[render]\nspp = {}\nseed = {}\ncache = \"off\"\n\
                 [camera]\n{kind}\norigin_mm = {:?}\ntarget_mm = {:?}\nup = {up:?}\n\
                 resolution = {size:?}\nfilter = \"box\"\n[[light]]\n{light}\n\
                 [[object]]\nkind = \"cloth\"\nfabric = \"truth.toml\"\nmodel = \"fibres\"\n",
                sized(24, 80),
                seed + k as u64,
                [middle[0], middle[1], far_mm],
                [middle[0], middle[1], 0.0],
            );
            std::fs::write(folder.join("scene.toml"), scene).unwrap();
            let picture = format!("{name}.clean.exr");
            succeed(folder, &["render", "scene.toml", "-o", &picture, "--quiet"]);
            let channels = exr_channels(&folder.join(&picture));
            let clean = ["R", "G", "B"].map(|c| &channels[c][..]);
            let rows = self.seen(clean, size, seed + 10 + k as u64);
            write(&folder.join(format!("{name}.exr")), size, &rows);
        }
    }

    /// Rows of a picture through the lens, blurred and with noise.
    fn seen(&self, clean: [&[f32]; 3], [w, h]: [usize; 2], seed: u64) -> Vec<[f32; 3]> {
        let value = |k: usize| {
            let (x, y) = ((k % w) as i64, (k / w) as i64);
            let mut sum = [0.0f32; 3];
            for (dy, v) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
                for (dx, u) in [(-1, 0.25), (0, 0.5), (1, 0.25)] {
                    let i = (x + dx).clamp(0, w as i64 - 1);
                    let j = (y + dy).clamp(0, h as i64 - 1);
                    let at = j as usize * w + i as usize;
                    (0..3).for_each(|c| sum[c] += u * v * clean[c][at]);
                }
            }
            let from_middle = [
                x as f64 + 0.5 - 0.5 * w as f64,
                y as f64 + 0.5 - 0.5 * h as f64,
            ];
            let square =
                (from_middle[0].powi(2) + from_middle[1].powi(2)) / (0.25 * (w * w + h * h) as f64);
            let lens = (1.0 + (self.corners - 1.0) * square) as f32;
            std::array::from_fn(|c| {
                sum[c] * lens * (1.0 + NOISE * normal(seed, (3 * k + c) as u64))
            })
        };
        (0..w * h).map(value).collect()
    }
}
