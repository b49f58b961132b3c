//! Fibres laid out for waves of rays.

use super::cell_ray::{CellHit, CellRay, Visit};
use super::cells::{Cells, Unfit};
use super::grid::GridPoint;
use super::joint_table::JointTable;
use super::optics::Optics;
use super::strands::Strands;
use crate::cpu::lanes::one;
use crate::packed::{FibreVolume, PackedPart, PackedVoxels, Switch};
use crate::refusal::Refusal;
use glam::{DVec3, Vec3};
use organza_basis::CellGrid;
use organza_scatter::Fibre;

/// A ray that starts among fibres meets none so near, in radii of the thinnest:
/// at a bend it may start a rounding outside the fibre that it leaves.
const START_RADII: f32 = 1e-3;

/// Fibres of one tile, alone or repeated, with what they scatter.
pub struct FibreMatter {
    pub(crate) cells: Cells,
    pub(crate) joints: JointTable,
    pub(crate) optics: Optics,
    /// All the matter; infinite in x and y where it has no end.
    pub(crate) low_mm: DVec3,
    pub(crate) high_mm: DVec3,
    /// Whether the matter is cut within the grid.
    pub(crate) is_cut: bool,
    /// A ray that starts among fibres meets none before this distance, mm.
    pub(crate) start_mm: f32,
    /// The same fibres in voxels, for the later events of paths.
    pub(crate) packed: Option<PackedPart>,
}

/// Where a ray goes through the matter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub at: GridPoint,
    /// From the ray's origin, mm.
    pub distance_mm: f64,
    /// No hit up to here, mm from the entry.
    pub min_mm: f32,
    /// The way out, mm from the entry; infinite where the grid's faces decide.
    pub end_mm: f32,
}

impl FibreMatter {
    /// Lays out fibres whose joints are counted from `origin_mm`. `reach` is the
    /// box of the tile and how far its copies go; `fibres` is indexed by the
    /// strands' materials. Cells take at most `max_bytes`.
    ///
    /// # Errors
    /// See [`Unfit`].
    pub fn new(
        strands: Strands<'_>,
        origin_mm: Vec3,
        reach: &CellGrid,
        fibres: &[Fibre],
        max_bytes: u64,
    ) -> Result<FibreMatter, Unfit> {
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
        let cells = Cells::new(
            strands,
            origin_mm.as_dvec3(),
            (low, high),
            reach.repeats(),
            max_bytes,
        )?;
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
        Ok(FibreMatter {
            cells,
            joints: JointTable::new(strands),
            optics: Optics::new(fibres),
            low_mm: low,
            high_mm: high,
            is_cut,
            start_mm: START_RADII * thinnest.fold(f32::INFINITY, f32::min),
            packed: None,
        })
    }

    /// Lays packed fibres out, which are met from the camera on. They take at most
    /// `max_bytes`.
    ///
    /// # Errors
    /// See [`FibreMatter::with_packed`].
    pub fn of_packed(source: &impl PackedVoxels, max_bytes: u64) -> Result<FibreMatter, Refusal> {
        let none = Strands {
            joints: &[],
            strands: &[],
        };
        let grid = source.cell_grid();
        let origin_mm = grid.bounds_mm().min;
        let bare = FibreMatter::new(none, origin_mm, grid, source.fibres(), max_bytes)
            .map_err(|unfit| Refusal::of_fibres(unfit, max_bytes))?;
        bare.with_packed(source, Switch::AT_ONCE, max_bytes)
    }

    /// The same with packed fibres of the same cloth for the later events of paths. Both
    /// together take at most `max_bytes`.
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

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let explicit = self.cells.memory_bytes() + self.joints.memory_bytes();
        let packed = self.packed.as_ref().map_or(0, |p| p.volume.memory_bytes());
        explicit + packed + self.optics.memory_bytes()
    }

    /// Whether memory did not suffice for copies of the fibres, and cells hold lists.
    pub(crate) fn has_lists(&self) -> bool {
        self.cells.lists.is_some()
    }

    /// The part of a ray from anywhere that lies in the matter.
    pub(super) fn enter(&self, origin_mm: DVec3, direction: DVec3) -> Option<Entry> {
        let (near, far) = self.clip(origin_mm, direction)?;
        let start = near.max(0.0);
        if start >= far {
            return None;
        }
        let at = self.cells.grid.locate(origin_mm + start * direction);
        Some(Entry {
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

    /// How far a ray from a point in the matter may go before it leaves it;
    /// infinite where the grid's faces decide.
    #[inline]
    pub(super) fn way_out_mm(&self, from: &GridPoint, direction: Vec3) -> f32 {
        if !self.is_cut {
            return f32::INFINITY;
        }
        self.way_out_from_mm(self.cells.grid.world_mm(from), direction)
    }

    /// The same from a point of the world.
    pub(super) fn way_out_from_mm(&self, origin: DVec3, direction: Vec3) -> f32 {
        if !self.is_cut {
            return f32::INFINITY;
        }
        let out = self.clip(origin, direction.as_dvec3());
        out.map_or(0.0, |(_, far)| far.max(0.0) as f32)
    }

    /// Where a ray passes the box of all the matter.
    fn clip(&self, origin_mm: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let (o, d) = (origin_mm[axis], direction[axis]);
            let (low, high) = (self.low_mm[axis], self.high_mm[axis]);
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

    /// The first fibre that a ray enters, by one lane: for tests and probes.
    pub fn first_hit(&self, origin_mm: DVec3, direction: DVec3) -> Option<FibreEntry> {
        let entry = self.enter(origin_mm, direction)?;
        let d = direction.as_vec3();
        let grid = &self.cells.grid;
        let mut ray = CellRay::new(grid, &entry.at, d, entry.min_mm, entry.end_mm)?;
        loop {
            match ray.visit::<one::F>(&self.cells, &self.joints, false, &mut 0) {
                Visit::Met(hit) => return Some(self.entry(&hit, entry.distance_mm)),
                Visit::Onward => {}
                Visit::Left => return None,
            }
        }
    }

    fn entry(&self, hit: &CellHit, before_mm: f64) -> FibreEntry {
        let at_mm = self.cells.grid.world_mm(&GridPoint {
            cell: hit.cell,
            period: hit.period,
            at_mm: hit.axis_at_mm + hit.out_mm,
        });
        FibreEntry {
            piece: hit.piece,
            distance_mm: before_mm + f64::from(hit.distance_mm),
            at_mm,
            tangent: self.joints.tangent(hit.piece, hit.along_mm),
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
    /// Unit tangent of the fibre there.
    pub tangent: Vec3,
}
