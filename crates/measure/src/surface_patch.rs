//! A surface model as a patch: the mean over the whole cloth.

use crate::{Exit, PatchResponse};
use glam::{Vec2, Vec3};
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

    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_i: Vec3,
        w_o: Vec3,
        _: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        stats.paths += 1;
        self.0.eval(w_i, w_o, Footprint::point(place_mm))
    }

    /// A surface model knows no absorption of its own: what does not come out
    /// counts as absorbed.
    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Exit {
        stats.paths += 1;
        let sample = self.0.sample(w, Footprint::FAR, rng);
        Exit {
            escape: sample.map(|s| (s.w_i, s.weight)),
            is_straight: sample.is_some_and(|s| s.is_straight()),
            absorbed: Rgb::WHITE - sample.map_or(Rgb::BLACK, |s| s.weight),
        }
    }

    fn is_exact(&self) -> bool {
        true
    }
}
