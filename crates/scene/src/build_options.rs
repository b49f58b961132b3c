//! What building a scene, or an object of it, needs besides the tables of its file.

use crate::loader::Loader;
use std::path::Path;

/// What building a scene needs besides the file.
pub struct BuildOptions<'a> {
    /// Where the scene file is: paths inside are relative to its folder.
    pub scene_path: &'a Path,
    /// Opens the files that the scene names.
    pub loader: &'a Loader<'a>,
    /// Limit on memory; what is free if none.
    pub max_memory_bytes: Option<u64>,
}
