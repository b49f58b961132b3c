//! File formats of volumes, one file each: [`FORMATS`] lists them.
//!
//! A new format is a file in this folder with a [`Format`] and a line in [`FORMATS`].
//! `voxelize`, `info` and scenes that render volumes take the formats from that list.

pub mod grid_set;
pub mod nrrd;
pub mod ovox;
pub mod vdb;
pub mod vol;

use self::grid_set::GridSet;
use self::ovox::{SourceFile, Stored};
use crate::{Error, Octree};
use glam::UVec3;
use organza_basis::{Aabb, Budget, MergedFlakes, Mixture};
use serde_json::{Value, json};
use std::io::Write;

/// Every format, the native one first.
pub static FORMATS: &[&Format] = &[&ovox::FORMAT, &vdb::FORMAT, &vol::FORMAT, &nrrd::FORMAT];

/// One format.
pub struct Format {
    /// The ending of its files, without a dot, in lower case.
    pub ending: &'static str,
    /// The first bytes of its files.
    pub magic: &'static [u8],
    /// A noun for a file, with an article.
    pub noun: &'static str,
    /// The part of a voxelized cloth that it keeps, in a few words.
    pub keeps: &'static str,
    /// The options for writing it.
    pub options: &'static [WriteOption],
    /// Describes the contents of a file, for `info`.
    pub describe: fn(&Source<'_>, &mut Budget) -> Result<Value, Error>,
    /// Reads a volume to render.
    pub read: fn(&Source<'_>, &mut Budget) -> Result<Volume, Error>,
    /// Memory that [`Format::write`] and its files take for an octree, bytes. Where nothing
    /// grows with the voxels it is zero.
    pub write_memory_bytes: fn(&Octree, u8) -> u64,
    /// The files to write for an octree; none of them is written yet.
    pub write: for<'a> fn(&'a Voxels<'a>) -> Result<Vec<Part<'a>>, Error>,
}

/// The format of a file by the ending of its name.
pub fn by_name(name: &str) -> Option<&'static Format> {
    let (_, ending) = name.rsplit_once('.')?;
    let mut formats = FORMATS.iter().copied();
    formats.find(|f| f.ending.eq_ignore_ascii_case(ending))
}

/// The format of a file by its first bytes.
pub fn by_magic(bytes: &[u8]) -> Option<&'static Format> {
    let mut formats = FORMATS.iter().copied();
    formats.find(|f| bytes.starts_with(f.magic))
}

/// An option for writing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteOption {
    /// The level of detail, for formats that hold one.
    Level,
    /// Floats of 16 bits.
    Half,
    /// No compression.
    Raw,
    /// Which voxels receive the length of thick fibres, for formats that keep populations.
    Footprint,
}

/// A volume to write, and how.
pub struct Voxels<'a> {
    /// The cloth.
    pub octree: &'a Octree,
    /// Level of detail, below [`Octree::level_count`]; 0 is the finest.
    pub level: u8,
    /// Floats of 16 bits.
    pub half: bool,
    /// No compression.
    pub raw: bool,
    /// The files that the cloth was made from, for formats that keep them.
    pub files: &'a [SourceFile],
    /// A mixture as one population, for formats that hold only one.
    pub merge: &'a dyn Fn(&Mixture) -> MergedFlakes,
}

/// Writes one file.
pub type WritePart<'a> = Box<dyn FnOnce(&mut dyn Write) -> Result<(), Error> + 'a>;

/// One of the files of a volume.
pub struct Part<'a> {
    /// The part of the name before the ending: `sggx` in `tile.sggx.vol`. `None` where the file
    /// has exactly the requested name.
    pub infix: Option<&'static str>,
    /// Writes it.
    pub write: WritePart<'a>,
}

/// The renderable contents of a file.
#[derive(Clone, Debug)]
pub enum Volume {
    /// Fibre mixtures at several levels.
    Octree(Stored),
    /// Dense grids.
    Grids(GridSet),
}

/// A box in a description.
pub(crate) fn box_of(b: &Aabb) -> Value {
    json!({ "min_mm": b.min.to_array(), "max_mm": b.max.to_array() })
}

/// A grid of values, channel fastest, of which there are `channels`: size, box and the range of
/// each channel.
fn described(kind: &str, channels: Value, data: &[f32], dims: UVec3, bounds_mm: &Aabb) -> Value {
    let count = data.len() / dims.as_usizevec3().element_product();
    let range = |c: usize| {
        let values = data.iter().skip(c).step_by(count);
        let (lo, hi) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &v| {
            (lo.min(v), hi.max(v))
        });
        json!([lo, hi])
    };
    json!({
        "kind": kind,
        "resolution": dims.to_array(),
        "channels": channels,
        "box": box_of(bounds_mm),
        "voxel_mm": (bounds_mm.size() / dims.as_vec3()).to_array(),
        "range": (0..count).map(range).collect::<Vec<_>>(),
    })
}

/// Reads a file of a folder by its name, up to a number of bytes. `None` when there is no such
/// file; an error gives the reason why it cannot be read.
pub type Open<'a> = dyn Fn(&str, u64) -> Result<Option<Vec<u8>>, String> + 'a;

/// The source of a volume.
pub struct Source<'a> {
    /// Name of the file, without its folder.
    pub name: &'a str,
    /// Opens files of that folder.
    pub open: &'a Open<'a>,
}

impl Source<'_> {
    /// Decodes the file itself.
    ///
    /// # Errors When the file does not exist or cannot be read, and those of `decode`.
    pub fn read<T>(
        &self,
        budget: &mut Budget,
        decode: impl FnOnce(&[u8], &mut Budget) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.read_beside(self.name, budget, decode)?
            .ok_or_else(|| Error::Unreadable("no such file".into()))
    }

    /// Decodes another file of the folder, if it exists. Its bytes are charged to the budget
    /// while it is decoded.
    ///
    /// # Errors
    /// When it cannot be read or is larger than the budget, and those of `decode`.
    pub fn read_beside<T>(
        &self,
        name: &str,
        budget: &mut Budget,
        decode: impl FnOnce(&[u8], &mut Budget) -> Result<T, Error>,
    ) -> Result<Option<T>, Error> {
        let opened = (self.open)(name, budget.left()).map_err(Error::Unreadable)?;
        let Some(bytes) = opened else {
            return Ok(None);
        };
        budget.take(bytes.len() as u64, "bytes")?;
        let decoded = decode(&bytes, budget);
        budget.give_back(bytes.len() as u64);
        decoded.map(Some)
    }
}
