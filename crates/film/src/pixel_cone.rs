//! The width of a pixel along its ray.

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
