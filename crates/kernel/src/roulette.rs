//! Russian roulette of paths, one or many.

use organza_basis::{PathRng, Rgb};
use organza_lanes::Floats;
use organza_lanes::math::V3;

/// Survival probability over the mean throughput of a path in voxels: it lives on
/// surely until it carries a quarter of what it began with.
pub const VOXEL_SCALE: f32 = 4.0;

/// The same of a path among explicit fibres and in the general walk: until it carries a fifth,
/// which cost against variance left flat between 3 and 8.
pub const FIBRE_SCALE: f32 = 5.0;

/// Plays for the lanes of a mask with random numbers `u` in `[0, 1)`: the lanes that
/// survive, and what their paths carry on. `throughput` is what they carry now.
#[inline(always)]
pub fn survivors<F: Floats>(
    throughput: V3<F>,
    scale: f32,
    u: F,
    mask: F::Mask,
) -> (F::Mask, V3<F>) {
    let survival = throughput.sum() * F::splat(scale / 3.0);
    survivors_by(throughput, survival, u, mask)
}

/// The same with the probabilities of survival given; above one they count as one.
#[inline(always)]
pub fn survivors_by<F: Floats>(
    throughput: V3<F>,
    survival: F,
    u: F,
    mask: F::Mask,
) -> (F::Mask, V3<F>) {
    let one = F::splat(1.0);
    let survival = survival.min(one);
    let survives = mask & u.below(survival);
    let carried = throughput.scaled(one / survival.max(F::splat(f32::MIN_POSITIVE)));
    (survives, carried)
}

/// What a path of the general walk carries on; `None` of one that ends. A random number is drawn
/// only where it may.
pub fn survivor(throughput: Rgb, rng: &mut PathRng) -> Option<Rgb> {
    let survival = FIBRE_SCALE * throughput.mean();
    // What is no number goes on, so that its sample is counted as such.
    if survival.is_nan() || survival >= 1.0 {
        return Some(throughput);
    }
    let (survives, carried) = survivors_by(V3::splat(throughput.0), survival, rng.unit(), true);
    survives.then(|| Rgb(carried.into()))
}
