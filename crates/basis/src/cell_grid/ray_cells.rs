//! The cells along a ray.

use super::{CellGrid, LocalRay};
use glam::{IVec3, UVec3, Vec3};

/// The part of a ray inside one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellSpan {
    /// The cell, wrapped into the first period.
    pub cell: UVec3,
    /// Where the ray enters it, mm from the ray's entry into the cell grid.
    pub t0: f32,
    /// Where it leaves; greater than `t0`.
    pub t1: f32,
    /// Corners of the cell in local coordinates, where the ray is (not wrapped).
    low: Vec3,
    high: Vec3,
}

impl CellSpan {
    /// A point of the ray between `t0` and `t1`, kept inside the cell: what is
    /// looked up there belongs to this cell even where rounding has put the
    /// point a hair beyond its faces.
    #[inline]
    pub fn point(&self, ray: &LocalRay, t: f32) -> Vec3 {
        ray.point(t).max(self.low).min(self.high)
    }
}

/// The cells along a ray, in order, covering its length without gap or overlap.
///
/// Integer stepping decides which cell comes next, so that a ray in a face or
/// through an edge always advances and always ends.
pub struct Cells {
    cell_grid: CellGrid,
    edge: i32,
    cell: IVec3,
    cell_dims: UVec3,
    sign: IVec3,
    origin: Vec3,
    inverse_step: Vec3,
    next_t: Vec3,
    t: f32,
    length: f32,
}

impl Cells {
    pub(super) fn new(cell_grid: &CellGrid, ray: &LocalRay, edge: u32) -> Cells {
        let cell_dims = cell_grid.cell_dims(edge);
        let edge = edge as i32;
        let voxel = cell_grid.cell(ray.origin).as_ivec3();
        let mut walk = Cells {
            cell_grid: *cell_grid,
            edge,
            cell: voxel / edge,
            cell_dims,
            sign: IVec3::ZERO,
            origin: ray.origin,
            inverse_step: Vec3::ZERO,
            next_t: Vec3::INFINITY,
            t: 0.0,
            length: ray.length,
        };
        for axis in 0..3 {
            let d = ray.step[axis];
            if d != 0.0 {
                walk.sign[axis] = if d > 0.0 { 1 } else { -1 };
                walk.inverse_step[axis] = 1.0 / d;
                walk.next_t[axis] = walk.face_t(axis);
            }
        }
        walk
    }

    /// Faces of the current cell along `axis`, in voxels.
    fn faces(&self, axis: usize) -> (i32, i32) {
        let dim = self.cell_grid.dims[axis] as i32;
        let n = self.cell_dims[axis] as i32;
        let c = self.cell[axis];
        // Cells are counted on through the periods; a period whose length is
        // no multiple of the edge ends in a cut cell.
        let (period, within) = if (c as u32) < n as u32 {
            (0, c)
        } else {
            (c.div_euclid(n), c.rem_euclid(n))
        };
        let low = within * self.edge;
        (
            period * dim + low,
            period * dim + (low + self.edge).min(dim),
        )
    }

    /// Least and greatest local point of the current cell.
    fn corners(&self) -> (Vec3, Vec3) {
        let [x, y, z] = [self.faces(0), self.faces(1), self.faces(2)];
        (
            Vec3::new(x.0 as f32, y.0 as f32, z.0 as f32),
            Vec3::new(
                (x.1 as f32).next_down(),
                (y.1 as f32).next_down(),
                (z.1 as f32).next_down(),
            ),
        )
    }

    /// Distance at which the ray leaves the current cell through `axis`.
    fn face_t(&self, axis: usize) -> f32 {
        let (low, high) = self.faces(axis);
        let face = if self.sign[axis] > 0 { high } else { low };
        (face as f32 - self.origin[axis]) * self.inverse_step[axis]
    }
}

impl Iterator for Cells {
    type Item = CellSpan;

    #[inline]
    fn next(&mut self) -> Option<CellSpan> {
        while self.t < self.length {
            let inside = |axis: usize| (self.cell[axis] as u32) < self.cell_dims[axis];
            let wraps = self.cell_grid.repeats;
            if !inside(2) || !(wraps || inside(0) && inside(1)) {
                return None;
            }
            let n = self.next_t;
            let axis = if n.x < n.y {
                if n.x < n.z { 0 } else { 2 }
            } else if n.y < n.z {
                1
            } else {
                2
            };
            let (low, high) = self.corners();
            let mut here = CellSpan {
                cell: self.cell_grid.wrap(self.cell, self.cell_dims),
                t0: self.t,
                t1: n[axis].min(self.length),
                low,
                high,
            };
            self.cell[axis] += self.sign[axis];
            self.next_t[axis] = if self.sign[axis] == 0 {
                f32::INFINITY
            } else {
                self.face_t(axis)
            };
            if self.sign[axis] == 0 {
                // No axis moves: the rest of the ray lies in this cell.
                self.t = self.length;
                here.t1 = self.length;
                return Some(here);
            }
            if here.t1 > here.t0 {
                self.t = here.t1;
                return Some(here);
            }
        }
        None
    }
}
