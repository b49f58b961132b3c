//! OpenVDB files: sparse grids that other programs open `[Museth2013]`.
//!
//! Trees of the usual 5-4-3 shape with float, three-float and 32-bit integer values are written
//! and read, in full or half precision, raw or compressed with zlib; Blosc frames are read as
//! OpenVDB writes them. Grids that cannot be read are refused by name, so that no grid is
//! silently empty. The codec is our own because existing libraries allocate the memory that a
//! file declares, and panic on some files.

mod blosc;
mod cursor;
mod from_octree;
mod grids;
mod read;
mod value;
mod write;

pub use from_octree::grids_from_octree;
pub use read::{File, read};
pub use write::{Codec, write};

use super::{Format, Part, Source, WriteOption};
use crate::Error;
use glam::{DAffine3, DMat3, DVec3, IVec3};
use organza_basis::Budget;
use serde_json::json;
pub use value::Value;

/// The record of the format.
pub static FORMAT: Format = Format {
    ending: "vdb",
    magic: b" BDV",
    noun: "an OpenVDB volume (.vdb)",
    keeps: "one level: density, orientation, spread, SGGX matrix, albedo, yarn",
    options: &[WriteOption::Level, WriteOption::Half, WriteOption::Raw],
    describe: |source, budget| Ok(open(source, budget)?.describe()),
    read: |source, budget| {
        open(source, budget)?
            .grid_set(budget)
            .map(super::Volume::Grids)
    },
    write_memory_bytes: from_octree::memory_bytes,
    write: |voxels| {
        let grids = grids_from_octree(voxels.octree, voxels.level, voxels.half, voxels.merge);
        let codec = if voxels.raw { Codec::Raw } else { Codec::Zip };
        Ok(vec![Part {
            infix: None,
            write: Box::new(move |out| write(&grids, codec, out)),
        }])
    },
};

fn open(source: &Source<'_>, budget: &mut Budget) -> Result<File, Error> {
    source.read(budget, read)
}

pub(crate) const ENDING: &str = ".vdb";
/// Cells across the nodes below the root, from the leaves up.
pub(crate) const EDGES: [i32; 3] = [8, 128, 4096];

/// 8 x 8 x 8 cells of which some hold values.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf<T> {
    /// Least cell, a multiple of 8.
    pub origin: IVec3,
    /// Active cells: bit `i % 64` of word `i / 64`, `i = 64 x + 8 y + z`.
    pub mask: [u64; 8],
    /// All 512 values in the same order; background where not active.
    pub values: Vec<T>,
}

/// A cube of cells with one value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube<T> {
    /// Least cell.
    pub origin: IVec3,
    /// Cells along an edge: 8, 128 or 4096.
    pub edge: i32,
    /// The value of all its cells.
    pub value: T,
}

/// A sparse array over all cells of a 32-bit lattice.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells<T> {
    /// Value where nothing is active.
    pub background: T,
    /// Leaves, none twice.
    pub leaves: Vec<Leaf<T>>,
    /// Active cubes, each of one value.
    pub cubes: Vec<Cube<T>>,
}

/// A sparse array of one of the supported kinds.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// OpenVDB's `float`.
    Float(Cells<f32>),
    /// OpenVDB's `vec3s`.
    Vec3(Cells<[f32; 3]>),
    /// OpenVDB's `int32`.
    Int(Cells<i32>),
}

/// One named grid of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Its name in the file.
    pub name: String,
    /// From cell numbers (the middle of a cell) to millimetres.
    pub mm_from_cell: DAffine3,
    /// Least and greatest cell of the lattice that the grid belongs to, where the file records
    /// them (files of organza do): a period includes its empty cells.
    pub extent: Option<(IVec3, IVec3)>,
    /// Store 16-bit floats (not for integers).
    pub half: bool,
    /// The values.
    pub data: Data,
}

impl<T: Value> Cells<T> {
    /// A grid without active cells.
    pub fn new(background: T) -> Cells<T> {
        Cells {
            background,
            leaves: Vec::new(),
            cubes: Vec::new(),
        }
    }

    /// Number of active cells, those in cubes counted one by one.
    pub fn active_count(&self) -> u64 {
        let leaves: u64 = self.leaves.iter().map(Leaf::active_count).sum();
        let cubes = self.cubes.iter().map(|c| (c.edge as u64).pow(3));
        leaves + cubes.sum::<u64>()
    }

    /// Least and greatest active cell; `None` when there is none.
    pub fn active_box(&self) -> Option<(IVec3, IVec3)> {
        let mut bounds: Option<(IVec3, IVec3)> = None;
        let mut grow = |low: IVec3, high: IVec3| {
            let (a, b) = bounds.unwrap_or((low, high));
            bounds = Some((a.min(low), b.max(high)));
        };
        self.for_each_active(|cell, edge, _| grow(cell, cell + (edge - 1)));
        bounds
    }

    /// Calls `visit(least cell, edge, value)` for every active cell (edge 1)
    /// and cube.
    pub fn for_each_active(&self, mut visit: impl FnMut(IVec3, i32, T)) {
        for leaf in &self.leaves {
            for i in (0..512).filter(|i| leaf.mask[i / 64] >> (i % 64) & 1 == 1) {
                let i_cell = i as i32;
                let at = IVec3::new(i_cell >> 6, i_cell >> 3 & 7, i_cell & 7);
                visit(leaf.origin + at, 1, leaf.values[i]);
            }
        }
        for c in &self.cubes {
            visit(c.origin, c.edge, c.value);
        }
    }
}

impl<T> Leaf<T> {
    fn active_count(&self) -> u64 {
        self.mask.iter().map(|m| u64::from(m.count_ones())).sum()
    }
}

impl Data {
    /// Number of active cells.
    pub fn active_count(&self) -> u64 {
        match self {
            Data::Float(c) => c.active_count(),
            Data::Vec3(c) => c.active_count(),
            Data::Int(c) => c.active_count(),
        }
    }

    /// Least and greatest active cell.
    pub fn active_box(&self) -> Option<(IVec3, IVec3)> {
        match self {
            Data::Float(c) => c.active_box(),
            Data::Vec3(c) => c.active_box(),
            Data::Int(c) => c.active_box(),
        }
    }

    /// Least and greatest active value of each component (one or three);
    /// `None` when nothing is active.
    pub fn range(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let mut range: Option<(Vec<f64>, Vec<f64>)> = None;
        let mut see = |v: &[f64]| {
            let (low, high) = range.get_or_insert_with(|| (v.to_vec(), v.to_vec()));
            low.iter_mut().zip(v).for_each(|(a, &b)| *a = a.min(b));
            high.iter_mut().zip(v).for_each(|(a, &b)| *a = a.max(b));
        };
        match self {
            Data::Float(c) => c.for_each_active(|_, _, v| see(&[f64::from(v)])),
            Data::Vec3(c) => c.for_each_active(|_, _, v| see(&v.map(f64::from))),
            Data::Int(c) => c.for_each_active(|_, _, v| see(&[f64::from(v)])),
        }
        range
    }

    /// OpenVDB's name of the values.
    pub fn type_name(&self) -> &'static str {
        match self {
            Data::Float(_) => f32::NAME,
            Data::Vec3(_) => <[f32; 3]>::NAME,
            Data::Int(_) => i32::NAME,
        }
    }
}

impl File {
    /// Describes the grids, and those that could not be read.
    fn describe(&self) -> serde_json::Value {
        let grids = self.grids.iter().map(|g| {
            let (low, high) = g.data.active_box().unwrap_or_default();
            let map = g.mm_from_cell.matrix3;
            json!({
                "name": g.name,
                "type": g.data.type_name(),
                "active_voxels": g.data.active_count(),
                "first_cell": low.to_array(),
                "last_cell": high.to_array(),
                "voxel_mm": [map.x_axis.length(), map.y_axis.length(), map.z_axis.length()],
            })
        });
        let unread = self.unread.iter();
        let unread = unread.map(|(name, why)| json!({ "name": name, "not_read": why }));
        json!({
            "kind": "vdb",
            "grids": grids.collect::<Vec<_>>(),
            "unread": unread.collect::<Vec<_>>(),
        })
    }
}

/// The map of a lattice whose cell (0, 0, 0) has its least corner at `min_mm`.
pub fn mm_from_cell(min_mm: DVec3, voxel_mm: DVec3) -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_diagonal(voxel_mm),
        translation: min_mm + 0.5 * voxel_mm,
    }
}
