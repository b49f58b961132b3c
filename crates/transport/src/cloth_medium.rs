//! A medium from an octree of fibres: every population of fibres in a voxel
//! scatters as SGGX micro-flakes.

use crate::population_flakes::{FlakeOptics, PopulationFlakes, ShapeTable};
use crate::{Medium, SiteInfo};
use glam::{UVec3, Vec3};
use organza_basis::{CellGrid, CellSpan, FibreComponent, LocalRay, Mixture, PathRng, Rgb, Sym3};
use organza_scatter::{AxialFlake, LobeSample};
use organza_volume::Octree;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Levels between a voxel and the node whose majorant a span uses: 4 voxels
/// along an edge, because the density of cloth varies inside yarns.
const NODE_LEVELS: u8 = 2;

/// A voxel's populations as one; see [`ClothMedium::merged`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergedFlakes {
    /// Extinction at unit projected area; zero where there is no fibre.
    pub density_per_mm: f32,
    /// SGGX matrix, greatest eigenvalue at most one; zero without fibre.
    pub sggx: Sym3,
    /// Single-scattering albedo.
    pub albedo: Rgb,
    /// How many populations there are.
    pub populations: usize,
}

/// Fibres of an octree level as specular SGGX flakes.
pub struct ClothMedium {
    octree: Arc<Octree>,
    level: u8,
    optics: Vec<FlakeOptics>,
    /// Per material.
    shapes: Vec<ShapeTable<(f32, f32)>>,
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
        let shapes = optics
            .iter()
            .map(|o| ShapeTable::new(o.end_on_ratio, |broadside, end_on| (broadside, end_on)))
            .collect();
        Some(ClothMedium {
            octree,
            level,
            optics,
            shapes,
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

    /// The populations of a cell.
    pub fn populations(&self, cell: UVec3) -> Mixture {
        self.octree.mixture(self.level, cell)
    }

    /// Single-scattering albedo of a population.
    pub fn albedo_of(&self, c: &FibreComponent) -> Rgb {
        self.optics[usize::from(c.material)].albedo
    }

    /// What a voxel of the grid would be if its populations were one, for
    /// programs that know no more: extinctions at unit area add, matrices are
    /// their mean by extinction [Heitz2015]. Exact for one population.
    pub fn merged(&self, cell: UVec3) -> MergedFlakes {
        let mixture = self.octree.mixture(self.level, cell);
        let mut merged = MergedFlakes {
            density_per_mm: mixture.broadside_per_mm(),
            sggx: Sym3::default(),
            albedo: Rgb::BLACK,
            populations: mixture.as_slice().len(),
        };
        for c in mixture.as_slice() {
            let share = c.broadside_per_mm() / merged.density_per_mm;
            let (broadside, end_on) = self.flake_shape(c);
            let across = broadside * broadside;
            let s = Sym3::axial(c.axis, across, across * end_on * end_on);
            merged.sggx = merged.sggx.plus(s.scaled(share));
            merged.albedo += self.optics[usize::from(c.material)].albedo * share;
        }
        merged
    }

    /// Broadside area, relative to straight smooth fibres, and end-on ratio of the
    /// flakes of a population: [`crate::population_shape`], tabulated.
    pub fn flake_shape(&self, c: &FibreComponent) -> (f32, f32) {
        self.shapes[usize::from(c.material)].look_up(c.spread_rad)
    }
}

impl PopulationFlakes for ClothMedium {
    type Flakes = AxialFlake;

    /// Without building the flake: `sqrt(e^2 + (1 - e^2) sin^2)` times the
    /// broadside value.
    fn extinction(&self, c: &FibreComponent, w: Vec3) -> f32 {
        let (broadside, end_on) = self.flake_shape(c);
        let along = c.axis.dot(w);
        let sin_sq = (1.0 - along * along).max(0.0);
        let area = (end_on * end_on * (1.0 - sin_sq) + sin_sq).sqrt();
        c.broadside_per_mm() * broadside * area
    }

    fn flakes(&self, c: &FibreComponent) -> AxialFlake {
        AxialFlake::new(c.axis, self.flake_shape(c).1)
    }

    fn albedo(&self, c: &FibreComponent) -> Rgb {
        self.optics[usize::from(c.material)].albedo
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
        self.total(site, w)
    }

    fn eval(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.mix(site, w_out, w_in).0
    }

    fn sample(&self, site: &Mixture, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        self.scatter(site, w_out, rng)
    }

    fn pdf(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> f32 {
        self.mix(site, w_out, w_in).1
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
