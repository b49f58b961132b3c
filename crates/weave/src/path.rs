//! One period of the centreline of a yarn, with the frames of its cross-sections.

use crate::spline::catmull_rom;
use crate::sway::Sway;
use glam::{DQuat, DVec2, DVec3};
use std::sync::Arc;

/// Share of an interval over which the direction of a displaced thread is taken.
const SWAY_STEP: f64 = 1e-3;

/// Periodic C1 piecewise cubic heights over a straight axis.
#[derive(Clone, Debug)]
pub(crate) struct Hermite {
    /// Knot positions, one more than there are knots: the last is the first
    /// plus the period, millimetres.
    pub knots_mm: Arc<[f64]>,
    pub height_mm: Vec<f64>,
    pub slope: Vec<f64>,
}

impl Hermite {
    /// Period along the axis.
    pub fn period_mm(&self) -> f64 {
        self.knots_mm[self.height_mm.len()] - self.knots_mm[0]
    }

    /// Lowest and highest height. The extremes of a cubic may lie between knots, so these are
    /// the extremes of its Bezier hull, which the cubic never leaves.
    pub fn range_mm(&self) -> (f64, f64) {
        let hull = |k: usize| {
            let (d, [h0, a0, h1, a1]) = self.interval(k);
            [h0, h0 + d * a0 / 3.0, h1 - d * a1 / 3.0, h1]
        };
        let points = (0..self.height_mm.len()).flat_map(hull);
        points.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
            (low.min(h), high.max(h))
        })
    }

    /// Height at a place along the axis, which may lie outside one period.
    pub fn height_at(&self, at_mm: f64) -> f64 {
        let first = self.knots_mm[0];
        let at = first + (at_mm - first).rem_euclid(self.period_mm());
        let knots = self.height_mm.len();
        let k = self.knots_mm.partition_point(|&s| s <= at).clamp(1, knots) - 1;
        let (d, _) = self.interval(k);
        self.at(k, (at - self.knots_mm[k]) / d).0
    }

    /// Height and slope at a fraction `t` of interval `k`.
    pub fn at(&self, k: usize, t: f64) -> (f64, f64) {
        let (d, [h0, a0, h1, a1]) = self.interval(k);
        let (u, t2) = (1.0 - t, t * t);
        let height = h0 * (1.0 + 2.0 * t) * u * u
            + h1 * t2 * (3.0 - 2.0 * t)
            + d * t * u * (a0 * u - a1 * t);
        let slope =
            6.0 * t * u * (h1 - h0) / d + a0 * u * (1.0 - 3.0 * t) + a1 * t * (3.0 * t - 2.0);
        (height, slope)
    }

    /// Length of interval `k` and height, slope at its two ends.
    pub fn interval(&self, k: usize) -> (f64, [f64; 4]) {
        let next = (k + 1) % self.height_mm.len();
        (
            self.knots_mm[k + 1] - self.knots_mm[k],
            [
                self.height_mm[k],
                self.slope[k],
                self.height_mm[next],
                self.slope[next],
            ],
        )
    }

    /// The largest magnitude of the second derivative, per millimetre.
    pub fn max_bend_per_mm(&self) -> f64 {
        (0..self.height_mm.len())
            .flat_map(|k| {
                let (d, [h0, a0, h1, a1]) = self.interval(k);
                let chord = 6.0 * (h1 - h0) / d;
                [
                    (chord - 4.0 * a0 - 2.0 * a1) / d,
                    (2.0 * a0 + 4.0 * a1 - chord) / d,
                ]
            })
            .fold(0.0, |m, b| m.max(b.abs()))
    }
}

/// Points along one period with the two axes of the cross-section: `lateral x
/// vertical` is the tangent for a straight yarn. The last point is the first
/// plus `period`.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    pub points: Vec<DVec3>,
    pub lateral: Vec<DVec3>,
    pub vertical: Vec<DVec3>,
    /// Length from the first point, millimetres.
    pub arc_mm: Vec<f64>,
    pub period: DVec3,
    /// True when the line ends at the last point.
    open: bool,
    /// The coordinate, x or y, in which the line goes farthest, if that never falls along it.
    advancing: Option<usize>,
}

impl Path {
    /// Samples a woven yarn that runs along `axis` from `origin`, `steps` per
    /// interval between knots. Cross-sections lean with the yarn by the share
    /// `lean` of its slope.
    pub fn woven(
        curve: &Hermite,
        axis: DVec3,
        origin: DVec3,
        steps: usize,
        lean: f64,
        sway: Option<&Sway>,
    ) -> Path {
        if let Some(sway) = sway {
            return Path::swaying(curve, axis, origin, steps, lean, sway);
        }
        let lateral = DVec3::Z.cross(axis);
        let mut points = Vec::new();
        let mut vertical = Vec::new();
        let knots = curve.height_mm.len();
        let mut push = |s: f64, (height, slope): (f64, f64)| {
            points.push(origin + s * axis + height * DVec3::Z);
            let (sin, cos) = (lean * slope.atan()).sin_cos();
            vertical.push(cos * DVec3::Z - sin * axis);
        };
        for k in 0..knots {
            let (d, _) = curve.interval(k);
            for i in 0..steps {
                let t = i as f64 / steps as f64;
                push(curve.knots_mm[k] + t * d, curve.at(k, t));
            }
        }
        push(curve.knots_mm[knots], curve.at(0, 0.0));
        Path::new(
            points,
            vec![lateral; knots * steps + 1],
            vertical,
            curve.period_mm() * axis,
        )
    }

    /// The same of a thread that is displaced in the plane of the cloth.
    fn swaying(
        curve: &Hermite,
        axis: DVec3,
        origin: DVec3,
        steps: usize,
        lean: f64,
        sway: &Sway,
    ) -> Path {
        let side = DVec3::new(axis.y, axis.x, 0.0);
        let period = curve.period_mm();
        let knots = curve.height_mm.len();
        // There are two knots from each crossing to the next.
        let place = |k: usize, t: f64| {
            let s = curve.knots_mm[k] + t * curve.interval(k).0;
            let along = s + sway.along_mm(k / 2, 0.5 * ((k % 2) as f64 + t));
            let across = sway.across_mm((s - curve.knots_mm[0]) / period);
            origin + along * axis + across * side
        };
        let (mut points, mut lateral, mut vertical) = (Vec::new(), Vec::new(), Vec::new());
        let mut push = |k: usize, t: f64| {
            let (height, slope) = curve.at(k, t);
            // Across the border of the tile the thread goes on as it began.
            let [before, after] = [t - SWAY_STEP, t + SWAY_STEP].map(|t| match (k, t) {
                (0, t) if t < 0.0 => place(knots - 1, 1.0 + t) - period * axis,
                (k, t) if t < 0.0 => place(k - 1, 1.0 + t),
                (k, t) => place(k, t),
            });
            let forward = (after - before).normalize_or(axis);
            points.push(place(k, t) + height * DVec3::Z);
            let (sin, cos) = (lean * slope.atan()).sin_cos();
            vertical.push(cos * DVec3::Z - sin * forward);
            lateral.push(DVec3::Z.cross(forward));
        };
        for k in 0..knots {
            (0..steps).for_each(|i| push(k, i as f64 / steps as f64));
        }
        points.push(points[0] + period * axis);
        lateral.push(lateral[0]);
        vertical.push(vertical[0]);
        Path::new(points, lateral, vertical, period * axis)
    }

    /// From samples of one period, including its end.
    pub fn new(
        points: Vec<DVec3>,
        lateral: Vec<DVec3>,
        vertical: Vec<DVec3>,
        period: DVec3,
    ) -> Path {
        let mut length = 0.0;
        let mut arc_mm = vec![0.0];
        for pair in points.windows(2) {
            length += pair[0].distance(pair[1]);
            arc_mm.push(length);
        }
        let span = points[points.len() - 1] - points[0];
        let axis = usize::from(span.y > span.x);
        let advances = points.windows(2).all(|p| p[0][axis] <= p[1][axis]);
        Path {
            points,
            lateral,
            vertical,
            arc_mm,
            period,
            open: false,
            advancing: advances.then_some(axis),
        }
    }

    /// A smooth line through given points (uniform Catmull-Rom), each span in steps of
    /// `longest_mm` at most. `period` is what separates the line from its next copy, zero for a
    /// closed line; an open line has none. Frames are transported along the line without
    /// rotation; the angle that remains over a period is distributed evenly.
    pub fn through(given: &[DVec3], period: Option<DVec3>, longest_mm: f64) -> Path {
        let n = given.len() as isize;
        let at = |i: isize| match (i, period) {
            (i, Some(p)) => given[i.rem_euclid(n) as usize] + i.div_euclid(n) as f64 * p,
            (i, None) if i < 0 => 2.0 * given[0] - given[1],
            (i, None) if i >= n => 2.0 * given[n as usize - 1] - given[n as usize - 2],
            (i, None) => given[i as usize],
        };
        let spans = if period.is_some() { n } else { n - 1 };
        let mut points = Vec::new();
        for i in 0..spans {
            let around = [at(i - 1), at(i), at(i + 1), at(i + 2)];
            let steps = (around[1].distance(around[2]) / longest_mm).ceil();
            let steps = steps.clamp(1.0, 64.0);
            points.extend((0..steps as usize).map(|k| catmull_rom(around, k as f64 / steps)));
        }
        points.push(at(spans));

        let last = points.len() - 1;
        let tangent = |i: usize| {
            let before = match (i, period) {
                (0, Some(p)) => points[last - 1] - p,
                (i, _) => points[i.saturating_sub(1)],
            };
            let after = match (i, period) {
                (i, Some(p)) if i == last => points[1] + p,
                (i, _) => points[(i + 1).min(last)],
            };
            (after - before).normalize_or(DVec3::X)
        };
        let mut lateral = Vec::with_capacity(points.len());
        let level = DVec3::Z.cross(period.unwrap_or_default()).try_normalize();
        let mut across = level.unwrap_or_else(|| tangent(0).any_orthonormal_vector());
        for i in 0..points.len() {
            let t = tangent(i);
            across = (across - across.dot(t) * t)
                .try_normalize()
                .unwrap_or(t.any_orthonormal_vector());
            lateral.push(across);
        }
        if period.is_some() {
            let t = tangent(0);
            let left = lateral[last]
                .cross(lateral[0])
                .dot(t)
                .atan2(lateral[last].dot(lateral[0]));
            for (i, across) in lateral.iter_mut().enumerate() {
                let turn = left * i as f64 / last as f64;
                *across = DQuat::from_axis_angle(tangent(i), turn) * *across;
            }
        }
        let vertical = lateral
            .iter()
            .enumerate()
            .map(|(i, &l)| tangent(i).cross(l))
            .collect();
        Path {
            open: period.is_none(),
            ..Path::new(points, lateral, vertical, period.unwrap_or_default())
        }
    }

    /// Whether the line has a sample `i`: an open one ends.
    pub fn has(&self, i: isize) -> bool {
        !self.open || (0..=self.steps() as isize).contains(&i)
    }

    /// Number of steps in a period.
    pub fn steps(&self) -> usize {
        self.points.len() - 1
    }

    /// Length of a period, millimetres.
    pub fn length_mm(&self) -> f64 {
        self.arc_mm[self.steps()]
    }

    /// Mean distance between neighbouring points, millimetres.
    pub fn mean_step_mm(&self) -> f64 {
        self.length_mm() / self.steps() as f64
    }

    /// The point beside sample `i` by `offset` (across, up) in its
    /// cross-section; `i` may lie outside one period, or just beyond the ends
    /// of an open line, which is continued by reflection.
    pub fn offset(&self, i: isize, offset: DVec2) -> DVec3 {
        let n = self.steps() as isize;
        if self.open {
            let end = i.clamp(0, n);
            if end != i {
                return 2.0 * self.offset(end, offset)
                    - self.offset((2 * end - i).clamp(0, n), offset);
            }
            let k = i as usize;
            return self.points[k] + offset.x * self.lateral[k] + offset.y * self.vertical[k];
        }
        let k = i.rem_euclid(n) as usize;
        self.points[k]
            + i.div_euclid(n) as f64 * self.period
            + offset.x * self.lateral[k]
            + offset.y * self.vertical[k]
    }

    /// As [`Path::offset`], at a length from the first point, which may lie outside one period;
    /// interpolated between samples.
    pub fn at_arc(&self, arc_mm: f64, offset: DVec2) -> DVec3 {
        if self.open && !(0.0..self.length_mm()).contains(&arc_mm) {
            let end = if arc_mm < 0.0 {
                0
            } else {
                self.steps() as isize
            };
            return self.offset(end, offset);
        }
        let turns = (arc_mm / self.length_mm()).floor();
        let rest = arc_mm - turns * self.length_mm();
        let (k, t) = self.place(rest);
        let i = turns as isize * self.steps() as isize + k as isize;
        self.offset(i, offset).lerp(self.offset(i + 1, offset), t)
    }

    /// The sample before a length within the period, and the share of the way to the next.
    pub fn place(&self, arc_mm: f64) -> (usize, f64) {
        let after = self.arc_mm.partition_point(|&a| a <= arc_mm);
        let k = after.clamp(1, self.steps()) - 1;
        let width = self.arc_mm[k + 1] - self.arc_mm[k];
        let t = if width > 0.0 {
            (arc_mm - self.arc_mm[k]) / width
        } else {
            0.0
        };
        (k, t)
    }

    /// The sample nearest to a point, among those of the period and one on either side; the
    /// first of several.
    pub fn nearest(&self, at: DVec3) -> isize {
        let steps = self.steps() as isize;
        let (first, last) = match self.open {
            true => (0, steps),
            false => (-steps, 2 * steps),
        };
        let sample = |i: isize| self.offset(i, DVec2::ZERO);
        let Some(axis) = self.advancing else {
            let square = |i: &isize| sample(*i).distance_squared(at);
            let all = first..=last;
            return all
                .min_by(|a, b| square(a).total_cmp(&square(b)))
                .unwrap_or(0);
        };
        // From the samples beside the point on, those that lie farther along the line than the
        // nearest so far cannot be nearer.
        let (mut low, mut high) = (first, last + 1);
        while low < high {
            let middle = low + (high - low) / 2;
            match sample(middle)[axis] < at[axis] {
                true => low = middle + 1,
                false => high = middle,
            }
        }
        let mut found = (f64::INFINITY, first);
        for i in low..=last {
            let point = sample(i);
            if (point[axis] - at[axis]).powi(2) > found.0 {
                break;
            }
            let square = point.distance_squared(at);
            if square < found.0 {
                found = (square, i);
            }
        }
        for i in (first..low).rev() {
            let point = sample(i);
            if (point[axis] - at[axis]).powi(2) > found.0 {
                break;
            }
            let square = point.distance_squared(at);
            if square <= found.0 {
                found = (square, i);
            }
        }
        found.1
    }

    /// Length from the first point to sample `i`, which may lie outside.
    pub fn arc_at(&self, i: isize) -> f64 {
        let n = self.steps() as isize;
        self.arc_mm[i.rem_euclid(n) as usize] + i.div_euclid(n) as f64 * self.length_mm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    #[test]
    fn the_nearest_sample_is_the_one_that_trying_all_finds() {
        let knots_mm: Vec<f64> = (0..=6).map(|k| 0.25 * f64::from(k)).collect();
        let curve = Hermite {
            knots_mm: knots_mm.into(),
            height_mm: vec![0.1, 0.0, -0.1, 0.0, 0.1, 0.0],
            slope: vec![0.0, -0.6, 0.0, 0.6, 0.0, -0.6],
        };
        let woven = Path::woven(&curve, DVec3::Y, DVec3::new(0.3, 0.1, 0.0), 16, 0.0, None);
        assert_eq!(woven.advancing, Some(1));
        // A line that turns back has no coordinate that never falls.
        let bends = [[0.0, 0.0], [0.5, 0.4], [0.2, 0.1], [0.9, 0.6]];
        let bends = bends.map(|[x, y]| DVec3::new(x, y, 0.05));
        for path in [
            woven,
            Path::through(&bends, Some(DVec3::X), 0.02),
            Path::through(&bends, None, 0.02),
            Path::through(&[DVec3::ZERO, DVec3::X, 2.0 * DVec3::X], None, 0.02),
        ] {
            let steps = path.steps() as isize;
            for i in 0..2000 {
                let mut rng = PathRng::new(5, 0, i);
                let u = DVec3::from([0; 3].map(|_| f64::from(rng.unit())));
                let at = 4.0 * (u - 0.5) * DVec3::new(1.0, 1.0, 0.1);
                let square = |i: &isize| path.offset(*i, DVec2::ZERO).distance_squared(at);
                let all = (-steps..=2 * steps).filter(|&i| path.has(i));
                let best = all.min_by(|a, b| square(a).total_cmp(&square(b)));
                assert_eq!(Some(path.nearest(at)), best, "seed 5: {at}");
            }
        }
    }
}
