//! Layouts of directions that goniometers use.

use crate::{Angles, Pair};
use glam::Vec2;
use organza_basis::warp;

/// Incident directions along each side of the square.
const SIDE: usize = 15;

/// The steepest incident direction, degrees.
const RIM_DEG: f64 = 75.0;

/// Exitant directions of the measurements in [Irawan2008]: theta and phi in
/// degrees.
const EXITANT_DEG: [(f64, f64); 7] = [
    (0.0, 0.0),
    (30.0, 0.0),
    (30.0, 90.0),
    (60.0, 0.0),
    (60.0, 45.0),
    (60.0, 90.0),
    (60.0, 135.0),
];

/// The 225 incident directions of [Irawan2008]: a 15 x 15 grid over the square, borders
/// included, mapped to the hemisphere up to 75 degrees by the concentric map [Shirley1997], row
/// by row.
///
/// The source does not give the map from the disk to the hemisphere; here equal areas become
/// equal solid angles, as the source of the concentric map proposes.
pub fn irawan_incident() -> Vec<Angles> {
    let step = 1.0 / (SIDE - 1) as f32;
    let fall = 1.0 - RIM_DEG.to_radians().cos();
    let angles = |k: usize| {
        let square = Vec2::new((k % SIDE) as f32, (k / SIDE) as f32) * step;
        let disk = warp::concentric_disk(square).as_dvec2();
        let cos = 1.0 - disk.length_squared().min(1.0) * fall;
        Angles::new(
            cos.clamp(-1.0, 1.0).acos().to_degrees(),
            disk.y.atan2(disk.x).to_degrees(),
        )
    };
    (0..SIDE * SIDE).map(angles).collect()
}

/// The 7 exitant directions of [Irawan2008].
pub fn irawan_exitant() -> [Angles; 7] {
    EXITANT_DEG.map(|(theta_deg, phi_deg)| Angles { theta_deg, phi_deg })
}

/// All 225 x 7 pairs, exitant directions outermost.
pub fn irawan_layout() -> Vec<Pair> {
    let incident = irawan_incident();
    let pairs_of = |&(theta_deg, phi_deg): &(f64, f64)| {
        let exitant = Angles { theta_deg, phi_deg };
        let pair = move |&incident: &Angles| Pair { incident, exitant };
        incident.iter().map(pair).collect::<Vec<_>>()
    };
    EXITANT_DEG.iter().flat_map(pairs_of).collect()
}

/// Directions at the middles of equal steps: `polar` of them from 0 to 90
/// degrees, or to 180 with the back, times `azimuths` around.
pub fn grid_directions(polar: u32, azimuths: u32, with_back: bool) -> Vec<Angles> {
    let rings = if with_back { 2 * polar } else { polar };
    let middle = |k: u32, n: u32, range: f64| (f64::from(k) + 0.5) * range / f64::from(n);
    (0..rings)
        .flat_map(|t| (0..azimuths).map(move |p| (t, p)))
        .map(|(t, p)| {
            Angles::new(
                middle(t, polar, 90.0),
                f64::from(p) * 360.0 / f64::from(azimuths),
            )
        })
        .collect()
}

/// Every incident direction of a regular grid over the face with every exitant direction of
/// both sides, exitant directions outermost.
pub fn grid_layout(polar: u32, azimuths: u32) -> Vec<Pair> {
    let incident = grid_directions(polar, azimuths, false);
    let pairs_of = |exitant: Angles| {
        let pair = move |&incident: &Angles| Pair { incident, exitant };
        incident.iter().map(pair).collect::<Vec<_>>()
    };
    let exitant = grid_directions(polar, azimuths, true);
    exitant.into_iter().flat_map(pairs_of).collect()
}

/// Reflection and transmission in the planes of weft and warp, light at
/// `theta_deg` in that plane, exitant directions every 10 degrees to 80 on both
/// sides of the cloth.
pub fn in_plane_layout(theta_deg: f64) -> Vec<Pair> {
    let mut list = Vec::new();
    for phi_deg in [0.0, 90.0] {
        let incident = Angles { theta_deg, phi_deg };
        for back in [false, true] {
            for step in -8..=8 {
                let tilt = 10.0 * f64::from(step);
                let exitant = Angles::new(
                    if back { 180.0 - tilt.abs() } else { tilt.abs() },
                    if tilt < 0.0 { phi_deg + 180.0 } else { phi_deg },
                );
                list.push(Pair { incident, exitant });
            }
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_covers_the_cap_evenly() {
        let incident = irawan_incident();
        assert_eq!(incident.len(), 225);
        assert_eq!(irawan_layout().len(), 225 * 7);
        let rim = |a: &&Angles| (a.theta_deg - 75.0).abs() < 1e-3;
        assert_eq!(incident.iter().filter(rim).count(), 56);
        assert!(incident.iter().all(|a| a.theta_deg < 75.0 + 1e-3));
        // The middle of the grid is the normal; squares around it are rings of
        // equal height: cos theta falls with the square of the ring's number.
        assert!(incident[112].theta_deg < 4.0 * f64::from(f32::EPSILON));
        for (k, a) in incident.iter().enumerate() {
            let (x, y) = ((k % 15) as f64 - 7.0, (k / 15) as f64 - 7.0);
            let ring = x.abs().max(y.abs()) / 7.0;
            let cos = 1.0 - ring * ring * (1.0 - 75f64.to_radians().cos());
            let off = (a.theta_deg.to_radians().cos() - cos).abs();
            assert!(off < 4.0 * f64::from(f32::EPSILON), "{k}");
        }
        assert_eq!(grid_layout(3, 4).len(), 12 * 24);
        assert_eq!(in_plane_layout(30.0).len(), 2 * 2 * 17);
        // No two directions coincide.
        for (i, a) in incident.iter().enumerate() {
            for b in &incident[..i] {
                assert!((a.direction() - b.direction()).length() > 0.03);
            }
        }
    }
}
