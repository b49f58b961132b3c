//! Rays.

use glam::Vec3;

/// A half line: `origin + t direction`, `t >= 0`, with a unit direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start, in millimetres.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// The yarn that the ray leaves; `None` where it comes from outside all matter, or
    /// where that is not known.
    pub left_yarn: Option<u32>,
}

impl Ray {
    /// A ray from a start and a unit direction, from outside all matter.
    pub fn new(origin: Vec3, direction: Vec3) -> Ray {
        Ray {
            origin,
            direction,
            left_yarn: None,
        }
    }

    /// The same ray, which leaves this yarn.
    pub fn leaving(self, left_yarn: Option<u32>) -> Ray {
        Ray { left_yarn, ..self }
    }

    /// The point at distance `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }
}
