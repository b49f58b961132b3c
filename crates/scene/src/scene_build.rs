//! From a scene file to media, lights and a camera.

use crate::build_options::BuildOptions;
use crate::camera::{CameraTable, of_a_goniometer};
use crate::error::{InputError, Result};
use crate::light_pictures;
use crate::loader::Loader;
use crate::memory::free_memory_bytes;
use crate::object::{At, ObjectTable};
use crate::scene_file::{IntegratorName, SceneFile};
use glam::Vec2;
use organza_basis::Budget;
use organza_transport::{Camera, Scene};
use std::path::Path;

/// Refuses what can be checked without reading or voxelizing anything.
///
/// # Errors
/// Names the file and key at fault.
pub fn check(file: &SceneFile, scene_path: &Path, loader: &Loader<'_>) -> Result<()> {
    camera(file, scene_path)?;
    let as_fibres = file.render.integrator == IntegratorName::Fibres;
    for (index, table) in file.object.iter().enumerate() {
        let at = At {
            index,
            as_fibres,
            scene_path,
            loader,
        };
        table.check(&at)?;
        if let Some([x0, y0, x1, y1]) = table.extent_mm()
            && !(x0 < x1 && y0 < y1)
        {
            return Err(at.fail(format!(
                ": extent_mm: expected x0, y0, x1, y1 with x0 < x1 and y0 < y1, \
                 found {x0}, {y0}, {x1}, {y1}"
            )));
        }
    }
    Ok(())
}

/// The camera of a scene; that of a goniometer if it has none.
///
/// # Errors
/// Names the file and key at fault.
pub fn camera(file: &SceneFile, scene_path: &Path) -> Result<Camera> {
    let table = file.camera.as_ref();
    table
        .map_or_else(of_a_goniometer, CameraTable::build)
        .map_err(|why| InputError::of_key(scene_path, "camera", why))
}

/// Warns of a scene whose picture is black but for what its channels know of the
/// cloth, or shows lights alone: both can be meant.
pub fn warn_of_emptiness(file: &SceneFile, scene_path: &Path, loader: &Loader<'_>) {
    if file.object.is_empty() {
        loader.warn(scene_path, "there is no [[object]]");
    }
    if file.light.is_empty() && !file.object.iter().any(ObjectTable::shines) {
        loader.warn(scene_path, "there is no [[light]]");
    }
}

/// Builds everything a scene file describes.
///
/// # Errors
/// Names the file and key at fault.
pub fn scene(file: &SceneFile, options: &BuildOptions<'_>) -> Result<Scene> {
    check(file, options.scene_path, options.loader)?;
    let camera = camera(file, options.scene_path)?;
    let lights = light_pictures::lights(
        &file.light,
        options.scene_path,
        options.max_memory_bytes,
        options.loader,
    )?;
    let as_fibres = file.render.integrator == IntegratorName::Fibres;
    let mut media = Vec::new();
    let allowed = options.max_memory_bytes.unwrap_or_else(free_memory_bytes);
    let mut budget = Budget::new(allowed);
    for (index, table) in file.object.iter().enumerate() {
        let at = At {
            index,
            as_fibres,
            scene_path: options.scene_path,
            loader: options.loader,
        };
        for mut medium in table.media(&at, &camera, options, &mut budget)? {
            if let Some([x0, y0, x1, y1]) = table.extent_mm() {
                let (min, max) = (Vec2::new(x0, y0), Vec2::new(x1, y1));
                medium.cut_to(min, max).ok_or_else(|| {
                    at.fail(": extent_mm: expected x0, y0, x1, y1 with x0 < x1 and y0 < y1")
                })?;
            }
            media.push(medium);
        }
    }
    Ok(Scene {
        media,
        lights,
        camera,
    })
}
