//! A surface model as a patch: the mean over the whole cloth.

use crate::{Exit, PatchResponse};
use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb};
use organza_scatter::{Footprint, Passage, Surface};
use organza_transport::Stats;

/// A surface model that covers the whole patch.
pub struct SurfacePatch<S>(pub S);

impl<S: Surface> PatchResponse for SurfacePatch<S> {
    fn estimate_bsdf(&self, w_in: Vec3, w_out: Vec3, _: &mut PathRng, stats: &mut Stats) -> Rgb {
        stats.paths += 1;
        self.0.eval(w_out, w_in, Footprint::FAR)
    }

    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_in: Vec3,
        w_out: Vec3,
        _: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        stats.paths += 1;
        self.0.eval(w_out, w_in, Footprint::point(place_mm))
    }

    /// A surface model does not describe absorption: light that does not leave counts as
    /// absorbed.
    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Exit {
        stats.paths += 1;
        let passage = self.0.pass_or_sample(w, Footprint::FAR, rng);
        let escape = passage.map(|p| match p {
            Passage::Straight => (-w, Rgb::WHITE),
            Passage::Scattered(s) => (s.w_in, s.weight),
        });
        Exit {
            escape,
            is_straight: passage == Some(Passage::Straight),
            absorbed: Rgb::WHITE - escape.map_or(Rgb::BLACK, |(_, weight)| weight),
        }
    }

    fn is_exact(&self) -> bool {
        true
    }
}
