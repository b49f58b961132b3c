//! Explicit fibres: the reference for media of fibres.
//!
//! Every fibre of a tile is a chain of cylinders (or cones, where it tapers)
//! joined at ellipses, in a hierarchy of boxes. Light meets its surface at an
//! offset h across its width, is scattered by the near-field lobe at that offset
//! and leaves from that lobe's own exit point on the cylinder [Marschner2003]:
//! leaving from where it came in would shift reflection by 4 to 8 %.
//!
//! A tile that repeats is walked copy by copy, with the ray moved into the tile:
//! an endless cloth takes no more memory than one period.
//!
//! # Inside fibres
//! A fibre is met where a ray **enters** it from outside. What starts inside a
//! fibre leaves it freely: exit points lie on the surface, so that the fibre just
//! left is never met again by rounding, and no epsilon is needed; a later bend of
//! the same fibre is. Fibres that are placed to overlap are, where they do, one
//! body with the surface of their union. [`ExplicitFibres::measure_overlap`] returns
//! how much of their volume that concerns.

mod curves;
mod draped;
mod fibre_hit;
mod hierarchy;
mod overlap;
mod piece;
mod random_point;
#[cfg(test)]
mod tests;

use crate::Stats;
use curves::{Curves, count_joints};
pub use fibre_hit::FibreHit;
use glam::{DVec2, DVec3, UVec3, Vec3, Vec3A};
use hierarchy::Hierarchy;
use obvhs::ray::{Ray as BvhRay, RayHit};
use organza_basis::{CellGrid, MAX_PERIODS};
use organza_basis::{Ray, SegmentSource, Tile};
use organza_kernel::fibres::{Drape, FibreBody, FibreMatter, Joint, Strand, Unfit};
use organza_scatter::Fibre;
pub use overlap::Overlap;
use piece::FibrePiece;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

/// Why fibres cannot be traced.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExplicitFibresError {
    /// No segment that is finite and has a radius.
    #[error("the cloth has no fibres to trace")]
    Empty,
    /// The box of the tile.
    #[error("the tile is not a finite box")]
    Tile,
    /// A material without scattering.
    #[error("{materials} materials of fibres, but scattering for {fibres}")]
    Materials {
        /// Materials of the source.
        materials: usize,
        /// Fibres given.
        fibres: usize,
    },
    /// More pieces than can be counted.
    #[error("{0} pieces of fibre are more than a tile can hold: use a smaller tile")]
    TooMany(u64),
    /// More memory is needed than allowed.
    #[error(
        "explicit fibres need about {needed} bytes of memory, {allowed} are allowed: use a smaller tile or allow more"
    )]
    Memory {
        /// Estimated need at its peak, bytes.
        needed: u64,
        /// The limit, bytes.
        allowed: u64,
    },
}

/// Peak bytes per joint while fibres are gathered: 36 of the joint, twice, and the
/// strand's. An estimate.
const BYTES_PER_JOINT: u64 = 80;

/// Peak bytes per joint while the hierarchy is built, copies at the tile's faces
/// included: 36 of the joint, 12 per copy, the boxes and the builder's nodes.
/// An estimate.
const HIERARCHY_BYTES_PER_JOINT: u64 = 320;

/// A ray starts so much before its origin in the hierarchy, which drops boxes
/// that end within 1e-4 of it.
const BVH_LEAD_MM: f32 = 3e-4;

/// A ray that starts among fibres meets none so near, in radii of the thinnest:
/// at a bend it may start a rounding outside the fibre that it leaves.
const START_RADII: f64 = 1e-3;

/// Copies of the tile overlap by so much, for what is met at a face.
const FACE_SLACK_MM: f64 = 1e-9;

/// Explicit fibres of one tile, alone or repeated without end.
pub struct ExplicitFibres {
    curves: Arc<Curves>,
    fibres: Vec<Fibre>,
    /// The tile's box as one cell.
    cell_grid: CellGrid,
    /// The tile's least corner, from which everything below is counted.
    origin_mm: DVec3,
    period_mm: DVec2,
    start_mm: f64,
    tile: Tile,
    /// Built when the general walk first asks for it: the kernel has cells.
    hierarchy: Arc<OnceLock<Hierarchy>>,
    /// In cells, flat and alone, once they were asked for.
    in_cells: Arc<OnceLock<Result<FibreMatter, Unfit>>>,
}

impl ExplicitFibres {
    /// All fibres of a source; `fibres` is indexed by its materials. `progress`
    /// is called with the share of the work done.
    ///
    /// # Errors
    /// When there are none, one has no scattering, or memory does not suffice.
    pub fn new(
        source: &dyn SegmentSource,
        fibres: Vec<Fibre>,
        max_memory_bytes: Option<u64>,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<ExplicitFibres, ExplicitFibresError> {
        let materials = source.material_count();
        if fibres.len() < materials {
            return Err(ExplicitFibresError::Materials {
                materials,
                fibres: fibres.len(),
            });
        }
        let joints = count_joints(source);
        if joints == 0 {
            return Err(ExplicitFibresError::Empty);
        }
        let needed = joints.saturating_mul(BYTES_PER_JOINT);
        let allowed = max_memory_bytes.unwrap_or(u64::MAX);
        if needed > allowed {
            return Err(ExplicitFibresError::Memory { needed, allowed });
        }
        if joints > u64::from(u32::MAX) / 8 {
            return Err(ExplicitFibresError::TooMany(joints));
        }
        let (batches, done) = (source.batch_count().max(1), AtomicUsize::new(0));
        let curves = Curves::gather(source, &|| {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(0.5 * done as f32 / batches as f32);
        });
        let tile = source.tile();
        let bounds_mm = curves.bounds_mm(&tile);
        let cell_grid =
            CellGrid::new(bounds_mm, UVec3::ONE, tile.repeats).ok_or(ExplicitFibresError::Tile)?;
        progress(1.0);
        let start_mm = curves.joints.iter().map(|j| f64::from(j.radius_mm));
        let start_mm = START_RADII * start_mm.fold(f64::INFINITY, f64::min);
        Ok(ExplicitFibres {
            origin_mm: tile.bounds_mm.min.as_dvec3(),
            period_mm: tile.period_mm().as_dvec2(),
            start_mm,
            curves: Arc::new(curves),
            fibres,
            cell_grid,
            tile,
            hierarchy: Arc::default(),
            in_cells: Arc::default(),
        })
    }

    /// The same fibres with other scattering, as many materials as before: they share
    /// their hierarchy and cells with these ones.
    ///
    /// # Errors
    /// When one has no scattering.
    pub fn with_scattering(
        &self,
        fibres: Vec<Fibre>,
    ) -> Result<ExplicitFibres, ExplicitFibresError> {
        let materials = self.fibres.len();
        if fibres.len() < materials {
            return Err(ExplicitFibresError::Materials {
                materials,
                fibres: fibres.len(),
            });
        }
        Ok(ExplicitFibres {
            curves: Arc::clone(&self.curves),
            fibres,
            cell_grid: self.cell_grid,
            origin_mm: self.origin_mm,
            period_mm: self.period_mm,
            start_mm: self.start_mm,
            tile: self.tile,
            hierarchy: Arc::clone(&self.hierarchy),
            in_cells: Arc::clone(&self.in_cells),
        })
    }

    /// Where the fibres are.
    pub fn cell_grid(&self) -> &CellGrid {
        &self.cell_grid
    }

    /// Fibres that are cut with it are open at the cut, like what starts inside.
    pub(crate) fn cell_grid_mut(&mut self) -> &mut CellGrid {
        self.in_cells = Arc::default();
        &mut self.cell_grid
    }

    /// These fibres alone in cells, which are made once, for all that share them; the
    /// first one's `max_bytes` counts.
    ///
    /// # Errors
    /// See [`Unfit`].
    pub(crate) fn alone_in_cells(&self, max_bytes: u64) -> Result<FibreMatter, Unfit> {
        let laid_out = || FibreMatter::new(&[self.body(None)], Vec::new(), max_bytes);
        match self.in_cells.get_or_init(laid_out) {
            Ok(matter) => Ok(matter.with_fibres(&self.fibres)),
            Err(why) => Err(*why),
        }
    }

    /// The fibres as the kernel takes them, flat or over what they are laid over.
    pub fn body(&self, drape: Option<Arc<dyn Drape>>) -> FibreBody<'_> {
        FibreBody {
            strands: self.curves.strands(),
            origin_mm: self.origin_mm.as_vec3(),
            reach: &self.cell_grid,
            fibres: &self.fibres,
            drape,
        }
    }

    /// Checks that the hierarchy, which the general walk builds when it first asks for it,
    /// will fit into `allowed` bytes together with the fibres.
    ///
    /// # Errors
    /// [`ExplicitFibresError::Memory`].
    pub fn check_hierarchy(&self, allowed: u64) -> Result<(), ExplicitFibresError> {
        let needed = self.hierarchy_bytes();
        if needed > allowed {
            return Err(ExplicitFibresError::Memory { needed, allowed });
        }
        Ok(())
    }

    /// Peak bytes of the fibres and their hierarchy; an estimate.
    pub(crate) fn hierarchy_bytes(&self) -> u64 {
        (self.curves.joints.len() as u64).saturating_mul(HIERARCHY_BYTES_PER_JOINT)
    }

    fn hierarchy(&self) -> &Hierarchy {
        self.hierarchy
            .get_or_init(|| Hierarchy::new(&self.curves, &self.tile))
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let of = |count: usize, size: usize| (count * size) as u64;
        of(self.curves.joints.len(), size_of::<Joint>())
            + of(self.curves.curves.len(), size_of::<Strand>())
            + self.hierarchy.get().map_or(0, Hierarchy::memory_bytes)
    }

    /// The first fibre that the ray enters before `limit` mm, and how far.
    pub fn first_hit(&self, ray: &Ray, limit: f64, stats: &mut Stats) -> Option<(f64, FibreHit)> {
        let found = self.walk(ray, limit, false, &mut stats.tentative)?;
        stats.collisions += 1;
        Some((
            found.distance_mm,
            self.describe(&found, ray.direction, ray.direction),
        ))
    }

    /// True when a fibre stands in the ray's way before `reach` mm.
    pub fn blocks(&self, ray: &Ray, reach: f64, stats: &mut Stats) -> bool {
        let tests = &mut stats.shadow_steps;
        self.walk(ray, reach, true, tests).is_some()
    }

    /// The nearest entry along a ray, or any.
    pub(crate) fn walk(&self, ray: &Ray, limit: f64, any: bool, tests: &mut u64) -> Option<Found> {
        let clip = self.cell_grid.clip(ray, limit)?;
        let d = ray.direction.as_dvec3();
        let t_entry = clip.t_entry;
        let p = ray.at(t_entry) - self.origin_mm;
        let length = f64::from(clip.length);
        // A ray that starts among fibres has left its own.
        let least = if t_entry > 0.0 { 0.0 } else { self.start_mm };
        let found = if self.cell_grid.repeats() {
            self.walk_copies(p, d, (least, length), any, tests)
        } else {
            self.in_tile(p, d, (least, length), any, tests)
        };
        found.map(|f| f.later(t_entry))
    }

    /// From copy to copy of the tile, each in its own coordinates: the nearest entry, or
    /// any, between `least` and `length` mm from `p` along the unit direction `d`.
    fn walk_copies(
        &self,
        mut p: DVec3,
        d: DVec3,
        (mut least, length): (f64, f64),
        any: bool,
        tests: &mut u64,
    ) -> Option<Found> {
        let mut gone = 0.0;
        for axis in 0..2 {
            p[axis] = p[axis].rem_euclid(self.period_mm[axis]);
        }
        // One in the plane of the cloth, beside all fibres, would go on without end.
        for _ in 0..MAX_PERIODS {
            let ahead = |axis: usize| match d[axis] {
                0.0 => f64::INFINITY,
                along if along > 0.0 => (self.period_mm[axis] - p[axis]) / along,
                along => p[axis] / -along,
            };
            let (x, y) = (ahead(0), ahead(1));
            let axis = usize::from(y < x);
            let span = x.min(y).max(0.0);
            let most = (span + FACE_SLACK_MM).min(length - gone);
            if let Some(found) = self.in_tile(p, d, (least, most), any, tests) {
                return Some(found.later(gone));
            }
            gone += span;
            if gone >= length || !gone.is_finite() {
                return None;
            }
            p += span * d;
            p[axis] = if d[axis] > 0.0 {
                0.0
            } else {
                self.period_mm[axis]
            };
            least = -FACE_SLACK_MM;
        }
        None
    }

    /// The nearest entry, or any, in the tile.
    fn in_tile(
        &self,
        o: DVec3,
        d: DVec3,
        (least, most): (f64, f64),
        any: bool,
        tests: &mut u64,
    ) -> Option<Found> {
        let lead = f64::from(BVH_LEAD_MM);
        let ray = BvhRay::new(
            (o - lead * d).as_vec3a(),
            // The hierarchy loses rays with a component of minus zero.
            d.as_vec3a() + Vec3A::ZERO,
            0.0,
            (most + lead) as f32 * (1.0 + 1e-6),
        );
        let hierarchy = self.hierarchy();
        let mut nearest: Option<Found> = None;
        let mut most = most;
        let mut test = |_: &BvhRay, leaf: usize| -> f32 {
            *tests += 1;
            let placed = &hierarchy.placed[leaf];
            let shift_mm = placed.shift.as_dvec2() * self.period_mm;
            let piece = self.curves.piece(placed.piece, shift_mm);
            let Some(t) = piece.entry(o, d, least, most) else {
                return f32::INFINITY;
            };
            most = t;
            nearest = Some(Found {
                distance_mm: t,
                point: o + t * d,
                piece,
                index: placed.piece,
            });
            // Rounded up: boxes at the same distance are still looked into.
            ((t + lead) as f32).next_up()
        };
        if any {
            hierarchy.boxes.ray_traverse_miss(ray, test);
        } else {
            hierarchy
                .boxes
                .ray_traverse(ray, &mut RayHit::none(), &mut test);
        }
        nearest
    }
}

/// An entry into a piece, in the coordinates of its copy of the tile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    pub distance_mm: f64,
    point: DVec3,
    piece: FibrePiece,
    index: u32,
}

/// An entry as plies take it.
pub(crate) struct Entry {
    /// Unit tangent of the curve.
    pub tangent: Vec3,
    /// From its axis to the point, across the tangent, mm.
    pub out_mm: Vec3,
    pub radius_mm: f32,
    pub material: u16,
    pub yarn: u32,
}

impl Found {
    /// What was entered, and where.
    pub fn entry(&self, fibres: &ExplicitFibres) -> Entry {
        let share = self.piece.nearest(self.point);
        let tangent = fibres.curves.tangent(self.index, share as f32);
        let out = (self.point - self.piece.axis_point(share)).as_vec3();
        let radius_mm = out.length();
        // Across the tangent, which at a bend is not that of the cylinder.
        let across = out - tangent * tangent.dot(out);
        let strand = fibres.curves.curve_of(self.index);
        Entry {
            tangent,
            out_mm: radius_mm * across.normalize_or(tangent.any_orthonormal_vector()),
            radius_mm,
            material: strand.material,
            yarn: strand.yarn,
        }
    }

    fn later(self, by_mm: f64) -> Found {
        Found {
            distance_mm: self.distance_mm + by_mm,
            ..self
        }
    }
}
