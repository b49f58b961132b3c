//! The interface of a family of micro-flakes for media.

use super::DiffuseFlake;
use crate::LobeSample;
use glam::Vec3;
use organza_basis::{Mixture, PathRng, Rgb};

/// How the populations of a voxel scatter as micro-flakes of one family.
///
/// # Contract
/// Directions, measures and weights are those of [`Lobe`](crate::Lobe), given that
/// a collision happened. A family may draw one flake per collision; `eval` and
/// `sample` are then given it and condition on it, so that light and walk share it.
/// The extinction toward `w` is at most the mixture's broadside one.
pub trait FlakeScattering: Send + Sync {
    /// Extinction toward `w`, 1/mm.
    fn sigma_t_per_mm(&self, mixture: &Mixture, w: Vec3) -> f32;

    /// Whether a collision draws a flake.
    fn draws_flakes(&self) -> bool {
        false
    }

    /// Draws the flake that a walk meets, if the family does so.
    fn draw_flake(&self, _: &Mixture, _w_out: Vec3, _: &mut PathRng) -> Option<DiffuseFlake> {
        None
    }

    /// Albedo times phase function, and the density of `sample`, both 1/sr.
    fn eval(
        &self,
        mixture: &Mixture,
        flake: Option<&DiffuseFlake>,
        w_out: Vec3,
        w_in: Vec3,
    ) -> (Rgb, f32);

    /// Draws where light comes from.
    fn sample(
        &self,
        mixture: &Mixture,
        flake: Option<&DiffuseFlake>,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> Option<LobeSample>;
}
