//! Media described as matter of the kernel.
//!
//! Media do not know the kernel, and the kernel does not know media: both meet here.
//! Explicit fibres describe themselves ([`ExplicitFibres::body`](crate::ExplicitFibres)).

use crate::{FlakeOctreeMedium, GridMedium, Medium, OctreeMedium, VirtualFibreMedium};
use glam::UVec3;
use organza_basis::{CellGrid, FibrePopulation};
use organza_kernel::packed::{ExpectedFibre, PackedVoxels};
use organza_kernel::{
    Matter, MatterBlocks, NO_YARN, Population, Scatterers, Substance, Unsuited, end_on_ratio,
};
use organza_scatter::virtual_fibres::population_sigma_t_per_mm;
use organza_scatter::{AxialFlake, Fibre, FlakeFamily};
use std::sync::Arc;

impl Matter for GridMedium {
    fn cell_grid(&self) -> &CellGrid {
        Medium::cell_grid(self)
    }

    fn scatterers(&self) -> Scatterers<'_> {
        Scatterers::Flakes(FlakeFamily::SGGX_SPECULAR.scattering(&[]))
    }

    fn populations(&self, cell: UVec3, out: &mut Vec<Population>) -> Result<(), Unsuited> {
        let (sigma_t_per_mm, matrix, albedo) = self.values_of(cell);
        if sigma_t_per_mm == 0.0 {
            return Ok(());
        }
        let (across, flake) = AxialFlake::from_matrix(matrix).ok_or(Unsuited::NotAxial)?;
        let broadside_per_mm = sigma_t_per_mm * across;
        if broadside_per_mm > 0.0 {
            out.push(Population {
                broadside_per_mm,
                flake,
                substance: Substance::Flakes(albedo, 0),
                yarn: NO_YARN,
            });
        }
        Ok(())
    }
}

/// The blocks of a level of a cloth of blocks.
fn blocks_of<P>(medium: &OctreeMedium<P>) -> Option<MatterBlocks> {
    let octree = medium.octree();
    let level = octree.outline_level(medium.level());
    octree.blocks().map(|blocks| MatterBlocks {
        crossings: blocks.crossings(),
        voxels: blocks.block_cells(level),
        index: Arc::clone(blocks.index()),
        shown_at: Arc::clone(blocks.all_shown_at()),
    })
}

impl Matter for FlakeOctreeMedium {
    fn cell_grid(&self) -> &CellGrid {
        Medium::cell_grid(self)
    }

    fn scatterers(&self) -> Scatterers<'_> {
        Scatterers::Flakes(Arc::clone(self.flakes().scattering()))
    }

    fn blocks(&self) -> Option<MatterBlocks> {
        blocks_of(self)
    }

    fn populations(&self, cell: UVec3, out: &mut Vec<Population>) -> Result<(), Unsuited> {
        let mixture = FlakeOctreeMedium::populations(self, cell);
        out.extend(mixture.iter().map(|c| {
            let (broadside_per_mm, flakes) = self.flakes().flakes(c);
            Population {
                broadside_per_mm,
                flake: AxialFlake::new(flakes.axis, flakes.end_on),
                substance: Substance::Flakes(flakes.albedo, flakes.material),
                yarn: c.yarn,
            }
        }));
        Ok(())
    }
}

impl Matter for VirtualFibreMedium {
    fn cell_grid(&self) -> &CellGrid {
        Medium::cell_grid(self)
    }

    fn scatterers(&self) -> Scatterers<'_> {
        Scatterers::Fibres(VirtualFibreMedium::fibres(self))
    }

    fn blocks(&self) -> Option<MatterBlocks> {
        blocks_of(self)
    }

    fn populations(&self, cell: UVec3, out: &mut Vec<Population>) -> Result<(), Unsuited> {
        let populations = self.populations_of(cell);
        out.extend(populations.iter().map(|c| Population {
            broadside_per_mm: population_sigma_t_per_mm(c, c.axis.any_orthonormal_vector()),
            flake: AxialFlake::new(c.axis, end_on_ratio(c.spread_rad)),
            substance: Substance::Fibres(c.material),
            yarn: c.yarn,
        }));
        Ok(())
    }
}

impl PackedVoxels for VirtualFibreMedium {
    fn cell_grid(&self) -> &CellGrid {
        Medium::cell_grid(self)
    }

    fn populations(&self, cell: UVec3) -> &[FibrePopulation] {
        self.populations_of(cell)
    }

    fn expected(&self, cell: UVec3) -> ExpectedFibre {
        let here = self.populations_of(cell).iter();
        let densest = here.max_by(|a, b| a.broadside_per_mm().total_cmp(&b.broadside_per_mm()));
        let (axis, radius_mm) = match densest {
            Some(c) => (c.axis, c.radius_mm),
            None => {
                let around = self.densest_around(cell);
                (around.axis, around.radius_mm)
            }
        };
        ExpectedFibre { axis, radius_mm }
    }

    fn fibres(&self) -> &[Fibre] {
        VirtualFibreMedium::fibres(self)
    }

    fn factors(&self) -> Vec<[f32; 3]> {
        let factors = self.packing_factors().iter();
        factors
            .map(|f| [f.own_yarn, f.other_yarn, f.outside])
            .collect()
    }
}
