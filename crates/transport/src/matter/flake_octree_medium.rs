//! Fibres of an octree as micro-flakes of any family.

use crate::SiteInfo;
use crate::matter::octree_medium::{OctreeLevel, OctreeMedium, Scatterer};
use glam::{UVec3, Vec3};
use organza_basis::{CellGrid, Mixture, PathRng, Rgb};
use organza_scatter::{
    ClearFibre, DiffuseFlake, FlakeFamily, FlakeMixtures, FlakeOptics, LobeSample,
    TransmittingFlakes,
};
use organza_volume::Octree;
use std::sync::Arc;

/// What lies at a collision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakeSite {
    mixture: Mixture,
    /// The flake of a real collision, if the family draws one.
    met: Option<DiffuseFlake>,
}

/// Fibres of an octree level as flakes of a [`FlakeFamily`].
///
/// Populations of all families have the same ratio of end-on to broadside
/// extinction, see [`crate::population_shape`]. Where a family draws a flake per
/// collision, `eval`, `sample` and `pdf` are those of the flake that
/// [`crate::Medium::draw_event`] drew.
pub type FlakeOctreeMedium = OctreeMedium<FlakeMixtures>;

/// The level of an octree that materials so many are known of; `None` when there is no
/// such level, or materials are missing.
fn level_of(octree: impl Into<Arc<Octree>>, level: u8, materials: usize) -> Option<OctreeLevel> {
    let octree = octree.into();
    if level >= octree.level_count() || materials < octree.material_count() {
        return None;
    }
    let outline = octree.outline_level(level);
    let cell_grid = CellGrid::new(octree.bounds_mm(), octree.dims(outline), octree.repeats())?;
    Some(OctreeLevel {
        octree,
        level,
        outline,
        cell_grid,
    })
}

impl FlakeOctreeMedium {
    /// The cloth at a level of detail (0 the finest). `optics` is indexed by
    /// the octree's materials. Media of several levels may share one octree.
    ///
    /// `None` when the level does not exist or a material has no optics.
    pub fn new(
        octree: impl Into<Arc<Octree>>,
        level: u8,
        optics: Vec<FlakeOptics>,
        family: FlakeFamily,
    ) -> Option<FlakeOctreeMedium> {
        let level = level_of(octree, level, optics.len())?;
        let scatterer = family.of_materials(optics);
        Some(OctreeMedium { level, scatterer })
    }

    /// The same of flakes that transmit, of the fibres of each material.
    pub fn of_clear_fibres(
        octree: impl Into<Arc<Octree>>,
        level: u8,
        optics: Vec<FlakeOptics>,
        fibres: Vec<ClearFibre>,
    ) -> Option<FlakeOctreeMedium> {
        let level = level_of(octree, level, optics.len())?;
        let scattering = TransmittingFlakes::new(&optics, fibres);
        let scatterer = FlakeMixtures::new(optics, Arc::new(scattering));
        Some(OctreeMedium { level, scatterer })
    }

    /// The populations of a cell of its [grid](crate::Medium::cell_grid).
    pub fn populations(&self, cell: UVec3) -> Mixture {
        self.octree().outlined_mixture(self.level(), cell)
    }

    /// The flakes of the cloth's materials.
    pub fn flakes(&self) -> &FlakeMixtures {
        &self.scatterer
    }
}

impl Scatterer for FlakeMixtures {
    type Site = FlakeSite;

    fn site(&self, level: &OctreeLevel, cell: UVec3) -> FlakeSite {
        FlakeSite {
            mixture: level.octree.outlined_mixture(level.level, cell),
            met: None,
        }
    }

    fn is_empty(&self, site: &FlakeSite) -> bool {
        site.mixture.is_empty()
    }

    fn draw_event(&self, site: FlakeSite, w_out: Vec3, rng: &mut PathRng) -> FlakeSite {
        let met = self.draw_flake(&site.mixture, w_out, rng);
        FlakeSite { met, ..site }
    }

    fn sigma_t(&self, site: &FlakeSite, w: Vec3) -> f32 {
        self.sigma_t_per_mm(&site.mixture, w)
    }

    fn eval(&self, site: &FlakeSite, w_out: Vec3, w_in: Vec3) -> Rgb {
        FlakeMixtures::eval(self, &site.mixture, site.met.as_ref(), w_out, w_in).0
    }

    fn sample(&self, site: &FlakeSite, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        FlakeMixtures::sample(self, &site.mixture, site.met.as_ref(), w_out, rng)
    }

    fn pdf(&self, site: &FlakeSite, w_out: Vec3, w_in: Vec3) -> f32 {
        FlakeMixtures::eval(self, &site.mixture, site.met.as_ref(), w_out, w_in).1
    }

    fn info(&self, site: &FlakeSite) -> SiteInfo {
        let densest = site
            .mixture
            .iter()
            .max_by(|a, b| a.broadside_per_mm().total_cmp(&b.broadside_per_mm()));
        densest.map_or(SiteInfo::default(), |c| SiteInfo::new(c.axis, Some(c.yarn)))
    }
}
