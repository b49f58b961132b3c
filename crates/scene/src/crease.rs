//! `[[object.crease]]`: where a cloth on a mesh was folded and pressed.

use crate::stroke::{away_mm, check_places, smooth};
use glam::Vec2;
use organza_mesh::Mesh;
use serde::Deserialize;

/// Length of a mesh's edges across a crease, in widths of the crease.
const FINE: f32 = 0.1;

/// A pressed crease: cloth is flattened along a line. It does not bend there; meshes do.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Crease {
    /// Where it begins, on the cloth: mm along weft and warp.
    pub from_mm: [f32; 2],
    /// Where it ends.
    pub to_mm: [f32; 2],
    /// Its width, mm; half way to its edge, cloth is flattened half as much as in its middle.
    pub width_mm: f32,
    /// The share of its thickness that cloth loses in the middle: 0 to 0.6.
    #[serde(default = "usual_flatten")]
    pub flatten: f32,
}

/// (estimated)
fn usual_flatten() -> f32 {
    0.4
}

impl Crease {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `.key: what was expected`.
    pub fn check(&self) -> Result<(), String> {
        check_places(self.from_mm, self.to_mm)?;
        let number = |key: &str, found: f32, [from, to]: [f32; 2]| match found {
            x if (from..=to).contains(&x) => Ok(()),
            _ => Err(format!(".{key}: expected {from} to {to}, found {found}")),
        };
        number("width_mm", self.width_mm, [0.01, 1e4])?;
        number("flatten", self.flatten, [0.0, 0.6])
    }

    fn away_mm(&self, at_mm: Vec2) -> f32 {
        away_mm([self.from_mm, self.to_mm].map(Vec2::from), at_mm)
    }

    /// The share of its thickness that the cloth loses at a place.
    fn share(&self, at_mm: Vec2) -> f32 {
        self.flatten * smooth(1.0 - 2.0 * self.away_mm(at_mm) / self.width_mm)
    }

    /// How long the edges of a mesh may be at a place so that the crease shows.
    pub fn longest_edge_mm(&self, at_mm: Vec2) -> f32 {
        let beside_mm = (self.away_mm(at_mm) - 0.5 * self.width_mm).max(0.0);
        FINE * self.width_mm + beside_mm
    }

    /// Flattens what lies on a mesh along creases; where they cross, as the flatter one.
    pub fn flatten(creases: &[Crease], mesh: &mut Mesh) {
        if !creases.is_empty() {
            let share = |at_mm| creases.iter().map(|c| c.share(at_mm)).fold(0.0, f32::max);
            mesh.flatten(share);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A crease flattens along its whole length, less towards its edge, and nothing beside it.
    #[test]
    fn a_crease_fades_to_its_edge() {
        let crease = Crease {
            from_mm: [0.0, 0.0],
            to_mm: [10.0, 0.0],
            width_mm: 4.0,
            flatten: 0.6,
        };
        let at = |x, y| crease.share(Vec2::new(x, y));
        assert_eq!([at(0.0, 0.0), at(10.0, 0.0), at(5.0, 2.0)], [0.6, 0.6, 0.0]);
        assert!((at(5.0, 1.0) - 0.3).abs() < 1e-6);
        let refused = Crease {
            flatten: 0.7,
            ..crease
        };
        assert_eq!(
            refused.check().unwrap_err(),
            ".flatten: expected 0 to 0.6, found 0.7"
        );
    }
}
