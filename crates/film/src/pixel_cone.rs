//! How wide pixels are where their rays go.

use crate::{Camera, Projection};
use glam::{DVec3, Vec2, Vec3};
use organza_basis::{Aabb, CellGrid};

/// Width that a pixel sees at a distance along a camera ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelCone {
    /// Width where the ray begins.
    pub width_mm: f64,
    /// Growth per mm of distance.
    pub growth: f64,
}

impl PixelCone {
    /// The width at a distance from the ray's origin.
    pub fn width_at_mm(&self, distance_mm: f64) -> f64 {
        self.width_mm + self.growth * distance_mm
    }
}

impl Camera {
    /// How wide a pixel is along a ray with this unit direction, across the
    /// optical axis. What a lens adds out of focus is left out: it hides
    /// detail but does not ask for less.
    pub fn pixel_cone(&self, direction: DVec3) -> PixelCone {
        let pixel = self.film_width / f64::from(self.resolution.x);
        match self.projection {
            Projection::Orthographic { .. } => PixelCone {
                width_mm: pixel,
                growth: 0.0,
            },
            _ => PixelCone {
                width_mm: 0.0,
                growth: pixel * direction.dot(self.forward),
            },
        }
    }

    /// Least and greatest width of a pixel where its ray comes to a flat cloth,
    /// mm, with room for what lens and filter add; infinite with a horizon.
    ///
    /// Between the corners of the picture the width has no extreme: the inverse
    /// of a plane's depth is linear over the film.
    pub fn footprints_mm(&self, cloth: &CellGrid) -> (f32, f32) {
        const ROOM: f64 = 1.05;
        if let Projection::Orthographic { .. } = self.projection {
            let width = self.pixel_cone(self.forward).width_mm as f32;
            return (width, width);
        }
        let size = self.resolution.as_vec2();
        let corners = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
        let widths = corners.map(|c| {
            let offset = self.film_offset(c * (size + 2.0) - 1.0);
            let direction = (self.forward + offset).normalize();
            let distance_mm = cloth.distance_mm(self.origin_mm, direction);
            self.pixel_cone(direction).width_at_mm(distance_mm)
        });
        let least = widths.iter().copied().fold(f64::INFINITY, f64::min);
        let most = widths.iter().copied().fold(0.0, f64::max);
        let least = if least.is_finite() { least } else { 0.0 };
        ((least / ROOM) as f32, (most * ROOM) as f32)
    }

    /// The same for anything inside a box.
    pub fn footprints_in_mm(&self, bounds_mm: Aabb) -> (f32, f32) {
        let cone = self.pixel_cone(self.forward);
        let depth = |corner: Vec3| (corner.as_dvec3() - self.origin_mm).dot(self.forward);
        let (centre, half) = (bounds_mm.centre(), 0.5 * bounds_mm.size());
        let middle = depth(centre);
        let reach = f64::from(half.dot(self.forward.abs().as_vec3()));
        let width = |depth: f64| cone.width_at_mm(depth.max(0.0)) as f32;
        (width(middle - reach), width(middle + reach))
    }
}
