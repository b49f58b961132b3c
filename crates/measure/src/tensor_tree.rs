//! The BSDF over the cells of a tensor tree [Ward2012], as Radiance reads it: hemispheres
//! are flattened to disks, the disks to squares [Shirley1997], and the squares are divided
//! into equal cells.
//!
//! Every cell has the same solid angle times cosine, so a matrix of cells is measured with as
//! many paths for every incident cell, and each path serves all exitant cells at once. The
//! face of the cloth is the front of the file. Light that passes straight through is in the
//! cell that it reaches.

use crate::parts::measure_parts;
use crate::{Exit, MeasureError, PatchResponse, PathNames, PathRun};
use glam::{DVec2, Vec3};
use organza_basis::{PathRng, Stopped, Watch, warp};
use organza_transport::Stats;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Number of dimensions of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeRank {
    /// Rank 3, for scattering that does not depend on the azimuth of the cloth: the polar
    /// angle of the light and the exitant direction relative to its azimuth.
    Isotropic,
    /// Rank 4, for cloth with a weft and a warp: two dimensions for each direction.
    Anisotropic,
}

/// A rank and a depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TreeLayout {
    rank: TreeRank,
    depth: u32,
}

/// What a cell takes in memory: three channels and a variance.
const BYTES_OF_CELL: u64 = 16;

impl TreeLayout {
    /// The greatest depth of any rank.
    pub const MAX_DEPTH: u32 = 7;

    /// A layout with `2^depth` cells along each dimension; `None` unless depth is 1 to 7, or 1
    /// to 6 for rank 4.
    pub fn new(rank: TreeRank, depth: u32) -> Option<TreeLayout> {
        let most = match rank {
            TreeRank::Isotropic => TreeLayout::MAX_DEPTH,
            TreeRank::Anisotropic => TreeLayout::MAX_DEPTH - 1,
        };
        (1..=most)
            .contains(&depth)
            .then_some(TreeLayout { rank, depth })
    }

    /// The number of dimensions, 3 or 4.
    pub fn dimensions(self) -> usize {
        match self.rank {
            TreeRank::Isotropic => 3,
            TreeRank::Anisotropic => 4,
        }
    }

    /// Cells along a dimension.
    pub fn side(self) -> usize {
        1 << self.depth
    }

    /// Cells of incident directions on one side of the cloth. Rank 3 uses half of its first
    /// dimension.
    pub fn incident_cells(self) -> usize {
        match self.rank {
            TreeRank::Isotropic => self.side() / 2,
            TreeRank::Anisotropic => self.side() * self.side(),
        }
    }

    /// Cells of exitant directions on one side of the cloth.
    pub fn exitant_cells(self) -> usize {
        self.side() * self.side()
    }

    /// Solid angle times cosine of an exitant cell.
    pub fn projected_sr(self) -> f64 {
        PI / self.exitant_cells() as f64
    }

    /// Memory of the measured cells, and of the tree that is written from them.
    pub fn memory_bytes(self) -> u64 {
        let cells = self.incident_cells() as u64 * self.exitant_cells() as u64;
        2 * 4 * cells * BYTES_OF_CELL
    }

    /// A direction of arriving light, drawn from an incident cell with a density that is
    /// proportional to its cosine. It points towards the light.
    fn draw(self, cell: usize, front: bool, rng: &mut PathRng) -> Vec3 {
        let n = self.side();
        let u = rng.unit2().as_dvec2();
        let disk = match self.rank {
            TreeRank::Isotropic => {
                // The first coordinate falls from 0.5 at the normal to 0 at the horizon.
                let edge = |k: usize| 1.0 - 2.0 * k as f64 / n as f64;
                let [low, high] = [edge(cell + 1), edge(cell)].map(|r| r * r);
                let radius = (low + u.x * (high - low)).sqrt();
                DVec2::from_angle(TAU * u.y) * radius
            }
            TreeRank::Anisotropic => {
                let corner = DVec2::new((cell / n) as f64, (cell % n) as f64);
                let square = ((corner + u) / n as f64).min(DVec2::splat(1.0 - f64::EPSILON));
                -warp::concentric_disk(square.as_vec2()).as_dvec2()
            }
        };
        let z = (1.0 - disk.length_squared()).max(1e-12).sqrt();
        to_cloth(disk.extend(if front { -z } else { z }).as_vec3())
    }

    /// The cell of a direction of leaving light, for light that arrives from `w_in`.
    fn exitant_cell(self, w_in: Vec3, w_out: Vec3) -> usize {
        let (w_in, w_out) = (to_cloth(w_in).as_dvec3(), to_cloth(w_out).as_dvec3());
        let disk = match self.rank {
            // Relative to the azimuth towards which the light travels.
            TreeRank::Isotropic => {
                let onward = (-w_in.truncate()).try_normalize().unwrap_or(DVec2::X);
                DVec2::new(onward.x, -onward.y).rotate(w_out.truncate())
            }
            TreeRank::Anisotropic => w_out.truncate(),
        };
        let n = self.side();
        let at = |x: f64| ((x * n as f64) as usize).min(n - 1);
        let square = square_of_disk(disk);
        at(square.x) * n + at(square.y)
    }
}

/// Between the frame of the cloth and that of the file: half a turn about the warp, because
/// Radiance takes the side away from its normal, below z = 0, as the front of a file. The
/// turn is its own inverse.
fn to_cloth(w: Vec3) -> Vec3 {
    Vec3::new(-w.x, w.y, -w.z)
}

/// The place of a point of the unit disk on the unit square: the inverse of
/// [`warp::concentric_disk`].
fn square_of_disk(p: DVec2) -> DVec2 {
    let radius = p.length();
    let quarter = p.y.atan2(p.x) / FRAC_PI_4;
    let flat = if quarter.abs() <= 1.0 {
        DVec2::new(radius, radius * quarter)
    } else if quarter.abs() >= 3.0 {
        let beyond = quarter - 4.0f64.copysign(quarter);
        DVec2::new(-radius, -radius * beyond)
    } else {
        let beyond = (p.y.atan2(p.x).abs() - FRAC_PI_2) / FRAC_PI_4;
        DVec2::new(-radius * beyond, radius.copysign(p.y))
    };
    (0.5 * (flat + 1.0)).clamp(DVec2::ZERO, DVec2::ONE)
}

/// A cell: the mean BSDF between an incident and an exitant cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeCell {
    /// 1/sr, linear sRGB.
    pub mean: [f32; 3],
    /// Variance of the mean of the three channels, as an error of the measurement.
    pub variance: f32,
}

/// The four matrices of cells; light from the front first. Cells lie exitant cell by exitant
/// cell within each incident cell.
#[derive(Clone, Debug, PartialEq)]
pub struct TensorTree {
    /// Rank and depth.
    pub layout: TreeLayout,
    /// Transmission of light from the front and from the back, with unscattered light.
    pub transmission: [Vec<TreeCell>; 2],
    /// Reflection of light from the front and from the back.
    pub reflection: [Vec<TreeCell>; 2],
}

impl TensorTree {
    /// The total share of the light from an incident cell that a matrix transmits or reflects.
    pub fn hemispherical(&self, matrix: &[TreeCell], incident: usize) -> [f64; 3] {
        let count = self.layout.exitant_cells();
        let cells = matrix.iter().skip(incident * count).take(count);
        let mut sum = [0.0; 3];
        for cell in cells {
            for (s, v) in sum.iter_mut().zip(cell.mean) {
                *s += f64::from(v) * self.layout.projected_sr();
            }
        }
        sum
    }

    /// The incident cell that contains, or touches, the normal.
    pub fn along_normal(&self) -> usize {
        let n = self.layout.side();
        match self.layout.rank {
            TreeRank::Isotropic => n / 2 - 1,
            TreeRank::Anisotropic => n / 2 * n + n / 2,
        }
    }
}

/// Streams of random numbers that belong to the cells of trees.
const TREE_STREAMS: u64 = 1 << 61;

/// Measures all four matrices with `paths` paths of light from every incident cell and side.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_tensor_tree(
    patch: &impl PatchResponse,
    layout: TreeLayout,
    paths: u64,
    seed: u64,
    watch: Watch<'_>,
) -> Result<(TensorTree, Stats), MeasureError> {
    if paths < 2 {
        return Err(MeasureError::TooFewPaths(paths));
    }
    let (incident, exitant) = (layout.incident_cells(), layout.exitant_cells());
    let column = |k: usize| {
        let (front, cell) = (k < incident, k % incident);
        // Sums per channel, and of squares of their mean: reflection, then transmission.
        let mut sums = vec![[0.0f64; 4]; 2 * exitant];
        let mut stats = Stats::default();
        let names = PathNames::new(seed, TREE_STREAMS + k as u64, 0..paths);
        let draw = |rng: &mut PathRng| layout.draw(cell, front, rng);
        // The exit of a path is found from the direction that the path drew.
        let (mut rejected, mut path) = (0, 0);
        let mut found = |exit: Exit| {
            let w_in = draw(&mut names.rng(path));
            path += 1;
            let Some((to, weight)) = exit.finite(&mut rejected) else {
                return;
            };
            let crosses = (to.z > 0.0) != front;
            let slot = layout.exitant_cell(w_in, to) + if crosses { exitant } else { 0 };
            if let Some(slot) = sums.get_mut(slot) {
                let channels = weight.0.to_array().map(f64::from);
                for (sum, value) in slot.iter_mut().zip(channels) {
                    *sum += value;
                }
                slot[3] += (channels.iter().sum::<f64>() / 3.0).powi(2);
            }
        };
        patch.each_exit(&draw, PathRun::new(&names, &mut stats, &mut found));
        stats.rejected += rejected;
        Stopped::check(watch(paths))?;
        let count = paths as f64;
        let scale = 1.0 / (count * layout.projected_sr());
        let cell = |[r, g, b, squares]: [f64; 4]| {
            let mean = (r + g + b) / (3.0 * count);
            let variance = (squares / count - mean * mean).max(0.0) / (count - 1.0);
            TreeCell {
                mean: [r, g, b].map(|x| (x * scale) as f32),
                variance: (variance * (scale * count).powi(2)) as f32,
            }
        };
        let cells: Vec<TreeCell> = sums.into_iter().map(cell).collect();
        Ok((cells, stats))
    };
    let (columns, stats) = measure_parts(2 * incident, column)?;
    let mut tree = TensorTree {
        layout,
        transmission: [Vec::new(), Vec::new()],
        reflection: [Vec::new(), Vec::new()],
    };
    for (k, cells) in columns.into_iter().enumerate() {
        let side = k / incident;
        let (reflected, transmitted) = cells.split_at(exitant);
        tree.reflection[side].extend_from_slice(reflected);
        tree.transmission[side].extend_from_slice(transmitted);
    }
    Ok((tree, stats))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    #[test]
    fn the_disk_and_the_square_are_each_others_inverse() {
        let mut rng = PathRng::from_seed(5);
        for _ in 0..2000 {
            let square = rng.unit2();
            let disk = warp::concentric_disk(square).as_dvec2();
            let back = square_of_disk(disk);
            let off = (back - square.as_dvec2()).length();
            assert!(off < 4.0 * f64::from(f32::EPSILON), "{square} {back}");
        }
        // The corners of the square are points of the rim.
        for corner in [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE] {
            let disk = warp::concentric_disk(corner).as_dvec2();
            assert!((disk.length() - 1.0).abs() < 4.0 * f64::from(f32::EPSILON));
        }
    }

    #[test]
    fn unscattered_light_reaches_the_cell_that_it_comes_from() {
        for (rank, depth) in [(TreeRank::Anisotropic, 3), (TreeRank::Isotropic, 4)] {
            let layout = TreeLayout::new(rank, depth).unwrap();
            let n = layout.side();
            for cell in 0..layout.incident_cells() {
                for (front, path) in [(true, 0), (false, 1)] {
                    let w = layout.draw(cell, front, &mut PathRng::new(3, cell as u64, path));
                    assert_eq!(w.z > 0.0, front);
                    let reached = layout.exitant_cell(w, -w);
                    match rank {
                        TreeRank::Anisotropic => assert_eq!(reached, cell),
                        // Along the first axis, opposite to where the light comes from.
                        TreeRank::Isotropic => {
                            assert_eq!(reached / n, n - 1 - cell);
                            assert!([n / 2 - 1, n / 2].contains(&(reached % n)));
                        }
                    }
                }
            }
        }
        assert_eq!(TreeLayout::new(TreeRank::Anisotropic, 7), None);
        assert_eq!(TreeLayout::new(TreeRank::Isotropic, 0), None);
    }
}
