//! A row of lockstitches: a needle thread above the cloth and a bobbin thread below it, which hold
//! each other in its middle at every hole of the needle.
//!
//! Places are along the row, across it to the left, and up, in millimetres; height 0 is the middle
//! of the cloth that shows the needle thread.

use glam::{DVec2, DVec3};
use organza_basis::PathRng;

/// How lockstitches are made.
#[derive(Clone, Copy, Debug)]
pub struct LockstitchSpec {
    /// Length of a stitch along the row.
    pub stitch_mm: f64,
    /// Width of a zigzag: holes alternate between the two sides of the row.
    pub zigzag_mm: f64,
    /// Heights of the lower and the upper side of all that is sewn.
    pub layers_mm: [f64; 2],
    /// How far the upper side sinks at a hole.
    pub sink_mm: f64,
    /// Diameter of a hole, from which the cloth is pushed aside; 0 for none.
    pub hole_mm: f64,
}

/// A row of lockstitches.
#[derive(Clone, Debug)]
pub struct Lockstitch {
    /// The holes of the needle: along the row and across it.
    holes_mm: Vec<DVec2>,
    thread_radius_mm: f64,
    layers_mm: [f64; 2],
    sink_mm: f64,
    /// Radius of a hole, and how far from its middle cloth is pushed aside.
    hole_radius_mm: f64,
    hole_reach_mm: f64,
}

/// Deviation of holes from their places, in stitches, along the row and across it (estimated).
const JITTER: DVec2 = DVec2::new(0.04, 0.015);
/// How far cloth is pressed half way between two holes, as a share of what it is at a hole
/// (estimated).
const BETWEEN: f64 = 0.45;
/// Radii of the thread across which pressed cloth comes up again (estimated).
const REACH: f64 = 3.2;
/// Diameters of a hole across which the cloth around it is pushed aside (estimated).
const HOLE_REACH: f64 = 3.0;
/// Radius of a hole, at most, as a share of that reach: cloth beside it keeps a fifth of its width.
const WIDEST_HOLE: f64 = 0.4;
/// Radius of the cloth in the middle of a hole that is not pushed aside but left out, in radii of
/// the hole.
const LEFT_OUT: f64 = 0.02;
/// Length of a mesh's edges at a hole, in radii of the hole, and its growth with the distance from the
/// middle: edges span 0.75 rad at most, so that circles around it are off by 7 % of their radius.
const HOLE_EDGE: f64 = 0.4;
const EDGE_GROWTH: f64 = 0.35;
/// Radii of the thread between its middle and either strand of the needle thread in a hole.
const STRANDS: f64 = 1.1;

impl Lockstitch {
    /// A row of a length, stitched with a thread of a radius.
    pub fn new(spec: &LockstitchSpec, row_mm: f64, thread_radius_mm: f64, seed: u64) -> Lockstitch {
        let count = (row_mm / spec.stitch_mm).round().max(1.0);
        let own_mm = row_mm / count;
        let mut rng = PathRng::from_seed(seed);
        let mut hole = |i: u32| {
            let side = if i.is_multiple_of(2) { 0.5 } else { -0.5 };
            let place = DVec2::new(f64::from(i) * own_mm, side * spec.zigzag_mm);
            // Evenly spread deviations are at most 1.7 times the root of their mean square.
            let off = 3.0f64.sqrt() * (2.0 * rng.unit2().as_dvec2() - 1.0);
            place + off * JITTER * own_mm
        };
        let holes_mm: Vec<DVec2> = (0..=count as u32).map(&mut hole).collect();
        // No place is pushed by two holes.
        let pairs = holes_mm.windows(2).map(|pair| pair[0].distance(pair[1]));
        let hole_reach_mm = pairs.fold(HOLE_REACH * spec.hole_mm, |least, d| least.min(0.5 * d));
        Lockstitch {
            holes_mm,
            thread_radius_mm,
            layers_mm: spec.layers_mm,
            sink_mm: spec.sink_mm,
            hole_radius_mm: (0.5 * spec.hole_mm).min(WIDEST_HOLE * hole_reach_mm),
            hole_reach_mm,
        }
    }

    /// Beyond this distance from the row cloth lies as before.
    pub fn reach_mm(&self) -> f64 {
        2.5 * REACH * self.thread_radius_mm
    }

    /// The holes before and after a place.
    fn holes_beside_mm(&self, place_mm: DVec2) -> [DVec2; 2] {
        let after = self.holes_mm.partition_point(|h| h.x < place_mm.x);
        let last = self.holes_mm.len() - 1;
        [after.saturating_sub(1), after.min(last)].map(|i| self.holes_mm[i])
    }

    /// A place, as seen from the nearest hole.
    fn seen_from_hole_mm(&self, place_mm: DVec2) -> DVec2 {
        let [a, b] = self.holes_beside_mm(place_mm).map(|hole| place_mm - hole);
        match a.length_squared() < b.length_squared() {
            true => a,
            false => b,
        }
    }

    /// How far cloth that lay at this distance from a hole's middle is pushed away from it: by the
    /// hole's radius at its middle. Cloth that lay farther away stays so.
    fn push_mm(&self, away_mm: f64) -> f64 {
        let share = (1.0 - away_mm / self.hole_reach_mm).max(0.0);
        self.hole_radius_mm * share * share
    }

    /// Whether cloth is pushed away from the holes.
    pub fn has_holes(&self) -> bool {
        self.hole_radius_mm > 0.0
    }

    /// By how much cloth that lay at a place is pushed away from a hole; `None` in the middle of
    /// one, where there is none.
    pub fn pushed_mm(&self, place_mm: DVec2) -> Option<DVec2> {
        if !self.has_holes() {
            return Some(DVec2::ZERO);
        }
        let away = self.seen_from_hole_mm(place_mm);
        let away_mm = away.length();
        let is_left = away_mm > LEFT_OUT * self.hole_radius_mm;
        is_left.then(|| self.push_mm(away_mm) / away_mm * away)
    }

    /// How long the edges of a mesh may be at a place so that holes show as round: the shorter, the
    /// farther they are drawn apart around a hole.
    pub fn longest_edge_mm(&self, place_mm: DVec2) -> f64 {
        if !self.has_holes() {
            return f64::INFINITY;
        }
        let (radius_mm, away_mm) = (
            self.hole_radius_mm,
            self.seen_from_hole_mm(place_mm).length(),
        );
        let lay_mm = away_mm.max(LEFT_OUT * radius_mm);
        let shrunk = lay_mm / (lay_mm + self.push_mm(lay_mm));
        HOLE_EDGE * radius_mm * shrunk
            + EDGE_GROWTH * away_mm
            + (away_mm - self.hole_reach_mm).max(0.0)
    }

    /// How far the upper side of the cloth sinks at a place.
    pub fn depth_mm(&self, place_mm: DVec2) -> f64 {
        let [a, b] = self.holes_beside_mm(place_mm);
        let share = match b.x > a.x {
            true => (place_mm.x - a.x) / (b.x - a.x),
            false => 0.0,
        };
        let cosine = (std::f64::consts::PI * share).cos();
        let along = BETWEEN + (1.0 - BETWEEN) * cosine.powi(4);
        let nearest = a.lerp(b, share);
        let aside = (place_mm - nearest) / (REACH * self.thread_radius_mm);
        self.sink_mm * along * (-aside.length_squared()).exp()
    }

    /// Points of the needle thread.
    pub fn needle_thread_mm(&self) -> Vec<DVec3> {
        let [low, high] = self.layers_mm;
        let (r, middle) = (self.thread_radius_mm, 0.5 * (low + high));
        let inside = (high - middle - self.sink_mm).max(0.0);
        let on_top = |p: DVec2| p.extend(high + 0.8 * r - self.depth_mm(p));
        let mut points = Vec::new();
        for (i, &hole) in self.holes_mm.iter().enumerate() {
            let strand = |side: f64| {
                let at = |along: f64, across: f64, height| {
                    (hole + r * DVec2::new(along, side * across)).extend(height)
                };
                // From the lock up to the surface.
                [
                    at(0.0, STRANDS, middle),
                    at(0.1 * side, STRANDS, middle + 0.8 * inside),
                    on_top(hole + r * DVec2::new(1.6 * side, 0.7 * side)) - 0.3 * r * DVec3::Z,
                ]
            };
            if i > 0 {
                let before: DVec2 = self.holes_mm[i - 1];
                let [from, to] = [
                    before + r * DVec2::new(1.6, 0.7),
                    hole - r * DVec2::new(1.6, 0.7),
                ];
                points.extend([0.25, 0.5, 0.75].map(|t| on_top(from.lerp(to, t))));
                points.extend(strand(-1.0).iter().rev());
            }
            // Around the bobbin thread.
            points.push(hole.extend(middle - r));
            if i + 1 < self.holes_mm.len() {
                points.extend(strand(1.0));
            }
        }
        points
    }

    /// Points of the bobbin thread: it passes between the strands of the needle thread.
    pub fn bobbin_thread_mm(&self) -> Vec<DVec3> {
        let [low, high] = self.layers_mm;
        let (r, middle) = (self.thread_radius_mm, 0.5 * (low + high));
        let below = low - 0.8 * r;
        let mut points = Vec::new();
        for (i, &hole) in self.holes_mm.iter().enumerate() {
            let strand = |side: f64| {
                let at = |along: f64, height| (hole + r * DVec2::X * side * along).extend(height);
                [at(0.6, 0.5 * (low + middle)), at(1.6, below + 0.3 * r)]
            };
            if i > 0 {
                let before = self.holes_mm[i - 1];
                points.extend([0.3, 0.5, 0.7].map(|t| before.lerp(hole, t).extend(below)));
                points.extend(strand(-1.0).iter().rev());
            }
            points.push(hole.extend(middle + r));
            if i + 1 < self.holes_mm.len() {
                points.extend(strand(1.0));
            }
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYERS_MM: [f64; 2] = [-2.0, 0.5];

    fn row(seed: u64) -> Lockstitch {
        row_with_holes(seed, 0.0, 0.0)
    }

    fn row_with_holes(seed: u64, hole_mm: f64, zigzag_mm: f64) -> Lockstitch {
        let spec = LockstitchSpec {
            stitch_mm: 3.1,
            zigzag_mm,
            layers_mm: LAYERS_MM,
            sink_mm: 0.25,
            hole_mm,
        };
        Lockstitch::new(&spec, 30.0, 0.2, seed)
    }

    /// Threads hold each other: in every hole the needle thread passes below the bobbin thread,
    /// which passes between its strands; elsewhere they stay on their own side of the cloth.
    #[test]
    fn threads_lock_at_every_hole() {
        for seed in [1, 2] {
            let row = row(seed);
            assert_eq!(row.holes_mm.len(), 11, "seed {seed}: ten stitches");
            let middle = 0.5 * (LAYERS_MM[0] + LAYERS_MM[1]);
            let near = |points: Vec<DVec3>, hole: DVec2| {
                let close = points
                    .into_iter()
                    .filter(move |p| p.truncate().distance(hole) < 0.01);
                close.map(|p| p.z).next()
            };
            for hole in &row.holes_mm {
                let needle = near(row.needle_thread_mm(), *hole).unwrap();
                let bobbin = near(row.bobbin_thread_mm(), *hole).unwrap();
                assert!(bobbin - needle > 0.39, "seed {seed}: {needle} {bobbin}");
            }
            assert!(row.needle_thread_mm().iter().all(|p| p.z > middle - 0.21));
            assert!(row.bobbin_thread_mm().iter().all(|p| p.z < middle + 0.21));
            let highest = row
                .needle_thread_mm()
                .iter()
                .map(|p| p.z)
                .fold(0.0, f64::max);
            assert!((0.5..0.66).contains(&highest), "seed {seed}: {highest}");
        }
    }

    /// Cloth sinks most at the holes, and by nothing beside the row and beyond its ends.
    #[test]
    fn cloth_sinks_along_the_row() {
        let row = row(3);
        let [first, second] = [row.holes_mm[3], row.holes_mm[4]];
        assert!((row.depth_mm(first) - 0.25).abs() < 1e-9);
        let between = row.depth_mm(first.lerp(second, 0.5));
        assert!((between - 0.25 * BETWEEN).abs() < 1e-9, "{between}");
        let aside = first + row.reach_mm() * DVec2::Y;
        let ahead = DVec2::new(-row.reach_mm() - 1.0, 0.0);
        assert!(row.depth_mm(aside) < 1e-3 && row.depth_mm(ahead) < 1e-3);
    }
    /// Cloth is pushed out of a hole, comes nowhere before other cloth, and lies as before at a few
    /// diameters of the hole.
    #[test]
    fn holes_push_cloth_aside_without_a_fold() {
        for (hole_mm, zigzag_mm) in [(0.7, 0.0), (0.3, 2.0), (3.0, 0.0)] {
            let row = row_with_holes(4, hole_mm, zigzag_mm);
            for (i, hole) in row.holes_mm.iter().enumerate() {
                assert_eq!(row.pushed_mm(*hole), None);
                let direction = DVec2::from_angle(i as f64);
                let at = |k: i32| {
                    let away_mm = 0.03 * row.hole_radius_mm * f64::from(k);
                    let place = *hole + away_mm * direction;
                    (place + row.pushed_mm(place).unwrap()).distance(*hole)
                };
                let opening_mm = at(1);
                let wide = hole_mm.min(0.8);
                assert!(opening_mm > 0.49 * wide, "{hole_mm}: {opening_mm}");
                for k in 1..60 {
                    assert!(at(k + 1) - at(k) > 0.005 * row.hole_radius_mm);
                }
            }
            let beside = row.holes_mm[2] + 3.0 * hole_mm.max(1.0) * DVec2::Y * -1.0;
            let away = beside + DVec2::Y * -zigzag_mm;
            assert_eq!(row.pushed_mm(away), Some(DVec2::ZERO));
        }
        assert_eq!(row(4).pushed_mm(row(4).holes_mm[2]), Some(DVec2::ZERO));
    }
}
