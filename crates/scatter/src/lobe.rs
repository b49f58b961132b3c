//! The one interface of everything that scatters.

use glam::Vec3;
use organza_basis::{PathRng, Rgb};

/// What a walk draws at a scattering event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeSample {
    /// Unit direction away from the event, the way the walk goes on: where the
    /// light comes from.
    pub w_in: Vec3,
    /// `eval / pdf`: everything that the throughput is multiplied by,
    /// absorption included. Multiply by nothing else.
    pub weight: Rgb,
    /// Density of `w_in` per steradian, for multiple importance sampling.
    pub pdf: f32,
}

impl LobeSample {
    /// A direction with its weight and density.
    pub const fn new(w_in: Vec3, weight: Rgb, pdf: f32) -> LobeSample {
        LobeSample { w_in, weight, pdf }
    }
}

/// A scattering function at one event.
///
/// # Contract
/// - **Directions** are unit vectors in the world that point away from the
///   event. `w_out` is the way the walk came from (light leaves there, toward
///   the camera); `w_in` is where light arrives from. A walk that travels
///   along `d` has `w_out = -d` and goes on along `w_in`.
/// - **Measure**: `eval` and `pdf` are per steradian of `w_in`.
/// - **`eval`** is the light scattered into `w_out` per radiance arriving from
///   `w_in`, given that an event happened: the phase function times albedo for
///   flakes, `f cos(theta_i)` for fibres. No cosine is left for the caller.
///   Its integral over `w_in` is the event's albedo: at most one, on average
///   over what a conditional lobe is conditional on.
/// - **`sample`** draws `w_in` with density `pdf(w_out, w_in)`, exactly.
///   `None` means that the light is absorbed: the walk ends and scores zero.
/// - Lobes may be **conditional** on something drawn before (a flake's normal,
///   a fibre's offset). All three functions then condition on it, so that next
///   event estimation and phase sampling combined by the balance heuristic
///   stay unbiased as long as both use the same drawn lobe.
/// - Every value is finite and not negative for every pair of unit vectors.
pub trait Lobe {
    /// Scattered light per arriving radiance and steradian.
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb;

    /// Density with which [`Lobe::sample`] draws `w_in`, per steradian.
    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32;

    /// Draws where light comes from; `None` ends the walk.
    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample>;
}
