//! Rectangle lights far from the matter, drawn in lanes.

use super::placed_light::Toward;
use glam::Vec3;
use organza_basis::CellGrid;
use organza_lanes::Floats;
use organza_lanes::math::V3;
use organza_light::RectangleLight;

/// Greatest area over the squared distance from the matter: points of nearer light are not
/// drawn evenly from its area.
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
    /// Edges of a voxel, mm.
    pub voxel_mm: Vec3,
}

impl Panel {
    /// `None` when it is too near to the matter for its size, so far from it.
    pub fn new(rectangle: &RectangleLight, apart_mm: f32, cell_grid: &CellGrid) -> Option<Panel> {
        let [corner, u, v] = rectangle.corner_and_edges_mm();
        let cross = u.cross(v);
        let area_mm2 = cross.length();
        (area_mm2 <= MAX_SOLID_ANGLE * apart_mm * apart_mm).then(|| Panel {
            corner_mm: corner - cell_grid.bounds_mm().min,
            edges_mm: [u, v],
            normal: cross / area_mm2,
            area_mm2,
            radiance: rectangle.radiance().0,
            is_two_sided: rectangle.is_two_sided(),
            voxel_mm: cell_grid.voxel_mm(),
        })
    }

    /// Toward drawn points, from places in voxels.
    #[inline(always)]
    pub fn toward<F: Floats>(
        &self,
        at: V3<F>,
        beyond: [F; 2],
        u: F,
        v: F,
        mask: F::Mask,
    ) -> Toward<F> {
        let place = V3::new(at.x + beyond[0], at.y + beyond[1], at.z);
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
        Toward {
            toward,
            distance_mm,
            irradiance: V3::splat(self.radiance).scaled(strength),
            seen: mask,
        }
    }

    /// The greatest irradiance in the matter, or radiance, over the radiance.
    pub fn brightness(&self) -> f32 {
        self.radiance.max_element() * MAX_SOLID_ANGLE
    }
}
