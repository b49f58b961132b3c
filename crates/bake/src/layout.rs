//! The pairs of directions that materials are fitted to, and those that judge them.

use glam::Vec3;
use organza_measure::{Angles, Pair};

/// Which way the light goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Lit and seen on the face.
    Face,
    /// Lit and seen on the back.
    Back,
    /// Lit on the face, seen on the back.
    Through,
}

/// Which part of the material a pair shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// Reflection with the half vector within 20 degrees of the normal, neither direction
    /// grazing.
    Highlight,
    /// Other reflection, neither direction grazing.
    Diffuse,
    /// Reflection with a direction beyond 60 degrees.
    Grazing,
    /// Transmission within 40 degrees of straight through.
    Forward,
    /// Other transmission.
    Spread,
}

/// One pair with its part in the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedPair {
    /// The directions.
    pub pair: Pair,
    /// Which way the light goes.
    pub side: Side,
    /// Which part of the material it shows.
    pub part: Part,
    /// Whether it is kept from the fit.
    pub is_held_out: bool,
}

/// The steepest direction, degrees.
const MAX_THETA_DEG: f64 = 80.0;
/// The largest angle between half vector and normal of the pairs near highlights, degrees.
const NEAR_DEG: f64 = 25.0;

/// The middle direction of a pair, light mirrored to the side of the eye.
fn half_cosine(pair: &Pair) -> f32 {
    let (i, o) = (pair.incident.direction(), pair.exitant.direction());
    let i = Vec3::new(i.x, i.y, i.z.abs() * o.z.signum());
    (i + o).normalize_or_zero().z.abs()
}

impl PlannedPair {
    fn new(pair: Pair, is_held_out: bool) -> PlannedPair {
        let (front, from_front) = (
            pair.incident.theta_deg < 90.0,
            pair.exitant.theta_deg < 90.0,
        );
        let side = match (front, from_front) {
            (true, true) => Side::Face,
            (false, false) => Side::Back,
            _ => Side::Through,
        };
        let tilt = |a: &Angles| a.theta_deg.min(180.0 - a.theta_deg);
        let is_grazing = tilt(&pair.incident).max(tilt(&pair.exitant)) > 60.0;
        let cos = |deg: f32| deg.to_radians().cos();
        let straight = -pair.incident.direction().dot(pair.exitant.direction());
        let part = match side {
            Side::Through if straight > cos(40.0) => Part::Forward,
            Side::Through => Part::Spread,
            _ if is_grazing => Part::Grazing,
            _ if half_cosine(&pair) > cos(20.0) => Part::Highlight,
            _ => Part::Diffuse,
        };
        PlannedPair {
            pair,
            side,
            part,
            is_held_out,
        }
    }
}

/// `count` pairs of an additive sequence [Roberts2018] over directions up to 80 degrees, even
/// in projected solid angle: of every eight, four are reflected by the face, half of these
/// near highlights, three are transmitted, one is reflected by the back. Every fourth group
/// of eight is held out.
pub fn planned_pairs(count: u32) -> Vec<PlannedPair> {
    // The root above one of x^5 = x + 1.
    let root = (0..60).fold(2.0f64, |x, _| (1.0 + x).powf(0.2));
    let limit = MAX_THETA_DEG.to_radians().sin().powi(2);
    let angles = |u: f64, v: f64| Angles::new((u * limit).sqrt().asin().to_degrees(), 360.0 * v);
    let behind = |a: Angles| Angles {
        theta_deg: 180.0 - a.theta_deg,
        ..a
    };
    let mut list = Vec::new();
    let mut k = 0u32;
    while (list.len() as u32) < count {
        k += 1;
        let u = |d: i32| (0.5 + f64::from(k) * root.powi(-d)).fract();
        let incident = angles(u(1), u(2));
        let place = list.len() as u32 % 8;
        let pair = match place {
            0 | 1 => near_highlight(incident, u(3), u(4)),
            2 | 3 => Some((incident, angles(u(3), u(4)))),
            7 => Some((behind(incident), behind(angles(u(3), u(4))))),
            _ => Some((incident, behind(angles(u(3), u(4))))),
        };
        let Some((incident, exitant)) = pair else {
            continue;
        };
        let is_held_out = list.len() as u32 / 8 % 4 == 3;
        list.push(PlannedPair::new(Pair { incident, exitant }, is_held_out));
    }
    list
}

/// A pair whose half vector is near the normal; `None` where its eye is too steep.
fn near_highlight(incident: Angles, u: f64, v: f64) -> Option<(Angles, Angles)> {
    let half = Angles::new(NEAR_DEG * u, 360.0 * v);
    let (h, i) = (half.direction().as_dvec3(), incident.direction().as_dvec3());
    let o = 2.0 * h.dot(i) * h - i;
    let exitant = Angles::new(
        o.z.clamp(-1.0, 1.0).acos().to_degrees(),
        o.y.atan2(o.x).to_degrees(),
    );
    (exitant.theta_deg < MAX_THETA_DEG).then_some((incident, exitant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_is_fitted_and_judged() {
        let plan = planned_pairs(320);
        assert_eq!(plan.len(), 320);
        for part in [
            Part::Highlight,
            Part::Diffuse,
            Part::Grazing,
            Part::Forward,
            Part::Spread,
        ] {
            for is_held_out in [false, true] {
                let of_part = |p: &&PlannedPair| {
                    p.part == part && p.is_held_out == is_held_out && p.side != Side::Back
                };
                let count = plan.iter().filter(of_part).count();
                assert!(count >= 5, "{part:?} {is_held_out}: {count}");
            }
        }
        assert_eq!(plan.iter().filter(|p| p.side == Side::Back).count(), 40);
        let steep = |a: Angles| (a.theta_deg - 90.0).abs() < 9.9;
        assert!(
            !plan
                .iter()
                .any(|p| steep(p.pair.incident) || steep(p.pair.exitant))
        );
        // The mirror pair is a highlight.
        let pair = Pair::new(Angles::new(30.0, 10.0), Angles::new(30.0, 190.0));
        assert_eq!(PlannedPair::new(pair, false).part, Part::Highlight);
    }
}
