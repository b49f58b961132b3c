//! File formats of volumes, one file each: [`FORMATS`] lists them.
//!
//! A new format is a file here with a [`Format`] and a line in [`FORMATS`]. What
//! writes volumes, what shows what is in one, and scenes that render them take the
//! formats from that list.

pub mod grid_set;
pub mod nrrd;
pub mod ovox;
pub mod vdb;
pub mod vol;

use self::grid_set::GridSet;
use self::ovox::{SourceFile, Stored};
use crate::{Error, Octree};
use organza_basis::{Aabb, Budget, MergedFlakes, Mixture};
use std::io::Write;

/// Every format, the native one first.
pub static FORMATS: &[&Format] = &[&ovox::FORMAT, &vdb::FORMAT, &vol::FORMAT, &nrrd::FORMAT];

/// One format.
pub struct Format {
    /// How its files end, without a dot, in lower case.
    pub ending: &'static str,
    /// How its files begin.
    pub magic: &'static [u8],
    /// What a file is, in words, with an article.
    pub noun: &'static str,
    /// What it keeps of a voxelized cloth, in a few words.
    pub keeps: &'static str,
    /// What can be chosen in writing it.
    pub options: &'static [WriteOption],
    /// What is in a file, for people and programs.
    pub describe: fn(&Source<'_>, &mut Budget) -> Result<serde_json::Value, Error>,
    /// Reads a volume to render.
    pub read: fn(&Source<'_>, &mut Budget) -> Result<Volume, Error>,
    /// What to write of an octree: the files, none of them written yet.
    pub write: for<'a> fn(&'a Voxels<'a>) -> Result<Vec<Part<'a>>, Error>,
}

/// The format of a file of this name, by its ending.
pub fn by_name(name: &str) -> Option<&'static Format> {
    let (_, ending) = name.rsplit_once('.')?;
    let mut formats = FORMATS.iter().copied();
    formats.find(|f| f.ending.eq_ignore_ascii_case(ending))
}

/// The format of a file that begins like this.
pub fn by_magic(bytes: &[u8]) -> Option<&'static Format> {
    let mut formats = FORMATS.iter().copied();
    formats.find(|f| bytes.starts_with(f.magic))
}

/// Something to choose in writing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteOption {
    /// Which level of detail: the format holds one.
    Level,
    /// Floats of 16 bits.
    Half,
    /// No compression.
    Raw,
    /// Where the length of thick fibres lies: the format keeps populations.
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
    /// What the cloth was made from, for formats that keep it.
    pub files: &'a [SourceFile],
    /// A mixture as one population, for formats that hold only one.
    pub merge: &'a dyn Fn(&Mixture) -> MergedFlakes,
}

/// What writes one file.
pub type WritePart<'a> = Box<dyn FnOnce(&mut dyn Write) -> Result<(), Error> + 'a>;

/// One of the files that a volume is written to.
pub struct Part<'a> {
    /// Stands before the ending: `sggx` of `tile.sggx.vol`. `None` where the file
    /// has the very name that was asked for.
    pub infix: Option<&'static str>,
    /// Writes it.
    pub write: WritePart<'a>,
}

/// What a file holds that can be rendered.
#[derive(Clone, Debug)]
pub enum Volume {
    /// Fibre mixtures at several levels.
    Octree(Stored),
    /// Dense grids.
    Grids(GridSet),
}

/// A box in a description.
pub(crate) fn box_of(b: &Aabb) -> serde_json::Value {
    serde_json::json!({ "min_mm": b.min.to_array(), "max_mm": b.max.to_array() })
}

/// Gives the bytes of a file of a folder by its name, of at most so many bytes:
/// `None` when there is none of that name, and else the reason why it cannot be read.
pub type Open<'a> = dyn Fn(&str, u64) -> Result<Option<Vec<u8>>, String> + 'a;

/// Where a volume is read from.
pub struct Source<'a> {
    /// Name of the file, without its folder.
    pub name: &'a str,
    /// Opens files of that folder.
    pub open: &'a Open<'a>,
}

impl Source<'_> {
    /// Decodes the file itself.
    ///
    /// # Errors
    /// When it is not there or cannot be read, and those of `decode`.
    pub fn read<T>(
        &self,
        budget: &mut Budget,
        decode: impl FnOnce(&[u8], &mut Budget) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.read_beside(self.name, budget, decode)?
            .ok_or_else(|| Error::Unreadable("no such file".into()))
    }

    /// Decodes a file beside it, if there is one. Its bytes are charged while it is
    /// decoded.
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
