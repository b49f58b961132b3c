//! Media described as matter of the kernel.
//!
//! Media do not know the kernel, and the kernel does not know media: both meet here.
//! Explicit fibres describe themselves ([`ExplicitFibres::body`](crate::ExplicitFibres)).

use crate::{Draping, FlakeOctreeMedium, GridMedium, Medium, Plane, VirtualFibreMedium};
use glam::{DVec3, UVec3};
use organza_basis::{CellGrid, FibrePopulation};
use organza_kernel::fibres::{
    Drape, DrapeBox, DrapeSpan, DrapeStep, DrapeTables, DrapeTetrahedron, FibrePlane,
};
use organza_kernel::packed::{ExpectedFibre, PackedVoxels};
use organza_kernel::{
    Matter, MatterBlocks, NO_YARN, Population, Scatterers, Substance, Unsuited, end_on_ratio,
};
use organza_mesh::{Shell, ShellSpan};
use organza_scatter::virtual_fibres::population_sigma_t_per_mm;
use organza_scatter::{AxialFlake, Fibre, FlakeFamily};
use organza_volume::Octree;
use std::sync::Arc;

impl Drape for Draping {
    fn bounds_mm(&self) -> (DVec3, DVec3) {
        Draping::bounds_mm(self)
    }

    fn visit_spans(
        &self,
        origin_mm: DVec3,
        direction: DVec3,
        limit_mm: f64,
        visit: &mut dyn FnMut(&DrapeSpan) -> f64,
    ) {
        self.visit_whole_spans((origin_mm, direction), limit_mm, &mut |span| {
            visit(&drape_span(span))
        });
    }

    fn step(&self, part: u32, origin_mm: DVec3, direction: DVec3, from_mm: f64) -> DrapeStep {
        let step = self
            .shell()
            .map(|shell| shell.step(part, (origin_mm, direction), from_mm));
        DrapeStep {
            span: step.and_then(|s| s.span).as_ref().map(drape_span),
            end_mm: step.map_or(from_mm, |s| s.end_mm),
            beyond: step.and_then(|s| s.beyond),
        }
    }

    fn part_at(&self, near: u32, place_mm: DVec3) -> Option<u32> {
        self.shell()?.tetrahedron_at(near, place_mm)
    }

    fn tables(&self, point_mm: DVec3) -> DrapeTables {
        let shell = self.shell();
        shell.map_or_else(DrapeTables::default, |shell| tables_of(shell, point_mm))
    }
}

fn drape_span(span: &ShellSpan) -> DrapeSpan {
    DrapeSpan {
        t0: span.t0,
        t1: span.t1,
        cloth_mm: span.cloth_mm,
        step: span.step,
        world_from_cloth: span.world_from_cloth,
        stretch: span.stretch,
        part: span.tetrahedron,
        is_alone: span.is_alone,
    }
}

/// The shell of a draping as tables of the kernel.
fn tables_of(shell: &Shell, point_mm: DVec3) -> DrapeTables {
    let tables = shell.tables(point_mm);
    let tetrahedra = tables.tetrahedra.iter().map(|t| DrapeTetrahedron {
        corner_mm: t.corner_mm,
        cloth_corner_mm: t.cloth_corner_mm,
        weights_from_world: t.weights_from_world,
        cloth_from_world: t.cloth_from_world,
        world_from_cloth: t.world_from_cloth,
        stretch: t.stretch,
        neighbours: t.neighbours,
        is_alone: t.is_alone,
    });
    let boxes = tables.boxes.iter().map(|b| DrapeBox {
        min_mm: b.min_mm,
        max_mm: b.max_mm,
        skip: b.skip,
        first: b.first,
        count: b.count,
    });
    DrapeTables {
        tetrahedra: tetrahedra.collect(),
        boxes: boxes.collect(),
    }
}

impl From<&Plane> for FibrePlane {
    fn from(plane: &Plane) -> FibrePlane {
        let (position_mm, normal) = plane.position_and_normal();
        FibrePlane {
            position_mm,
            normal,
            reflectance: plane.reflectance(),
            radiance: plane.radiance(),
        }
    }
}

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
fn blocks_of(octree: &Octree, level: u8) -> Option<MatterBlocks> {
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
        let octree = self.octree();
        blocks_of(octree, octree.outline_level(self.level()))
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
        let octree = self.octree();
        blocks_of(octree, octree.outline_level(self.level()))
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
