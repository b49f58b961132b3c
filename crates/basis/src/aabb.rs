//! Axis-aligned boxes.

use crate::Ray;
use glam::Vec3;

/// A closed axis-aligned box, in the units of its corners (millimetres
/// throughout organza).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least corner.
    pub min: Vec3,
    /// Greatest corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that holds nothing: the neutral element of [`Aabb::union`].
    pub const EMPTY: Aabb = Aabb {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    /// A box from its two corners.
    pub fn new(min: Vec3, max: Vec3) -> Aabb {
        Aabb { min, max }
    }

    /// True when no point lies inside.
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Edge lengths.
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// The middle.
    pub fn centre(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// The smallest box around both.
    pub fn union(&self, other: &Aabb) -> Aabb {
        Aabb::new(self.min.min(other.min), self.max.max(other.max))
    }

    /// The smallest box around this one and a point.
    pub fn with_point(&self, p: Vec3) -> Aabb {
        Aabb::new(self.min.min(p), self.max.max(p))
    }

    /// The box moved outwards by `margin` on every side.
    pub fn grown(&self, margin: f32) -> Aabb {
        Aabb::new(self.min - margin, self.max + margin)
    }

    /// True when the point lies inside or on the surface.
    pub fn contains(&self, p: Vec3) -> bool {
        p.cmpge(self.min).all() && p.cmple(self.max).all()
    }

    /// The interval of ray parameters inside the box, cut at zero.
    ///
    /// `None` when the ray misses. A ray parallel to a face is inside that
    /// slab when its origin is, faces included; no comparison sees a NaN.
    pub fn intersect(&self, ray: &Ray) -> Option<(f64, f64)> {
        let mut near = 0.0f64;
        let mut far = f64::INFINITY;
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], f64::from(ray.direction[axis]));
            let (lo, hi) = (f64::from(self.min[axis]), f64::from(self.max[axis]));
            if d == 0.0 {
                if o < lo || o > hi {
                    return None;
                }
                continue;
            }
            let (a, b) = ((lo - o) / d, (hi - o) / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far).then_some((near, far))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parallel_rays_on_a_face_are_inside() {
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let ray = Ray::new(Vec3::new(-1.0, 0.0, 1.0), Vec3::X);
        assert_eq!(unit.intersect(&ray), Some((1.0, 2.0)));
        let outside = Ray::new(Vec3::new(-1.0, 0.0, 1.0001), Vec3::X);
        assert_eq!(unit.intersect(&outside), None);
    }

    #[test]
    fn a_ray_that_starts_inside_begins_at_zero() {
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let ray = Ray::new(Vec3::splat(0.5), Vec3::NEG_Z);
        assert_eq!(unit.intersect(&ray), Some((0.0, 0.5)));
    }

    #[test]
    fn a_box_behind_the_ray_is_missed() {
        let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
        let ray = Ray::new(Vec3::new(2.0, 0.5, 0.5), Vec3::X);
        assert_eq!(unit.intersect(&ray), None);
    }
}
