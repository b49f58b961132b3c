//! One cloth of explicit fibres: its cells, and where it ends.

use super::cells::{Cells, Placed, Unfit};
use super::grid::GridPoint;
use super::strands::Strands;
use glam::{DVec3, Vec3};
use organza_basis::CellGrid;
use organza_mesh::Shell;
use organza_scatter::Fibre;
use std::sync::Arc;

/// A ray that starts among fibres meets none so near, in radii of the thinnest:
/// at a bend it may start a rounding outside the fibre that it leaves.
const START_RADII: f32 = 1e-3;

/// One cloth, described to be laid out.
#[derive(Clone)]
pub struct FibreBody<'a> {
    /// Its fibres.
    pub strands: Strands<'a>,
    /// What joints are counted from.
    pub origin_mm: Vec3,
    /// The box of the tile, and how far its copies go.
    pub reach: &'a CellGrid,
    /// How fibres scatter, indexed by the strands' materials.
    pub fibres: &'a [Fibre],
    /// The shell that an endless cloth fills, if it is not flat.
    pub shell: Option<Arc<Shell>>,
}

/// One cloth in cells. Of a draped one all places are the cloth's own.
pub struct Body {
    pub cells: Cells,
    /// All the matter; infinite in x and y where it has no end.
    pub low_mm: DVec3,
    pub high_mm: DVec3,
    /// Whether the matter is cut within the grid.
    pub is_cut: bool,
    /// A ray that starts among fibres meets none before this distance, mm.
    pub start_mm: f32,
    pub shell: Option<Arc<Shell>>,
}

/// Where a ray goes through the matter.
#[derive(Clone, Copy, Debug)]
pub struct Passage {
    pub at: GridPoint,
    /// From the ray's origin, mm.
    pub distance_mm: f64,
    /// No hit up to here, mm from the entry.
    pub min_mm: f32,
    /// The way out, mm from the entry; infinite where the grid's faces decide.
    pub end_mm: f32,
}

impl Body {
    /// Lays out one cloth, whose pieces are numbered from `first_piece` on.
    ///
    /// # Errors
    /// See [`Unfit`].
    pub fn new(body: &FibreBody<'_>, first_piece: u32, max_bytes: u64) -> Result<Body, Unfit> {
        let (strands, reach) = (body.strands, body.reach);
        let bounds = reach.bounds_mm();
        let mut low = bounds.min.as_dvec3();
        let mut high = low + bounds.size().as_dvec3();
        // What touches the faces lies inside.
        let room = 1e-4 * (high.z - low.z).max(1e-3);
        (low.z, high.z) = (low.z - room, high.z + room);
        if !reach.repeats() {
            (low.x, low.y) = (low.x - room, low.y - room);
            (high.x, high.y) = (high.x + room, high.y + room);
        }
        let placed = Placed {
            origin_mm: body.origin_mm.as_dvec3(),
            bounds_mm: (low, high),
            repeats: reach.repeats(),
            first_piece,
        };
        let cells = Cells::new(strands, &placed, max_bytes)?;
        let thinnest = strands.joints.iter().map(|j| j.radius_mm);
        let all = reach.reach_mm();
        let is_cut = if reach.repeats() {
            !reach.is_endless()
        } else {
            all != bounds
        };
        if is_cut {
            (low, high) = (all.min.as_dvec3(), all.max.as_dvec3());
        } else if reach.repeats() {
            (low.x, low.y) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
            (high.x, high.y) = (f64::INFINITY, f64::INFINITY);
        }
        Ok(Body {
            cells,
            low_mm: low,
            high_mm: high,
            is_cut,
            start_mm: START_RADII * thinnest.fold(f32::INFINITY, f32::min),
            shell: body.shell.clone(),
        })
    }

    /// The part of a ray from anywhere that lies in the matter.
    pub fn enter(&self, origin_mm: DVec3, direction: DVec3) -> Option<Passage> {
        let (near, far) = self.clip(origin_mm, direction)?;
        let start = near.max(0.0);
        if start >= far {
            return None;
        }
        let at = self.cells.grid.locate(origin_mm + start * direction);
        Some(Passage {
            at,
            distance_mm: start,
            min_mm: if start > 0.0 { 0.0 } else { self.start_mm },
            end_mm: self.end_mm(far - start),
        })
    }

    fn end_mm(&self, far: f64) -> f32 {
        if self.is_cut {
            far as f32
        } else {
            f32::INFINITY
        }
    }

    /// The middle of all the matter; in x and y the origin where it has no end.
    pub fn middle_mm(&self) -> Vec3 {
        let middle = 0.5 * (self.low_mm + self.high_mm);
        let is_infinite = middle.is_nan_mask() | !middle.is_finite_mask();
        DVec3::select(is_infinite, DVec3::ZERO, middle).as_vec3()
    }

    /// How far a ray from a point in the matter may go before it leaves it;
    /// infinite where the grid's faces decide.
    #[inline]
    pub fn way_out_mm(&self, from: &GridPoint, direction: Vec3) -> f32 {
        if !self.is_cut {
            return f32::INFINITY;
        }
        self.way_out_from_mm(self.cells.grid.world_mm(from), direction)
    }

    /// The same from a point of the world.
    pub fn way_out_from_mm(&self, origin: DVec3, direction: Vec3) -> f32 {
        if !self.is_cut {
            return f32::INFINITY;
        }
        let out = self.clip(origin, direction.as_dvec3());
        out.map_or(0.0, |(_, far)| far.max(0.0) as f32)
    }

    fn clip(&self, origin_mm: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        clip(origin_mm, direction, (self.low_mm, self.high_mm))
    }
}

/// Where a ray passes a box, if it does not end before.
#[inline(always)]
pub fn clip(
    origin_mm: DVec3,
    direction: DVec3,
    (low_mm, high_mm): (DVec3, DVec3),
) -> Option<(f64, f64)> {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let (o, d) = (origin_mm[axis], direction[axis]);
        let (low, high) = (low_mm[axis], high_mm[axis]);
        if d == 0.0 {
            if o < low || o > high {
                return None;
            }
            continue;
        }
        let (a, b) = ((low - o) / d, (high - o) / d);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    (near < far && far > 0.0).then_some((near, far))
}
