//! The table of a fabric: the mean BSDF of its cloth, in a file beside it.

use crate::cloth_place::FarSheet;
use crate::error::{InputError, Result};
use crate::fabric_file::Fabric;
use crate::loader::Loader;
use glam::Vec2;
use organza_basis::SegmentSource;
use organza_surface::ClothSurface;
use organza_surface::table::{FarTable, MAX_FILE_BYTES, is_table, read_table};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// The ending of tables.
pub const ENDING: &str = "bsdf";
/// The key of a table's description that holds the [digest](Fabric::look_digest) of its fabric.
pub const FABRIC_KEY: &str = "fabric_digest";

/// The key of a description that holds that of the texture.
pub const TEXTURE_KEY: &str = "texture";
/// Its key for errors in pixels of several widths.
pub const PIXELS_KEY: &str = "pixels";
/// The width of a pixel, mm.
pub const PIXEL_KEY: &str = "pixel_mm";
/// An upper end of the error of the table with texture there, a share of the root mean square
/// value; null where it was not measured.
pub const ERROR_KEY: &str = "error_at_most";
/// With `lod = "auto"`, a table with texture is seen where its error is at most this.
const TOLERATED: f64 = 0.05;

/// Where the table of a fabric file is.
pub fn beside(fabric: &Path) -> PathBuf {
    fabric.with_extension(ENDING)
}

/// Whether there is a table beside a fabric file.
pub(crate) fn is_there(_: &Fabric, path: &Path, loader: &Loader<'_>) -> bool {
    loader.unreachable(&beside(path)).is_none()
}

/// A table and its description.
///
/// # Errors
/// Names the file, and what is wrong with it.
pub fn read(path: &Path, loader: &Loader<'_>) -> Result<(FarTable, Value)> {
    let fail = |why: String| InputError::of_file(path, why);
    if let Some(found) = loader.file_bytes(path).filter(|n| *n > MAX_FILE_BYTES) {
        return Err(fail(format!(
            "has {found} bytes; expected a table of organza, which has at most {MAX_FILE_BYTES}"
        )));
    }
    let bytes = loader.bytes(path)?;
    if !is_table(&bytes) {
        return Err(fail(
            "is not a table of organza; expected a file that `organza table` wrote (files of \
             `measure --layout rgl` end in .bsdf, too, and are for other programs)"
                .into(),
        ));
    }
    read_table(&bytes).map_err(|why| fail(why.to_string()))
}

impl Fabric {
    /// SHA-256, in hexadecimal, of all that the look of the cloth depends on: yarns, weave,
    /// optics and the files that these name, but not the sections `[surface]`,
    /// `[scattering]` and `[voxel]`, which are about representations of the cloth.
    pub fn look_digest(&self) -> String {
        const APART: [&str; 4] = ["name", "surface", "scattering", "voxel"];
        let mut digest = Sha256::new();
        for (index, file) in self.sources().iter().enumerate() {
            let text = std::str::from_utf8(&file.bytes).ok();
            let table = text.filter(|_| index == 0);
            match table.and_then(|t| t.parse::<toml::Table>().ok()) {
                Some(mut table) => {
                    table.retain(|key, _| !APART.contains(&key));
                    digest.update(table.to_string());
                }
                None => {
                    digest.update((file.name.len() as u64).to_le_bytes());
                    digest.update(&file.name);
                    digest.update(&file.bytes);
                }
            }
        }
        // Those of a scene precede those of the file.
        let own = self.optics.len().saturating_sub(1);
        for optics in self.optics.iter().take(own).filter(|o| !o.is_empty()) {
            digest.update(format!("{optics:?}"));
        }
        let bytes = digest.finalize();
        bytes.iter().map(|b| format!("{b:02x}")).collect()
    }
}

/// Whether a table was made of a fabric as it is now.
fn is_of(about: &Value, fabric: &Fabric) -> bool {
    about.get(FABRIC_KEY).and_then(Value::as_str) == Some(&fabric.look_digest())
}

/// What a cloth is from afar, if there is anything: the table beside its fabric, else its
/// surface model. A table of another state of the fabric is left out with a warning.
///
/// # Errors
/// A table that cannot be read, a surface model without a repeat.
pub(crate) fn far_sheet<'a>(
    fabric: &'a Fabric,
    path: &'a Path,
    loader: &Loader<'_>,
) -> Result<Option<FarSheet<'a>>> {
    if let Some(table) = far_table(fabric, path, loader)? {
        return Ok(Some(table.into()));
    }
    if fabric.file.surface.is_none() {
        return Ok(None);
    }
    Ok(Some(FarSheet {
        repeat_mm: fabric.surface_repeat_mm(path)?,
        surface: Box::new(|| fabric.surface(path)),
    }))
}

/// The table beside a fabric, if it is there and of this fabric as it is.
///
/// # Errors
/// A table that cannot be read.
pub(crate) fn far_table(
    fabric: &Fabric,
    path: &Path,
    loader: &Loader<'_>,
) -> Result<Option<ClothSurface>> {
    if !is_there(fabric, path, loader) {
        return Ok(None);
    }
    let file = beside(path);
    let (table, about) = read(&file, loader)?;
    if is_of(&about, fabric) {
        let surface = cloth_surface(fabric, table);
        let repeat_mm = match good_from_mm(&about) {
            // Half of what is called the repeat is where the change begins.
            Some(from_mm) => surface.repeat_mm.min(2.0 * from_mm),
            None => surface.repeat_mm,
        };
        return Ok(Some(ClothSurface {
            repeat_mm,
            ..surface
        }));
    }
    loader.warn(&file, stale(path) + "; lod = \"auto\" leaves it out");
    Ok(None)
}

/// The narrowest of the measured pixels from which on the error is tolerated, mm.
fn good_from_mm(about: &Value) -> Option<f32> {
    let number = |pixel: &Value, key: &str| pixel.get(key).and_then(Value::as_f64);
    let pixels = about.get(TEXTURE_KEY)?.get(PIXELS_KEY)?.as_array()?;
    let measured = pixels.iter().rev();
    let good = measured.take_while(|p| number(p, ERROR_KEY).is_some_and(|e| e <= TOLERATED));
    let narrowest = good.last().and_then(|p| number(p, PIXEL_KEY));
    narrowest.map(|mm| mm as f32).filter(|mm| *mm > 0.0)
}

fn stale(fabric: &Path) -> String {
    let fabric = fabric.display();
    format!("was made of {fabric} with other yarns, optics or files")
}

/// The surface of the table beside a fabric. A table of another state of the fabric is a
/// warning.
///
/// # Errors
/// No table, or one that cannot be read.
pub(crate) fn surface(fabric: &Fabric, path: &Path, loader: &Loader<'_>) -> Result<ClothSurface> {
    let file = beside(path);
    if loader.unreachable(&file).is_some() {
        return Err(InputError::of_file(
            path,
            format!(
                "has no table beside it, which model = \"table\" needs; make it by: organza table \
                 {} -o {}",
                path.display(),
                file.display()
            ),
        ));
    }
    let (table, about) = read(&file, loader)?;
    if !is_of(&about, fabric) {
        loader.warn(&file, stale(path) + "; organza table makes it anew");
    }
    Ok(cloth_surface(fabric, table))
}

fn cloth_surface(fabric: &Fabric, table: FarTable) -> ClothSurface {
    let size = fabric.cloth.tile().bounds_mm.size();
    ClothSurface {
        surface: Box::new(table),
        origin_mm: Vec2::ZERO,
        repeat_mm: size.truncate().max_element(),
    }
}
