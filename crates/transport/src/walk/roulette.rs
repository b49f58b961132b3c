//! Russian roulette of the general walk.

use organza_basis::{PathRng, Rgb};

/// Survival probability over the mean throughput. A path lives on surely until it
/// carries a fifth of what it began with, which cost against variance left flat
/// between 3 and 8.
const SCALE: f32 = 5.0;

/// What a path carries on; `None` of one that ends. A random number is drawn only
/// where the path may end.
pub fn survivor(throughput: Rgb, rng: &mut PathRng) -> Option<Rgb> {
    let survival = SCALE * throughput.mean();
    if survival < 1.0 {
        let survives = rng.unit() < survival;
        return survives.then(|| throughput * (1.0 / survival));
    }
    Some(throughput)
}
