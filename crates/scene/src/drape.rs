//! `object.mesh`: the mesh that a cloth is laid over.

use crate::error::{Result, input};
use crate::loader::Loader;
use crate::memory::free_memory_bytes;
use crate::read;
use crate::scene_build::BuildOptions;
use crate::scene_file::ClothTable;
use organza_basis::Budget;
use organza_mesh::{Mesh, Placement, Repairs, read_gltf, read_obj, read_ply};
use std::path::Path;

/// Millimetres to a unit of length: glTF prescribes metres, the others nothing.
const GLTF_MM_PER_UNIT: f32 = 1000.0;

/// The mesh of the cloth that is a scene's object of this index, if it has one.
///
/// # Errors
/// Names the file and what is wrong with it, or the key that is missing.
pub fn mesh(table: &ClothTable, index: usize, options: &BuildOptions<'_>) -> Result<Option<Mesh>> {
    let fail = |key: &str, why: &str| {
        input(format!(
            "{}: object[{index}].{key}: {why}",
            options.scene_path.display()
        ))
    };
    let Some(name) = &table.mesh else {
        for (key, given) in [
            ("mm_per_unit", table.mm_per_unit),
            ("mm_per_uv", table.mm_per_uv),
        ] {
            if given.is_some() {
                return Err(fail(key, "belongs to a `mesh`, which is not given"));
            }
        }
        return Ok(None);
    };
    let mm_per_uv = table.mm_per_uv.ok_or_else(|| {
        let why = "is missing: millimetres of cloth per unit of texture coordinate";
        fail("mm_per_uv", why)
    })?;
    let path = read::beside(options.scene_path, name);
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let placement = Placement {
        mm_per_unit: table.mm_per_unit.unwrap_or(match ending.as_str() {
            "gltf" | "glb" => GLTF_MM_PER_UNIT,
            _ => 1.0,
        }),
        mm_per_uv,
    };
    let loader = options.loader;
    let bytes = loader.bytes(&path)?;
    let allowed = options.max_memory_bytes.unwrap_or_else(free_memory_bytes);
    let budget = &mut Budget::new(allowed);
    let mesh = match ending.as_str() {
        "obj" => read_obj(&bytes, placement, budget),
        "ply" => read_ply(&bytes, placement, budget),
        "gltf" | "glb" => {
            let open = |uri: &str| loader.bytes_or_why(&read::beside(&path, uri));
            read_gltf(&bytes, placement, &open, budget)
        }
        _ => return Err(fail("mesh", "expected a file .obj, .ply, .gltf or .glb")),
    }
    .map_err(|e| input(format!("{}: {e}", path.display())))?;
    warn_of_repairs(&path, mesh.repairs(), loader);
    Ok(Some(mesh))
}

fn warn_of_repairs(path: &Path, repairs: Repairs, loader: &Loader<'_>) {
    for (count, what) in [
        (repairs.dropped_faces, "faces without area left out"),
        (repairs.computed_normals, "normals computed from faces"),
        (
            repairs.collapsed_uv,
            "faces without texture area laid out flat",
        ),
        (repairs.mirrored_uv, "faces with mirrored texture"),
    ] {
        if count > 0 {
            loader.warn(path, format!("{count} {what}"));
        }
    }
}
