//! Micro-flakes of every family: the kernel against the walk.

use crate::kernel::{
    agree, film, kernel, lens, parallel, pictures, samples, scene, settings, sky, vector_backends,
};
use organza_basis::{Rgb, unwatched};
use organza_testing::little_weave;
use organza_transport::*;
use organza_volume::{FibreFootprint, VoxelizeOptions, voxelize};

/// Two materials of other end-on ratios, with these albedos, that cross in the same voxels.
pub(crate) fn cloth(family: FlakeFamily, albedos: [f32; 2]) -> AnyMedium {
    let options = VoxelizeOptions {
        voxel_mm: 0.02,
        levels: Some(2),
        footprint: FibreFootprint::Axis,
        max_memory_bytes: None,
    };
    let octree = voxelize(&little_weave(0.015, 1), &options, &unwatched).unwrap();
    let optics = |albedo: f32, end_on_ratio| FlakeOptics {
        albedo: Rgb::new(albedo, 0.9 * albedo, 0.7 * albedo),
        end_on_ratio,
    };
    let optics = vec![optics(albedos[0], 0.1), optics(albedos[1], 0.4)];
    AnyMedium::FlakeOctree(FlakeOctreeMedium::new(octree, 0, optics, family).unwrap())
}

/// Pictures of the kernel and of the walk; the twin is darker by a tenth.
#[test]
fn the_kernel_agrees_with_the_walk_for_every_family() {
    let flat = Projection::Orthographic { width_mm: 0.3 };
    for family in FlakeFamily::all() {
        for (lit, lights, projection) in [
            ("parallel", parallel(), flat),
            ("sky", sky(), lens()),
            ("picture", vec![pictures::picture()], flat),
        ] {
            let name = format!("seed 9, {family:?}, {lit}");
            let scene_of = |albedos| scene(cloth(family, albedos), lights.clone(), projection);
            let settings = settings(0..samples(), u32::MAX);
            let walked = |scene: &Scene| {
                let made = kernel(scene, &settings, Backend::widest());
                film(scene, &settings, Some(made))
            };
            let cloth = scene_of([0.95, 0.8]);
            let (a, stats) = walked(&cloth);
            let (b, of_walk) = film(&cloth, &settings, None);
            assert_eq!(stats.rejected + stats.majorant_violations, 0, "{name}");
            let (spread, mean) = agree(&a, &b);
            assert!(spread.p_value > 1e-4, "{name}: pixels {spread:?}");
            assert!(mean.p_value > 1e-4, "{name}: mean {mean:?}");
            let per_path = |s: &Stats| s.collisions as f64 / s.paths as f64;
            let (m, n) = (per_path(&stats), per_path(&of_walk));
            assert!((m / n - 1.0).abs() < 0.05, "{name}: {m}, {n} events a path");

            let (twin, _) = walked(&scene_of([0.855, 0.72]));
            let (spread, mean) = agree(&twin, &b);
            let least = spread.p_value.min(mean.p_value);
            // Margin: the probability at which the twin is rejected.
            assert!(least < 1e-9, "{name}: twin {least}");
        }
    }
}

/// What lanes draw is their family's own: its picture is no other's.
#[test]
fn families_are_told_apart() {
    let flat = Projection::Orthographic { width_mm: 0.3 };
    let settings = settings(0..samples(), u32::MAX);
    let walked = |family| {
        let scene = scene(cloth(family, [0.95, 0.8]), parallel(), flat);
        let made = kernel(&scene, &settings, Backend::widest());
        film(&scene, &settings, Some(made)).0
    };
    let named = |name| walked(FlakeFamily::named(name).unwrap());
    let mirrors = named("sggx-specular");
    for other in ["sggx-diffuse", "gaussian-diffuse", "sggx-transmitting"] {
        let (spread, mean) = agree(&named(other), &mirrors);
        let least = spread.p_value.min(mean.p_value);
        // Margin: the probability at which another family is rejected.
        assert!(least < 1e-9, "seed 9: {other} {least}");
    }
}

/// White flakes send all light back, whatever their family; the twin keeps 97 %.
#[test]
fn white_flakes_vanish_under_even_light() {
    let flat = Projection::Orthographic { width_mm: 0.3 };
    let light = Light::from(EnvironmentLight {
        radiance: Rgb::WHITE,
        hemisphere: Hemisphere::All,
    });
    for family in FlakeFamily::all() {
        let shown = |albedo| {
            let scene = scene(cloth(family, [albedo; 2]), vec![light.clone()], flat);
            let settings = settings(0..2 * samples(), u32::MAX);
            let made = kernel(&scene, &settings, Backend::widest());
            let (film, stats) = film(&scene, &settings, Some(made));
            assert!(stats.collisions > stats.paths);
            film.mean()[0]
        };
        // Margin: rounding, and four standard errors.
        let is_white = |(mean, error): (f64, f64)| (mean - 1.0).abs() < 1e-4 + 4.0 * error;
        let (white, twin) = (shown(1.0), shown(0.97));
        assert!(is_white(white), "seed 9: {family:?} {white:?}");
        assert!(!is_white(twin), "seed 9: {family:?} twin {twin:?}");
    }
}

#[test]
fn back_ends_give_the_same_bits_for_every_family() {
    let mut lights = parallel();
    lights.push(pictures::picture());
    for family in FlakeFamily::all() {
        let scene = scene(cloth(family, [0.95, 0.8]), lights.clone(), lens());
        let settings = settings(0..6, 40);
        let of = |backend| film(&scene, &settings, Some(kernel(&scene, &settings, backend)));
        let one = of(Backend::Scalar);
        for backend in vector_backends() {
            assert!(of(backend) == one, "{family:?}, {backend:?}");
        }
    }
}
