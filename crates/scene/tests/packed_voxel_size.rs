//! The edge of voxels for packed fibres: one fibre radius, more where a thick cloth would have
//! too many of them, and refused with one that works where the user's is too small.

use organza_scene::fabric_file::{self, Fabric};
use organza_scene::loader::Loader;
use organza_volume::FibreFootprint;
use std::path::{Path, PathBuf};

fn fabric(name: &str) -> (PathBuf, Fabric) {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/fabrics/");
    let path = Path::new(folder).join(name).with_extension("toml");
    let fabric = fabric_file::load(&path, &[], &Loader::new()).unwrap();
    (path, fabric)
}

/// Edge of voxels in um, or why there are none.
fn edge_um(
    (path, fabric): &(PathBuf, Fabric),
    voxel_um: Option<f32>,
    max_mib: u64,
) -> Result<f32, String> {
    let plan = fabric.plan(
        path,
        FibreFootprint::Axis,
        voxel_um,
        None,
        Some(max_mib << 20),
    );
    plan.map(|p| p.voxel_mm() * 1e3).map_err(|e| e.to_string())
}

/// Thick pile gets larger voxels, thin cloth does not.
#[test]
fn voxels_of_thick_cloth_are_larger_than_a_fibre_radius() {
    let (velvet, denim) = (fabric("pile/velvet"), fabric("denim"));
    let edge = edge_um(&denim, None, 4096).unwrap();
    assert!((edge - 8.0).abs() < 4.0 * f32::EPSILON, "{edge} um");
    let edge = edge_um(&velvet, None, 4096).unwrap();
    // Radii of 6.5 and 6 um.
    assert!((7.5..9.0).contains(&edge), "{edge} um");
}

/// A refusal names an edge that is accepted.
#[test]
fn too_small_voxels_are_refused_with_an_edge_that_works() {
    let velvet = fabric("pile/velvet");
    let refusal = edge_um(&velvet, Some(0.5), 512).unwrap_err();
    let found = refusal.split("at least ").nth(1).unwrap();
    let least: f32 = found.split(' ').next().unwrap().parse().unwrap();
    assert!(edge_um(&velvet, Some(least), 512).is_ok(), "{refusal}");
    assert!(
        edge_um(&velvet, Some(least - 1.5), 512).is_err(),
        "{refusal}"
    );
}
