//! The voxels that receive the length of a thick fibre.

use crate::lattice::Lattice;

/// Which voxels receive the length of a fibre that is thicker than a voxel, by more than the
/// tenth that fitting voxels to a period may cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FibreFootprint {
    /// The voxels that the fibre covers: correct for extinction that is looked up at the
    /// position of the light.
    #[default]
    Covered,
    /// The voxels that the axis of the fibre passes: for media that look the density up at the
    /// axis of the fibre that a ray meets.
    Axis,
}

impl FibreFootprint {
    /// True when fibres of this radius count as lines.
    pub(crate) fn is_line(self, radius_mm: f32, lattice: &Lattice) -> bool {
        let narrowest = lattice.voxel_mm.min_element();
        self == FibreFootprint::Axis || 2.0 * f64::from(radius_mm) <= 1.1 * narrowest
    }
}
