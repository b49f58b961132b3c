//! The maps of a tile, from paths that look straight down on every texel.

use crate::relief::{slopes, smooth, smooth_mean};
use crate::texel::Texel;
use glam::{UVec2, Vec2, Vec3};
use organza_basis::PathRng;
use organza_measure::{LookSums, TexelGrid};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// The steepest slope of the relief: a surface that is tilted by 63 degrees.
const MAX_SLOPE: f32 = 2.0;

/// Standard deviation of the smoothing of colours and directions, texels: noise of single
/// texels is halved, and no thread is blurred.
const COLOUR_SIGMA: f32 = 0.7;

/// The same of hues and of gloss, which few paths determine.
const HUE_SIGMA: f32 = 2.0;

/// The gloss that is kept as one, as a multiple of its mean. More is rare.
const MOST_GLOSS: f64 = 1.25;

/// Least transmitted share of light: less would leave no hue.
const MIN_SHARE: f32 = 1e-4;

/// Share of the mean colour in the hue of a texel that lets hardly any light through.
const MEAN_HUE: f32 = 0.3;

/// Memory that maps of one texel take while they are made and written, bytes; an upper bound.
pub const BYTES_PER_TEXEL: u64 = 400;

/// The maps of one repeat.
#[derive(Clone, Debug)]
pub struct Maps {
    /// Texels in x and y.
    pub size: UVec2,
    /// Extent of the repeat, mm.
    pub tile_mm: Vec2,
    /// Texels, the row of the largest y first.
    pub texels: Vec<Texel>,
    /// Height of the visible surface over the middle plane, mm, as smooth as the normals.
    pub height_mm: Vec<f32>,
}

impl Maps {
    /// Maps of what paths found. Slopes are those of the height map after smoothing by a
    /// Gaussian of standard deviation `smoothing_mm`, so that normals follow threads and not
    /// single fibres, whose normals are the roughness of the models.
    pub fn new(looks: &[LookSums], grid: &TexelGrid, smoothing_mm: f32) -> Maps {
        let size = grid.texels;
        let texel_mm = grid.size_mm / size.as_vec2();
        let plane = |value: &dyn Fn(&LookSums) -> f32| looks.iter().map(value).collect::<Vec<_>>();
        let hits = plane(&|l| l.hits as f32);
        let small = Vec2::splat(COLOUR_SIGMA);
        let mean =
            |value: &dyn Fn(&LookSums) -> f32| smooth_mean(&plane(value), &hits, size, small);
        let colour = |value: &dyn Fn(&LookSums) -> Vec3, sigma: f32| {
            let sigma = Vec2::splat(sigma);
            let channel = |c: &dyn Fn(&LookSums) -> f32| smooth_mean(&plane(c), &hits, size, sigma);
            [
                channel(&|l| value(l).x),
                channel(&|l| value(l).y),
                channel(&|l| value(l).z),
            ]
        };
        let reflected = colour(&|l| l.reflected.0, COLOUR_SIGMA);
        let transmitted = colour(&|l| l.transmitted.0, COLOUR_SIGMA);
        let soft = colour(&|l| l.transmitted.0, HUE_SIGMA);
        let total = looks.iter().map(|l| l.transmitted.0).sum::<Vec3>();
        let mean_transmitted = total / hits.iter().sum::<f32>().max(1.0);
        let once = plane(&|l| l.reflected_once.mean());
        let gloss = smooth_mean(&once, &hits, size, Vec2::splat(HUE_SIGMA));
        let axis = [mean(&|l| l.axis.x), mean(&|l| l.axis.y)];
        let coverage = smooth_mean(&hits, &plane(&|l| l.count as f32), size, small);
        let sigma = Vec2::splat(smoothing_mm) / texel_mm;
        let sigma = sigma.max(Vec2::splat(COLOUR_SIGMA));
        // Holes get the height of what is around them, and a plane is no relief.
        let height = smooth_mean(&plane(&|l| l.height_mm), &hits, size, sigma);
        let height_mm = smooth(&height, size, Vec2::splat(COLOUR_SIGMA));
        let slope = slopes(&height_mm, size, texel_mm);
        let sum = |list: &[f32]| list.iter().map(|&v| f64::from(v)).sum::<f64>();
        let most_gloss = (MOST_GLOSS * sum(&once) / sum(&hits).max(1.0)).max(1e-6) as f32;
        let at = |list: &[f32], k: usize| list.get(k).copied().unwrap_or(0.0);
        let texels = (0..looks.len())
            .map(|k| {
                let axis = Vec2::new(at(&axis[0], k), at(&axis[1], k));
                let slope = slope.get(k).copied().unwrap_or_default();
                Texel {
                    coverage: at(&coverage, k).clamp(0.0, 1.0),
                    slope: slope * (MAX_SLOPE / slope.length().max(MAX_SLOPE)),
                    across_rad: wrap(0.5 * axis.y.atan2(axis.x) + FRAC_PI_2),
                    order: axis.length().clamp(0.0, 1.0),
                    reflected: colour_at(&reflected, k),
                    transmitted: {
                        let hue = colour_at(&soft, k) + MEAN_HUE * mean_transmitted;
                        let share = colour_at(&transmitted, k).max_element().max(MIN_SHARE);
                        share * hue / hue.max_element().max(1e-9)
                    },
                    gloss: (at(&gloss, k) / most_gloss).clamp(0.0, 1.0),
                }
            })
            .collect();
        Maps {
            size,
            tile_mm: grid.size_mm,
            texels,
            height_mm,
        }
    }

    /// About `count` texels spread evenly over the tile, one drawn from every cell of a grid.
    pub fn sample(&self, count: u32, seed: u64) -> Vec<Texel> {
        let side = (f64::from(count).sqrt().ceil() as u32).max(1);
        let cells = UVec2::splat(side).min(self.size);
        let mut rng = PathRng::new(seed, 1 << 58, 0);
        let mut list = Vec::new();
        for y in 0..cells.y {
            for x in 0..cells.x {
                let place = (UVec2::new(x, y).as_vec2() + rng.unit2()) / cells.as_vec2();
                let at = (place * self.size.as_vec2()).as_uvec2().min(self.size - 1);
                list.extend(self.texels.get((at.y * self.size.x + at.x) as usize));
            }
        }
        list
    }

    /// Mean coverage.
    pub fn coverage(&self) -> f64 {
        let sum: f64 = self.texels.iter().map(|t| f64::from(t.coverage)).sum();
        sum / self.texels.len().max(1) as f64
    }

    /// Least and greatest height, mm.
    pub fn height_range_mm(&self) -> (f32, f32) {
        let low = self.height_mm.iter().copied().fold(f32::INFINITY, f32::min);
        let high = self
            .height_mm
            .iter()
            .copied()
            .fold(f32::NEG_INFINITY, f32::max);
        (low, high.max(low + 1e-6))
    }
}

fn colour_at(planes: &[Vec<f32>; 3], k: usize) -> Vec3 {
    let [r, g, b] = planes.each_ref().map(|p| p.get(k).copied().unwrap_or(0.0));
    Vec3::new(r, g, b).clamp(Vec3::ZERO, Vec3::ONE)
}

/// An angle of an axis as one between -45 and 135 degrees, so that those of weft and warp are
/// far from the ends, where filters of textures fail.
pub fn wrap(angle_rad: f32) -> f32 {
    (angle_rad + FRAC_PI_4).rem_euclid(PI) - FRAC_PI_4
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::Rgb;

    /// A tile whose left half is a fibre along y, red, and whose right half a hole.
    fn looks() -> (Vec<LookSums>, TexelGrid) {
        let fibre = LookSums {
            count: 4,
            hits: 4,
            reflected: Rgb::new(2.0, 0.4, 0.4),
            reflected_once: Rgb::splat(0.4),
            transmitted: Rgb::splat(0.8),
            height_mm: 4.0 * 0.25,
            axis: Vec2::new(-4.0, 0.0),
        };
        let hole = LookSums {
            count: 4,
            ..LookSums::default()
        };
        let grid = TexelGrid {
            low_mm: Vec2::ZERO,
            size_mm: Vec2::new(2.0, 1.0),
            texels: UVec2::new(32, 16),
        };
        let texel = |k: usize| if k % 32 < 16 { fibre } else { hole };
        ((0..32 * 16).map(texel).collect(), grid)
    }

    #[test]
    fn maps_show_what_paths_found() {
        let (looks, grid) = looks();
        let maps = Maps::new(&looks, &grid, 0.05);
        let (fibre, hole) = (maps.texels[8 * 32 + 8], maps.texels[8 * 32 + 24]);
        assert!((fibre.coverage - 1.0).abs() < 1e-3 && hole.coverage < 1e-3);
        assert!((fibre.reflected - Vec3::new(0.5, 0.1, 0.1)).length() < 4.0 * f32::EPSILON);
        assert!((fibre.transmitted - Vec3::splat(0.2)).length() < 4.0 * f32::EPSILON);
        // Across a fibre along y is x.
        assert!(fibre.across_rad.abs() < 1e-4 && fibre.order > 0.99);
        assert!((maps.coverage() - 0.5).abs() < 4.0 * f64::from(f32::EPSILON));
        // A plane is no relief, although there are holes in it.
        assert!(maps.texels.iter().all(|t| t.slope.length() < 1e-3));
        assert!(maps.height_mm.iter().all(|h| (h - 0.25).abs() < 1e-3));
        assert_eq!(maps.sample(64, 1).len(), 64);
    }

    #[test]
    fn angles_are_wrapped_away_from_warp_and_weft() {
        for (angle, wrapped) in [(0.0, 0.0), (90.0, 90.0), (180.0, 0.0), (170.0, -10.0)] {
            let found = wrap(f32::to_radians(angle)).to_degrees();
            assert!((found - wrapped).abs() < 1e-3, "{angle}: {found}");
        }
    }
}
