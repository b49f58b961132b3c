//! Colours that depend on the place in the cloth: of prints and of wear.

use super::{Cloth, Material};
use crate::dye::UNDYED;
use glam::Vec3;
use organza_basis::{Rgb, Segment};

/// Most materials of a cloth: each has tables of its own.
pub(super) const MAX_MATERIALS: usize = 4096;
/// Most parts into which a segment is divided.
const MAX_PARTS: usize = 64;

impl Cloth {
    /// Makes `count` materials of each material, with the colours that `colour` gives for its own
    /// colour and a number below `count`. Returns their numbers, `count` for each material in turn.
    pub(super) fn recolour(
        &mut self,
        count: usize,
        colour: impl Fn(Rgb, usize) -> Rgb,
    ) -> Vec<u16> {
        let plain = self.materials.len();
        let mut numbers = Vec::with_capacity(plain * count);
        for own in 0..plain {
            for step in 0..count {
                let before = &self.materials[own];
                let new = Material {
                    colour: Some(colour(before.colour.unwrap_or(UNDYED), step)),
                    ..before.clone()
                };
                let known = self.materials.iter().position(|m| *m == new);
                let index = known.unwrap_or_else(|| {
                    self.materials.push(new);
                    self.materials.len() - 1
                });
                numbers.push(index as u16);
            }
        }
        numbers
    }
}

/// Divides a segment where its material changes. `material` gives the material at a place from the
/// segment's own one; it is asked once in every `part_mm`.
pub(super) fn recoloured(
    segment: &Segment,
    part_mm: f32,
    material: impl Fn(u16, Vec3) -> u16,
    emit: &mut dyn FnMut(&Segment),
) {
    let parts = (segment.length_mm() / part_mm).ceil() as usize;
    let parts = parts.clamp(1, MAX_PARTS);
    let of = |i: usize| {
        let share = (i as f32 + 0.5) / parts as f32;
        material(
            segment.material,
            segment.start_mm.lerp(segment.end_mm, share),
        )
    };
    let (mut from, mut material) = (0, of(0));
    for i in 1..=parts {
        let next = if i < parts { of(i) } else { material };
        if i < parts && next == material {
            continue;
        }
        let part = match (from, i) {
            (0, all) if all == parts => Segment {
                material,
                ..*segment
            },
            _ => Segment {
                material,
                ..cut(segment, [from, i].map(|k| k as f32 / parts as f32))
            },
        };
        emit(&part);
        (from, material) = (i, next);
    }
}

/// The piece of a segment between two shares of it.
fn cut(s: &Segment, shares: [f32; 2]) -> Segment {
    let point = |t: f32| s.start_mm.lerp(s.end_mm, t);
    let radius = |t: f32| s.start_radius_mm + (s.end_radius_mm - s.start_radius_mm) * t;
    let tangent = |t: f32| {
        let between = s.start_tangent.lerp(s.end_tangent, t);
        between.try_normalize().unwrap_or(s.start_tangent)
    };
    let [a, b] = shares;
    Segment {
        start_mm: point(a),
        end_mm: point(b),
        start_radius_mm: radius(a),
        end_radius_mm: radius(b),
        start_tangent: tangent(a),
        end_tangent: tangent(b),
        ..*s
    }
}
