//! Fibres of an octree as micro-flakes of any family.

use crate::SiteInfo;
use crate::matter::octree_medium::{OctreeLevel, OctreeMedium, Scatterer};
use crate::matter::sggx_octree_medium::{info_of, level_of};
use glam::{UVec3, Vec3};
use organza_basis::{Mixture, PathRng, Rgb};
use organza_scatter::{
    ClearFibre, DiffuseFlake, FlakeFamily, FlakeOptics, FlakeScattering, LobeSample,
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

/// Fibres of an octree level as flakes of a [`FlakeFamily`]. Mirrors of the SGGX
/// distribution have a medium of their own, [`crate::SggxOctreeMedium`], which the kernel
/// takes.
///
/// Populations of all families have the same ratio of end-on to broadside
/// extinction, see [`crate::population_shape`]. Where a family draws a flake per
/// collision, `eval`, `sample` and `pdf` are those of the flake that
/// [`crate::Medium::draw_event`] drew.
pub type FlakeOctreeMedium = OctreeMedium<FamilyFlakes>;

/// Flakes of a family, for a cloth's materials.
pub struct FamilyFlakes {
    flakes: Box<dyn FlakeScattering>,
}

impl FlakeOctreeMedium {
    /// The cloth at a level of detail (0 the finest). `optics` is indexed by
    /// the octree's materials.
    ///
    /// `None` when the level does not exist or a material has no optics.
    pub fn new(
        octree: impl Into<Arc<Octree>>,
        level: u8,
        optics: Vec<FlakeOptics>,
        family: FlakeFamily,
    ) -> Option<FlakeOctreeMedium> {
        let level = level_of(octree, level, optics.len())?;
        let scatterer = FamilyFlakes {
            flakes: family.of_materials(optics),
        };
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
        let flakes = Box::new(TransmittingFlakes::new(optics, fibres));
        let scatterer = FamilyFlakes { flakes };
        Some(OctreeMedium { level, scatterer })
    }
}

impl Scatterer for FamilyFlakes {
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
        info_of(&site.mixture)
    }
}
