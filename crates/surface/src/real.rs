//! The scalar the model is written for: `f32` renders, `f64` judges.

use num_traits::{Float, FloatConst};
use std::fmt::Debug;
use std::iter::Sum;

/// A floating-point number with the constants the model needs.
pub trait Real: Float + FloatConst + Debug + Sum + Send + Sync + 'static {
    /// From a literal or a parameter.
    fn of(x: f64) -> Self;
}

impl Real for f32 {
    fn of(x: f64) -> f32 {
        x as f32
    }
}

impl Real for f64 {
    fn of(x: f64) -> f64 {
        x
    }
}

/// A unit vector in the frame of a yarn segment: x across the yarn, y along
/// it, z out of the cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction<T> {
    /// Across the yarn.
    pub x: T,
    /// Along the yarn.
    pub y: T,
    /// Out of the cloth.
    pub z: T,
}

impl<T: Real> Direction<T> {
    /// From its coordinates, which the caller has normalised.
    pub fn new(x: T, y: T, z: T) -> Self {
        Direction { x, y, z }
    }

    /// Scalar product.
    pub fn dot(self, o: Self) -> T {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
}
