//! The lights of a scene, with the pictures that they name.

use crate::error::{InputError, Result};
use crate::loader::Loader;
use crate::{environment_file, read};
use organza_light::{Light, LightTable, LoadedPicture};
use std::cell::Cell;
use std::path::Path;

/// The lights that the `[[light]]` tables of a scene file describe, with the pictures that they name.
///
/// # Errors
/// Names the file and key at fault; a picture that takes more memory than allowed.
pub fn lights(
    tables: &[LightTable],
    scene_path: &Path,
    max_memory_bytes: Option<u64>,
    loader: &Loader<'_>,
) -> Result<Vec<Light>> {
    let built = tables.iter().enumerate().map(|(i, table)| {
        let is_missing = Cell::new(false);
        let load = |name: &str| {
            let path = read::beside(scene_path, name);
            let decoded = environment_file::decode(&path, max_memory_bytes, loader);
            let (size, pixels) = decoded.map_err(|e| {
                is_missing.set(e.is_missing);
                e.to_string()
            })?;
            Ok(LoadedPicture {
                name: path.display().to_string(),
                size,
                pixels,
            })
        };
        table.build(&load).map_err(|e| InputError {
            is_missing: is_missing.get(),
            ..InputError::of_key(scene_path, format!("light[{i}]"), e)
        })
    });
    built.collect()
}
