//! What a collision asks of the place where it happened.

use crate::{Medium, SiteInfo};
use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use organza_scatter::LobeSample;

/// A place in matter where light was met. Directions are unit vectors in the matter's own
/// frame; see [`Medium`] for what the methods mean.
///
/// The walk calls these methods through one virtual call for each, a few times an event;
/// the loops that look for the event are monomorphic.
pub(crate) trait Site {
    /// Albedo times phase, per channel, 1/sr.
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb;

    /// A scattered direction; `None` when the light is absorbed.
    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample>;

    /// Density with which [`Site::sample`] draws `w_in`, 1/sr.
    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32;

    /// From the collision to where a ray toward `w_in` starts, mm.
    fn exit_mm(&self, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3;

    /// What to show of the place; `None` where there is no cloth.
    fn info(&self) -> Option<SiteInfo>;

    /// The yarn of what was met, where there is one: [`Site::info`] may take longer.
    fn yarn(&self) -> Option<u32> {
        self.info()?.yarn
    }

    /// Radiance that the matter itself sends along `w_out`.
    fn emitted(&self, _w_out: Vec3) -> Rgb {
        Rgb::BLACK
    }

    /// Visibility, within the cell around the collision at `at_mm`, of light from `w_in`,
    /// and the distance in mm to the cell's face, where matter has tables of it.
    fn local_visibility(&self, _at_mm: Vec3, _w_out: Vec3, _w_in: Vec3) -> Option<(f32, f32)> {
        None
    }
}

/// A site of a medium, with the medium.
pub(crate) struct MediumSite<'a, M: Medium> {
    pub medium: &'a M,
    pub site: M::Site,
}

impl<M: Medium> MediumSite<'_, M> {
    /// Draws which part of the place the light meets, where that is left open.
    pub fn draw_event(&mut self, w_out: Vec3, rng: &mut PathRng) {
        self.site = self.medium.draw_event(self.site, w_out, rng);
    }
}

impl<M: Medium> Site for MediumSite<'_, M> {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.medium.eval(&self.site, w_out, w_in)
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        self.medium.sample(&self.site, w_out, rng)
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.medium.pdf(&self.site, w_out, w_in)
    }

    fn exit_mm(&self, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        self.medium.exit_mm(&self.site, w_out, w_in, rng)
    }

    fn info(&self) -> Option<SiteInfo> {
        Some(self.medium.info(&self.site))
    }

    fn yarn(&self) -> Option<u32> {
        self.medium.yarn(&self.site)
    }

    fn local_visibility(&self, at_mm: Vec3, w_out: Vec3, w_in: Vec3) -> Option<(f32, f32)> {
        self.medium.local_visibility(&self.site, at_mm, w_out, w_in)
    }
}
