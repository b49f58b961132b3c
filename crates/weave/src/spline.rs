//! Curves through points at equal distances.

use std::ops::{Add, Mul, Sub};

/// The point at the share `t` of the way between the two middle ones of four points, on the
/// uniform Catmull-Rom spline: tangents are continuous.
#[inline]
pub(crate) fn catmull_rom<S, V>([a, b, c, d]: [V; 4], t: S) -> V
where
    S: Copy + From<f32> + Mul<V, Output = V>,
    V: Copy + Add<Output = V> + Sub<Output = V>,
{
    let times = |factor: f32, v: V| S::from(factor) * v;
    let square = a - times(2.5, b) + times(2.0, c) - times(0.5, d);
    let cubic = times(1.5, b - c) + times(0.5, d - a);
    b + t * (times(0.5, c - a) + t * (square + t * cubic))
}
