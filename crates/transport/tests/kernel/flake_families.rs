//! Micro-flakes of every family: the kernel against the walk.

use crate::kernel::{
    FLAT, assert_agree, assert_back_ends_alike, assert_same_events, by_kernel, least_p, lens,
    parallel, pictures, samples, scene, settings, sky, walked,
};
use crate::scenes::{octree, white_sky};
use organza_basis::Rgb;
use organza_testing::{little_weave, sized};
use organza_transport::*;

/// Two materials of other end-on ratios, with these albedos, that cross in the same voxels.
pub(crate) fn cloth(family: FlakeFamily, albedos: [f32; 2]) -> AnyMedium {
    let octree = octree(&little_weave(0.015, 1), 0.02, 2);
    let optics = |albedo: f32, end_on_ratio| {
        FlakeOptics::new(Rgb::new(albedo, 0.9 * albedo, 0.7 * albedo), end_on_ratio)
    };
    let optics = vec![optics(albedos[0], 0.1), optics(albedos[1], 0.4)];
    AnyMedium::FlakeOctree(FlakeOctreeMedium::new(octree, 0, optics, family).unwrap())
}

/// Pictures of the kernel and of the walk; the twin is darker by a tenth.
#[test]
fn the_kernel_agrees_with_the_walk_for_every_family() {
    for (i, family) in FlakeFamily::all().enumerate() {
        let lit = [
            ("parallel", parallel(), FLAT),
            ("sky", sky(), lens()),
            ("picture", vec![pictures::picture()], FLAT),
        ];
        let each = sized(3, 1);
        for (lit, lights, projection) in lit.into_iter().skip(i % each).step_by(each) {
            let name = format!("{family:?}, {lit}");
            let scene_of = |albedos| scene(cloth(family, albedos), lights.clone(), projection);
            let settings = settings(0..sized(512, 65_536), u32::MAX);
            let cloth = scene_of([0.95, 0.8]);
            let (a, stats) = by_kernel(&cloth, &settings);
            let (b, of_walk) = walked(&cloth, &settings);
            assert_eq!(stats.rejected + stats.majorant_violations, 0, "{name}");
            assert_agree(&name, &a, &b);
            assert_same_events(&name, &stats, &of_walk);

            let (twin, _) = by_kernel(&scene_of([0.855, 0.72]), &settings);
            let least = least_p(&twin, &b);
            // Margin: the probability at which the twin is rejected.
            assert!(least < 1e-9, "{name}, seed 9: twin {least}");
        }
    }
}

/// What lanes draw is their family's own: its picture is no other's.
#[test]
fn families_are_told_apart() {
    let settings = settings(0..samples(), u32::MAX);
    let named = |name| {
        let family = FlakeFamily::named(name).unwrap();
        let scene = scene(cloth(family, [0.95, 0.8]), parallel(), FLAT);
        by_kernel(&scene, &settings).0
    };
    let mirrors = named("sggx-specular");
    for other in ["sggx-diffuse", "gaussian-diffuse", "sggx-transmitting"] {
        let least = least_p(&named(other), &mirrors);
        // Margin: the probability at which another family is rejected.
        assert!(least < 1e-9, "seed 9: {other} {least}");
    }
}

/// White flakes send all light back, whatever their family; the twin keeps 97 %.
#[test]
fn white_flakes_vanish_under_even_light() {
    let light = white_sky(Hemisphere::All);
    for family in FlakeFamily::all() {
        let shown = |albedo| {
            let scene = scene(cloth(family, [albedo; 2]), vec![light.clone()], FLAT);
            let settings = settings(0..sized(2048, 131_072), u32::MAX);
            let (film, stats) = by_kernel(&scene, &settings);
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
        assert_back_ends_alike(&format!("{family:?}"), &scene);
    }
}
