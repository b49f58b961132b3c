//! Loops and tufts that push each other aside.

use super::Place;
use crate::Error;
use crate::pile::{PUSHED_PIECES, Tuft, Tufts, share_of_lean};
use crate::separate::{Line, Room, separate};
use crate::spec::PileSides;
use glam::{DVec2, DVec3};

/// The largest number of loops or tufts in a tile that are pushed apart: a loop has about 18
/// points, and every point takes some 400 bytes; a tuft takes less.
const MAX_PUSHED: usize = 1 << 16;

impl Place<'_> {
    /// Pushes the loops of pile ends apart. What lies in the ground stays, and every end keeps its
    /// length.
    pub(super) fn push_apart(&self, ends: &mut [Vec<DVec3>], loops: usize) -> Result<(), Error> {
        check_count(loops, "loops")?;
        let radius_mm = self.yarn.radius_mm();
        let ground_mm = self.face_mm.abs();
        let above_mm = ground_mm + radius_mm;
        let held = |points: &[DVec3]| points.iter().map(|p| p.z.abs() <= ground_mm).collect();
        let sides = match self.spec.sides {
            Some(PileSides::Both) => 2,
            Some(PileSides::Face) | None => 1,
        };
        // Loops of the face do not touch those of the back.
        for side in 0..sides {
            let own = || (side..ends.len()).step_by(sides);
            let mut lines: Vec<Line> = own()
                .map(|i| Line {
                    held: held(&ends[i]),
                    points: ends[i].clone(),
                    radius_mm,
                    period: Some(self.size_mm.y * DVec3::Y),
                })
                .collect();
            let room = Room {
                size_mm: self.size_mm,
                faces_mm: match side {
                    0 => [above_mm, f64::INFINITY],
                    _ => [f64::NEG_INFINITY, -above_mm],
                },
            };
            separate(&mut lines, room);
            for (i, line) in own().zip(lines) {
                ends[i] = line.points;
            }
        }
        Ok(())
    }
}

impl Tufts {
    /// Pushes the tufts of a tile of this size apart above the ground. Tips keep their heights, as
    /// those of pile that is sheared afterwards.
    pub(super) fn push_apart(&mut self, size_mm: DVec2) -> Result<(), Error> {
        check_count(self.tufts.len(), "tufts")?;
        let before: Vec<Line> = self.lines().collect();
        let mut lines = before.clone();
        let room = Room {
            size_mm,
            faces_mm: [self.face_mm, f64::INFINITY],
        };
        separate(&mut lines, room);
        for ((tuft, line), before) in self.tufts.iter_mut().zip(lines).zip(before) {
            let moved = line.points.iter().zip(&before.points);
            for (pushed, (p, q)) in tuft.pushed_mm.iter_mut().zip(moved) {
                *pushed = (*p - *q).truncate();
            }
        }
        Ok(())
    }

    /// The middles of the tufts above the ground.
    pub(in crate::cloth) fn lines(&self) -> impl Iterator<Item = Line> + '_ {
        self.tufts.iter().map(|tuft| self.line(tuft))
    }

    /// One of them, with the radius that the tuft has halfway up, but no more than half its
    /// distance from the next.
    fn line(&self, tuft: &Tuft) -> Line {
        let leg_mm = self.yarn.radius_mm();
        let foot_mm = DVec2::new(tuft.bound_half_mm.x + 2.0 * leg_mm, leg_mm);
        let half_mm = (0.5 * (foot_mm + self.splay * tuft.room_mm)).min(tuft.room_mm);
        // Tufts that lean alike are closer together than their roots.
        let upright = tuft.height_mm / tuft.tip_mm.length().hypot(tuft.height_mm);
        let point = |i: usize| {
            let s = i as f64 / PUSHED_PIECES as f64;
            let plane = tuft.bound_mm.truncate() + share_of_lean(s) * tuft.tip_mm;
            (plane + tuft.pushed_mm[i]).extend(self.face_mm + s * tuft.height_mm)
        };
        Line {
            points: (0..=PUSHED_PIECES).map(point).collect(),
            radius_mm: upright * half_mm.min_element(),
            period: None,
            held: (0..=PUSHED_PIECES).map(|i| i == 0).collect(),
        }
    }
}

fn check_count(count: usize, what: &str) -> Result<(), Error> {
    if count <= MAX_PUSHED {
        return Ok(());
    }
    let message = format!("expected at most {MAX_PUSHED} {what} in one tile, found {count}");
    Err(Error::spec("pile.collide", message))
}
