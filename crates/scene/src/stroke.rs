//! `[[object.stroke]]`: where a hand stroked the pile of a cloth.

use glam::Vec2;
use serde::Deserialize;

/// Share of half the width of a stroke over which the pile goes over to that beside it (estimated).
const SOFT: f32 = 0.8;
/// Length of a mesh's edges there, in widths of the stroke.
const FINE: f32 = 0.06;

/// A stroke over the pile of a cloth that lies on a mesh: from then on it leans along the stroke.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Stroke {
    /// Where it begins, on the cloth: mm along weft and warp.
    pub from_mm: [f32; 2],
    /// Where it ends.
    pub to_mm: [f32; 2],
    /// Its width, mm.
    pub width_mm: f32,
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

/// How far a place is from a straight line between two places of the cloth, mm.
pub(crate) fn away_mm([from, to]: [Vec2; 2], at_mm: Vec2) -> f32 {
    let along = (at_mm - from).dot(to - from) / (to - from).length_squared();
    at_mm.distance(from + along.clamp(0.0, 1.0) * (to - from))
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
        if !(1e-3..=1e6).contains(&self.width_mm) {
            let found = self.width_mm;
            return Err(format!(".width_mm: expected 0.001 to 1e6, found {found}"));
        }
        if !(-60.0..=60.0).contains(&self.lean_deg) {
            let found = self.lean_deg;
            return Err(format!(".lean_deg: expected -60 to 60, found {found}"));
        }
        Ok(())
    }

    fn away_mm(&self, at_mm: Vec2) -> f32 {
        away_mm([self.from_mm, self.to_mm].map(Vec2::from), at_mm)
    }

    /// How much of it a place has: one in its middle, none beside it.
    fn share(&self, at_mm: Vec2) -> f32 {
        smooth((0.5 - self.away_mm(at_mm) / self.width_mm) / (0.5 * SOFT))
    }

    /// How long the edges of a mesh may be at a place so that the stroke shows: short at its edge.
    pub fn longest_edge_mm(&self, at_mm: Vec2) -> f32 {
        let edge = 0.5 * (1.0 - 0.5 * SOFT) * self.width_mm;
        let half = 0.25 * SOFT * self.width_mm;
        FINE * self.width_mm + ((self.away_mm(at_mm) - edge).abs() - half).max(0.0)
    }

    /// The lean at a place after strokes one after the other, as tangents along weft and warp.
    pub fn tangent_after(strokes: &[Stroke], at_mm: Vec2) -> Vec2 {
        strokes.iter().fold(Vec2::ZERO, |before, stroke| {
            let [from, to] = [stroke.from_mm, stroke.to_mm].map(Vec2::from);
            let own = (to - from).normalize_or_zero() * stroke.lean_deg.to_radians().tan();
            before.lerp(own, stroke.share(at_mm))
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
            width_mm: 2.0,
            lean_deg: 45.0,
        };
        let strokes = [
            stroke([-5.0, 0.0], [5.0, 0.0]),
            stroke([0.0, -5.0], [0.0, 5.0]),
        ];
        let at = |x, y| Stroke::tangent_after(&strokes, Vec2::new(x, y));
        assert!(at(3.0, 0.0).abs_diff_eq(Vec2::X, 1e-6));
        assert!(at(0.0, 0.0).abs_diff_eq(Vec2::Y, 1e-6));
        assert_eq!(at(3.0, 1.1), Vec2::ZERO);
        // At its edge it goes over to the pile beside it.
        let edge = at(3.0, 0.8);
        assert!(edge.x > 0.1 && edge.x < 0.9, "{edge}");
        let refused = Stroke {
            width_mm: 0.0,
            ..strokes[0]
        };
        assert_eq!(
            refused.check().unwrap_err(),
            ".width_mm: expected 0.001 to 1e6, found 0"
        );
    }
}
