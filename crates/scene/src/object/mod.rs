//! The kinds of object that a scene file can name, one file each, and the
//! `[[object]]` table that names one.
//!
//! A kind is the type of its table, which implements [`ObjectKind`], and one line in
//! the list at the end of this file.

mod cloth;
mod grid;
mod laying;
mod plane;
mod volume;

pub use cloth::ClothTable;
pub use grid::{AlbedoValue, GridTable, InterpolationName};
pub use plane::PlaneTable;
pub use volume::{VolumeMaterials, VolumeTable};

use crate::build_options::BuildOptions;
use crate::error::{InputError, Result};
use crate::loader::Loader;
use organza_basis::Budget;
use organza_transport::{AnyMedium, Camera};
use serde::Deserialize;
use std::path::Path;

/// Where an object stands in a scene file.
#[derive(Clone, Copy, Debug)]
pub struct At<'a> {
    /// Which of the scene's objects, from 0.
    pub index: usize,
    /// Whether every cloth is shown as explicit fibres.
    pub as_fibres: bool,
    /// The scene file; paths are relative to its folder.
    pub scene_path: &'a Path,
    /// Opens the files that the scene names.
    pub loader: &'a Loader<'a>,
}

impl At<'_> {
    /// An error of the object: `.key: why`, or `: why` of the object as a whole.
    pub fn fail(&self, why: impl AsRef<str>) -> InputError {
        let key = format!("object[{}]{}", self.index, why.as_ref());
        InputError::keyed(key).in_file(self.scene_path)
    }
}

/// One kind of object, as an `[[object]]` table describes it. The type's own keys are
/// those of the table.
pub trait ObjectKind {
    /// Refuses what can be refused without reading a file.
    ///
    /// # Errors
    /// Names the scene and the key at fault.
    fn check(&self, at: &At<'_>) -> Result<()>;

    /// Where it ends: x and y of two corners, mm; without end if none.
    fn extent_mm(&self) -> Option<[f32; 4]> {
        None
    }

    /// Whether it sends out light.
    fn shines(&self) -> bool {
        false
    }

    /// What it is, for people and programs, but for its kind. Everything is read that
    /// can be without making voxels.
    ///
    /// # Errors
    /// Those of [`ObjectKind::media`].
    fn describe(&self, at: &At<'_>, options: &BuildOptions<'_>) -> Result<serde_json::Value>;

    /// The media that `camera` sees: one, and those that lie on it. Grids are charged to `budget`.
    ///
    /// # Errors
    /// Names the file and the key at fault.
    fn media(
        &self,
        at: &At<'_>,
        camera: &Camera,
        options: &BuildOptions<'_>,
        budget: &mut Budget,
    ) -> Result<Vec<AnyMedium>>;
}

macro_rules! objects {
    ($($variant:ident($table:ty) = $name:literal,)*) => {
        /// An `[[object]]` table: the key `kind` and the keys of that kind.
        #[derive(Clone, Debug, Deserialize)]
        #[serde(tag = "kind")]
        pub enum ObjectTable {
            $(
                #[doc = concat!("`kind = \"", $name, "\"`.")]
                #[serde(rename = $name)]
                $variant($table),
            )*
        }

        impl ObjectTable {
            /// Its kind, as files name it.
            pub fn kind(&self) -> &'static str {
                match self { $(ObjectTable::$variant(_) => $name,)* }
            }

            fn described(&self) -> &dyn ObjectKind {
                match self { $(ObjectTable::$variant(table) => table,)* }
            }
        }
    };
}

impl ObjectTable {
    /// Refuses what can be refused without reading a file.
    ///
    /// # Errors
    /// As [`ObjectKind::check`].
    pub fn check(&self, at: &At<'_>) -> Result<()> {
        self.described().check(at)
    }

    /// Where it ends: x and y of two corners, mm; without end if none.
    pub fn extent_mm(&self) -> Option<[f32; 4]> {
        self.described().extent_mm()
    }

    /// Whether it sends out light.
    pub fn shines(&self) -> bool {
        self.described().shines()
    }

    /// What it is, for people and programs.
    ///
    /// # Errors
    /// As [`ObjectKind::describe`].
    pub fn describe(&self, at: &At<'_>, options: &BuildOptions<'_>) -> Result<serde_json::Value> {
        let mut about = self.described().describe(at, options)?;
        about["kind"] = self.kind().into();
        Ok(about)
    }

    /// The media that `camera` sees. Grids are charged to `budget`.
    ///
    /// # Errors
    /// As [`ObjectKind::media`].
    pub fn media(
        &self,
        at: &At<'_>,
        camera: &Camera,
        options: &BuildOptions<'_>,
        budget: &mut Budget,
    ) -> Result<Vec<AnyMedium>> {
        self.described().media(at, camera, options, budget)
    }
}

objects! {
    Grid(GridTable) = "grid",
    Cloth(ClothTable) = "cloth",
    Volume(VolumeTable) = "volume",
    Plane(PlaneTable) = "plane",
}
