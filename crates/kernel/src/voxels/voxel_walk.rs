//! Steps from voxel to voxel along a ray.

use glam::{IVec3, Vec3};
use organza_basis::CellGrid;

/// A place on its way through voxels.
pub struct VoxelWalk {
    /// The voxel, counted on through periods.
    pub cell: IVec3,
    step: IVec3,
    next_mm: Vec3,
    per_voxel_mm: Vec3,
    at_mm: f32,
}

impl VoxelWalk {
    pub fn new(cell_grid: &CellGrid, p: Vec3, direction: Vec3) -> VoxelWalk {
        let per_mm = direction / cell_grid.voxel_mm();
        let cell = p.floor();
        let forth = per_mm.cmpge(Vec3::ZERO);
        let border = Vec3::select(forth, cell + 1.0, cell);
        let still = per_mm.cmpeq(Vec3::ZERO);
        let far = Vec3::INFINITY;
        VoxelWalk {
            cell: cell.as_ivec3(),
            step: IVec3::select(forth, IVec3::ONE, IVec3::NEG_ONE),
            next_mm: Vec3::select(still, far, (border - p) / per_mm),
            per_voxel_mm: Vec3::select(still, far, per_mm.abs().recip()),
            at_mm: 0.0,
        }
    }

    /// Leaves the current voxel and returns the length of the path through it.
    #[inline]
    pub fn step(&mut self) -> f32 {
        let n = self.next_mm;
        let axis = if n.x < n.y {
            if n.x < n.z { 0 } else { 2 }
        } else if n.y < n.z {
            1
        } else {
            2
        };
        let length = n[axis] - self.at_mm;
        self.at_mm = n[axis];
        self.cell[axis] += self.step[axis];
        self.next_mm[axis] += self.per_voxel_mm[axis];
        length.max(0.0)
    }
}
