//! `object.mesh`: the mesh that a cloth or a volume is laid over.

use crate::build_options::BuildOptions;
use crate::error::{InputError, Result};
use crate::loader::Loader;
use crate::memory::free_memory_bytes;
use crate::read;
use organza_basis::Budget;
use organza_mesh::{Mesh, Placement, Repairs, read_gltf, read_obj, read_ply};
use std::path::Path;

/// Millimetres to a unit of length: glTF prescribes metres, the others nothing.
const GLTF_MM_PER_UNIT: f32 = 1000.0;

/// The largest coordinate of a mesh or of the cloth on it, mm. There `f32`, in which
/// both are kept, has steps of 1 mm, as wide as a coarse thread.
const MAX_MM: f32 = 1e7;

/// Length of cloth on a length of mesh, at most: each millimetre of a ray near the mesh
/// passes that many millimetres of cloth, and takes that many times as long.
const MAX_STRETCH: f32 = 1e3;

/// The keys of an object that name its mesh.
#[derive(Clone, Copy, Debug)]
pub struct MeshKeys<'a> {
    /// `mesh`: the file, relative to the scene.
    pub mesh: Option<&'a str>,
    /// `mm_per_unit`: length of the mesh's units.
    pub mm_per_unit: Option<f32>,
    /// `mm_per_uv`: length of cloth per unit of texture coordinate.
    pub mm_per_uv: Option<f32>,
}

/// The mesh of the scene's object of this index, if it has one.
///
/// # Errors
/// Names the file and what is wrong with it, or the key that is missing.
pub fn mesh(keys: MeshKeys<'_>, index: usize, options: &BuildOptions<'_>) -> Result<Option<Mesh>> {
    let fail = |key: &str, why: &str| {
        InputError::of_key(options.scene_path, format!("object[{index}].{key}"), why)
    };
    let Some(name) = keys.mesh else {
        for (key, given) in [
            ("mm_per_unit", keys.mm_per_unit),
            ("mm_per_uv", keys.mm_per_uv),
        ] {
            if given.is_some() {
                return Err(fail(key, "belongs to a `mesh`, which is not given"));
            }
        }
        return Ok(None);
    };
    let mm_per_uv = keys.mm_per_uv.ok_or_else(|| {
        let why = "is missing: millimetres of cloth per unit of texture coordinate";
        fail("mm_per_uv", why)
    })?;
    let path = read::beside(options.scene_path, name);
    let placement = Placement {
        mm_per_unit: keys.mm_per_unit.unwrap_or_else(|| usual_mm_per_unit(&path)),
        mm_per_uv,
    };
    let allowed = options.max_memory_bytes.unwrap_or_else(free_memory_bytes);
    let mesh = read_mesh(&path, placement, allowed, options.loader);
    mesh.map(Some).map_err(|why| match why {
        NoMesh::File(e) => e,
        NoMesh::Key(key, why) => fail(key, &why),
    })
}

/// Why there is no mesh.
pub enum NoMesh {
    /// The file is at fault.
    File(InputError),
    /// A key of the object is: its name, and what is wrong with it.
    Key(&'static str, String),
}

impl From<InputError> for NoMesh {
    fn from(e: InputError) -> NoMesh {
        NoMesh::File(e)
    }
}

/// A mesh of a file, with at most so many bytes of memory.
///
/// # Errors
/// See [`NoMesh`].
pub fn read_mesh(
    path: &Path,
    placement: Placement,
    max_bytes: u64,
    loader: &Loader<'_>,
) -> std::result::Result<Mesh, NoMesh> {
    for (key, length) in [
        ("mm_per_unit", placement.mm_per_unit),
        ("mm_per_uv", placement.mm_per_uv),
    ] {
        if length > MAX_MM {
            let why = format!("expected at most {MAX_MM:e}, found {length:e}");
            return Err(NoMesh::Key(key, why));
        }
    }
    let bytes = loader.bytes(path)?;
    let budget = &mut Budget::new(max_bytes);
    let mesh = match ending(path).as_str() {
        "obj" => read_obj(&bytes, placement, budget),
        "ply" => read_ply(&bytes, placement, budget),
        "gltf" | "glb" => {
            let open = |uri: &str| loader.bytes_or_why(&read::beside(path, uri));
            read_gltf(&bytes, placement, &open, budget)
        }
        _ => {
            let why = "expected a file .obj, .ply, .gltf or .glb";
            return Err(NoMesh::Key("mesh", why.into()));
        }
    }
    .map_err(|e| InputError::of_file(path, e))?;
    check_size(&mesh).map_err(|(key, why)| NoMesh::Key(key, why))?;
    warn_of_repairs(path, mesh.repairs(), loader);
    Ok(mesh)
}

fn ending(path: &Path) -> String {
    let ending = path.extension().unwrap_or_default();
    ending.to_string_lossy().to_lowercase()
}

/// Length of the units of a mesh whose file does not say it, mm.
pub fn usual_mm_per_unit(path: &Path) -> f32 {
    match ending(path).as_str() {
        "gltf" | "glb" => GLTF_MM_PER_UNIT,
        _ => 1.0,
    }
}

/// Refuses what would take forever, or has no place in `f32`: a key and why.
fn check_size(mesh: &Mesh) -> Result<(), (&'static str, String)> {
    let vertices = || mesh.triangles().iter().flatten();
    let far = |lengths: &mut dyn Iterator<Item = f32>| lengths.fold(0.0, f32::max);
    let mesh_mm = far(&mut vertices().map(|v| v.position_mm.abs().max_element()));
    let cloth_mm = far(&mut vertices().map(|v| v.uv_mm.abs().max_element()));
    for (key, what, reach_mm) in [
        ("mm_per_unit", "the mesh", mesh_mm),
        ("mm_per_uv", "the cloth on it", cloth_mm),
    ] {
        if reach_mm > MAX_MM {
            return Err((
                key,
                format!("{what} reaches {reach_mm:e} mm from the origin; at most {MAX_MM:e} mm"),
            ));
        }
    }
    let (mut cloth_mm2, mut mesh_mm2) = (0.0f64, 0.0f64);
    for [a, b, c] in mesh.triangles() {
        let [u, v] = [b.uv_mm - a.uv_mm, c.uv_mm - a.uv_mm];
        cloth_mm2 += f64::from(u.perp_dot(v).abs());
        let normal = (b.position_mm - a.position_mm).cross(c.position_mm - a.position_mm);
        mesh_mm2 += f64::from(normal.length());
    }
    let stretch = (cloth_mm2 / mesh_mm2).sqrt();
    if stretch > f64::from(MAX_STRETCH) {
        return Err((
            "mm_per_uv",
            format!(
                "lays {stretch:.0} mm of cloth on every millimetre of the mesh; at most \
                 {MAX_STRETCH}"
            ),
        ));
    }
    Ok(())
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
