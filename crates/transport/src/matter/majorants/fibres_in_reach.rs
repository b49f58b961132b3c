//! Majorants of virtual fibres: from the fibres in voxels and those within reach of them.

use crate::matter::voxel_fibres::VoxelFibres;
use glam::{IVec3, Vec3};
use organza_basis::FibrePopulation;

/// Sum of the broadside extinctions: a bound for every direction.
pub fn broadside_per_mm(populations: &[FibrePopulation]) -> f32 {
    populations
        .iter()
        .map(FibrePopulation::broadside_per_mm)
        .sum()
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
    fn for_each(&self, mut visit: impl FnMut(&[FibrePopulation])) {
        let high = (self.low + self.edge).min(self.dims);
        let (low, high) = (self.low - self.reach, high + self.reach);
        for z in low.z..high.z {
            for y in low.y..high.y {
                for x in low.x..high.x {
                    visit(self.voxels.of(IVec3::new(x, y, z) - self.pad));
                }
            }
        }
    }

    /// A bound of the extinction, over all directions.
    pub fn majorant_per_mm(&self) -> f32 {
        let mut most = 0.0f32;
        self.for_each(|here| most = most.max(broadside_per_mm(here)));
        most
    }

    /// The densest population.
    pub fn densest(&self) -> Densest {
        let (mut found, mut most) = (Densest::default(), 0.0);
        self.for_each(|here| {
            for c in here {
                if c.broadside_per_mm() > most {
                    most = c.broadside_per_mm();
                    found = Densest {
                        axis: c.axis,
                        radius_mm: c.radius_mm,
                    };
                }
            }
        });
        found
    }
}
