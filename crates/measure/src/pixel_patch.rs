//! A part of a patch that a pixel covers.

use crate::{Exit, PatchResponse, PathRun};
use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb};
use organza_transport::Stats;

/// A square of the middle plane of a cloth, as a pixel sees it: its BSDF is the mean over the
/// square. Where light goes is that of the whole patch.
pub struct PixelPatch<'a, P> {
    /// The whole.
    pub patch: &'a P,
    /// The middle of the square, mm.
    pub middle_mm: Vec2,
    /// Its side, mm.
    pub width_mm: f32,
}

impl<P: PatchResponse> PixelPatch<'_, P> {
    fn place_mm(&self, rng: &mut PathRng) -> Vec2 {
        self.middle_mm + (rng.unit2() - 0.5) * self.width_mm
    }
}

impl<P: PatchResponse> PatchResponse for PixelPatch<'_, P> {
    fn estimate_bsdf(&self, w_in: Vec3, w_out: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Rgb {
        let place_mm = self.place_mm(rng);
        self.patch.estimate_at(place_mm, w_in, w_out, rng, stats)
    }

    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_in: Vec3,
        w_out: Vec3,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        self.patch.estimate_at(place_mm, w_in, w_out, rng, stats)
    }

    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Exit {
        self.patch.estimate_exit(w, rng, stats)
    }

    fn each_bsdf(&self, directions: (Vec3, Vec3), run: PathRun<'_, Rgb>) {
        let place = |rng: &mut PathRng| self.place_mm(rng);
        self.patch.each_bsdf_at(&place, directions, run);
    }
}
