//! A medium from an octree of fibres as micro-flakes of any family.

use crate::{ClothMedium, Medium, SiteInfo};
use glam::Vec3;
use organza_basis::{CellGrid, CellSpan, LocalRay};
use organza_basis::{Mixture, PathRng, Rgb};
use organza_scatter::{DiffuseFlake, FlakeFamily, FlakeOptics, FlakeScattering, LobeSample};
use organza_volume::Octree;
use std::ops::ControlFlow;
use std::sync::Arc;

/// What lies at a collision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakeSite {
    mixture: Mixture,
    /// The flake of a real collision, if the family draws one.
    met: Option<DiffuseFlake>,
}

impl FlakeSite {
    fn unsettled(mixture: Mixture) -> FlakeSite {
        FlakeSite { mixture, met: None }
    }
}

/// Fibres of an octree level as flakes of a [`FlakeFamily`]. Mirrors of the SGGX
/// distribution have a medium of their own, [`ClothMedium`], which the kernel takes.
///
/// Populations of all families have the same ratio of end-on to broadside
/// extinction, see [`crate::population_shape`]. Where a family draws a flake per
/// collision, `eval`, `sample` and `pdf` are those of the flake that
/// [`Medium::settle`] drew.
pub struct FlakeMedium {
    cloth: ClothMedium,
    flakes: Box<dyn FlakeScattering>,
}

impl FlakeMedium {
    /// The cloth at a level of detail (0 the finest). `optics` is indexed by
    /// the octree's materials.
    ///
    /// `None` when the level does not exist or a material has no optics.
    pub fn new(
        octree: impl Into<Arc<Octree>>,
        level: u8,
        optics: Vec<FlakeOptics>,
        family: FlakeFamily,
    ) -> Option<FlakeMedium> {
        let cloth = ClothMedium::new(octree, level, optics.clone())?;
        let flakes = family.of_materials(optics);
        Some(FlakeMedium { cloth, flakes })
    }

    pub(crate) fn cell_grid_mut(&mut self) -> &mut CellGrid {
        self.cloth.cell_grid_mut()
    }

    /// The octree.
    pub fn octree(&self) -> &Octree {
        self.cloth.octree()
    }
}

impl Medium for FlakeMedium {
    type Site = FlakeSite;

    fn cell_grid(&self) -> &CellGrid {
        self.cloth.cell_grid()
    }

    fn for_each_span<B>(
        &self,
        ray: &LocalRay,
        visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        self.cloth.for_each_span(ray, visit)
    }

    fn for_each_voxel<B>(
        &self,
        ray: &LocalRay,
        mut visit: impl FnMut(f32, f32, FlakeSite) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        self.cloth.for_each_voxel(ray, |t0, t1, mixture| {
            visit(t0, t1, FlakeSite::unsettled(mixture))
        })
    }

    fn is_piecewise_constant(&self) -> bool {
        true
    }

    fn site(&self, p: Vec3) -> FlakeSite {
        FlakeSite::unsettled(self.cloth.site(p))
    }

    fn settle(&self, site: FlakeSite, w_out: Vec3, rng: &mut PathRng) -> FlakeSite {
        if !self.flakes.draws_flakes() {
            return site;
        }
        let met = self.flakes.draw_flake(&site.mixture, w_out, rng);
        FlakeSite { met, ..site }
    }

    fn sigma_t(&self, site: &FlakeSite, w: Vec3) -> f32 {
        self.flakes.sigma_t_per_mm(&site.mixture, w)
    }

    fn eval(&self, site: &FlakeSite, w_out: Vec3, w_in: Vec3) -> Rgb {
        let flake = site.met.as_ref();
        self.flakes.eval(&site.mixture, flake, w_out, w_in).0
    }

    fn sample(&self, site: &FlakeSite, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let flake = site.met.as_ref();
        self.flakes.sample(&site.mixture, flake, w_out, rng)
    }

    fn pdf(&self, site: &FlakeSite, w_out: Vec3, w_in: Vec3) -> f32 {
        let flake = site.met.as_ref();
        self.flakes.eval(&site.mixture, flake, w_out, w_in).1
    }

    fn info(&self, site: &FlakeSite) -> SiteInfo {
        self.cloth.info(&site.mixture)
    }
}
