//! The lateral borders of matter.

use glam::{Vec2, Vec3};
use organza_basis::CellGrid;

/// The rectangle in x and y that the matter fills, in voxels from the corner of
/// the first period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Borders {
    pub low: Vec2,
    pub high: Vec2,
}

impl Borders {
    /// Those of a cell grid; `None` where it is endless.
    pub fn of(cell_grid: &CellGrid) -> Option<Borders> {
        if cell_grid.is_endless() {
            return None;
        }
        if !cell_grid.repeats() {
            let high = cell_grid.dims().as_vec3().truncate();
            return Some(Borders {
                low: Vec2::ZERO,
                high,
            });
        }
        let (reach, min) = (cell_grid.reach_mm(), cell_grid.bounds_mm().min);
        let voxels = |p: Vec3| ((p - min) / cell_grid.voxel_mm()).truncate();
        Some(Borders {
            low: voxels(reach.min),
            high: voxels(reach.max),
        })
    }

    /// How far it is from a place in voxels to the border, mm.
    pub fn way_out_mm(&self, cell_grid: &CellGrid, at: Vec3, toward: Vec3) -> f32 {
        let per_mm = (toward / cell_grid.voxel_mm()).truncate();
        let border = Vec2::select(per_mm.cmpgt(Vec2::ZERO), self.high, self.low);
        let way = (border - at.truncate()) / per_mm;
        let still = per_mm.cmpeq(Vec2::ZERO);
        Vec2::select(still, Vec2::INFINITY, way)
            .min_element()
            .max(0.0)
    }
}
