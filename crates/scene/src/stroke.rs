//! `[[object.stroke]]`: where a hand stroked the pile of a cloth.

use glam::Vec2;
use serde::Deserialize;

/// Share of half the width of a stroke over which the pile goes over to that beside it (estimated).
const SOFT: f32 = 0.8;
/// Length of a mesh's edges there, in widths of the stroke.
const FINE: f32 = 0.06;
/// Most places between its ends, and how often corners are cut.
const MOST_BENDS: usize = 64;
const ROUNDINGS: usize = 3;

/// A stroke over the pile of a cloth that lies on a mesh: from then on it leans along the stroke.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Where it begins, on the cloth: mm along weft and warp.
    pub from_mm: [f32; 2],
    /// Where it ends.
    pub to_mm: [f32; 2],
    /// Places that it bends toward in between, at most 64; straight without them.
    #[serde(default)]
    pub through_mm: Vec<[f32; 2]>,
    /// Its width, mm.
    pub width_mm: f32,
    /// Its width where it ends, mm; that where it begins without it.
    pub to_width_mm: Option<f32>,
    /// How far the pile leans along it, beside its own lean: -60 to 60 degrees.
    pub lean_deg: f32,
}

/// Checks where something straight begins and ends on a cloth.
///
/// # Errors
/// `.key: what was expected`.
pub(crate) fn check_places(from_mm: [f32; 2], to_mm: [f32; 2]) -> Result<(), String> {
    let are_near = [from_mm, to_mm].concat().iter().all(|x| x.abs() <= 1e6);
    match are_near && from_mm != to_mm {
        true => Ok(()),
        false => Err(".to_mm: expected two places within 1e6 mm".into()),
    }
}

/// The share of a straight line, between two places of the cloth, at which it is nearest to a place;
/// 0 on a line without length.
fn nearest_share([from, to]: [Vec2; 2], at_mm: Vec2) -> f32 {
    let along = (at_mm - from).dot(to - from) / (to - from).length_squared();
    if along.is_finite() {
        along.clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// How far a place is from a straight line between two places of the cloth, mm.
pub(crate) fn away_mm(ends: [Vec2; 2], at_mm: Vec2) -> f32 {
    at_mm.distance(ends[0].lerp(ends[1], nearest_share(ends, at_mm)))
}

/// What goes over smoothly from none at 0 and below to one at 1 and above.
pub(crate) fn smooth(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

impl Stroke {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `.key: what was expected`.
    pub fn check(&self) -> Result<(), String> {
        check_places(self.from_mm, self.to_mm)?;
        let are_near = self.through_mm.iter().flatten().all(|x| x.abs() <= 1e6);
        if self.through_mm.len() > MOST_BENDS || !are_near {
            let most = MOST_BENDS;
            return Err(format!(
                ".through_mm: expected at most {most} places within 1e6 mm"
            ));
        }
        for (key, width_mm) in [
            ("width_mm", Some(self.width_mm)),
            ("to_width_mm", self.to_width_mm),
        ] {
            if let Some(found) = width_mm.filter(|w| !(1e-3..=1e6).contains(w)) {
                return Err(format!(".{key}: expected 0.001 to 1e6, found {found}"));
            }
        }
        if !(-60.0..=60.0).contains(&self.lean_deg) {
            let found = self.lean_deg;
            return Err(format!(".lean_deg: expected -60 to 60, found {found}"));
        }
        Ok(())
    }

    /// The line along which the hand goes.
    pub(crate) fn path(&self) -> HandPath {
        let given = [self.from_mm]
            .into_iter()
            .chain(self.through_mm.iter().copied());
        let mut points: Vec<Vec2> = given.chain([self.to_mm]).map(Vec2::from).collect();
        for _ in 0..ROUNDINGS {
            points = rounded(&points);
        }
        let mut at_mm = vec![0.0];
        for pair in points.windows(2) {
            at_mm.push(at_mm[at_mm.len() - 1] + pair[0].distance(pair[1]));
        }
        HandPath {
            points,
            at_mm,
            widths_mm: [self.width_mm, self.to_width_mm.unwrap_or(self.width_mm)],
            tangent: self.lean_deg.to_radians().tan(),
        }
    }
}

/// A line whose corners are cut at quarters of its pieces: its ends stay.
fn rounded(points: &[Vec2]) -> Vec<Vec2> {
    let [first, .., last] = points else {
        return points.to_vec();
    };
    if points.len() < 3 {
        return points.to_vec();
    }
    let cut = points
        .windows(2)
        .flat_map(|w| [w[0].lerp(w[1], 0.25), w[0].lerp(w[1], 0.75)]);
    let mut cut: Vec<Vec2> = cut.collect();
    cut[0] = *first;
    if let Some(end) = cut.last_mut() {
        *end = *last;
    }
    cut
}

/// The line of a stroke, with its corners rounded.
pub(crate) struct HandPath {
    points: Vec<Vec2>,
    /// Length of the line up to every point.
    at_mm: Vec<f32>,
    /// Widths where it begins and ends.
    widths_mm: [f32; 2],
    /// Lean along it.
    tangent: f32,
}

impl HandPath {
    /// Distance to the line from a place, and there its direction and the width of the stroke.
    fn nearest(&self, at_mm: Vec2) -> (f32, Vec2, f32) {
        let length_mm = self.at_mm[self.at_mm.len() - 1];
        let piece = |(pair, ends_mm): (&[Vec2], &[f32])| {
            let [from, to] = [pair[0], pair[1]];
            let along = nearest_share([from, to], at_mm);
            let away = at_mm.distance(from.lerp(to, along));
            let run = (ends_mm[0] + along * (ends_mm[1] - ends_mm[0])) / length_mm;
            let [from_mm, to_mm] = self.widths_mm;
            let width_mm = from_mm + run * (to_mm - from_mm);
            (away, (to - from).normalize_or_zero(), width_mm)
        };
        let pieces = self.points.windows(2).zip(self.at_mm.windows(2)).map(piece);
        let first = (f32::INFINITY, Vec2::ZERO, self.widths_mm[0]);
        pieces.fold(first, |best, p| if p.0 < best.0 { p } else { best })
    }

    /// How long the edges of a mesh may be at a place so that the stroke shows: short at its edge.
    pub fn longest_edge_mm(&self, at_mm: Vec2) -> f32 {
        let (away, _, width_mm) = self.nearest(at_mm);
        let edge = 0.5 * (1.0 - 0.5 * SOFT) * width_mm;
        let half = 0.25 * SOFT * width_mm;
        FINE * width_mm + ((away - edge).abs() - half).max(0.0)
    }

    /// The lean at a place after strokes one after the other over pile of another lean, as tangents
    /// along weft and warp.
    pub fn tangent_after(paths: &[HandPath], at_mm: Vec2, before: Vec2) -> Vec2 {
        paths.iter().fold(before, |before, path| {
            let (away, direction, width_mm) = path.nearest(at_mm);
            // One in the middle of the stroke, none beside it.
            let share = smooth((0.5 - away / width_mm) / (0.5 * SOFT));
            before.lerp(direction * path.tangent, share)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pile leans along the last stroke that came by, and stands as before beside them.
    #[test]
    fn the_last_stroke_counts() {
        let stroke = |from_mm, to_mm| Stroke {
            from_mm,
            to_mm,
            through_mm: Vec::new(),
            width_mm: 2.0,
            to_width_mm: None,
            lean_deg: 45.0,
        };
        let strokes = [
            stroke([-5.0, 0.0], [5.0, 0.0]),
            stroke([0.0, -5.0], [0.0, 5.0]),
        ];
        let paths = strokes.each_ref().map(Stroke::path);
        let at = |x, y| HandPath::tangent_after(&paths, Vec2::new(x, y), Vec2::ZERO);
        assert!(at(3.0, 0.0).abs_diff_eq(Vec2::X, 1e-6));
        assert!(at(0.0, 0.0).abs_diff_eq(Vec2::Y, 1e-6));
        assert_eq!(at(3.0, 1.1), Vec2::ZERO);
        // At its edge it goes over to the pile beside it.
        let edge = at(3.0, 0.8);
        assert!(edge.x > 0.1 && edge.x < 0.9, "{edge}");
        let refused = Stroke {
            width_mm: 0.0,
            ..strokes[0].clone()
        };
        assert_eq!(
            refused.check().unwrap_err(),
            ".width_mm: expected 0.001 to 1e6, found 0"
        );
        // One that bends leans along its bend, and grows wider; the twin goes straight.
        let bent = Stroke {
            through_mm: vec![[0.0, 4.0]],
            to_width_mm: Some(6.0),
            ..strokes[0].clone()
        };
        let [bent, straight] = [&bent, &strokes[0]].map(|s| [s.path()]);
        let at = |paths: &[HandPath; 1], x, y| {
            HandPath::tangent_after(paths, Vec2::new(x, y), Vec2::ZERO)
        };
        let top = at(&bent, 0.0, 3.0);
        assert!(top.abs_diff_eq(Vec2::X, 0.02), "{top}");
        assert!(at(&bent, 4.0, -0.8).y < -0.1 && at(&bent, -4.0, -0.8) == Vec2::ZERO);
        assert_eq!(at(&straight, 0.0, 3.0), Vec2::ZERO);
    }
}
