//! A shell as plain tables, for engines that follow rays without pointers.

use crate::shell::Shell;
use crate::shell_around::{Boxes, NOBODY, ShellBox};
use glam::{DVec3, Mat3, Vec3};

/// Tetrahedra and the boxes around them. Places of the world are counted from a point that
/// the caller names.
#[derive(Clone, Debug, Default)]
pub struct ShellTables {
    /// In the order of the boxes that hold them.
    pub tetrahedra: Vec<ShellTetrahedron>,
    /// A tree of boxes from the root on: the first child of a box follows it.
    pub boxes: Vec<ShellBox>,
}

/// A tetrahedron in which the map between world and cloth is affine.
#[derive(Clone, Copy, Debug)]
pub struct ShellTetrahedron {
    /// Its first corner in the world, mm from the point.
    pub corner_mm: Vec3,
    /// Weights of its second to fourth corner, from the world relative to the first, 1/mm.
    pub weights_from_world: Mat3,
    /// Its first corner in the cloth, mm.
    pub cloth_corner_mm: DVec3,
    /// Places of the cloth per place of the world.
    pub cloth_from_world: Mat3,
    /// Turns directions of the cloth to the world: orthogonal.
    pub world_from_cloth: Mat3,
    /// Takes differences of places of the cloth to the world.
    pub stretch: Mat3,
    /// The tetrahedra beyond the faces opposite to its corners; [`NOBODY`] where none is.
    pub neighbours: [u32; 4],
    /// Whether no other tetrahedron fills any of its room.
    pub is_alone: bool,
}

impl Shell {
    /// The shell as tables, with places of the world counted from a point.
    pub fn tables(&self, point_mm: DVec3) -> ShellTables {
        let (all, around) = self.all();
        let Boxes { boxes, order } = Boxes::new(all, point_mm, self.margin_mm());
        let mut place = vec![NOBODY; all.len()];
        for (at, &old) in order.iter().enumerate() {
            place[old as usize] = at as u32;
        }
        let tetrahedra = order.iter().map(|&old| {
            let (t, around) = (&all[old as usize], &around[old as usize]);
            ShellTetrahedron {
                corner_mm: (t.corner_mm - point_mm).as_vec3(),
                weights_from_world: t.weights_from_world.as_mat3(),
                cloth_corner_mm: t.cloth_corner_mm,
                cloth_from_world: t.cloth_from_world.as_mat3(),
                world_from_cloth: t.world_from_cloth,
                stretch: t.stretch,
                neighbours: around
                    .neighbours
                    .map(|n| place.get(n as usize).copied().unwrap_or(NOBODY)),
                is_alone: around.is_alone,
            }
        });
        ShellTables {
            tetrahedra: tetrahedra.collect(),
            boxes,
        }
    }
}
