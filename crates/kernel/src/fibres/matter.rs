//! Fibres laid out for waves of rays.

use super::body::{Body, FibreBody};
use super::cell_ray::{CellHit, CellRay, Visit};
use super::cells::Unfit;
use super::grid::GridPoint;
use super::joint_table::JointTable;
use super::plane::Plane;
use super::strands::Strands;
use crate::packed::{FibreVolume, PackedPart, PackedVoxels, Switch};
use crate::refusal::Refusal;
use glam::{DVec3, Vec3};
use organza_lanes::dispatch::{Job, dispatch_sixteen};
use organza_lanes::{Backend, Floats};
use organza_scatter::Fibre;
use organza_scatter::near::Optics;
use std::sync::Arc;

/// Cloths of explicit fibres, and planes, with what they scatter.
pub struct FibreMatter {
    pub(crate) bodies: Arc<Vec<Body>>,
    pub(crate) planes: Vec<Plane>,
    /// Of the pieces of all bodies, one body after the other.
    pub(crate) joints: Arc<JointTable>,
    pub(crate) optics: Optics,
    /// The fibres of the only body in voxels, for the later events of paths.
    pub(crate) packed: Option<PackedPart>,
}

impl FibreMatter {
    /// Lays out one cloth or several, and planes. Everything takes at most `max_bytes`
    /// while it is laid out.
    ///
    /// # Errors
    /// See [`Unfit`].
    pub fn new(
        bodies: &[FibreBody<'_>],
        planes: Vec<Plane>,
        max_bytes: u64,
    ) -> Result<FibreMatter, Unfit> {
        let (mut made, mut joints) = (Vec::<Body>::new(), JointTable::default());
        let mut fibres: Vec<Fibre> = Vec::new();
        for body in bodies {
            let cells: u64 = made.iter().map(|b| b.cells.memory_bytes()).sum();
            let taken = cells + joints.memory_bytes() + JointTable::bytes_of(body.strands);
            let left = max_bytes.saturating_sub(taken);
            let one = Body::new(body, joints.count(), left);
            made.push(one.map_err(|unfit| match unfit {
                Unfit::Memory(needed) => Unfit::Memory(needed + taken),
                Unfit::TooMany => Unfit::TooMany,
            })?);
            let first = u16::try_from(fibres.len()).map_err(|_| Unfit::TooMany)?;
            joints.add(body.strands, first);
            fibres.extend_from_slice(body.fibres);
        }
        Ok(FibreMatter {
            bodies: Arc::new(made),
            planes,
            joints: Arc::new(joints),
            optics: Optics::new(&fibres),
            packed: None,
        })
    }

    /// The same matter without packed fibres, whose fibres scatter otherwise; `fibres` are
    /// those of all bodies, one body after the other, as many as before.
    pub fn with_fibres(&self, fibres: &[Fibre]) -> FibreMatter {
        FibreMatter {
            bodies: Arc::clone(&self.bodies),
            planes: self.planes.clone(),
            joints: Arc::clone(&self.joints),
            optics: Optics::new(fibres),
            packed: None,
        }
    }

    /// Lays packed fibres out, which are met from the camera on. They take at most
    /// `max_bytes`.
    ///
    /// # Errors
    /// See [`FibreMatter::with_packed`].
    pub fn of_packed(source: &impl PackedVoxels, max_bytes: u64) -> Result<FibreMatter, Refusal> {
        let grid = source.cell_grid();
        let none = FibreBody {
            strands: Strands {
                joints: &[],
                strands: &[],
            },
            origin_mm: grid.bounds_mm().min,
            reach: grid,
            fibres: source.fibres(),
            shell: None,
        };
        let bare = FibreMatter::new(&[none], Vec::new(), max_bytes)
            .map_err(|unfit| Refusal::of_fibres(unfit, max_bytes))?;
        bare.with_packed(source, Switch::AT_ONCE, max_bytes)
    }

    /// The same with packed fibres of the same cloth, which must be one flat cloth without
    /// planes, for the later events of paths. Both together take at most `max_bytes`.
    ///
    /// # Errors
    /// Fibres that voxels do not suit, or too many of them.
    pub fn with_packed(
        mut self,
        source: &impl PackedVoxels,
        switch: Switch,
        max_bytes: u64,
    ) -> Result<FibreMatter, Refusal> {
        let least = self.memory_bytes() + FibreVolume::min_bytes(source.cell_grid());
        if least > max_bytes {
            return Err(Refusal::Memory(least, max_bytes));
        }
        let volume = FibreVolume::new(source)?;
        self.packed = Some(PackedPart {
            volume,
            switch,
            starts_at_entry: false,
        });
        Ok(self)
    }

    /// Whether paths meet packed fibres.
    pub fn has_packed(&self) -> bool {
        self.packed.is_some()
    }

    /// Whether there is nothing but one flat body: every ray has one way through its cells.
    #[inline(always)]
    pub(crate) fn is_one_body(&self) -> bool {
        self.planes.is_empty() && self.bodies.len() == 1 && self.bodies[0].shell.is_none()
    }

    /// Whether there is nothing but one flat body of explicit fibres.
    pub(super) fn is_plain(&self) -> bool {
        self.is_one_body() && self.packed.is_none()
    }

    /// A number that matter laid out otherwise hardly has: the grids, how many pieces there are, and
    /// the level of voxels.
    pub(super) fn fingerprint(&self) -> u64 {
        let mut sum = organza_basis::mix64(u64::from(self.joints.count()));
        let mut add = |number: u64| sum = organza_basis::mix64(sum ^ number);
        for body in self.bodies.iter() {
            let grid = &body.cells.grid;
            add(grid.count() as u64);
            let sizes = grid.cell_mm().to_array().into_iter();
            sizes.map(f64::to_bits).for_each(&mut add);
        }
        add(self.planes.len() as u64);
        if let Some(part) = &self.packed {
            let grid = &part.volume.cell_grid;
            let dims = grid.dims().to_array().into_iter();
            dims.map(u64::from).for_each(&mut add);
            let per_mm = grid.voxels_per_mm().to_array().into_iter();
            per_mm.map(|n| u64::from(n.to_bits())).for_each(&mut add);
        }
        sum
    }

    /// The middle of the first body; in x and y the origin where it has no end.
    pub(crate) fn middle_mm(&self) -> Vec3 {
        self.bodies.first().map_or(Vec3::ZERO, Body::middle_mm)
    }

    /// Whether some of it is draped.
    pub(super) fn is_draped(&self) -> bool {
        self.bodies.iter().any(|b| b.shell.is_some())
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let bodies = self.bodies.iter().map(|b| b.cells.memory_bytes());
        let explicit = bodies.sum::<u64>() + self.joints.memory_bytes();
        let packed = self.packed.as_ref().map_or(0, |p| p.volume.memory_bytes());
        explicit + packed + self.optics.memory_bytes()
    }

    /// Whether memory did not suffice for copies of the fibres, and cells hold lists.
    pub(crate) fn has_lists(&self) -> bool {
        self.bodies.iter().any(|b| b.cells.lists.is_some())
    }

    /// The first fibre that a ray enters in the first body, as if that were flat and
    /// alone. A ray that starts among fibres has left its own.
    pub fn first_hit(&self, origin_mm: DVec3, direction: DVec3) -> Option<FibreEntry> {
        let ends_mm = (self.start_mm(), f64::INFINITY);
        self.entry_between((origin_mm, direction), ends_mm, false, &mut 0)
    }

    /// A ray that starts among the fibres of the first body meets none before, mm.
    pub fn start_mm(&self) -> f64 {
        self.bodies.first().map_or(0.0, |b| f64::from(b.start_mm))
    }

    /// The first fibre that a ray, an origin and a unit direction, enters beyond one distance
    /// and up to another in the first body, as if that were flat and alone; or any, if `any`.
    /// `tests` counts pieces.
    pub fn entry_between(
        &self,
        (origin_mm, direction): (DVec3, DVec3),
        (min_mm, max_mm): (f64, f64),
        any: bool,
        tests: &mut u64,
    ) -> Option<FibreEntry> {
        let body = self.bodies.first()?;
        let entry = body.enter(origin_mm, direction)?;
        if entry.distance_mm >= max_mm {
            return None;
        }
        let least = (min_mm - entry.distance_mm).max(0.0) as f32;
        let most = ((max_mm - entry.distance_mm) as f32).min(entry.end_mm);
        let grid = &body.cells.grid;
        let search = Search {
            ray: CellRay::new(grid, &entry.at, direction.as_vec3(), least, most)?,
            body,
            joints: &self.joints,
            any,
            tests,
        };
        let hit = dispatch_sixteen(Backend::widest(), search)?;
        Some(self.entry(body, &hit, entry.distance_mm))
    }

    fn entry(&self, body: &Body, hit: &CellHit, before_mm: f64) -> FibreEntry {
        let at_mm = body.cells.grid.world_mm(&GridPoint {
            cell: hit.cell,
            period: hit.period,
            at_mm: hit.axis_at_mm + hit.out_mm,
        });
        FibreEntry {
            piece: hit.piece,
            distance_mm: before_mm + f64::from(hit.distance_mm),
            at_mm,
            out_mm: hit.out_mm,
            tangent: self.joints.tangent(hit.piece, hit.along_mm),
        }
    }
}

/// A ray from cell to cell, to the first fibre that it enters.
struct Search<'a> {
    ray: CellRay,
    body: &'a Body,
    joints: &'a JointTable,
    any: bool,
    tests: &'a mut u64,
}

impl Job for Search<'_> {
    type Output = Option<CellHit>;

    fn run<F: Floats>(mut self) -> Option<CellHit> {
        let cells = &self.body.cells;
        loop {
            match self
                .ray
                .visit::<F>(cells, self.joints, self.any, self.tests)
            {
                Visit::Met(hit) => return Some(hit),
                Visit::Onward => {}
                Visit::Left => return None,
            }
        }
    }
}

/// Where a ray enters a fibre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FibreEntry {
    /// Number of the piece.
    pub piece: u32,
    /// From the ray's origin, mm.
    pub distance_mm: f64,
    /// In the world.
    pub at_mm: DVec3,
    /// From the axis to there.
    pub out_mm: Vec3,
    /// Unit tangent of the fibre there.
    pub tangent: Vec3,
}
