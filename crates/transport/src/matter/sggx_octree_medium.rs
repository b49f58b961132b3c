//! Fibres of an octree as SGGX micro-flakes: every population of a voxel scatters
//! as mirrors.

use crate::SiteInfo;
use crate::matter::octree_medium::{OctreeLevel, OctreeMedium, Scatterer};
use glam::{UVec3, Vec3};
use organza_basis::{CellGrid, Mixture, PathRng, Rgb};
use organza_scatter::{FlakeMaterials, FlakeOptics, LobeSample, PopulationFlakes};
use organza_volume::Octree;
use std::sync::Arc;

/// Fibres of an octree level as specular SGGX flakes.
pub type SggxOctreeMedium = OctreeMedium<SggxFlakes>;

/// Specular SGGX flakes of a cloth's materials.
pub struct SggxFlakes {
    materials: FlakeMaterials,
}

/// The level of an octree that materials so many are known of; `None` when there is no
/// such level, or materials are missing.
pub(crate) fn level_of(
    octree: impl Into<Arc<Octree>>,
    level: u8,
    materials: usize,
) -> Option<OctreeLevel> {
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

/// What to show of a mixture.
pub(crate) fn info_of(mixture: &Mixture) -> SiteInfo {
    let densest = mixture
        .as_slice()
        .iter()
        .max_by(|a, b| a.broadside_per_mm().total_cmp(&b.broadside_per_mm()));
    densest.map_or(SiteInfo::default(), |c| SiteInfo {
        axis: c.axis,
        yarn: Some(c.yarn),
    })
}

impl SggxOctreeMedium {
    /// The cloth at a level of detail (0 the finest). `optics` is indexed by
    /// the octree's materials. Media of several levels may share one octree.
    ///
    /// `None` when the level does not exist or a material has no optics.
    pub fn new(
        octree: impl Into<Arc<Octree>>,
        level: u8,
        optics: Vec<FlakeOptics>,
    ) -> Option<SggxOctreeMedium> {
        let level = level_of(octree, level, optics.len())?;
        let scatterer = SggxFlakes {
            materials: FlakeMaterials::new(optics),
        };
        Some(OctreeMedium { level, scatterer })
    }

    /// The populations of a cell of its [grid](crate::Medium::cell_grid).
    pub fn populations(&self, cell: UVec3) -> Mixture {
        self.octree().outlined_mixture(self.level(), cell)
    }

    /// The flakes of the cloth's materials.
    pub fn materials(&self) -> &FlakeMaterials {
        &self.scatterer.materials
    }
}

impl Scatterer for SggxFlakes {
    type Site = Mixture;

    fn site(&self, level: &OctreeLevel, cell: UVec3) -> Mixture {
        level.octree.outlined_mixture(level.level, cell)
    }

    fn is_empty(&self, site: &Mixture) -> bool {
        site.is_empty()
    }

    fn sigma_t(&self, site: &Mixture, w: Vec3) -> f32 {
        self.materials.total(site, w)
    }

    fn eval(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.materials.mix(site, w_out, w_in).0
    }

    fn sample(&self, site: &Mixture, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        self.materials.scatter(site, w_out, rng)
    }

    fn pdf(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> f32 {
        self.materials.mix(site, w_out, w_in).1
    }

    fn info(&self, site: &Mixture) -> SiteInfo {
        info_of(site)
    }
}
