//! A medium from an octree of fibres: every population of fibres in a voxel
//! scatters as SGGX micro-flakes.

use crate::{Medium, SiteInfo};
use glam::{UVec3, Vec3};
use organza_basis::{CellGrid, CellSpan, LocalRay, Mixture, PathRng, Rgb};
use organza_scatter::{FlakeMaterials, FlakeOptics, LobeSample, PopulationFlakes};
use organza_volume::Octree;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Levels between a voxel and the node whose majorant a span uses: 4 voxels
/// along an edge, because the density of cloth varies inside yarns.
const NODE_LEVELS: u8 = 2;

/// Fibres of an octree level as specular SGGX flakes.
pub struct ClothMedium {
    octree: Arc<Octree>,
    level: u8,
    flakes: FlakeMaterials,
    cell_grid: CellGrid,
}

impl ClothMedium {
    /// The cloth at a level of detail (0 the finest). `optics` is indexed by
    /// the octree's materials. Media of several levels may share one octree.
    ///
    /// `None` when the level does not exist or a material has no optics.
    pub fn new(
        octree: impl Into<Arc<Octree>>,
        level: u8,
        optics: Vec<FlakeOptics>,
    ) -> Option<ClothMedium> {
        let octree = octree.into();
        if level >= octree.level_count() || optics.len() < octree.material_count() {
            return None;
        }
        let cell_grid = CellGrid::new(octree.bounds_mm(), octree.dims(level), octree.repeats())?;
        Some(ClothMedium {
            octree,
            level,
            flakes: FlakeMaterials::new(optics),
            cell_grid,
        })
    }

    pub(crate) fn cell_grid_mut(&mut self) -> &mut CellGrid {
        &mut self.cell_grid
    }

    /// The octree.
    pub fn octree(&self) -> &Octree {
        &self.octree
    }

    /// The level of detail, 0 the finest.
    pub fn level(&self) -> u8 {
        self.level
    }

    /// The populations of a cell.
    pub fn populations(&self, cell: UVec3) -> Mixture {
        self.octree.mixture(self.level, cell)
    }

    /// The flakes of the cloth's materials.
    pub fn materials(&self) -> &FlakeMaterials {
        &self.flakes
    }
}

impl Medium for ClothMedium {
    type Site = Mixture;

    fn cell_grid(&self) -> &CellGrid {
        &self.cell_grid
    }

    fn for_each_span<B>(
        &self,
        ray: &LocalRay,
        mut visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let top = self.octree.level_count() - 1;
        let node_level = (self.level + NODE_LEVELS).min(top);
        let edge = 1 << (node_level - self.level);
        for span in self.cell_grid.cells(ray, edge) {
            let majorant = self.octree.majorant_per_mm(node_level, span.cell);
            if majorant > 0.0 {
                visit(&span, majorant)?;
            }
        }
        ControlFlow::Continue(())
    }

    fn for_each_voxel<B>(
        &self,
        ray: &LocalRay,
        mut visit: impl FnMut(f32, f32, Mixture) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        // Node by node, so that a stretch of air costs one step.
        self.for_each_span(ray, |node, _| {
            let within = LocalRay {
                origin: node.point(ray, node.t0),
                length: node.t1 - node.t0,
                ..*ray
            };
            for span in self.cell_grid.cells(&within, 1) {
                let site = self.octree.mixture(self.level, span.cell);
                if !site.is_empty() {
                    visit(node.t0 + span.t0, node.t0 + span.t1, site)?;
                }
            }
            ControlFlow::Continue(())
        })
    }

    fn is_piecewise_constant(&self) -> bool {
        true
    }

    fn site(&self, p: Vec3) -> Mixture {
        self.octree.mixture(self.level, self.cell_grid.cell(p))
    }

    fn sigma_t(&self, site: &Mixture, w: Vec3) -> f32 {
        self.flakes.total(site, w)
    }

    fn eval(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.flakes.mix(site, w_out, w_in).0
    }

    fn sample(&self, site: &Mixture, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        self.flakes.scatter(site, w_out, rng)
    }

    fn pdf(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> f32 {
        self.flakes.mix(site, w_out, w_in).1
    }

    fn info(&self, site: &Mixture) -> SiteInfo {
        let densest = site
            .as_slice()
            .iter()
            .max_by(|a, b| a.broadside_per_mm().total_cmp(&b.broadside_per_mm()));
        densest.map_or(SiteInfo::default(), |c| SiteInfo {
            axis: c.axis,
            yarn: Some(c.yarn),
        })
    }
}
