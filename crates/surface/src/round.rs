//! Diffuse light of round yarns.
//!
//! The diffuse part of the thesis is that of a flat sheet. Yarns are not flat: a row of round
//! yarns shows its flanks when light and viewer lean across it in the same direction, and then
//! it becomes brighter towards grazing angles.

use crate::real::Direction;
use std::f32::consts::FRAC_PI_2;

/// Value of a row of touching round yarns, diffuse on their surface, as a
/// multiple of the flat sheet's of the same albedo; both directions above it,
/// in the frame of a segment (x across).
///
/// Exact except for light between yarns: the lit and the visible part of a yarn are arcs that
/// its neighbours limit. The value is symmetric and conserves energy.
pub(crate) fn round_yarns(w_in: Direction<f32>, w_out: Direction<f32>) -> f32 {
    let angle = |w: Direction<f32>| w.x.atan2(w.z);
    let (a, b) = (angle(w_in), angle(w_out));
    let ((low_a, high_a), (low_b, high_b)) = (open(a), open(b));
    let (low, high) = (low_a.max(low_b), high_a.min(high_b));
    if !(low < high) {
        return 0.0;
    }
    // Of cos(v - a) cos(v - b).
    let edges = (2.0 * high - a - b).sin() - (2.0 * low - a - b).sin();
    let integral = 0.5 * ((high - low) * (a - b).cos() + 0.5 * edges);
    let across = w_in.x.hypot(w_in.z) * w_out.x.hypot(w_out.z);
    (0.5 * integral * across / (w_in.z * w_out.z)).max(0.0)
}

/// The arc of a yarn that a direction at angle `a` from the normal meets: offsets h = sin(v -
/// a) across the beam from the yarn's own edge to where the neighbour begins, 2 cos a apart.
fn open(a: f32) -> (f32, f32) {
    let lean = a.abs();
    let far = lean - FRAC_PI_2;
    let near = lean + (2.0 * lean.cos() - 1.0).clamp(-1.0, 1.0).asin();
    if a < 0.0 { (-near, -far) } else { (far, near) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::sequence;
    use glam::{Vec2, Vec3};
    use organza_basis::warp;

    /// Whether a ray from a place of the yarn at 0 passes its neighbours.
    fn escapes(place: Vec2, w: Vec2) -> bool {
        let normal = place.normalize();
        let clear = |k: i32| {
            let to = Vec2::new(2.0 * k as f32, 0.0) - place;
            let along = to.dot(w);
            along < 0.0 || (to - along * w).length() > 1.0 - 1e-5
        };
        normal.dot(w) > 0.0 && (-30..=30).filter(|&k| k != 0).all(clear)
    }

    #[test]
    fn closed_form_equals_rays_between_cylinders() {
        let turn = warp::direction_from_angles;
        for (i, o) in [
            (turn(0.1, 0.0), turn(0.3, 2.0)),
            (turn(1.1, 0.2), turn(1.2, 0.1)),
            (turn(1.2, 3.0), turn(0.9, 0.1)),
            (turn(1.4, 1.4), turn(0.8, 4.0)),
        ] {
            let plane = |w: Vec3| Vec2::new(w.x, w.z).normalize();
            let count = 20_000;
            let mut sum = 0.0;
            for k in 0..count {
                let v = ((k as f32 + 0.5) / count as f32 - 0.5) * std::f32::consts::PI;
                let n = Vec2::new(v.sin(), v.cos());
                if escapes(n, plane(i)) && escapes(n, plane(o)) {
                    sum += n.dot(Vec2::new(i.x, i.z)) * n.dot(Vec2::new(o.x, o.z));
                }
            }
            let rays = 0.5 * sum * std::f32::consts::PI / count as f32 / (i.z * o.z);
            let d = |w: Vec3| Direction::new(w.x, w.y, w.z);
            let closed = round_yarns(d(i), d(o));
            let most = 2e-3 * (1.0 + rays);
            assert!((closed - rays).abs() < most, "{closed} {rays}");
            assert!((closed - round_yarns(d(o), d(i))).abs() < 4.0 * f32::EPSILON);
        }
    }

    #[test]
    fn no_more_comes_back_than_there_is() {
        for theta in [0.0, 0.7, 1.3, 1.55] {
            for phi in [0.0, 0.8, 1.57] {
                let w = warp::direction_from_angles(theta, phi);
                let d = |w: Vec3| Direction::new(w.x, w.y, w.z);
                let draws = sequence::<2>(4096).map(|[a, b]| {
                    let w_in = warp::cosine_hemisphere(Vec2::new(a, b));
                    round_yarns(d(w_in), d(w))
                });
                let albedo = draws.sum::<f32>() / 4096.0;
                assert!(albedo < 1.0 && albedo > 0.5, "{theta} {phi}: {albedo}");
            }
        }
    }
}
