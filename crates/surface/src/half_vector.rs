//! Sampling by half vectors. The model depends mostly on the half vector of a pair of
//! directions, so a table of the light that each half vector carries gives directions close to
//! the highlights of both warp and weft.

use glam::{Vec2, Vec3};
use organza_basis::PathRng;

/// Texels along each side of the table.
const SIDE: usize = 48;

/// A density over half vectors, constant on squares of their projection onto
/// the cloth.
#[derive(Debug)]
pub(crate) struct HalfVectorTable {
    /// Threshold and alias of each texel [Walker1977].
    alias: Vec<(f32, u32)>,
    /// Density over the unit square of the projection.
    density: Vec<f32>,
}

fn texel_middle(index: usize) -> Vec2 {
    let at = |i: usize| (2 * i + 1) as f32 / SIDE as f32 - 1.0;
    Vec2::new(at(index % SIDE), at(index / SIDE))
}

impl HalfVectorTable {
    /// Fits the table to `value(w_in, w_out)` for views `w_out`, which should be
    /// distributed as the cosine.
    pub fn new(views: &[Vec3], value: impl Fn(Vec3, Vec3) -> f32) -> HalfVectorTable {
        let mut mass = vec![0.0f32; SIDE * SIDE];
        for (index, mass) in mass.iter_mut().enumerate() {
            let p = texel_middle(index);
            let z2 = 1.0 - p.length_squared();
            if z2 <= 0.0 {
                continue;
            }
            let h = p.extend(z2.sqrt());
            for &w_out in views {
                let cos = w_out.dot(h);
                let w_in = 2.0 * cos * h - w_out;
                if cos > 0.0 && w_in.z > 0.0 {
                    // Light carried per area of the projection.
                    *mass += value(w_in, w_out) * w_in.z * 4.0 * cos / h.z;
                }
            }
        }
        let total: f32 = mass.iter().sum();
        let texel_area = 4.0 / (SIDE * SIDE) as f32;
        // Every texel gets a share, because the views may have missed light there.
        let even = 0.02 / (SIDE * SIDE) as f32;
        let share = |m: f32| {
            if total > 0.0 {
                even + 0.98 * m / total
            } else {
                1.0 / (SIDE * SIDE) as f32
            }
        };
        let shares: Vec<f32> = mass.into_iter().map(share).collect();
        HalfVectorTable {
            density: shares.iter().map(|s| s / texel_area).collect(),
            alias: alias_table(&shares),
        }
    }

    /// Draws `w_in`. A result below the horizon means that the draw failed.
    #[inline]
    pub fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Vec3 {
        let pick = rng.unit() * (SIDE * SIDE) as f32;
        let (threshold, alias) = self.alias[pick as usize];
        let index = if rng.unit() < threshold {
            pick as usize
        } else {
            alias as usize
        };
        let p = texel_middle(index) + (2.0 * rng.unit2() - Vec2::ONE) / SIDE as f32;
        let z2 = 1.0 - p.length_squared();
        if z2 <= 0.0 {
            return Vec3::NEG_Z;
        }
        let h = p.extend(z2.sqrt());
        let cos = w_out.dot(h);
        if cos <= 0.0 {
            return Vec3::NEG_Z;
        }
        2.0 * cos * h - w_out
    }

    /// Density of `w_in`, 1/sr; both directions above the horizon.
    #[inline]
    pub fn pdf(&self, w_in: Vec3, w_out: Vec3) -> f32 {
        let sum = w_in + w_out;
        let length = sum.length();
        // There is no half vector, so nothing is drawn.
        if length <= 0.0 {
            return 0.0;
        }
        let h = sum / length;
        let cell = |x: f32| (((x + 1.0) * 0.5 * SIDE as f32) as usize).min(SIDE - 1);
        // Solid angle to projected area, and half vector to direction: with
        // w_out.h half the length of the sum.
        self.density[cell(h.y) * SIDE + cell(h.x)] * h.z / (2.0 * length)
    }
}

/// Thresholds and aliases that draw index i with probability `shares[i]`.
fn alias_table(shares: &[f32]) -> Vec<(f32, u32)> {
    let n = shares.len();
    let total: f64 = shares.iter().map(|&s| f64::from(s)).sum();
    let scaled = shares.iter().map(|&s| f64::from(s) / total * n as f64);
    let mut scaled: Vec<f64> = scaled.collect();
    let mut table: Vec<(f32, u32)> = (0..n as u32).map(|i| (1.0, i)).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&i| scaled[i] < 1.0);
    while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
        small.pop();
        table[s] = (scaled[s] as f32, l as u32);
        scaled[l] -= 1.0 - scaled[s];
        if scaled[l] < 1.0 {
            large.pop();
            small.push(l);
        }
    }
    table
}
