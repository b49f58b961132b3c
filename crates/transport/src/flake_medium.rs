//! A medium from an octree of fibres as micro-flakes of the families that are no
//! mirrors of the SGGX distribution.

use crate::population_flakes::{Bands, PopulationFlakes};
use crate::{ClothMedium, Medium, SiteInfo};
use glam::Vec3;
use organza_basis::{CellGrid, CellSpan, LocalRay};
use organza_basis::{Mixture, PathRng, Rgb};
use organza_scatter::{DiffuseFlake, FlakeOptics, GaussianBand, Lobe, LobeSample, SineBand};
use organza_volume::Octree;
use std::ops::ControlFlow;
use std::sync::Arc;

/// A family of micro-flakes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlakeFamily {
    /// Diffuse flakes with the normals of SGGX: one flake is drawn per collision
    /// and scatters toward lights and walk alike [`DiffuseFlake`].
    SggxDiffuse,
    /// Mirrors with the truncated Gaussian profile [`GaussianBand`].
    Gaussian,
    /// Mirrors with the profile of a power of the sine [`SineBand`].
    SinePower,
}

enum Flakes {
    Diffuse,
    Gaussian(Bands<GaussianBand>),
    SinePower(Bands<SineBand>),
}

/// What lies at a collision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakeSite {
    mixture: Mixture,
    /// The flake of a real collision, of diffuse ones.
    met: Option<DiffuseFlake>,
}

impl FlakeSite {
    fn unsettled(mixture: Mixture) -> FlakeSite {
        FlakeSite { mixture, met: None }
    }
}

/// Fibres of an octree level as flakes of a [`FlakeFamily`]; specular SGGX flakes
/// have [`ClothMedium`] for themselves.
///
/// Populations of all families have the same ratio of end-on to broadside
/// extinction, see [`crate::population_shape`]. `eval`, `sample` and `pdf` of
/// diffuse flakes are those of the flake that [`Medium::settle`] drew.
pub struct FlakeMedium {
    cloth: ClothMedium,
    flakes: Flakes,
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
        let flakes = match family {
            FlakeFamily::SggxDiffuse => Flakes::Diffuse,
            FlakeFamily::Gaussian => Flakes::Gaussian(Bands::new(&optics)),
            FlakeFamily::SinePower => Flakes::SinePower(Bands::new(&optics)),
        };
        let cloth = ClothMedium::new(octree, level, optics)?;
        Some(FlakeMedium { cloth, flakes })
    }

    pub(crate) fn cell_grid_mut(&mut self) -> &mut CellGrid {
        self.cloth.cell_grid_mut()
    }

    /// The octree.
    pub fn octree(&self) -> &Octree {
        self.cloth.octree()
    }

    fn mix(&self, site: &FlakeSite, w_out: Vec3, w_in: Vec3) -> (Rgb, f32) {
        match (&self.flakes, &site.met) {
            (Flakes::Diffuse, None) => (Rgb::BLACK, 0.0),
            (Flakes::Diffuse, Some(met)) => (met.eval(w_out, w_in), met.pdf(w_out, w_in)),
            (Flakes::Gaussian(f), _) => f.mix(&site.mixture, w_out, w_in),
            (Flakes::SinePower(f), _) => f.mix(&site.mixture, w_out, w_in),
        }
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
        if !matches!(self.flakes, Flakes::Diffuse) {
            return site;
        }
        let met = PopulationFlakes::meet(&self.cloth, &site.mixture, w_out, rng);
        let flake = met.map(|c| {
            let materials = self.cloth.materials();
            let (flakes, albedo) = (materials.flake(c), materials.albedo(c));
            DiffuseFlake::meet(&flakes, albedo, w_out, rng)
        });
        FlakeSite { met: flake, ..site }
    }

    fn sigma_t(&self, site: &FlakeSite, w: Vec3) -> f32 {
        match &self.flakes {
            Flakes::Diffuse => self.cloth.total(&site.mixture, w),
            Flakes::Gaussian(f) => f.total(&site.mixture, w),
            Flakes::SinePower(f) => f.total(&site.mixture, w),
        }
    }

    fn eval(&self, site: &FlakeSite, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.mix(site, w_out, w_in).0
    }

    fn sample(&self, site: &FlakeSite, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        match &self.flakes {
            Flakes::Diffuse => site.met?.sample(w_out, rng),
            Flakes::Gaussian(f) => f.scatter(&site.mixture, w_out, rng),
            Flakes::SinePower(f) => f.scatter(&site.mixture, w_out, rng),
        }
    }

    fn pdf(&self, site: &FlakeSite, w_out: Vec3, w_in: Vec3) -> f32 {
        self.mix(site, w_out, w_in).1
    }

    fn info(&self, site: &FlakeSite) -> SiteInfo {
        self.cloth.info(&site.mixture)
    }
}
