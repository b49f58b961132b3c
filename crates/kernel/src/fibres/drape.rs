//! What an endless cloth is laid over: stretches of rays in the cloth's own coordinates.

use glam::{DVec3, Mat3, Vec3};

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
    /// The part of the shell that it lies in.
    pub part: u32,
    /// Whether no other part fills any of its room.
    pub is_alone: bool,
}

/// A step of a ray through a part of a shell.
#[derive(Clone, Copy, Debug)]
pub struct DrapeStep {
    /// What lies inside, if anything does.
    pub span: Option<DrapeSpan>,
    /// Where the ray leaves the part, mm.
    pub end_mm: f64,
    /// The part beyond; none where the shell ends or others lie in its room.
    pub beyond: Option<u32>,
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

    /// A ray that is inside a part of the shell, or on its way into it, at a distance.
    fn step(&self, part: u32, origin_mm: DVec3, direction: DVec3, from_mm: f64) -> DrapeStep;

    /// The part at a place that lies in or near one; none where it is not sure, and where parts
    /// share their room.
    fn part_at(&self, near: u32, place_mm: DVec3) -> Option<u32>;

    /// The shell as plain tables, with places of the world counted from a point.
    fn tables(&self, point_mm: DVec3) -> DrapeTables;
}

/// A shell as plain tables, for engines that cannot call it. Places of the world are in mm from
/// a point that the caller named.
#[derive(Clone, Debug, Default)]
pub struct DrapeTables {
    /// The parts in which the map between world and cloth is affine.
    pub tetrahedra: Vec<DrapeTetrahedron>,
    /// A tree of boxes around them from the root on: the first child of a box follows it.
    pub boxes: Vec<DrapeBox>,
}

/// A part of a shell; see [`DrapeSpan`].
#[derive(Clone, Copy, Debug)]
pub struct DrapeTetrahedron {
    /// Its first corner in the world and in the cloth, mm.
    pub corner_mm: Vec3,
    /// See `corner_mm`.
    pub cloth_corner_mm: DVec3,
    /// Weights of its second to fourth corner, from the world relative to the first.
    pub weights_from_world: Mat3,
    /// Places of the cloth per place of the world.
    pub cloth_from_world: Mat3,
    /// Turns directions of the cloth to the world: orthogonal.
    pub world_from_cloth: Mat3,
    /// Takes differences of places of the cloth to the world.
    pub stretch: Mat3,
    /// The tetrahedra beyond the faces opposite to its corners; `u32::MAX` where none is.
    pub neighbours: [u32; 4],
    /// Whether no other tetrahedron fills any of its room.
    pub is_alone: bool,
}

/// A box around tetrahedra.
#[derive(Clone, Copy, Debug)]
pub struct DrapeBox {
    /// Least and greatest corner in the world, mm.
    pub min_mm: Vec3,
    /// See `min_mm`.
    pub max_mm: Vec3,
    /// The next box for a ray that misses this one.
    pub skip: u32,
    /// The first of the tetrahedra that it holds itself, and their number.
    pub first: u32,
    /// See `first`.
    pub count: u32,
}
