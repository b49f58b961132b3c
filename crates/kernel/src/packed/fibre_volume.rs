//! Packed fibres in voxels, laid out for lanes.

use glam::{DVec3, UVec3, Vec2, Vec3};
use organza_basis::CellGrid;
use organza_lanes::math::V3;
use organza_lanes::{Floats, Ints};

/// No yarn: what rays from outside the cloth leave.
pub use crate::matter::NO_YARN;

/// Voxels along the edge of a brick, as a power of two.
const BRICK_LOG2: u32 = 2;
/// Voxels along the edge of a brick.
pub const BRICK: u32 = 1 << BRICK_LOG2;

/// Words of a population.
pub const POPULATION: usize = 4;

/// Bits of the place of a voxel's first population.
pub const PLACE_BITS: u32 = 29;

/// Bits of the end-on ratio in a population's third word.
pub const END_ON_BITS: u32 = 12;

/// Fibres of one tile in voxels, by the places of their axes.
///
/// # Buffers
/// Elements are `u32`; "bits" means the bits of an `f32`. Voxels stand in bricks of
/// [`BRICK`]³, so that a ray, whose look-ups are a few voxels apart, stays in few cache lines;
/// [`FibreVolume::index`] is the index of a voxel. Populations follow the same order.
/// Extinctions are shares of `scale_per_mm` and hold the greatest of the packing factors.
///
/// | buffer | index | what it holds |
/// |---|---|---|
/// | `voxels` | 2 x voxel | bound 8, reach 4, expected axis 10 + 10; then number of populations less one 3, place of the first 29; the first place is empty |
/// | `radii` | voxel | radius of the expected fibre, mm, as bits; empty where all fibres have one |
/// | `words` | 4 x place | extinction broadside as bits; material 8, axis 12 + 12; radius 20, code of the end-on ratio 12; yarn |
/// | `shares` | 4 x material + kind | packing factor over the greatest, as bits: own yarn, other yarn, from outside |
///
/// - The bound is that of the voxels that an axis met from here may lie in; bound and reach
///   are those of [`voxel_words`](crate::voxels::voxel_words).
/// - The expected fibre says where the axis of a tentative collision is looked up. In air it
///   is that of the densest voxel around.
/// - The radius of a population has the upper 20 bits of an `f32`.
pub struct FibreVolume {
    pub(crate) cell_grid: CellGrid,
    pub(crate) voxels: Vec<u32>,
    pub(crate) radii: Vec<u32>,
    /// Of all fibres, where they have one; of the greatest.
    pub(crate) radius_mm: f32,
    /// Bricks along each axis.
    pub(crate) bricks: UVec3,
    pub(crate) words: Vec<u32>,
    pub(crate) shares: Vec<u32>,
    /// What shares are of, 1/mm.
    pub(crate) scale_per_mm: f32,
}

/// One population in every lane.
pub struct PopulationWords<F: Floats>([F::Ints; POPULATION]);

impl<F: Floats> PopulationWords<F> {
    /// Extinction across the fibres, as a share.
    #[inline(always)]
    pub fn broadside(&self) -> F {
        self.0[0].as_floats()
    }

    /// Along the fibres; its length is between `3^-1/2` and one.
    #[inline(always)]
    pub fn axis(&self) -> V3<F> {
        super::axis_code::decoded::<F, 12>(self.0[1])
    }

    #[inline(always)]
    pub fn material(&self) -> F::Ints {
        self.0[1].shr::<24>()
    }

    #[inline(always)]
    pub fn radius_mm(&self) -> F {
        let code = self.0[2].shr::<END_ON_BITS>();
        code.shl::<END_ON_BITS>().as_floats()
    }

    #[inline(always)]
    pub fn end_on_code(&self) -> F::Ints {
        self.0[2] & F::Ints::splat((1 << END_ON_BITS) - 1)
    }

    /// The end-on ratio.
    #[inline(always)]
    pub fn end_on(&self) -> F {
        let root = self.end_on_code().to_floats() * F::splat(1.0 / 4095.0);
        root * root
    }

    #[inline(always)]
    pub fn yarn(&self) -> F::Ints {
        self.0[3]
    }
}

impl FibreVolume {
    /// Bricks along each axis of a grid.
    pub fn bricks_of(cell_grid: &CellGrid) -> UVec3 {
        cell_grid.cell_dims(BRICK)
    }

    /// Indices of voxels.
    #[inline(always)]
    pub fn index<F: Floats>(&self, x: F::Ints, y: F::Ints, z: F::Ints) -> F::Ints {
        let word = F::Ints::splat;
        let within = word(BRICK - 1);
        let (bx, by, bz) = (
            x.shr::<BRICK_LOG2>(),
            y.shr::<BRICK_LOG2>(),
            z.shr::<BRICK_LOG2>(),
        );
        let brick = bx + word(self.bricks.x) * (by + word(self.bricks.y) * bz);
        let row = (z & within).shl::<BRICK_LOG2>() + (y & within);
        let of_brick = brick.shl::<{ 3 * BRICK_LOG2 }>();
        of_brick + row.shl::<BRICK_LOG2>() + (x & within)
    }

    /// The populations at places.
    #[inline(always)]
    pub fn populations<F: Floats>(&self, place: F::Ints) -> PopulationWords<F> {
        let (first, one) = (place.shl::<2>(), F::Ints::splat(1));
        let (second, words) = (first + one, &self.words[..]);
        let third = second + one;
        PopulationWords([
            first.gather(words),
            second.gather(words),
            third.gather(words),
            (third + one).gather(words),
        ])
    }

    /// Yarn of the population at a place.
    pub fn yarn(&self, place: u32) -> u32 {
        self.words[POPULATION * place as usize + 3]
    }

    /// Unit mean axis of the population at a place.
    pub fn axis(&self, place: u32) -> Vec3 {
        use organza_lanes::one;
        let axis = self.populations::<one::F>(one::U(place)).axis();
        Vec3::new(axis.x.0, axis.y.0, axis.z.0).normalize()
    }

    /// A point in voxels of the first period, so many periods on, in the world.
    pub fn world_mm(&self, at: Vec3, period: Vec2) -> DVec3 {
        let bounds = self.cell_grid.bounds_mm();
        let moved = (period.as_dvec2() * bounds.size().truncate().as_dvec2()).extend(0.0);
        let local = at.as_dvec3() / self.cell_grid.voxels_per_mm().as_dvec3();
        bounds.min.as_dvec3() + moved + local
    }

    /// A fault: extinctions are multiplied by a factor of at most one.
    pub(crate) fn thin(&mut self, factor: f32) {
        for words in self.words.chunks_exact_mut(POPULATION) {
            words[0] = (f32::from_bits(words[0]) * factor.min(1.0)).to_bits();
        }
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let of_voxels = self.voxels.len() + self.radii.len();
        4 * (of_voxels + self.words.len() + self.shares.len()) as u64
    }
}
