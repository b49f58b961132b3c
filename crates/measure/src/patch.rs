//! What a goniometer asks of a patch.

use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use organza_transport::Stats;

/// Where a unit of light from one direction went: one random estimate, per
/// channel. The mean of the sum of all four is one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Back to the side that it came from.
    pub reflected: Rgb,
    /// Scattered to the other side.
    pub transmitted: Rgb,
    /// Straight through, having met nothing.
    pub direct: Rgb,
    /// Into the cloth.
    pub absorbed: Rgb,
}

impl Energy {
    /// Everything accounted for.
    pub fn sum(&self) -> Rgb {
        self.reflected + self.transmitted + self.direct + self.absorbed
    }
}

/// A patch of cloth, as volume or as surface.
///
/// Directions are unit vectors away from the cloth that do not lie in its
/// plane (`z` is not zero).
pub trait PatchResponse: Sync {
    /// One unbiased estimate of the BSDF's mean over the patch, 1/sr, without
    /// what goes straight through.
    fn estimate_bsdf(&self, w_i: Vec3, w_o: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Rgb;

    /// One unbiased estimate of where light from `w` goes.
    ///
    /// By reciprocity it may be traced as light that leaves along `w`
    /// under a furnace that fills the sphere.
    fn estimate_energy(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Energy;

    /// True when [`estimate_bsdf`](Self::estimate_bsdf) uses no random numbers:
    /// one estimate is the value.
    fn is_exact(&self) -> bool;
}
