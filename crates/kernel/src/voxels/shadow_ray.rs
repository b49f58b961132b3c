//! Exact transmittance: from voxel to voxel along a ray.

use super::blocks::Blocks;
use glam::{IVec2, IVec3, Vec3};
use organza_basis::CellGrid;

/// The way of light to a place.
pub struct ShadowRay<'a> {
    pub cell_grid: &'a CellGrid,
    /// The blocks of a cloth of blocks, and the crossing that it arrives at.
    pub blocks: Option<(&'a Blocks, IVec2)>,
    /// Where it arrives, in voxels of the first period.
    pub at: Vec3,
    /// Unit direction that it comes from.
    pub toward: Vec3,
    /// How far that is, or the end of the matter where that is cut, mm.
    pub reach_mm: f32,
    /// Up to this optical depth the transmittance does not depend on chance;
    /// behind, the way is followed for as long as light does so by chance.
    /// Infinite, the transmittance is exact.
    pub sure_depth: f32,
    /// The chance, uniform in `[0, 1)`.
    pub chance: f32,
}

impl ShadowRay<'_> {
    /// The transmittance, exact on average over the chance, and the number of
    /// voxels looked at; `extinction_per_mm` is that of a voxel toward the
    /// light, `None` beyond the last.
    #[inline]
    pub fn transmittance(&self, extinction_per_mm: impl Fn(usize) -> Option<f32>) -> (f32, u64) {
        let (p, dims) = (self.at, self.cell_grid.dims().as_ivec3());
        let cell = p.as_ivec3().clamp(IVec3::ZERO, dims - 1);
        let voxel = cell.as_vec3();
        let forth = self.toward.cmpge(Vec3::ZERO);
        let per_voxel_mm = self.cell_grid.voxel_mm() / self.toward.abs().max(Vec3::splat(1e-12));
        let ahead = Vec3::select(forth, voxel + 1.0 - p, p - voxel);
        // Way to the next border along each axis, and voxels behind it.
        let [mut x_mm, mut y_mm, mut z_mm] = (ahead * per_voxel_mm).to_array();
        let [dx_mm, dy_mm, dz_mm] = per_voxel_mm.to_array();
        let behind = IVec3::select(forth, dims - 1 - cell, cell);
        let [mut x_left, mut y_left, mut z_left] = behind.to_array();
        let strides = IVec3::new(1, dims.x, dims.x * dims.y);
        let strides = IVec3::select(forth, strides, -strides);
        let [dx, dy, dz] = strides.to_array();
        let mut place = (cell.z * dims.y + cell.y) * dims.x + cell.x;
        let base = |crossing: IVec2| {
            let block =
                |(blocks, _): (&Blocks, IVec2)| blocks.number(crossing) * blocks.voxels as usize;
            self.blocks.map_or(0, block)
        };
        let mut crossing = self.blocks.map_or(IVec2::ZERO, |(_, crossing)| crossing);
        let mut first = base(crossing);
        let turn = IVec2::new(if forth.x { 1 } else { -1 }, if forth.y { 1 } else { -1 });
        let reach_mm = self.reach_mm.min(self.cell_grid.most_mm() as f32);
        let stop = self.sure_depth - (1.0 - self.chance).ln();
        let (mut at_mm, mut depth, mut steps) = (0.0f32, 0.0f32, 0);
        while let Some(extinction) = extinction_per_mm(first + place as usize) {
            let next_mm = x_mm.min(y_mm).min(z_mm);
            depth += extinction * (next_mm.min(reach_mm) - at_mm).max(0.0);
            at_mm = next_mm;
            steps += 1;
            if depth > stop {
                return (0.0, steps);
            }
            // Through an edge both borders are passed at once.
            let (x, y, z) = (x_mm == next_mm, y_mm == next_mm, z_mm == next_mm);
            x_mm += if x { dx_mm } else { 0.0 };
            y_mm += if y { dy_mm } else { 0.0 };
            z_mm += if z { dz_mm } else { 0.0 };
            place += if x { dx } else { 0 } + if y { dy } else { 0 } + if z { dz } else { 0 };
            x_left -= i32::from(x);
            y_left -= i32::from(y);
            z_left -= i32::from(z);
            if (x_left | y_left | z_left) < 0 {
                if z_left < 0 || !self.cell_grid.repeats() {
                    break;
                }
                if x_left < 0 {
                    (x_left, place) = (dims.x - 1, place - dims.x * dx);
                    crossing.x += turn.x;
                }
                if y_left < 0 {
                    (y_left, place) = (dims.y - 1, place - dims.y * dy);
                    crossing.y += turn.y;
                }
                first = base(crossing);
            }
            if at_mm >= reach_mm {
                break;
            }
        }
        ((-depth.min(self.sure_depth)).exp(), steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec3;
    use organza_basis::Aabb;

    /// In the plane of the cloth, where no matter is: 256 periods of 4 mm, in voxels of half a
    /// millimetre. The twin is light that is stopped before.
    #[test]
    fn light_along_the_cloth_comes_to_an_end() {
        let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::new(4.0, 2.0, 1.0));
        let cell_grid = CellGrid::new(bounds_mm, UVec3::new(8, 4, 2), true).unwrap();
        let seen = |extinction: f32, tilt: f32| {
            let ray = ShadowRay {
                cell_grid: &cell_grid,
                blocks: None,
                at: Vec3::new(1.5, 1.5, 1.5),
                toward: Vec3::new(0.8, 0.6, tilt),
                reach_mm: f32::INFINITY,
                sure_depth: 20.0,
                chance: 0.0,
            };
            ray.transmittance(|_| Some(extinction))
        };
        for tilt in [0.0, 1e-9, -1e-9] {
            let (passed, steps) = seen(0.0, tilt);
            assert_eq!(passed, 1.0);
            assert!((2500..3000).contains(&steps), "{tilt}: {steps}");
        }
        assert!(seen(1.0, 0.0).1 < 100);
    }
}
