//! The interface through which matter is described to the kernel.

use glam::{UVec2, UVec3};
use organza_basis::{CellGrid, Rgb};
use organza_scatter::{AxialFlake, Fibre, FlakeScattering};
use std::sync::Arc;

/// Matter that can be laid out flat: constant within the voxels of a grid, in each
/// a few populations of fibres.
pub trait Matter: Sync {
    /// Where it is, and how it repeats.
    fn cell_grid(&self) -> &CellGrid;

    /// What scatters.
    fn scatterers(&self) -> Scatterers<'_>;

    /// Which block each crossing of a cloth of blocks shows; `None` of other matter.
    fn blocks(&self) -> Option<MatterBlocks> {
        None
    }

    /// Adds the populations of a voxel to `out`.
    ///
    /// # Errors
    /// A voxel that the kernel has no words for.
    fn populations(&self, cell: UVec3, out: &mut Vec<Population>) -> Result<(), Unsuited>;
}

/// What scatters in matter.
pub enum Scatterers<'a> {
    /// Micro-flakes of a family.
    Flakes(Arc<dyn FlakeScattering>),
    /// Virtual fibres, by the number that [`Substance::Fibres`] has.
    Fibres(&'a [Fibre]),
}

/// Matter that repeats a few blocks of voxels, in any order: a crossing of its grid shows one of
/// them.
#[derive(Clone, Debug)]
pub struct MatterBlocks {
    /// Crossings along x and y.
    pub crossings: UVec2,
    /// Voxels of a block along each axis; the matter is one block high.
    pub voxels: UVec3,
    /// The block of each crossing, x fastest.
    pub index: Arc<[u32]>,
    /// A crossing that shows each block.
    pub shown_at: Arc<[UVec2]>,
}

/// One population of fibres in a voxel, as micro-flakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Population {
    /// Extinction across the axis, 1/mm.
    pub broadside_per_mm: f32,
    /// Flakes along the axis.
    pub flake: AxialFlake,
    /// What scatters.
    pub substance: Substance,
    /// Yarn, where known.
    pub yarn: u32,
}

/// What a population scatters light with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Substance {
    /// Micro-flakes of that albedo and material.
    Flakes(Rgb, u16),
    /// Fibres of that material.
    Fibres(u16),
}

/// No yarn.
pub const NO_YARN: u32 = u32::MAX;

/// Most voxels along an axis: `f32` coordinates then keep voxels apart by the margin
/// that a walk needs.
pub const MAX_DIM: u32 = 4096;

/// Why matter cannot be laid out for lanes.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Unsuited {
    /// Flakes that are not those of a fibre.
    #[error("a grid has flakes that are not symmetric about their thinnest direction")]
    NotAxial,
    /// More voxels along an axis than [`MAX_DIM`].
    #[error("a medium has more than {MAX_DIM} voxels along an axis")]
    TooWide,
    /// More albedos than there are numbers for.
    #[error("a medium has more than 65536 different albedos")]
    TooManyAlbedos,
    /// More voxels of packed fibres than lanes can address.
    #[error("a medium has more than 2^30 voxels of packed fibres")]
    TooManyVoxels,
    /// More materials of packed fibres than there are numbers for.
    #[error("a medium has more than 256 materials of packed fibres")]
    TooManyMaterials,
    /// Thin matter beside matter so dense that the chance of meeting it is lost.
    #[error("thin matter beside dense matter (an optical depth of {0} across all of it)")]
    Contrast(f32),
    /// Matter so dense that places are too far apart.
    #[error("matter so dense that a voxel has an optical depth of {0}")]
    Dense(f32),
    /// More populations than can be addressed.
    #[error("a medium has more than 2^29 populations of fibres")]
    TooManyPopulations,
}
