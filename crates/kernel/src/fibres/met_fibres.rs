//! What the lanes of a wave have met, explicit fibres or packed ones, and rays that go on
//! among packed ones.

use super::grid::GridPoint;
use super::matter::FibreMatter;
use super::own_frame::OwnFrame;
use super::paths::{Paths, load};
use super::several::point_mm;
use crate::packed::PackedPart;
use crate::packed::volume_ray::{Departure, VolumeRay};
use glam::{DVec3, Vec3};
use organza_lanes::math::{LaneRng, V3};
use organza_lanes::{Floats, Ints, Mask};
use organza_scatter::near::Frame;

/// What is met, and by what.
pub struct Met<F: Floats> {
    /// The fibre as the way meets it.
    pub frame: Frame<F>,
    /// From the axis to the point met, mm.
    pub out_mm: V3<F>,
    /// Where across the fibre's width it is met, in `[-1, 1]`.
    pub offset: F,
}

impl<F: Floats> Met<F> {
    /// `self` where `mask`, else `o`.
    #[inline(always)]
    pub fn or_where_not(self, mask: F::Mask, o: Met<F>) -> Met<F> {
        Met {
            frame: self.frame.or_where_not(mask, o.frame),
            out_mm: self.out_mm.or_where_not(mask, o.out_mm),
            offset: self.offset.or_where_not(mask, o.offset),
        }
    }
}

/// Fibres in lanes.
pub struct MetFibres<F: Floats> {
    pub there: Met<F>,
    /// The nearest point of the axis, mm: of an explicit fibre from the centre of the cell,
    /// of a packed one from the least corner of the ray's period.
    pub axis_at: V3<F>,
    /// Numbers of materials.
    pub material: F::Ints,
    /// What the path's throughput is multiplied by: one of explicit fibres.
    pub weight: F,
}

/// Fibres that the slots from `first` on have met, for the lanes of a mask, of which
/// `packed` have met packed ones; `own` are the directions of draped cloths.
#[inline(always)]
pub fn met_fibres<F: Floats>(
    matter: &FibreMatter,
    paths: &Paths,
    first: usize,
    (w_out, own): (V3<F>, &OwnFrame<F>),
    packed: F::Mask,
    rng: &mut LaneRng<F::Ints>,
) -> MetFibres<F> {
    let zeros = V3::splat(Vec3::ZERO);
    let mut met = MetFibres {
        there: Met {
            frame: Frame {
                tangent: zeros,
                forward: zeros,
                side: zeros,
                sin_out: F::splat(0.0),
                cos_out: F::splat(0.0),
            },
            out_mm: zeros,
            offset: F::splat(0.0),
        },
        axis_at: zeros,
        material: F::Ints::splat(0),
        weight: F::splat(1.0),
    };
    // Without explicit fibres there are no joints to ask.
    if !matter.joints.words.is_empty() {
        let piece = F::Ints::load(&paths.met.piece[first..]);
        let along = F::load(&paths.met.along[first..]);
        let tangent = matter.joints.tangents::<F>(piece, along);
        met.there = own.met(paths, first, tangent, w_out);
        met.axis_at = load(&paths.met.axis_at, first);
        met.material = matter.joints.materials::<F>(piece);
    }
    let Some(part) = matter.packed.as_ref().filter(|_| packed.any()) else {
        return met;
    };
    let rays = &paths.volume_rays[first..];
    let own = part.volume.meeting::<F>(rays, w_out, rng, packed);
    MetFibres {
        there: own.met.or_where_not(packed, met.there),
        axis_at: own.axis_at_mm.or_where_not(packed, met.axis_at),
        material: own.material.or_where_not(packed, met.material),
        weight: own.weight.or_where_not(packed, met.weight),
    }
}

/// Where a slot's path leaves the fibre that it has met.
#[derive(Clone, Copy)]
pub enum LeavingPoint {
    Explicit(GridPoint),
    /// From the least corner of the period of the slot's ray, mm.
    Packed(Vec3),
}

/// The point that is `at_mm` from where places of the slot's fibre are counted.
pub fn leaving_point(paths: &Paths, slot: usize, at_mm: Vec3) -> LeavingPoint {
    if paths.in_volume[slot] {
        return LeavingPoint::Packed(at_mm);
    }
    LeavingPoint::Explicit(GridPoint {
        cell: paths.met.cell[slot],
        period: paths.met.period[slot],
        at_mm,
    })
}

/// The same point in the world.
pub fn world_mm(matter: &FibreMatter, paths: &Paths, slot: usize, from: &LeavingPoint) -> DVec3 {
    match (from, &matter.packed) {
        (LeavingPoint::Explicit(point), _) => point_mm(matter, paths, slot, point),
        (LeavingPoint::Packed(at_mm), Some(part)) => {
            let at = *at_mm * part.volume.cell_grid.voxels_per_mm();
            part.volume.world_mm(at, paths.volume_rays[slot].period())
        }
        (LeavingPoint::Packed(at_mm), None) => at_mm.as_dvec3(),
    }
}

/// The yarn of the fibre that a slot's path has met.
pub fn yarn(matter: &FibreMatter, paths: &Paths, slot: usize) -> u32 {
    match &matter.packed {
        Some(part) if paths.in_volume[slot] => part.volume.yarn(paths.volume_rays[slot].place),
        _ => matter.joints.yarn(paths.met.piece[slot]),
    }
}

/// A ray of a slot that goes on among packed fibres, at most `max_mm` far.
pub fn packed_ray(
    matter: &FibreMatter,
    part: &PackedPart,
    paths: &Paths,
    slot: usize,
    (from, direction, max_mm): (&LeavingPoint, Vec3, f32),
    rng: [u32; 3],
) -> Option<VolumeRay> {
    let mut departure = Departure {
        direction,
        end_mm: max_mm,
        left_yarn: yarn(matter, paths, slot),
        rng,
    };
    // Packed fibres belong to the only body.
    if let Some(body) = matter.bodies.first().filter(|body| body.is_cut) {
        let from_mm = world_mm(matter, paths, slot, from);
        departure.end_mm = max_mm.min(body.way_out_from_mm(from_mm, direction));
    }
    match from {
        LeavingPoint::Packed(at_mm) => {
            let at = *at_mm * part.volume.cell_grid.voxels_per_mm();
            let period = paths.volume_rays[slot].period();
            part.volume.ray(at, period, &departure)
        }
        LeavingPoint::Explicit(_) => {
            let from_mm = world_mm(matter, paths, slot, from);
            part.volume.ray_from_world(from_mm, &departure)
        }
    }
}
