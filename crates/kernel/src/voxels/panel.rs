//! Rectangle lights, sampled by shadow rays.
//!
//! The table of such a light is that of parallel light from its middle to that
//! of the matter: a guess, which the exact rays set right.

use glam::{DVec3, Vec3};
use organza_basis::CellGrid;
use organza_lanes::Floats;
use organza_lanes::math::V3;
use organza_light::RectangleLight;

/// Greatest area over the squared distance from the matter: nearer light is
/// better found by the walk, too.
const MAX_SOLID_ANGLE: f32 = 16.0;

/// A rectangle as the matter sees it, in plain numbers.
pub struct Panel {
    /// From the corner of the first period, mm.
    pub corner_mm: Vec3,
    pub edges_mm: [Vec3; 2],
    /// Unit normal of the side that shines.
    pub normal: Vec3,
    pub area_mm2: f32,
    /// Radiance of a side that shines, the same toward everywhere.
    pub radiance: Vec3,
    pub is_two_sided: bool,
    /// Edges of a voxel, mm, and the corner of the first period in the world, mm.
    pub voxel_mm: Vec3,
    pub min_mm: Vec3,
    /// The light itself, for rays from far cameras.
    rectangle: RectangleLight,
}

impl Panel {
    /// `None` when it stands in the matter or too near to it.
    pub fn new(rectangle: &RectangleLight, cell_grid: &CellGrid) -> Option<Panel> {
        let [corner, u, v] = rectangle.corner_and_edges_mm();
        let corners = [corner, corner + u, corner + v, corner + u + v];
        let matter = cell_grid.reach_mm();
        let low = corners.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = corners.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let apart_mm = (low - matter.max).max(matter.min - high).max_element();
        let cross = u.cross(v);
        let area_mm2 = cross.length();
        let far = apart_mm > 0.0 && area_mm2 <= MAX_SOLID_ANGLE * apart_mm * apart_mm;
        far.then(|| Panel {
            corner_mm: corner - cell_grid.bounds_mm().min,
            edges_mm: [u, v],
            normal: cross / area_mm2,
            area_mm2,
            radiance: rectangle.radiance().0,
            is_two_sided: rectangle.is_two_sided(),
            voxel_mm: cell_grid.voxel_mm(),
            min_mm: cell_grid.bounds_mm().min,
            rectangle: *rectangle,
        })
    }

    /// Where light from its middle to that of the first period travels.
    pub fn direction(&self, cell_grid: &CellGrid) -> Vec3 {
        let middle = self.corner_mm + 0.5 * (self.edges_mm[0] + self.edges_mm[1]);
        (0.5 * cell_grid.bounds_mm().size() - middle).normalize()
    }

    /// Toward drawn points: the unit direction, the distance in mm, and what the
    /// irradiance across it is over the radiance, as if drawn for the whole.
    #[inline(always)]
    pub fn toward<F: Floats>(&self, at: V3<F>, beyond: [F; 2], u: F, v: F) -> (V3<F>, F, F) {
        let place = V3 {
            x: at.x + beyond[0],
            y: at.y + beyond[1],
            z: at.z,
        };
        let drawn = V3::splat(self.edges_mm[0]).scaled_add(u, V3::splat(self.corner_mm));
        let drawn = V3::splat(self.edges_mm[1]).scaled_add(v, drawn);
        let to = drawn - place.times(V3::splat(self.voxel_mm));
        let square = to.dot(to);
        let distance_mm = square.sqrt();
        let toward = to.scaled(F::splat(1.0) / distance_mm);
        let mut facing = -toward.dot(V3::splat(self.normal));
        if self.is_two_sided {
            facing = facing.abs();
        }
        let strength = F::splat(self.area_mm2) * facing.max(F::splat(0.0)) / square;
        (toward, distance_mm, strength)
    }

    /// What a ray from the camera sees of it before the matter, or behind; from
    /// a place in voxels, so many mm from the camera.
    pub fn in_sight(
        &self,
        cell_grid: &CellGrid,
        at: Vec3,
        direction: Vec3,
        depth_mm: f32,
        behind: bool,
    ) -> Vec3 {
        let (at, direction_f64) = (at * self.voxel_mm + self.min_mm, direction.as_dvec3());
        let origin: DVec3 = at.as_dvec3() - f64::from(depth_mm) * direction_f64;
        let matter_mm = cell_grid.distance_mm(origin, direction_f64);
        match self.rectangle.distance_mm(origin, direction_f64) {
            Some(t) if (t > matter_mm) == behind => self.rectangle.radiance_toward(direction).0,
            _ => Vec3::ZERO,
        }
    }

    /// The greatest irradiance in the matter, or radiance, over the radiance.
    pub fn brightness(&self) -> f32 {
        self.radiance.max_element() * MAX_SOLID_ANGLE
    }
}
