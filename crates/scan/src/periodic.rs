//! A field cut so that it repeats in x and y without a visible seam.
//!
//! Along each axis the period is the shift at which the sheet matches itself best. Where the
//! sheet overlaps its shifted self, an optimal cut changes from one to the other: of all cuts
//! that move by at most one voxel from row to row and close on themselves, the one across which
//! density and direction differ least [Efros2001] [Kwatra2003].

use crate::{ScannedField, ScannedVoxel};
use glam::UVec3;

/// Number of cells that a period should be a multiple of, for four levels of detail.
const MULTIPLE: u32 = 8;

/// How much worse a match may be for the sake of [`MULTIPLE`].
const ALLOWED: f64 = 1.15;

/// Rows of a search for the period, at most: others are left out.
const SEARCH_ROWS: u32 = 48;

/// How a field was cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodicCut {
    /// Periods along x and y, voxels.
    pub period: [u32; 2],
    /// Voxels of the overlaps.
    pub overlap: [u32; 2],
    /// Mean difference of neighbours across each cut.
    pub seam: [Jump; 2],
    /// The same across the same surface where the sheet was whole: at both ends of the overlap.
    pub inside: [Jump; 2],
}

/// How much neighbours differ, on average over neighbours of which one has fibre.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jump {
    /// Difference of fill, in `[0, 1]`.
    pub fill: f64,
    /// Sine of the angle between axes, where both have fibre.
    pub sine: f64,
}

/// Why a field cannot be made periodic.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "{voxels} voxels along {axis} are too few for a tile and an overlap; at least {least} are \
     needed"
)]
pub struct TooSmall {
    /// The axis.
    pub axis: &'static str,
    /// Voxels that there are.
    pub voxels: u32,
    /// Voxels that are needed.
    pub least: u32,
}

/// Cuts a tile out of a flat sheet. `least_period` bounds the periods from below, in voxels; a
/// tile of at least half of the sheet if none.
///
/// # Errors
/// A field that is too small.
pub fn made_periodic(
    field: &ScannedField,
    least_period: Option<[u32; 2]>,
) -> Result<(ScannedField, PeriodicCut), TooSmall> {
    let mut cut = PeriodicCut {
        period: [0; 2],
        overlap: [0; 2],
        seam: [Jump::default(); 2],
        inside: [Jump::default(); 2],
    };
    let mut tile = field.clone();
    for axis in [0, 1] {
        let view = View { field: &tile, axis };
        let n = tile.dims()[axis];
        let overlap = (n / 8).clamp(4, 48);
        let least = least_period.map_or(n / 2, |l| l[axis]).max(8);
        if n < least + overlap || n < 16 {
            return Err(TooSmall {
                axis: ["x", "y"][axis],
                voxels: n,
                least: (least + overlap).max(16),
            });
        }
        let period = view.period(least, n - overlap, overlap);
        let path = view.path(period, overlap);
        (cut.seam[axis], cut.inside[axis]) = view.jumps(period, &path);
        cut.period[axis] = period;
        cut.overlap[axis] = overlap;
        tile = view.tile(period, &path);
    }
    tile.repeats = true;
    Ok((tile, cut))
}

/// A field seen along one of its axes.
struct View<'a> {
    field: &'a ScannedField,
    axis: usize,
}

/// What differs between two voxels, squared: density, and density times direction.
fn difference(a: &ScannedVoxel, b: &ScannedVoxel) -> f64 {
    let (f, g) = (f64::from(a.fill), f64::from(b.fill));
    if f == 0.0 && g == 0.0 {
        return 0.0;
    }
    // |f a a^T - g b b^T|^2 of unit vectors.
    let cos = f64::from(a.axis.dot(b.axis));
    (f - g).powi(2) + f * f + g * g - 2.0 * f * g * cos * cos
}

impl View<'_> {
    /// The cell at a place along the axis, a row across it, and a height.
    fn cell(&self, along: u32, row: u32, z: u32) -> UVec3 {
        match self.axis {
            0 => UVec3::new(along, row, z),
            _ => UVec3::new(row, along, z),
        }
    }

    fn rows(&self) -> u32 {
        self.field.dims()[1 - self.axis]
    }

    /// Difference between two columns of the sheet.
    fn columns(&self, a: u32, b: u32, row: u32, step: u32) -> f64 {
        let depth = self.field.dims().z;
        (0..depth)
            .step_by(step as usize)
            .map(|z| {
                let [a, b] = [a, b].map(|along| self.field.voxel(self.cell(along, row, z)));
                difference(&a, &b)
            })
            .sum()
    }

    /// The shift from `least` to `most` at which the overlap matches best.
    fn period(&self, least: u32, most: u32, overlap: u32) -> u32 {
        let step = self.rows().div_ceil(SEARCH_ROWS);
        let cost = |shift: u32| -> f64 {
            let mut sum = 0.0;
            for row in (0..self.rows()).step_by(step as usize) {
                for k in 0..overlap {
                    sum += self.columns(k, shift + k, row, 1);
                }
            }
            sum
        };
        let costs: Vec<(u32, f64)> = (least..=most).map(|s| (s, cost(s))).collect();
        let best = |multiple: u32| {
            let list = costs.iter().filter(|c| c.0 % multiple == 0);
            list.min_by(|a, b| a.1.total_cmp(&b.1)).copied()
        };
        let (any, round) = (best(1), best(MULTIPLE));
        match (any, round) {
            (Some(any), Some(round)) if round.1 <= ALLOWED * any.1 => round.0,
            (Some(any), _) => any.0,
            _ => most,
        }
    }

    /// For each row, the number of voxels of the overlap that are taken from the upper end.
    fn path(&self, period: u32, overlap: u32) -> Vec<u32> {
        let (rows, width) = (self.rows() as usize, overlap as usize - 1);
        // Cost of a change between k and k + 1: what differs at both.
        let mut cost = vec![0.0; rows * width];
        for row in 0..rows {
            let own: Vec<f64> = (0..overlap)
                .map(|k| self.columns(k, period + k, row as u32, 1))
                .collect();
            for k in 0..width {
                cost[row * width + k] = own[k] + own[k + 1];
            }
        }
        let mut best: Option<(f64, Vec<u32>)> = None;
        // A path that ends where it began, for every beginning.
        for start in 0..width {
            let mut sums = vec![f64::INFINITY; rows * width];
            sums[start] = cost[start];
            for row in 1..rows {
                for k in 0..width {
                    let near = k.saturating_sub(1)..=(k + 1).min(width - 1);
                    let before = near.map(|j| sums[(row - 1) * width + j]);
                    let least = before.fold(f64::INFINITY, f64::min);
                    sums[row * width + k] = least + cost[row * width + k];
                }
            }
            let ends = start.saturating_sub(1)..=(start + 1).min(width - 1);
            let last = (rows - 1) * width;
            let end = ends.min_by(|&a, &b| sums[last + a].total_cmp(&sums[last + b]));
            let Some(mut k) = end else { continue };
            let total = sums[last + k];
            if best.as_ref().is_some_and(|b| b.0 <= total) {
                continue;
            }
            let mut path = vec![0; rows];
            for row in (0..rows).rev() {
                path[row] = k as u32 + 1;
                if row > 0 {
                    let near = k.saturating_sub(1)..=(k + 1).min(width - 1);
                    let before = (row - 1) * width;
                    k = near
                        .min_by(|&a, &b| sums[before + a].total_cmp(&sums[before + b]))
                        .unwrap_or(k);
                }
            }
            best = Some((total, path));
        }
        best.map_or_else(|| vec![overlap / 2; rows], |b| b.1)
    }

    /// One period: up to the cut it continues the upper end, past it the lower end begins.
    fn tile(&self, period: u32, path: &[u32]) -> ScannedField {
        let mut dims = self.field.dims();
        dims[self.axis] = period;
        let mut tile = ScannedField::empty(dims, self.field.voxel_mm, self.field.fibre_radius_mm);
        tile.min_mm = self.field.min_mm;
        tile.density_scale = self.field.density_scale;
        tile.yarns.clone_from(&self.field.yarns);
        for z in 0..dims.z {
            for row in 0..self.rows() {
                let cut = path.get(row as usize).copied().unwrap_or(0);
                for along in 0..period {
                    let from = if along < cut { along + period } else { along };
                    let v = self.field.voxel(self.cell(from, row, z));
                    if v.fill > 0.0 {
                        tile.set(self.cell(along, row, z), &v);
                    }
                }
            }
        }
        tile
    }

    /// Mean differences of neighbours across the cut, and across the same surface in both of
    /// the parts that it joins.
    fn jumps(&self, period: u32, path: &[u32]) -> (Jump, Jump) {
        let (mut seam, mut inside) = (Sums::default(), Sums::default());
        for z in 0..self.field.dims().z {
            for (row, &cut) in (0u32..).zip(path) {
                let voxel = |along: u32| self.field.voxel(self.cell(along, row, z));
                let [lower, upper] = [0, period].map(|shift| {
                    let at = cut + shift;
                    [voxel(at - 1), voxel(at)]
                });
                inside.add(&lower[0], &lower[1]);
                inside.add(&upper[0], &upper[1]);
                seam.add(&upper[0], &lower[1]);
            }
        }
        (seam.jump(), inside.jump())
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    fill: [f64; 2],
    sine: [f64; 2],
}

impl Sums {
    fn add(&mut self, a: &ScannedVoxel, b: &ScannedVoxel) {
        if a.fill == 0.0 && b.fill == 0.0 {
            return;
        }
        self.fill[0] += f64::from((a.fill - b.fill).abs());
        self.fill[1] += 1.0;
        let weight = f64::from(a.fill.min(b.fill));
        self.sine[0] += weight * f64::from(a.axis.cross(b.axis).length().min(1.0));
        self.sine[1] += weight;
    }

    fn jump(&self) -> Jump {
        let mean = |[sum, count]: [f64; 2]| if count > 0.0 { sum / count } else { 0.0 };
        Jump {
            fill: mean(self.fill),
            sine: mean(self.sine),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::woven::Weave;

    /// A piece of a weave of which no two fibres are the same.
    fn piece(cells: [u32; 2]) -> ScannedField {
        let weave = Weave {
            pitch_mm: 0.08,
            roughness: 0.35,
            ..Weave::default()
        };
        weave.field([cells[0], cells[1], 12], 0.01, &|p| p)
    }

    #[test]
    fn a_weave_repeats_with_its_period_and_without_a_seam() {
        // Yarns are 8 voxels apart, the weave repeats after 16.
        let field = piece([101, 90]);
        let (tile, cut) = made_periodic(&field, None).unwrap();
        assert_eq!(cut.period.map(|p| p % 16), [0, 0], "{cut:?}");
        assert_eq!(tile.dims().truncate().to_array(), cut.period);
        assert!(tile.repeats && cut.period[0] >= 50 && cut.period[1] >= 45);
        for axis in [0, 1] {
            let (seam, inside) = (cut.seam[axis], cut.inside[axis]);
            assert!(seam.fill < 1.3 * inside.fill, "{axis}: {cut:?}");
            assert!(seam.sine < 1.3 * inside.sine + 0.01, "{axis}: {cut:?}");
        }
        // The known-bad twin: the same piece cut straight, at half a weave too much.
        let mut period = cut.period[0] + 8;
        while period + 8 > 101 {
            period -= 16;
        }
        let view = View {
            field: &field,
            axis: 0,
        };
        let (seam, inside) = view.jumps(period, &vec![1; 90]);
        assert!(seam.sine > 2.0 * inside.sine, "{seam:?} {inside:?}");
    }

    #[test]
    fn a_tile_of_a_periodic_field_is_that_field() {
        let weave = Weave {
            pitch_mm: 0.08,
            roughness: 0.0,
            spread_rad: 0.0,
            ..Weave::default()
        };
        let field = weave.field([90, 90, 12], 0.01, &|p| p);
        let (tile, cut) = made_periodic(&field, Some([16, 16])).unwrap();
        assert_eq!(cut.period, [16, 16], "{cut:?}");
        let dims = tile.dims();
        for z in 0..dims.z {
            for k in 0..256 {
                let cell = UVec3::new(k % 16, k / 16, z);
                let (a, b) = (tile.voxel(cell), field.voxel(cell));
                assert!(
                    (a.fill - b.fill).abs() < 4.0 * f32::EPSILON,
                    "{cell} {a:?} {b:?}"
                );
            }
        }
        let small = made_periodic(&piece([20, 90]), Some([20, 20])).unwrap_err();
        assert_eq!((small.axis, small.voxels, small.least), ("x", 20, 24));
    }
}
