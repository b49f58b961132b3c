//! Sixteen pieces of fibre with round ends, or that taper, against one ray.

use super::block::{BLOCK, Entries, RayLanes, numbers, vectors};
use organza_lanes::Floats;
use organza_lanes::math::V3;

/// The square of a radius that no ray meets.
const NO_SPHERE: f32 = -1e30;

/// Hulls of two spheres, of which a plane may cut an end; lengths and places as in
/// [`PieceBlock`](super::block::PieceBlock).
#[derive(Clone, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct HullBlock {
    pub foot: [[f32; BLOCK]; 3],
    pub axis: [[f32; BLOCK]; 3],
    /// The ends.
    pub start: [f32; BLOCK],
    pub end: [f32; BLOCK],
    /// Squares of the radii there, of the spheres that are met.
    pub start_squared: [f32; BLOCK],
    pub end_squared: [f32; BLOCK],
    /// Sine of the half-angle.
    pub narrowing: [f32; BLOCK],
    /// Radius of the side at the foot, over the half-angle's cosine.
    pub wide: [f32; BLOCK],
    /// Where the side begins and ends.
    pub low: [f32; BLOCK],
    pub high: [f32; BLOCK],
    /// See [`PieceCode`](super::block::PieceCode).
    pub piece: [u32; BLOCK],
}

impl HullBlock {
    /// Without pieces.
    pub fn empty() -> HullBlock {
        HullBlock {
            foot: [[0.0; BLOCK]; 3],
            axis: [[0.0; BLOCK]; 3],
            start: [0.0; BLOCK],
            end: [0.0; BLOCK],
            start_squared: [NO_SPHERE; BLOCK],
            end_squared: [NO_SPHERE; BLOCK],
            narrowing: [0.0; BLOCK],
            wide: [0.0; BLOCK],
            low: [1.0; BLOCK],
            high: [-1.0; BLOCK],
            piece: [0; BLOCK],
        }
    }

    /// Takes a sphere away.
    pub fn no_sphere(square: &mut f32) {
        *square = NO_SPHERE;
    }
}

/// The pieces from number `first` on.
#[inline(always)]
pub fn hull_entries<F: Floats>(block: &HullBlock, first: usize, ray: &RayLanes<F>) -> Entries<F> {
    let zero = F::splat(0.0);
    let axis = vectors::<F>(&block.axis, first);
    let foot = vectors::<F>(&block.foot, first);
    let along = ray.direction.dot(axis);
    let across = axis.scaled_add(-along, ray.direction);
    let from = ray.at - foot;
    let height = from.dot(axis);
    let aside = axis.scaled_add(-height, from);
    let s = numbers::<F>(&block.narrowing, first);
    let c_squared = F::splat(1.0) - s * s;
    let wide = numbers::<F>(&block.wide, first) - s * height;
    let tilt = s * along;
    let a = c_squared * across.dot(across) - tilt * tilt;
    let b = c_squared.mul_add(aside.dot(across), tilt * wide);
    let c = c_squared * aside.dot(aside) - wide * wide;
    let discriminant = b.mul_add(b, -(a * c));
    let side = -(b + discriminant.sqrt()) / a;
    let place = along.mul_add(side, height);
    let (low, high) = (
        numbers::<F>(&block.low, first),
        numbers::<F>(&block.high, first),
    );
    // Along the side of a cylinder this is no number, and not on it.
    let on_side = !discriminant.below(zero) & low.below(place) & place.below(high);

    let start = numbers::<F>(&block.start, first);
    let (first_ball, first_met) = sphere(
        axis.scaled_add(-start, from),
        ray.direction,
        numbers::<F>(&block.start_squared, first),
    );
    let first_met = first_met & !low.below(along.mul_add(first_ball, height));
    let end = numbers::<F>(&block.end, first);
    let (last_ball, last_met) = sphere(
        axis.scaled_add(-end, from),
        ray.direction,
        numbers::<F>(&block.end_squared, first),
    );
    let last_met = last_met & !along.mul_add(last_ball, height).below(high);
    let far = F::splat(f32::INFINITY);
    let ball = first_ball
        .or_where_not(first_met, far)
        .min(last_ball.or_where_not(last_met, far));
    let distance = side.or_where_not(on_side, ball);
    let met =
        (on_side | first_met | last_met) & ray.least.below(distance) & !ray.most.below(distance);
    Entries { met, distance }
}

/// Where a ray from `from` enters a sphere about the origin, if it does.
#[inline(always)]
fn sphere<F: Floats>(from: V3<F>, direction: V3<F>, radius_squared: F) -> (F, F::Mask) {
    let square = direction.dot(direction);
    let b = from.dot(direction);
    // Across the way: the difference of squares would cancel at a distance.
    let across = direction.scaled_add(-(b / square), from);
    let room = radius_squared - across.dot(across);
    let met = !room.below(F::splat(0.0));
    (-(b / square) - (room / square).sqrt(), met)
}
