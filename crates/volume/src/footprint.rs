//! The voxels that receive the length of a thick fibre.

use crate::lattice::Lattice;

/// Where the length of a fibre goes that is thicker than a voxel (by more than
/// the tenth that fitting a period takes from it at most, as a rule).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FibreFootprint {
    /// Over the voxels that the fibre covers: right for extinction looked up
    /// where the light is.
    #[default]
    Covered,
    /// Into the voxels that its axis passes: for media that look the density
    /// up at the axis of the fibre they are about to hit.
    Axis,
}

impl FibreFootprint {
    /// True when fibres so thick count as lines.
    pub(crate) fn is_line(self, radius_mm: f32, lattice: &Lattice) -> bool {
        let narrowest = lattice.voxel_mm.min_element();
        self == FibreFootprint::Axis || 2.0 * f64::from(radius_mm) <= 1.1 * narrowest
    }
}
