//! Curve segments, the interface between geometry and voxelizers.

use crate::Aabb;
use glam::{Vec2, Vec3};

/// A piece of a fibre (or yarn) between two points, with the properties that a voxelizer or
/// an explicit-fibre renderer needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// First end.
    pub start_mm: Vec3,
    /// Second end; equal to the first for a degenerate segment, which every
    /// consumer must survive.
    pub end_mm: Vec3,
    /// Radius at the first end.
    pub start_radius_mm: f32,
    /// Radius at the second end.
    pub end_radius_mm: f32,
    /// Unit tangent of the curve at the first end, along its own direction.
    pub start_tangent: Vec3,
    /// Unit tangent of the curve at the second end.
    pub end_tangent: Vec3,
    /// Which yarn of the tile it belongs to.
    pub yarn: u32,
    /// Which curve within its yarn: segments of one curve come in order.
    pub fibre: u32,
    /// Index into the cloth's table of materials.
    pub material: u16,
}

impl Segment {
    /// A straight segment of constant radius; tangents follow the chord, or
    /// the x axis when it has no length.
    pub fn straight(start_mm: Vec3, end_mm: Vec3, radius_mm: f32) -> Segment {
        let tangent = (end_mm - start_mm).try_normalize().unwrap_or(Vec3::X);
        Segment {
            start_mm,
            end_mm,
            start_radius_mm: radius_mm,
            end_radius_mm: radius_mm,
            start_tangent: tangent,
            end_tangent: tangent,
            yarn: 0,
            fibre: 0,
            material: 0,
        }
    }

    /// Length of the chord.
    pub fn length_mm(&self) -> f32 {
        self.start_mm.distance(self.end_mm)
    }

    /// A box around the segment with its radius.
    pub fn bounds_mm(&self) -> Aabb {
        Aabb::new(
            self.start_mm.min(self.end_mm),
            self.start_mm.max(self.end_mm),
        )
        .grown(self.start_radius_mm.max(self.end_radius_mm))
    }
}

/// The piece of space that a stream of segments fills.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Box of one period. Where the tile repeats, x and y extents are the
    /// period exactly and curves may leave the box sideways: what leaves on
    /// one side belongs to the neighbouring copy and must be wrapped by the
    /// consumer. z extents hold every curve with its radius.
    pub bounds_mm: Aabb,
    /// True when the tile repeats in x and y.
    pub repeats: bool,
}

impl Tile {
    /// The period in x and y.
    pub fn period_mm(&self) -> Vec2 {
        self.bounds_mm.size().truncate()
    }
}

/// Anything that can emit curve segments: a woven or knitted fabric, an
/// imported file, three segments placed by hand.
///
/// The stream comes in independent batches (a yarn, a block of a file), so
/// that consumers generate and use them in parallel and never need to hold
/// them all. The same batch always gives the same segments.
pub trait SegmentSource: Sync {
    /// The box that the stream fills and whether it repeats.
    fn tile(&self) -> Tile;

    /// Number of batches.
    fn batch_count(&self) -> usize;

    /// Emits the segments of batch `batch < batch_count()`, each curve's in
    /// order.
    fn for_each_in_batch(&self, batch: usize, emit: &mut dyn FnMut(&Segment));

    /// Number of materials that segments may refer to.
    fn material_count(&self) -> usize;
}

/// A list of segments in memory: small tests, imported curves.
#[derive(Clone, Debug)]
pub struct SegmentList {
    /// Box and repetition.
    pub tile: Tile,
    /// All segments, curve by curve.
    pub segments: Vec<Segment>,
}

/// Segments per batch of a [`SegmentList`]: enough to amortise a task, few
/// enough to share a small file between threads.
const LIST_BATCH: usize = 16_384;

impl SegmentList {
    /// Segments in a box, which repeats or not.
    pub fn new(bounds_mm: Aabb, repeats: bool, segments: Vec<Segment>) -> SegmentList {
        SegmentList {
            tile: Tile { bounds_mm, repeats },
            segments,
        }
    }
}

impl SegmentSource for SegmentList {
    fn tile(&self) -> Tile {
        self.tile
    }

    fn batch_count(&self) -> usize {
        self.segments.len().div_ceil(LIST_BATCH)
    }

    fn for_each_in_batch(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        let start = (batch * LIST_BATCH).min(self.segments.len());
        let end = (start + LIST_BATCH).min(self.segments.len());
        self.segments[start..end].iter().for_each(emit);
    }

    fn material_count(&self) -> usize {
        self.segments
            .iter()
            .map(|s| usize::from(s.material) + 1)
            .max()
            .unwrap_or(0)
    }
}
