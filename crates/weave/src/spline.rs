//! Curves through points at equal distances.

use glam::{DVec2, Vec2};
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

/// The point at the share `run` of a closed line through knots at equal distances. `run` may
/// lie outside 0 to 1.
#[inline]
pub(crate) fn closed_spline(knots: &[Vec2], run: f64) -> DVec2 {
    let (around, t) = around(knots, run);
    catmull_rom(around, t as f32).as_dvec2()
}

/// The same for numbers.
#[inline]
pub(crate) fn periodic_spline(knots: &[f64], run: f64) -> f64 {
    let (around, t) = around(knots, run);
    catmull_rom(around, t)
}

/// The two knots before and the two after the share `run` of a closed line, and the share of
/// the way between the inner two.
#[inline]
fn around<V: Copy>(knots: &[V], run: f64) -> ([V; 4], f64) {
    let n = knots.len();
    let place = (run - run.floor()) * n as f64;
    let first = (place as usize).min(n - 1);
    let t = place - first as f64;
    let after = if first + 1 < n { first + 1 } else { 0 };
    let last = if after + 1 < n { after + 1 } else { 0 };
    let before = if first > 0 { first - 1 } else { n - 1 };
    let around = [knots[before], knots[first], knots[after], knots[last]];
    (around, t)
}
