//! Loops that push each other aside.

use super::Place;
use crate::Error;
use crate::separate::{Line, Room, separate};
use crate::spec::PileSides;
use glam::DVec3;

/// The largest number of loops in a tile that are pushed apart: each has about 18 points, and every
/// point takes some 400 bytes.
const MAX_LOOPS: usize = 1 << 16;

impl Place<'_> {
    /// Pushes the loops of pile ends apart. What lies in the ground stays, and every end keeps its
    /// length.
    pub(super) fn push_apart(&self, ends: &mut [Vec<DVec3>], loops: usize) -> Result<(), Error> {
        if loops > MAX_LOOPS {
            let message = format!("expected at most {MAX_LOOPS} loops in one tile, found {loops}");
            return Err(Error::spec("pile.collide", message));
        }
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
