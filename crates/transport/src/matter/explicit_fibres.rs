//! Explicit fibres: the reference for media of fibres.
//!
//! Every fibre of a tile is a chain of cylinders (or cones, where it tapers)
//! joined at ellipses, sorted into the cells of the kernel. Light meets its surface at an
//! offset h across its width, is scattered by the near-field lobe at that offset
//! and leaves from that lobe's own exit point on the cylinder [Marschner2003]:
//! leaving from where it came in would shift reflection by 4 to 8 %.
//!
//! A tile that repeats is walked period by period: an endless cloth takes no more
//! memory than one.
//!
//! # Inside fibres
//! A fibre is met where a ray **enters** it from outside. What starts inside a
//! fibre leaves it freely: exit points lie on the surface, so that the fibre just
//! left is never met again by rounding, and no epsilon is needed; a later bend of
//! the same fibre is. Fibres that are placed to overlap are, where they do, one
//! body with the surface of their union.

mod curves;
mod draped;
mod fibre_hit;
mod random_point;
#[cfg(test)]
mod tests;

use crate::Stats;
use curves::{Curves, count_joints};
pub use fibre_hit::FibreHit;
use glam::{DVec3, UVec3, Vec3};
use organza_basis::{CellGrid, Ray, SegmentSource, Stopped, Watch};
use organza_kernel::fibres::{FibreBody, FibreEntry, FibreMatter, Joint, Strand, Unfit};
use organza_mesh::Shell;
use organza_scatter::Fibre;
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
    /// Whoever watched the work stopped it.
    #[error("{0}")]
    Stopped(#[from] Stopped),
}

/// Peak bytes per joint while fibres are gathered: 36 of the joint, twice, and the
/// strand's. An estimate.
const BYTES_PER_JOINT: u64 = 80;

/// The most joints of a tile.
const MAX_JOINTS: u64 = u32::MAX as u64 / 8;

/// Peak bytes per joint while fibres are sorted into cells that hold lists. An estimate.
const CELL_BYTES_PER_JOINT: u64 = 320;

/// Explicit fibres of one tile, alone or repeated without end.
pub struct ExplicitFibres {
    curves: Arc<Curves>,
    fibres: Vec<Fibre>,
    /// The tile's box as one cell.
    cell_grid: CellGrid,
    /// The tile's least corner, from which joints are counted.
    origin_mm: Vec3,
    /// What cells for the general walk should take at most; they take more where even lists do.
    max_bytes: u64,
    /// In cells, flat and alone, once they were asked for.
    in_cells: Arc<OnceLock<FibreMatter>>,
}

impl ExplicitFibres {
    /// All fibres of a source; `fibres` is indexed by its materials. `progress`
    /// is called with the share of the work done.
    ///
    /// # Errors
    /// When there are none, one has no scattering, memory does not suffice, or `progress` broke.
    pub fn new(
        source: &dyn SegmentSource,
        fibres: Vec<Fibre>,
        max_memory_bytes: Option<u64>,
        progress: Watch<'_, f32>,
    ) -> Result<ExplicitFibres, ExplicitFibresError> {
        let materials = source.material_count();
        if fibres.len() < materials {
            return Err(ExplicitFibresError::Materials {
                materials,
                fibres: fibres.len(),
            });
        }
        let allowed = max_memory_bytes.unwrap_or(u64::MAX);
        let most = (allowed / BYTES_PER_JOINT).min(MAX_JOINTS);
        let (batches, done) = (source.batch_count().max(1), AtomicUsize::new(0));
        let curves = Curves::gather(source, most, &|| {
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress(0.5 * done as f32 / batches as f32)
        });
        let Some(curves) = curves? else {
            // Only now is it worth the time to count them all.
            let joints = count_joints(source);
            let needed = joints.saturating_mul(BYTES_PER_JOINT);
            return Err(match needed > allowed {
                true => ExplicitFibresError::Memory { needed, allowed },
                false => ExplicitFibresError::TooMany(joints),
            });
        };
        if curves.joints.is_empty() {
            return Err(ExplicitFibresError::Empty);
        }
        let tile = source.tile();
        let bounds_mm = curves.bounds_mm(&tile);
        let cell_grid =
            CellGrid::new(bounds_mm, UVec3::ONE, tile.repeats).ok_or(ExplicitFibresError::Tile)?;
        Stopped::check(progress(1.0))?;
        Ok(ExplicitFibres {
            origin_mm: tile.bounds_mm.min,
            max_bytes: allowed,
            curves: Arc::new(curves),
            fibres,
            cell_grid,
            in_cells: Arc::default(),
        })
    }

    /// The same fibres with other scattering, as many materials as before: they share
    /// their cells with these ones.
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
            max_bytes: self.max_bytes,
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
        if let Some(matter) = self.in_cells.get() {
            return Ok(matter.with_fibres(&self.fibres));
        }
        let matter = self.laid_out(max_bytes)?;
        let matter = self.in_cells.get_or_init(|| matter);
        Ok(matter.with_fibres(&self.fibres))
    }

    fn laid_out(&self, max_bytes: u64) -> Result<FibreMatter, Unfit> {
        FibreMatter::new(&[self.body(None)], Vec::new(), max_bytes)
    }

    /// The cells that the general walk asks.
    ///
    /// # Panics
    /// Where a cell would hold more than a million pieces of fibre.
    fn cells(&self) -> &FibreMatter {
        self.in_cells.get_or_init(|| {
            let mut allowed = self.max_bytes;
            loop {
                match self.laid_out(allowed) {
                    Ok(matter) => return matter,
                    // What is needed is known step by step.
                    Err(Unfit::Memory(needed)) => allowed = needed.max(allowed.saturating_add(1)),
                    Err(Unfit::TooMany) => panic!("a million pieces of fibre lie in one place"),
                }
            }
        })
    }

    /// The fibres as the kernel takes them, flat or in a shell.
    pub fn body(&self, shell: Option<Arc<Shell>>) -> FibreBody<'_> {
        FibreBody {
            strands: self.curves.strands(),
            origin_mm: self.origin_mm,
            reach: &self.cell_grid,
            fibres: &self.fibres,
            shell,
        }
    }

    /// Checks that the cells, which the general walk lays out when it first asks for them,
    /// will fit into `allowed` bytes together with the fibres.
    ///
    /// # Errors
    /// [`ExplicitFibresError::Memory`].
    pub fn check_walk(&self, allowed: u64) -> Result<(), ExplicitFibresError> {
        let needed = self.walk_bytes();
        if needed > allowed {
            return Err(ExplicitFibresError::Memory { needed, allowed });
        }
        Ok(())
    }

    /// Peak bytes of the fibres and their cells; an estimate.
    pub(crate) fn walk_bytes(&self) -> u64 {
        (self.curves.joints.len() as u64).saturating_mul(CELL_BYTES_PER_JOINT)
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let of = |count: usize, size: usize| (count * size) as u64;
        of(self.curves.joints.len(), size_of::<Joint>())
            + of(self.curves.curves.len(), size_of::<Strand>())
            + self.in_cells.get().map_or(0, FibreMatter::memory_bytes)
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
        let (matter, ray) = (self.cells(), (ray.origin, ray.direction.as_dvec3()));
        Found::between(matter, ray, (matter.start_mm(), limit), any, tests)
    }
}

/// An entry into a fibre, in the places of the tile and its copies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    pub distance_mm: f64,
    /// From the point at that distance to the axis: rounding of the distance does not take
    /// the exit point off the surface.
    to_axis_mm: Vec3,
    entry: FibreEntry,
}

/// An entry as plies take it.
pub(crate) struct PlyEntry {
    /// Unit tangent of the curve.
    pub tangent: Vec3,
    /// From its axis to the point, across the tangent, mm.
    pub out_mm: Vec3,
    pub radius_mm: f32,
    pub material: u16,
    pub yarn: u32,
}

impl Found {
    /// The nearest along a ray, or any, beyond one distance and up to another.
    fn between(
        matter: &FibreMatter,
        (origin, direction): (DVec3, DVec3),
        ends_mm: (f64, f64),
        any: bool,
        tests: &mut u64,
    ) -> Option<Found> {
        let entry = matter.entry_between((origin, direction), ends_mm, any, tests)?;
        let point = origin + entry.distance_mm * direction;
        Some(Found {
            distance_mm: entry.distance_mm,
            to_axis_mm: (entry.at_mm - entry.out_mm.as_dvec3() - point).as_vec3(),
            entry,
        })
    }

    /// What was entered, and where.
    pub fn entry(&self, fibres: &ExplicitFibres) -> PlyEntry {
        let (tangent, out) = (self.entry.tangent, self.entry.out_mm);
        let radius_mm = out.length();
        // Across the tangent, which at a bend is not that of the cylinder.
        let across = out - tangent * tangent.dot(out);
        let strand = fibres.curves.curve_of(self.entry.piece);
        PlyEntry {
            tangent,
            out_mm: radius_mm * across.normalize_or(tangent.any_orthonormal_vector()),
            radius_mm,
            material: strand.material,
            yarn: strand.yarn,
        }
    }
}
