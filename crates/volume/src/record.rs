//! How a population and a brick of voxels are stored.
//!
//! One population takes 12 bytes:
//! - `length`: an integer count of the octree's length quantum, so that sums over voxels are
//!   exact and every level holds the same total. The quantum is chosen so that the length in
//!   the fullest block or coarsest voxel fits into 32 bits.
//! - `direction`: the axis on an octahedral grid of 4095 x 4095 steps over the half sphere
//!   (within 0.0006 rad), and in the top 8 bits the square root of the mean squared sine in 255
//!   steps up to its greatest value sqrt(1/2): a narrow spread is exact to 0.0014 rad.
//! - `population`: 20 bits name the yarn and material, 12 bits the radius in equal steps
//!   between the least and greatest of the tile (a single radius is exact; in a range of 1 : 10
//!   the least is exact to 0.11 %).

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use organza_basis::spread::{MAX_SPREAD_RAD, mean_cos_sq, spread_from_mean_sin_sq};
use std::sync::LazyLock;

/// Steps of an octahedral coordinate: even, so that the coordinate axes and
/// their diagonals are exact.
const AXIS_STEPS: f32 = 4094.0;
const SPREAD_STEPS: f32 = 255.0;
const RADIUS_STEPS: f32 = 4095.0;
/// Maximum number of pairs of yarn and material.
pub const MAX_GROUPS: usize = 1 << 20;

/// One population, quantised.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct StoredPopulation {
    /// Fibre length in quanta.
    pub length: u32,
    /// Axis (low 24 bits) and spread (high 8).
    pub direction: u32,
    /// Group (low 20 bits) and radius (high 12).
    pub population: u32,
}

/// 4 x 4 x 4 voxels: bit `x + 4 y + 16 z` of `masks[k]` is set when that voxel has more than
/// `k` populations. The populations of the brick are stored voxel by voxel from `first` on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Brick {
    /// Which voxels have more than k populations.
    pub masks: [u64; 4],
    /// Index of the first population.
    pub first: u32,
    /// Bound of the broadside extinction of every finest voxel below, 1/mm.
    pub majorant_per_mm: f32,
}

impl Brick {
    /// Indices of the populations of the voxel with this bit number.
    #[inline]
    pub fn records_of(&self, bit: u32) -> std::ops::Range<usize> {
        let below = (1u64 << bit) - 1;
        let mut before = 0;
        let mut count = 0;
        for mask in self.masks {
            before += (mask & below).count_ones();
            count += (mask >> bit) as u32 & 1;
        }
        let start = self.first as usize + before as usize;
        start..start + count as usize
    }
}

/// Root mean squared sine of the widest population.
static WIDEST_SINE: LazyLock<f32> = LazyLock::new(|| (1.0 - mean_cos_sq(MAX_SPREAD_RAD)).sqrt());

/// Spread for each of its 256 codes.
static SPREAD_OF_CODE: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let u = code as f32 / SPREAD_STEPS * *WIDEST_SINE;
        spread_from_mean_sin_sq(u * u)
    })
});

/// Packs a unit axis and the mean squared sine about it.
pub fn encode_direction(axis: Vec3, mean_sin_sq: f32) -> u32 {
    let n = if axis.z < 0.0 { -axis } else { axis };
    let p = n.truncate() / (n.x.abs() + n.y.abs() + n.z);
    // Every processor casts in one instruction; on older ones rounding is a function call.
    let code = |u: f32| (0.5 * (u + 1.0) * AXIS_STEPS + 0.5).clamp(0.0, AXIS_STEPS) as u32;
    let spread = mean_sin_sq.max(0.0).sqrt() / *WIDEST_SINE * SPREAD_STEPS + 0.5;
    code(p.x + p.y) | code(p.x - p.y) << 12 | (spread.min(SPREAD_STEPS) as u32) << 24
}

/// Unit axis, with z >= 0.
#[inline]
pub fn decode_axis(direction: u32) -> Vec3 {
    let coordinate = |code: u32| code as f32 * (2.0 / AXIS_STEPS) - 1.0;
    let (u, v) = (
        coordinate(direction & 0xfff),
        coordinate(direction >> 12 & 0xfff),
    );
    let (x, y) = (0.5 * (u + v), 0.5 * (u - v));
    Vec3::new(x, y, 1.0 - x.abs() - y.abs()).normalize()
}

/// False for codes that [`encode_direction`] never returns.
pub fn is_valid_direction(direction: u32) -> bool {
    let most = AXIS_STEPS as u32;
    direction & 0xfff <= most && direction >> 12 & 0xfff <= most
}

/// Spread in radians.
#[inline]
pub fn decode_spread(direction: u32) -> f32 {
    SPREAD_OF_CODE[(direction >> 24) as usize]
}

/// The scale of radii in a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiusScale {
    /// Least radius.
    pub min_mm: f32,
    /// Difference of neighbouring codes.
    pub step_mm: f32,
}

impl RadiusScale {
    /// The scale for radii between two values.
    pub fn new(min_mm: f32, max_mm: f32) -> RadiusScale {
        RadiusScale {
            min_mm,
            step_mm: (max_mm - min_mm).max(0.0) / RADIUS_STEPS,
        }
    }

    /// Packs group and radius.
    pub fn encode(&self, group: u32, radius_mm: f32) -> u32 {
        // Zero over zero is NaN, which becomes code 0.
        let code = (radius_mm - self.min_mm) / self.step_mm + 0.5;
        group | (code.clamp(0.0, RADIUS_STEPS) as u32) << 20
    }

    /// Radius in millimetres.
    #[inline]
    pub fn decode(&self, population: u32) -> f32 {
        self.min_mm + (population >> 20) as f32 * self.step_mm
    }
}

/// Index of the yarn and material.
#[inline]
pub fn decode_group(population: u32) -> usize {
    (population & 0xf_ffff) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::{PathRng, warp};

    #[test]
    fn axes_are_kept_within_the_stated_angle() {
        let mut rng = PathRng::from_seed(4);
        let mut worst = 0.0f32;
        for _ in 0..200_000 {
            let a = warp::uniform_sphere(rng.unit2());
            let b = decode_axis(encode_direction(a, 0.0));
            worst = worst.max(a.cross(b).length());
        }
        assert!(worst < 6e-4, "seed 4: {worst}");
        for a in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Z] {
            assert!(decode_axis(encode_direction(a, 0.0)).cross(a).length() <= 2.0 * f32::EPSILON);
        }
    }

    #[test]
    fn spreads_are_kept_within_the_stated_angle() {
        for i in 0..1000 {
            let s = 0.5 * i as f32 / 1000.0;
            let back = decode_spread(encode_direction(Vec3::X, 1.0 - mean_cos_sq(s)));
            // The slope ds/du grows from 1 for narrow spreads to 2 at s = 0.5.
            let most = 1.4e-3 * (1.0 + 4.0 * s * s) + 3e-4;
            assert!((back - s).abs() < most, "{s} {back}");
        }
        assert_eq!(decode_spread(encode_direction(Vec3::Y, 0.0)), 0.0);
        let widest = decode_spread(encode_direction(Vec3::Y, 2.0 / 3.0));
        assert!((widest - MAX_SPREAD_RAD).abs() < 1e-3);
    }

    #[test]
    fn radii_are_kept_within_the_stated_share() {
        let one = RadiusScale::new(0.0071, 0.0071);
        assert_eq!(one.decode(one.encode(5, 0.0071)), 0.0071);
        let scale = RadiusScale::new(0.001, 0.01);
        for i in 0..=1000 {
            let r = 0.001 + 9e-6 * i as f32;
            let p = scale.encode(77, r);
            assert!((scale.decode(p) / r - 1.0).abs() < 1.2e-3);
            assert_eq!(decode_group(p), 77);
        }
        let none = RadiusScale::new(0.0, 0.0);
        assert_eq!(none.decode(none.encode(0, 0.0)), 0.0);
    }
}
