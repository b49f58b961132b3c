//! The hierarchy of boxes around the pieces of fibre of a tile.

use super::curves::Curves;
use glam::IVec2;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb as BvhBox;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use organza_basis::Tile;
use std::time::Duration;

/// Boxes around pieces, and the pieces.
pub(crate) struct Hierarchy {
    pub boxes: CwBvh,
    /// Pieces in the order of the leaves.
    pub placed: Vec<Placed>,
}

/// A piece in one of the copies of the tile that reach into it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placed {
    pub piece: u32,
    /// Periods that the copy is moved by.
    pub shift: IVec2,
}

impl Hierarchy {
    /// Around all pieces of some curves.
    pub fn new(curves: &Curves, tile: &Tile) -> Hierarchy {
        let (pieces, boxes) = place(curves, tile);
        let mut took = Duration::default();
        let boxes = build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut took);
        let leaves = boxes.primitive_indices.iter();
        Hierarchy {
            placed: leaves.map(|&i| pieces[i as usize]).collect(),
            boxes,
        }
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let leaf = size_of::<Placed>() + size_of::<u32>();
        let node = size_of::<obvhs::cwbvh::node::CwBvhNode>();
        (self.placed.len() * leaf + self.boxes.nodes.len() * node) as u64
    }
}

/// Every piece in every copy of the tile in which it reaches into the tile, with
/// boxes around them.
fn place(curves: &Curves, tile: &Tile) -> (Vec<Placed>, Vec<BvhBox>) {
    let period = tile.period_mm();
    // Boxes are met in single precision.
    let margin = 2e-6 * tile.bounds_mm.size().max_element();
    let (mut placed, mut boxes) = (Vec::new(), Vec::new());
    for piece in curves.pieces() {
        let [a, b] = [piece, piece + 1].map(|i| &curves.joints[i as usize]);
        let grown = a.radius_mm.max(b.radius_mm) + margin;
        let low = a.position.min(b.position) - grown;
        let high = a.position.max(b.position) + grown;
        // Copies i with low + i period < period and high + i period > 0.
        let (from, to) = if tile.repeats {
            (
                (-high.truncate() / period).ceil().as_ivec2(),
                ((period - low.truncate()) / period).floor().as_ivec2(),
            )
        } else {
            (IVec2::ZERO, IVec2::ZERO)
        };
        for y in from.y..=to.y {
            for x in from.x..=to.x {
                let shift = IVec2::new(x, y);
                let by = (shift.as_vec2() * period).extend(0.0);
                placed.push(Placed { piece, shift });
                boxes.push(BvhBox::new((low + by).into(), (high + by).into()));
            }
        }
    }
    (placed, boxes)
}
