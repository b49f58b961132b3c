//! What happens where a lane meets matter: one interface for micro-flakes and
//! fibres.

use super::flat_scene::FlatScene;
use super::voxel_words::VoxelWords;
use organza_lanes::Floats;
use organza_lanes::math::{LaneRng, V3};

/// Matter that lanes met, and how.
pub struct Meeting<F: Floats> {
    /// The population.
    pub voxel: VoxelWords<F::Ints>,
    /// Its place.
    pub place: F::Ints,
    /// Unit direction back along the way.
    pub w_out: V3<F>,
}

/// Where a lane goes on.
pub struct Turn<F: Floats> {
    /// About of unit length.
    pub direction: V3<F>,
    /// What light is multiplied by, beside [`Event::common`].
    pub weight: V3<F>,
    /// A random number that is left.
    pub u: F,
}

/// An event in every lane.
pub trait Event<F: Floats>: Sized {
    /// Square of the extinction of a population over that across the fibres, times that of
    /// the axis' length, from the squares of the axis' parts along and across the way.
    fn area_squared(scene: &FlatScene, voxel: VoxelWords<F::Ints>, along: F, across: F) -> F;

    /// The event of the lanes of a mask.
    fn new(scene: &FlatScene, met: &Meeting<F>, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Self;

    /// What all light is multiplied by, wherever it comes from.
    fn common(&self) -> V3<F>;

    /// Light from a direction that is scattered back along the way, over its
    /// radiance and [`Event::common`], per steradian: grey, and per channel.
    fn toward(&self, scene: &FlatScene, w_in: V3<F>) -> (F, V3<F>);

    /// Draws where light comes from.
    fn turn(&self, scene: &FlatScene, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Turn<F>;
}
