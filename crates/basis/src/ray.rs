//! Rays.

use glam::{DVec3, Vec3};

/// A half line: `origin + t direction`, `t >= 0`, with a unit direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start, in millimetres: in double precision, because fibres are a few micrometres
    /// thick, and single precision has steps of that size some metres from the origin.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: Vec3,
    /// The yarn that the ray leaves; `None` where it comes from outside all matter, or
    /// where that is not known.
    pub left_yarn: Option<u32>,
}

impl Ray {
    /// A ray from a start and a unit direction, from outside all matter.
    pub fn new(origin: impl Into<DVec3>, direction: Vec3) -> Ray {
        Ray {
            origin: origin.into(),
            direction,
            left_yarn: None,
        }
    }

    /// The same ray, which leaves this yarn.
    pub fn leaving(self, left_yarn: Option<u32>) -> Ray {
        Ray { left_yarn, ..self }
    }

    /// The point at a distance, mm.
    pub fn at(&self, t: impl Into<f64>) -> DVec3 {
        self.origin + t.into() * self.direction.as_dvec3()
    }
}
