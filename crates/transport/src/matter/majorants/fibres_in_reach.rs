//! Majorants of virtual fibres: from the fibres in voxels and those within reach of them.

use crate::matter::voxel_fibres::VoxelFibres;
use glam::{IVec3, Vec3};
use organza_basis::FibrePopulation;

/// Sum of the broadside extinctions: a bound for every direction.
pub fn broadside_per_mm(populations: &[FibrePopulation]) -> f32 {
    let each = populations.iter().map(FibrePopulation::broadside_per_mm);
    each.sum()
}

/// The densest population in a block of voxels and around it.
#[derive(Clone, Copy, Default)]
pub struct Densest {
    /// Its mean axis.
    pub axis: Vec3,
    /// Radius of its fibres.
    pub radius_mm: f32,
}

/// A block of voxels and what is within reach of it.
pub struct FibresInReach<'a> {
    /// The fibres.
    pub voxels: &'a VoxelFibres,
    /// Cells of the grid along each axis.
    pub dims: IVec3,
    /// Cells of the grid before the first voxel.
    pub pad: IVec3,
    /// Cells within reach of a block.
    pub reach: IVec3,
    /// Least cell of the block.
    pub low: IVec3,
    /// Cells along its edge.
    pub edge: i32,
}

impl FibresInReach<'_> {
    /// A bound of the extinction, over all directions, and the densest population.
    pub fn bound(&self) -> (f32, Densest) {
        let high = (self.low + self.edge).min(self.dims) + self.reach;
        let (low, shift) = (self.low - self.reach, self.pad);
        let mut majorant_per_mm = 0.0f32;
        let (mut densest, mut most) = (Densest::default(), 0.0);
        self.voxels.for_each(low - shift, high - shift, |here| {
            let mut sum = 0.0;
            for c in here {
                let broadside_per_mm = c.broadside_per_mm();
                sum += broadside_per_mm;
                if broadside_per_mm > most {
                    most = broadside_per_mm;
                    densest = Densest {
                        axis: c.axis,
                        radius_mm: c.radius_mm,
                    };
                }
            }
            majorant_per_mm = majorant_per_mm.max(sum);
        });
        (majorant_per_mm, densest)
    }
}
