//! Tables of lights that lanes could not address: they look words up by signed numbers of 32
//! bits, so that tables of 2^31 words are refused before they are made.

use crate::kernel::{FLAT, scene, settings};
use crate::scenes::sun;
use glam::{UVec3, Vec3};
use organza_basis::{Aabb, Sym3, warp};
use organza_kernel::Refusal;
use organza_transport::*;

/// Voxels along an edge. Matter this dense has 27 nodes in a voxel.
const EDGE: u32 = 40;
const WORDS_OF_A_LIGHT: u64 = 27 * (EDGE * EDGE * EDGE) as u64;

/// A cube of dense matter under so many parallel lights.
fn lit_by(lights: u64) -> Scene {
    let dims = UVec3::splat(EDGE);
    let voxels = dims.element_product() as usize;
    let medium = GridMedium::new(
        Aabb::new(Vec3::ZERO, Vec3::ONE),
        false,
        Interpolation::Nearest,
        Grid::new(dims, vec![[400.0]; voxels]).unwrap(),
        Grid::constant(Sym3::axial(Vec3::X, 1.0, 0.3).to_array()),
        Grid::constant([0.5; 3]),
    );
    let light = |i| {
        let angle_rad = 0.3 + 1e-3 * i as f32;
        sun(-warp::direction_from_angles(0.5, angle_rad), 1.0)
    };
    let lights = (0..lights).map(light).collect();
    scene(AnyMedium::Grid(medium.unwrap()), lights, FLAT)
}

#[test]
fn tables_too_long_to_be_addressed_are_refused() {
    let settings = settings(0..1, u32::MAX);
    let most = (1u64 << 31) / WORDS_OF_A_LIGHT;
    let refused = flatten(&lit_by(most + 1), &settings, u64::MAX);
    let Err(KernelRefusal::Kernel(Refusal::Words(words))) = refused else {
        panic!("tables of more than 2^31 words were made");
    };
    assert_eq!(words, (most + 1) * WORDS_OF_A_LIGHT);
    // Tables of few lights are made; as long as the refusal counts them.
    let flat = flatten(&lit_by(2), &settings, u64::MAX).unwrap();
    let bytes = flat.memory_bytes();
    assert!(bytes >= 4 * 2 * WORDS_OF_A_LIGHT, "{bytes}");
}
