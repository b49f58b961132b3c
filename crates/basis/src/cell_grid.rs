//! The regular grid of cells that matter lives on, repeated or not, and the walk
//! of a ray through its cells. Geometry alone: a [`CellGrid`] holds no data.

mod ray_cells;

pub use ray_cells::{CellSpan, Cells};

use crate::{Aabb, Ray};
use glam::{DVec3, IVec3, UVec3, Vec2, Vec3};

/// A box cut into `dims` voxels, alone or repeated in x and y, without end or
/// over a rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellGrid {
    bounds_mm: Aabb,
    /// All the matter: infinite in x and y where the box repeats without end.
    reach_mm: Aabb,
    dims: UVec3,
    voxels_per_mm: Vec3,
    repeats: bool,
}

/// A ray in matter that repeats counts as having left it after so many periods of the
/// longer side. One along the cloth, beside all its fibres, would meet nothing without end;
/// any other has met something long before, or leaves through the faces.
pub const MAX_PERIODS: u32 = 256;

/// A ray cut to a cell grid's box, in voxel units.
///
/// `point(t)` takes the distance `t` in mm from where the ray enters; local
/// coordinates may lie beyond the box in x and y where the cell grid repeats.
#[derive(Clone, Copy, Debug)]
pub struct LocalRay {
    /// Entry point, in voxels from the box's least corner.
    pub origin: Vec3,
    /// Voxels per mm along the ray.
    pub step: Vec3,
    /// Unit direction in the world.
    pub direction: Vec3,
    /// World distance from the ray's origin to the entry point, mm.
    pub t_entry: f64,
    /// Length inside, mm.
    pub length: f32,
    /// The yarn that the ray leaves, see [`Ray::left_yarn`].
    pub left_yarn: Option<u32>,
}

impl LocalRay {
    /// The local point at a distance from the entry.
    pub fn point(&self, t: f32) -> Vec3 {
        self.origin + t * self.step
    }
}

impl CellGrid {
    /// A cell grid over a box. `None` unless the box has a finite positive
    /// volume and every dimension is at least one.
    pub fn new(bounds_mm: Aabb, dims: UVec3, repeats: bool) -> Option<CellGrid> {
        let size = bounds_mm.size();
        let good = bounds_mm.min.is_finite()
            && bounds_mm.max.is_finite()
            && size.cmpgt(Vec3::ZERO).all()
            && dims.cmpgt(UVec3::ZERO).all();
        let mut reach_mm = bounds_mm;
        if repeats {
            (reach_mm.min.x, reach_mm.min.y) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
            (reach_mm.max.x, reach_mm.max.y) = (f32::INFINITY, f32::INFINITY);
        }
        good.then(|| CellGrid {
            bounds_mm,
            reach_mm,
            dims,
            voxels_per_mm: dims.as_vec3() / size,
            repeats,
        })
    }

    /// The same with matter only inside a rectangle of the x-y plane, with its
    /// edges cut sharply. `None` when nothing is left, or the rectangle is not
    /// finite.
    pub fn cut_to(&self, min_mm: Vec2, max_mm: Vec2) -> Option<CellGrid> {
        let mut reach_mm = self.reach_mm;
        reach_mm.min = reach_mm.min.max(min_mm.extend(reach_mm.min.z));
        reach_mm.max = reach_mm.max.min(max_mm.extend(reach_mm.max.z));
        let good =
            min_mm.is_finite() && max_mm.is_finite() && reach_mm.size().cmpgt(Vec3::ZERO).all();
        good.then_some(CellGrid { reach_mm, ..*self })
    }

    /// The box that holds all the matter, infinite in x and y where the cell_grid
    /// has no end.
    pub fn reach_mm(&self) -> Aabb {
        self.reach_mm
    }

    /// Whether the matter goes on without end in x and y.
    pub fn is_endless(&self) -> bool {
        !self.reach_mm.size().is_finite()
    }

    /// The box of one period.
    pub fn bounds_mm(&self) -> Aabb {
        self.bounds_mm
    }

    /// Number of voxels along each axis.
    pub fn dims(&self) -> UVec3 {
        self.dims
    }

    /// Whether the box repeats in x and y; [`CellGrid::reach_mm`] is how far.
    pub fn repeats(&self) -> bool {
        self.repeats
    }

    /// How far a ray may go in it, mm: see [`MAX_PERIODS`]. Infinite where it does not repeat.
    pub fn most_mm(&self) -> f64 {
        if !self.repeats {
            return f64::INFINITY;
        }
        f64::from(MAX_PERIODS) * f64::from(self.bounds_mm.size().truncate().max_element())
    }

    /// Number of voxels in a mm along each axis.
    pub fn voxels_per_mm(&self) -> Vec3 {
        self.voxels_per_mm
    }

    /// Edge lengths of a voxel.
    pub fn voxel_mm(&self) -> Vec3 {
        1.0 / self.voxels_per_mm
    }

    /// The part of a ray, up to `t_max` mm, that lies in the matter; `None`
    /// when it misses.
    ///
    /// The entry is computed in `f64` and, where the cell grid repeats, moved
    /// into the first period, so that neither a far camera nor a grazing ray
    /// costs the look-ups their precision.
    pub fn clip(&self, ray: &Ray, t_max: f64) -> Option<LocalRay> {
        // Infinite faces over a finite direction stay infinite, never NaN: the
        // parallel case is taken apart by `intersect`.
        let (near, far) = self.reach_mm.intersect(ray)?;
        let far = far.min(t_max).min(near + self.most_mm());
        if near >= far {
            return None;
        }
        let entry = ray.at(near);
        let mut local = (entry - self.bounds_mm.min.as_dvec3()) * self.voxels_per_mm.as_dvec3();
        if self.repeats {
            local.x = local.x.rem_euclid(f64::from(self.dims.x));
            local.y = local.y.rem_euclid(f64::from(self.dims.y));
        }
        Some(LocalRay {
            origin: local.as_vec3(),
            step: ray.direction * self.voxels_per_mm,
            direction: ray.direction,
            t_entry: near,
            length: (far - near) as f32,
            left_yarn: ray.left_yarn,
        })
    }

    /// Distance in mm along a ray to the matter's box (to the slab, where it is endless);
    /// zero from inside, infinite when the ray misses.
    pub fn distance_mm(&self, origin_mm: DVec3, direction: DVec3) -> f64 {
        let (mut near, mut far) = (0.0f64, f64::INFINITY);
        let (min, max) = (self.reach_mm.min.as_dvec3(), self.reach_mm.max.as_dvec3());
        for axis in 0..3 {
            let (o, d) = (origin_mm[axis], direction[axis]);
            if d == 0.0 {
                if o < min[axis] || o > max[axis] {
                    return f64::INFINITY;
                }
                continue;
            }
            let (a, b) = ((min[axis] - o) / d, (max[axis] - o) / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        if near <= far { near } else { f64::INFINITY }
    }

    /// The voxel that holds a local point, wrapped where the cell grid repeats
    /// and clamped to the box elsewhere (rounding may put a point of the
    /// surface a hair outside).
    #[inline]
    pub fn cell(&self, p: Vec3) -> UVec3 {
        self.wrap(cell_below(p), self.dims)
    }

    /// Wraps or clamps a cell index of a grid with `dims` cells over the box.
    #[inline]
    pub fn wrap(&self, cell: IVec3, dims: UVec3) -> UVec3 {
        let last = dims.as_ivec3() - 1;
        let c = if self.repeats {
            // One compare in the common case of a cell in the first period.
            let around = |c: i32, n: u32| {
                if (c as u32) < n {
                    c
                } else {
                    c.rem_euclid(n as i32)
                }
            };
            IVec3::new(
                around(cell.x, dims.x),
                around(cell.y, dims.y),
                cell.z.clamp(0, last.z),
            )
        } else {
            cell.clamp(IVec3::ZERO, last)
        };
        c.as_uvec3()
    }

    /// Walks the ray through cells of `edge` voxels each (the last cell of a
    /// period is cut where `edge` does not divide it).
    pub fn cells(&self, ray: &LocalRay, edge: u32) -> Cells {
        Cells::new(self, ray, edge)
    }

    /// Number of cells of `edge` voxels along each axis.
    pub fn cell_dims(&self, edge: u32) -> UVec3 {
        UVec3::new(
            self.dims.x.div_ceil(edge),
            self.dims.y.div_ceil(edge),
            self.dims.z.div_ceil(edge),
        )
    }
}

/// The cell of unit edge that holds a point, without the call that rounding down
/// is on processors of every age.
#[inline]
pub fn cell_below(p: Vec3) -> IVec3 {
    let toward_zero = p.as_ivec3();
    let above = p.cmplt(toward_zero.as_vec3());
    let bit = |b: bool| i32::from(b);
    toward_zero - IVec3::new(bit(above.x), bit(above.y), bit(above.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PathRng, warp};

    fn cell_grid(repeats: bool) -> CellGrid {
        let bounds = Aabb::new(Vec3::new(-1.0, 2.0, 0.5), Vec3::new(0.5, 3.0, 1.5));
        CellGrid::new(bounds, UVec3::new(7, 5, 9), repeats).unwrap()
    }

    #[test]
    fn cells_cover_the_ray_and_hold_its_points() {
        let mut rng = PathRng::from_seed(3);
        for repeats in [false, true] {
            let cell_grid = cell_grid(repeats);
            for edge in [1, 2, 4, 64] {
                for _ in 0..400 {
                    let inside = cell_grid.bounds_mm.min
                        + cell_grid.bounds_mm.size()
                            * Vec3::new(rng.unit(), rng.unit(), rng.unit());
                    let d = warp::uniform_sphere(rng.unit2());
                    let ray = Ray::new(inside - 3.0 * d, d);
                    let Some(local) = cell_grid.clip(&ray, f64::INFINITY) else {
                        panic!("seed 3: aimed at a point inside");
                    };
                    let mut at = 0.0;
                    for span in cell_grid.cells(&local, edge) {
                        let (t0, t1) = (span.t0, span.t1);
                        assert_eq!(t0, at, "seed 3");
                        assert!(t1 > t0);
                        for t in [t0, 0.5 * (t0 + t1), t1] {
                            let p = span.point(&local, t);
                            assert_eq!(cell_grid.cell(p) / edge, span.cell, "seed 3");
                            assert!((p - local.point(t)).length() < 1e-3, "seed 3");
                        }
                        at = t1;
                    }
                    assert!(local.length - at < 1e-4, "seed 3: {at} of {}", local.length);
                }
            }
        }
    }

    #[test]
    fn rays_in_faces_and_through_corners_end() {
        for repeats in [false, true] {
            let l = cell_grid(repeats);
            let min = l.bounds_mm.min;
            let voxel = l.voxel_mm();
            for (from, d) in [
                (min + Vec3::new(-1.0, voxel.y, voxel.z), Vec3::X),
                (min - voxel, voxel.normalize()),
                (min + voxel, Vec3::NEG_Z),
                (min + 2.0 * voxel, Vec3::Z),
            ] {
                if let Some(local) = l.clip(&Ray::new(from, d), 50.0) {
                    let total: f32 = l.cells(&local, 1).map(|s| s.t1 - s.t0).sum();
                    assert!((total - local.length).abs() < 4.0 * f32::EPSILON);
                }
            }
        }
    }

    /// The twin is a ray that climbs out of the slab before.
    #[test]
    fn a_ray_along_a_repeating_slab_ends() {
        let l = cell_grid(true);
        let along = |tilt: f32| Ray::new(Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, tilt));
        for tilt in [0.0, 1e-9, -1e-9] {
            let local = l.clip(&along(tilt), f64::INFINITY).unwrap();
            assert_eq!(f64::from(local.length), l.most_mm(), "{tilt}");
            assert!(l.cells(&local, 4).count() < 2000, "{tilt}");
        }
        let climbs = l.clip(&along(0.01), f64::INFINITY).unwrap();
        assert!((climbs.length - 50.0).abs() < 1e-3, "{}", climbs.length);
    }

    #[test]
    fn a_horizontal_ray_in_a_repeating_slab_is_cut_at_t_max() {
        let l = cell_grid(true);
        let ray = Ray::new(Vec3::new(0.0, 0.0, 1.0), Vec3::X);
        let local = l.clip(&ray, 20.0).unwrap();
        assert_eq!(local.length, 20.0);
        let total: f32 = l.cells(&local, 4).map(|s| s.t1 - s.t0).sum();
        assert!((total - 20.0).abs() < 20.0 * f32::EPSILON);
    }
}
