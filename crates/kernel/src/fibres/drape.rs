//! What an endless cloth is laid over: stretches of rays in the cloth's own coordinates.

use glam::{DVec3, Mat3};

/// The part of a ray in which it is straight in the cloth, too.
#[derive(Clone, Copy, Debug)]
pub struct DrapeSpan {
    /// Distances along the ray at which it begins and ends, mm.
    pub t0: f64,
    /// Greater than `t0`.
    pub t1: f64,
    /// The place in the cloth at `t0`, mm.
    pub cloth_mm: DVec3,
    /// Change of that place per mm along the ray.
    pub step: DVec3,
    /// Turns directions of the cloth to the world: orthogonal.
    pub world_from_cloth: Mat3,
    /// Takes differences of places of the cloth to the world.
    pub stretch: Mat3,
}

/// A shell in which a cloth lies.
pub trait Drape: Send + Sync {
    /// A box around all of it: least and greatest corner, mm.
    fn bounds_mm(&self) -> (DVec3, DVec3);

    /// Visits the parts of a ray inside the shell that begin before `limit_mm`, each whole,
    /// in no strict order. `visit` returns the distance up to which parts are still wanted;
    /// some that begin farther may come, too.
    fn visit_spans(
        &self,
        origin_mm: DVec3,
        direction: DVec3,
        limit_mm: f64,
        visit: &mut dyn FnMut(&DrapeSpan) -> f64,
    );
}
