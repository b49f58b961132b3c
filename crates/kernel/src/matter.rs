//! The interface through which matter is described to the kernel.

use crate::Unsuited;
use glam::UVec3;
use organza_basis::{CellGrid, Rgb};
use organza_scatter::{AxialFlake, Fibre};

/// Matter that can be laid out flat: constant within the voxels of a grid, in each
/// a few populations of fibres.
pub trait Matter: Sync {
    /// Where it is, and how it repeats.
    fn cell_grid(&self) -> &CellGrid;

    /// The fibres that scatter, by the number that [`Substance::Fibres`] has;
    /// `None` of micro-flakes.
    fn fibres(&self) -> Option<&[Fibre]>;

    /// Adds the populations of a voxel to `out`.
    ///
    /// # Errors
    /// A voxel that the kernel has no words for.
    fn populations(&self, cell: UVec3, out: &mut Vec<Population>) -> Result<(), Unsuited>;
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
    /// Micro-flakes of that albedo.
    Flakes(Rgb),
    /// Fibres of that material.
    Fibres(u16),
}

/// No yarn.
pub const NO_YARN: u32 = u32::MAX;
