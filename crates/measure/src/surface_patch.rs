//! A surface model as a patch: the mean over the whole cloth.

use crate::{Energy, PatchResponse};
use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use organza_surface::{Footprint, SurfaceModel};
use organza_transport::Stats;

/// A surface model seen from afar.
pub struct SurfacePatch<S>(pub S);

impl<S: SurfaceModel> PatchResponse for SurfacePatch<S> {
    fn estimate_bsdf(&self, w_i: Vec3, w_o: Vec3, _: &mut PathRng, stats: &mut Stats) -> Rgb {
        stats.paths += 1;
        self.0.eval(w_i, w_o, Footprint::FAR)
    }

    /// A surface model knows no absorption of its own: what does not come out
    /// counts as absorbed.
    fn estimate_energy(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Energy {
        stats.paths += 1;
        let mut energy = Energy::default();
        if let Some(sample) = self.0.sample(w, Footprint::FAR, rng) {
            let share = if sample.is_straight() {
                &mut energy.direct
            } else if (sample.w_i.z > 0.0) == (w.z > 0.0) {
                &mut energy.reflected
            } else {
                &mut energy.transmitted
            };
            *share = sample.weight;
        }
        energy.absorbed = Rgb::WHITE - energy.sum();
        energy
    }

    fn is_exact(&self) -> bool {
        true
    }
}
