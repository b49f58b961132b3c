//! Sixteen straight pieces of fibre against one ray.

use organza_lanes::math::V3;
use organza_lanes::{Floats, Mask};

/// Pieces in a block.
pub const BLOCK: usize = 16;

/// An empty place of a block: a cylinder that nothing meets.
const NOTHING: f32 = 1e30;

/// Cylinders that end in the planes where they meet their neighbours. Lengths
/// are counted along the axis from its point nearest to the cell's centre (the
/// foot) and places from that centre.
#[derive(Clone, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct PieceBlock {
    pub foot: [[f32; BLOCK]; 3],
    pub axis: [[f32; BLOCK]; 3],
    pub radius_squared: [f32; BLOCK],
    /// Ends, each so much farther than the joint that the mitre fits in.
    pub low: [f32; BLOCK],
    pub high: [f32; BLOCK],
    /// See [`PieceCode`].
    pub piece: [u32; BLOCK],
}

impl PieceBlock {
    /// Without pieces.
    pub fn empty() -> PieceBlock {
        PieceBlock {
            foot: [[0.0; BLOCK]; 3],
            axis: [[0.0; BLOCK]; 3],
            radius_squared: [-NOTHING; BLOCK],
            low: [0.0; BLOCK],
            high: [0.0; BLOCK],
            piece: [0; BLOCK],
        }
    }
}

/// A ray in the frame of a cell, the same in all lanes.
#[derive(Clone, Copy)]
pub struct RayLanes<F: Floats> {
    pub at: V3<F>,
    pub direction: V3<F>,
    /// Hits lie beyond this distance and not beyond the other.
    pub least: F,
    pub most: F,
}

/// Where lanes are entered.
pub struct Entries<F: Floats> {
    pub met: F::Mask,
    pub distance: F,
}

/// Some numbers of a block. No closures around lanes: the compiler may leave them
/// without the back end's instructions.
#[inline(always)]
pub fn numbers<F: Floats>(all: &[f32; BLOCK], first: usize) -> F {
    F::load(&all[first..])
}

/// Some vectors of a block.
#[inline(always)]
pub fn vectors<F: Floats>(all: &[[f32; BLOCK]; 3], first: usize) -> V3<F> {
    V3::new(
        numbers(&all[0], first),
        numbers(&all[1], first),
        numbers(&all[2], first),
    )
}

/// The pieces from number `first` on.
#[inline(always)]
pub fn entries<F: Floats>(block: &PieceBlock, first: usize, ray: &RayLanes<F>) -> Entries<F> {
    let axis = vectors::<F>(&block.axis, first);
    let foot = vectors::<F>(&block.foot, first);
    // Across the axis: without the cancellation of 1 - cos^2 for rays along it.
    let along = ray.direction.dot(axis);
    let across = axis.scaled_add(-along, ray.direction);
    let from = ray.at - foot;
    let height = from.dot(axis);
    let aside = axis.scaled_add(-height, from);
    let a = across.dot(across);
    let b = aside.dot(across);
    let c = aside.dot(aside) - numbers::<F>(&block.radius_squared, first);
    let discriminant = b.mul_add(b, -(a * c));
    let distance = -(b + discriminant.sqrt()) / a;
    let place = along.mul_add(distance, height);
    let within = ray.least.below(distance)
        & !ray.most.below(distance)
        & !place.below(numbers::<F>(&block.low, first))
        & !numbers::<F>(&block.high, first).below(place);
    Entries {
        met: within & F::splat(0.0).below(discriminant),
        distance,
    }
}

/// The nearest of some lanes that `keeps` accepts: its number and distance.
#[inline(always)]
pub fn nearest<F: Floats>(
    met: F::Mask,
    distance: F,
    mut keeps: impl FnMut(usize, f32) -> bool,
) -> Option<(usize, f32)> {
    let mut bits = met.bits();
    if bits == 0 {
        return None;
    }
    let mut distances = [0.0; BLOCK];
    distance.store(&mut distances);
    while bits != 0 {
        let mut best = bits.trailing_zeros() as usize;
        let mut rest = bits & (bits - 1);
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            if distances[lane] < distances[best] {
                best = lane;
            }
        }
        if keeps(best, distances[best]) {
            return Some((best, distances[best]));
        }
        bits &= !(1 << best);
    }
    None
}

/// A piece's number with how far from its ends a hit is held against the
/// mitre planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PieceCode(pub u32);

/// Pieces that can be numbered.
pub const MAX_PIECES: u64 = 1 << 29;

impl PieceCode {
    /// `reach` is the larger extension of the piece's ends over the cell's least
    /// edge.
    pub fn new(piece: u32, reach: f32) -> PieceCode {
        let code = match reach {
            r if r <= 0.0 => 0,
            r if r <= 1.0 / 512.0 => 1,
            r if r <= 1.0 / 128.0 => 2,
            r if r <= 1.0 / 32.0 => 3,
            r if r <= 1.0 / 8.0 => 4,
            _ => 5,
        };
        PieceCode(piece | code << 29)
    }

    /// The piece.
    #[inline(always)]
    pub fn piece(self) -> u32 {
        self.0 & ((1 << 29) - 1)
    }

    /// How far from an end planes matter, in the cell's least edge: twice the
    /// greatest extension of its class.
    #[inline(always)]
    pub fn margin(self) -> f32 {
        const MARGINS: [f32; 8] = [
            0.0,
            1.0 / 256.0,
            1.0 / 64.0,
            1.0 / 16.0,
            1.0 / 4.0,
            f32::INFINITY,
            f32::INFINITY,
            f32::INFINITY,
        ];
        MARGINS[(self.0 >> 29) as usize]
    }
}
