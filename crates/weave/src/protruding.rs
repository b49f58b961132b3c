//! Fibres that protrude from a yarn as smooth random curves.
//!
//! A fibre leaves the yarn along its twist, bends away from the surface, and curls at random, as
//! of [`crate::random_curve`]. The cloth's neighbourhood holds it: within `reach_mm` of the faces it
//! bends back. Lengths are exponentially distributed, and only what lies outside the yarn
//! counts, so that the yarn has the hairiness that was asked for.

use crate::drawn_curve::Look;
use crate::neps;
use crate::random_curve::RandomCurve;
use crate::spec::HairinessSpec;
use crate::strand::{Strand, any_fibre, unit};
use crate::yarn::Yarn;
use glam::{DVec2, DVec3};
use organza_basis::{PathRng, Segment};
use std::f64::consts::TAU;

/// The longest protruding fibre, mean lengths.
const MAX_LENGTHS: f64 = 6.0;
/// Length of the root inside the yarn, yarn radii, and how deep it begins.
const ROOT_RADII: f64 = 1.5;
const ROOT_DEPTH: f64 = 0.5;
/// Steps per radius of curl, and per radius of the yarn where hairs are smooth.
const STEPS_PER_CURL: f64 = 8.0;
/// A fibre that finds no way out of the yarn ends after so many times its length.
const MAX_DETOUR: f64 = 4.0;
/// Share of the length over which the tip tapers, and the radius that remains there.
const TIP: f64 = 0.3;
const TIP_RADIUS: f64 = 0.4;
/// How much more sharply than its curl a fibre bends when it is led.
const LEAD: f64 = 3.0;

/// Upper bound of the distance that protruding fibres reach from the yarn in any direction.
pub(crate) fn longest_protruding_mm(yarn: &Yarn) -> f64 {
    let longest = |h: HairinessSpec| MAX_DETOUR * MAX_LENGTHS * h.length_mm;
    yarn.hairiness
        .map_or(0.0, longest)
        .max(neps::reach_mm(yarn))
}

/// Emits the protruding fibres of a strand, numbered from `first`. Returns the number after the
/// last.
pub(crate) fn protrude(
    strand: &Strand,
    hairiness: &HairinessSpec,
    first: u32,
    rng: &mut PathRng,
    emit: &mut dyn FnMut(&Segment),
) -> u32 {
    let mean_mm = hairiness.length_mm / (1.0 - (-MAX_LENGTHS).exp());
    let expected = hairiness.index * strand.path.length_mm() / hairiness.length_mm;
    // The mean is the expected number, even where that is below one.
    let count = expected.floor() as u64 + u64::from(unit(rng) < expected.fract());
    let faces = Faces::new(strand, hairiness.reach_mm);
    let mut id = first;
    for _ in 0..count {
        let length_mm = mean_mm * f64::from(rng.exponential()).min(MAX_LENGTHS);
        let (radius_mm, dye) = any_fibre(strand.yarn, strand.dye, rng);
        let material = dye.at(|| 1.0);
        let curve = grow(strand, hairiness, &faces, length_mm, rng);
        let last = curve.len() as isize - 1;
        let look = |i: isize| {
            let to_tip = (last - i) as f64 / (TIP * last as f64);
            let tapered = TIP_RADIUS + (1.0 - TIP_RADIUS) * to_tip.min(1.0);
            Look {
                radius_mm: radius_mm * tapered,
                material,
            }
        };
        id = strand.emit_points(id, &curve, look, emit);
    }
    id
}

/// The faces of a yarn: the lowest and highest place of its surface, and how far beyond fibres
/// may go.
struct Faces {
    low_mm: f64,
    high_mm: f64,
    reach_mm: f64,
}

impl Faces {
    fn new(strand: &Strand, reach_mm: f64) -> Faces {
        let half = strand.section.highest() * strand.yarn.radius_mm();
        let heights = strand.path.points.iter().map(|p| p.z);
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| {
            (a.min(z), b.max(z))
        });
        Faces {
            low_mm: low - half,
            high_mm: high + half,
            reach_mm,
        }
    }

    /// How far beyond the faces a height is, as a signed share of the reach.
    fn beyond(&self, z: f64) -> f64 {
        ((z - self.high_mm).max(0.0) + (z - self.low_mm).min(0.0)) / self.reach_mm
    }

    /// The nearest height within reach.
    fn clamp(&self, z: f64) -> f64 {
        z.clamp(self.low_mm - self.reach_mm, self.high_mm + self.reach_mm)
    }
}

/// A point beside the yarn, found by walking along the centreline from the last one.
pub(crate) struct Beside<'a> {
    pub strand: &'a Strand<'a>,
    /// Sample of the path, which may lie outside one period.
    pub nearest: isize,
}

impl Beside<'_> {
    /// Starts at the sample nearest to a point, among those of the period and one on either side.
    pub fn search(&mut self, at: DVec3) {
        self.nearest = self.strand.path.nearest(at);
    }

    /// Follows the yarn to the sample nearest to a point. Gives the unit direction from the
    /// centreline to the point, and the distance in radii of the yarn's section there.
    pub fn follow(&mut self, at: DVec3) -> (DVec3, f64) {
        let path = self.strand.path;
        let square = |i: isize| path.offset(i, DVec2::ZERO).distance_squared(at);
        let mut here = square(self.nearest);
        for step in [1, -1] {
            loop {
                let next = square(self.nearest + step);
                if next >= here || !path.has(self.nearest + step) {
                    break;
                }
                here = next;
                self.nearest += step;
            }
        }
        let from = at - path.offset(self.nearest, DVec2::ZERO);
        let k = self.nearest.rem_euclid(path.steps() as isize) as usize;
        let section = DVec2::new(from.dot(path.lateral[k]), from.dot(path.vertical[k]));
        let s = path.arc_at(self.nearest) / path.length_mm();
        let radius = self.strand.scale(s) * self.strand.yarn.radius_mm();
        (
            from.normalize_or(path.vertical[k]),
            (section / self.strand.section.at(s)).length() / radius,
        )
    }
}

/// The part of a fibre inside its ply, which rises to the surface along the twist.
pub(crate) struct Root {
    pub ply: u32,
    /// Where it comes to the surface: along the yarn, and around the ply.
    pub arc_mm: f64,
    pub phase_rad: f64,
    /// 1 along the yarn, -1 against it.
    pub along: f64,
    /// Length along the yarn.
    pub length_mm: f64,
}

impl Root {
    pub fn points(&self, strand: &Strand, steps: usize) -> Vec<DVec3> {
        let (yarn, path) = (strand.yarn, strand.path);
        let ply_phase = strand.ply_phase();
        let point = |i: usize| {
            let t = i as f64 / steps as f64;
            let arc = self.arc_mm - self.along * self.length_mm * (1.0 - t);
            let s = arc / path.length_mm();
            let radius = yarn.ply_radius_mm * (ROOT_DEPTH + (1.0 - ROOT_DEPTH) * t);
            let angle = self.phase_rad + (arc - self.arc_mm) * yarn.twist_rad_per_mm;
            let offset =
                strand.ply_centre(self.ply, ply_phase, s) + radius * DVec2::from_angle(angle);
            path.at_arc(arc, strand.scale(s) * strand.section.at(s) * offset)
        };
        (0..=steps).map(point).collect()
    }
}

/// The points of one fibre, from its root inside the yarn to its tip.
fn grow(
    strand: &Strand,
    hairiness: &HairinessSpec,
    faces: &Faces,
    length_mm: f64,
    rng: &mut PathRng,
) -> Vec<DVec3> {
    let yarn = strand.yarn;
    let path = strand.path;
    let ply = rng.below(yarn.plies);
    let (arc_mm, phase) = (unit(rng) * path.length_mm(), unit(rng) * TAU);
    let along = if unit(rng) < 0.5 { 1.0 } else { -1.0 };
    let is_returning = unit(rng) < hairiness.returning;
    // A fibre is led with a curvature of up to LEAD over the yarn's radius: steps by the curl
    // alone show kinks where the yarn is fine.
    let shortest_radius_mm = if hairiness.smooth {
        hairiness.curl_mm.min(yarn.radius_mm())
    } else {
        hairiness.curl_mm
    };
    let step_mm = (shortest_radius_mm / STEPS_PER_CURL)
        .min(0.25 * length_mm)
        .max(yarn.fibre_radius_mm);

    // The root rises to the surface along the twist.
    let root_mm = ROOT_RADII * yarn.ply_radius_mm;
    let roots = (root_mm / step_mm).ceil().clamp(2.0, 64.0) as usize;
    let root = Root {
        ply,
        arc_mm,
        phase_rad: phase,
        along,
        length_mm: root_mm,
    };
    let mut curve = root.points(strand, roots);

    let mut at = curve[roots];
    let mut direction = (at - curve[roots - 1]).normalize_or(DVec3::X);
    let start = path.arc_mm.partition_point(|&a| a < arc_mm) as isize;
    let mut beside = Beside {
        strand,
        nearest: start,
    };
    let mut random = RandomCurve::new(hairiness.curl_mm, step_mm);
    let lead = LEAD / hairiness.curl_mm.min(yarn.radius_mm());
    let lean = DVec3::new(hairiness.lean[0], hairiness.lean[1], 0.0);
    let (mut outside_mm, mut walked_mm) = (0.0, 0.0);
    while outside_mm < length_mm && walked_mm < MAX_DETOUR * length_mm {
        let (outwards, radii) = beside.follow(at);
        let mut bend = random.bend(rng);
        let is_going_back = is_returning && outside_mm > 0.5 * length_mm;
        if is_going_back {
            if radii < ROOT_DEPTH {
                break;
            }
            bend -= lead * outwards;
        } else if radii < 1.3 {
            bend += lead * outwards;
        }
        if !is_going_back && radii > 1.0 {
            bend += LEAD / hairiness.curl_mm * lean;
        }
        let beyond = faces.beyond(at.z);
        bend -= lead * beyond * beyond.abs() * DVec3::Z;
        direction = random.turned(direction, bend);
        let mut next = at + step_mm * direction;
        next.z = faces.clamp(next.z);
        if radii > 1.0 || is_going_back {
            outside_mm += at.distance(next);
        }
        walked_mm += step_mm;
        at = next;
        curve.push(at);
    }
    curve
}
