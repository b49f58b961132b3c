//! The extinction that rays find in virtual fibres: less where they leave a yarn.

use super::{VirtualFibreSite, VirtualFibres};
use glam::Vec3;
use organza_basis::{FibrePopulation, Mixture};
use organza_scatter::population_sigma_t_per_mm;

impl VirtualFibres {
    /// Share of a population's extinction in the voxels that a ray sees which leaves a
    /// yarn.
    fn share(&self, c: &FibrePopulation, left_yarn: Option<u32>) -> f32 {
        let factors = self.factors.get(usize::from(c.material));
        factors.map_or(1.0, |f| f.of(c.yarn, left_yarn) / f.largest())
    }

    /// The extinction that a ray along `w` finds in a population of a site, per mm.
    pub(super) fn extinction_per_mm(
        &self,
        c: &FibrePopulation,
        site: &VirtualFibreSite,
        w: Vec3,
    ) -> f32 {
        self.share(c, site.left_yarn) * population_sigma_t_per_mm(c, w)
    }

    /// The populations of a site as a ray sees them that leaves a yarn.
    pub(super) fn seen(&self, site: &VirtualFibreSite) -> Mixture {
        let mut seen = Mixture::EMPTY;
        for c in self.populations(site) {
            let share = self.share(c, site.left_yarn);
            seen.push(FibrePopulation {
                length_density_per_mm2: share * c.length_density_per_mm2,
                ..*c
            });
        }
        seen
    }
}
