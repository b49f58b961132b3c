//! Fibres as chains of joints: what is laid out in cells.

use glam::Vec3;

/// Where two pieces of a fibre meet, or where it ends.
#[derive(Clone, Copy, Debug)]
pub struct Joint {
    /// Relative to the least corner of the tile, mm.
    pub position: Vec3,
    /// Radius of the fibre there, mm.
    pub radius_mm: f32,
    /// Unit tangent; where both pieces have one radius, half-way between them.
    pub tangent: Vec3,
    /// The strand that it belongs to.
    pub strand: u32,
    /// Whether the pieces are cut here by the plane across the tangent, or round.
    pub cut: bool,
}

/// What all pieces of a fibre share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strand {
    /// Yarn of the tile.
    pub yarn: u32,
    /// Fibre of the yarn.
    pub fibre: u32,
    /// Index into the table of materials.
    pub material: u16,
}

/// All fibres of a tile, one after the other. Piece `k` lies between joints `k`
/// and `k + 1` when both are of one strand.
#[derive(Clone, Copy, Debug)]
pub struct Strands<'a> {
    /// Joints, strand by strand.
    pub joints: &'a [Joint],
    /// Strands.
    pub strands: &'a [Strand],
}

impl<'a> Strands<'a> {
    /// Numbers of all pieces.
    pub fn pieces(self) -> impl Iterator<Item = u32> + 'a {
        let joints = 0..self.joints.len();
        joints
            .filter(move |&k| self.begins_piece(k))
            .map(|k| k as u32)
    }

    /// Whether a piece begins at a joint.
    pub fn begins_piece(self, joint: usize) -> bool {
        let strand = |k: usize| self.joints.get(k).map(|j| j.strand);
        strand(joint) == strand(joint + 1)
    }
}
