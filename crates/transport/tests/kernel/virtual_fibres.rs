//! Virtual fibres with plain events: the kernel against the walk.

use crate::kernel::pictures::picture;
use crate::kernel::{
    FLAT, PINHOLE, assert_agree, assert_back_ends_alike, assert_same_events, by_kernel, film,
    flat_scene, least_p, lens, panels, parallel, samples, scene, settings, sky, walked, walker,
};
use crate::scenes::{octree, white_sky};
use glam::UVec3;
use organza_basis::{PathRng, Rgb, warp};
use organza_kernel::proofs::Fault;
use organza_kernel::{Matter, Refusal, Scatterers};
use organza_scatter::{Fibre, FittedFibre, FittedParameters};
use organza_testing::{dielectric_fibre, fitted_fibre, little_weave, sized};
use organza_transport::*;
use std::sync::LazyLock;

fn dielectric(absorption: [f32; 3], longitudinal_deg: f32, azimuthal_deg: f32) -> Fibre {
    let [longitudinal_rad, azimuthal_rad] = [longitudinal_deg, azimuthal_deg].map(f32::to_radians);
    dielectric_fibre(Rgb::from(absorption), longitudinal_rad, azimuthal_rad)
}

/// Fibres of two materials that cross in the same voxels.
pub(crate) fn cloth(fibres: Vec<Fibre>, event: VirtualFibreEvent) -> VirtualFibreMedium {
    cloth_at(0, fibres, event)
}

/// The same at a level, whose coarse voxels keep their outlines.
fn cloth_at(level: u8, fibres: Vec<Fibre>, event: VirtualFibreEvent) -> VirtualFibreMedium {
    let octree = octree(&little_weave(0.015, 1), 0.02, 2.max(1 + level));
    VirtualFibreMedium::new(octree, level, fibres, event).unwrap()
}

pub(crate) fn silk_and_cotton() -> Vec<Fibre> {
    // Tables take longer than many a test of them: all tests share these.
    static FIBRES: LazyLock<Vec<Fibre>> = LazyLock::new(|| {
        vec![
            dielectric([0.02, 0.1, 0.5], 5.0, 10.0),
            fitted_fibre("gabardine"),
        ]
    });
    FIBRES.clone()
}

/// The same, with the materials of the two exchanged.
pub(crate) fn cotton_and_silk() -> Vec<Fibre> {
    silk_and_cotton().into_iter().rev().collect()
}

/// What the kernel is given of fibres, against the medium's own extinction.
#[test]
fn described_fibres_are_the_medium() {
    let medium = cloth(silk_and_cotton(), VirtualFibreEvent::Plain);
    let dims = Medium::cell_grid(&medium).dims();
    let mut rng = PathRng::from_seed(64);
    let mut mixed = 0;
    for i in 0..dims.element_product() {
        let c = UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y));
        let mut populations = Vec::new();
        medium.populations(c, &mut populations).unwrap();
        let site = medium.site(c.as_vec3() + 0.5);
        for _ in 0..4 {
            let w = warp::uniform_sphere(rng.unit2());
            let most: f32 = populations.iter().map(|p| p.broadside_per_mm).sum();
            let exact = medium.sigma_t(&site, w);
            let bound = most * (1.0 + 1e-5);
            assert!(exact <= bound, "seed 64: {exact}, {most} at {c}");
        }
        if let [only] = &populations[..] {
            let axis = only.flake.scaled_axis().normalize();
            let across = axis.any_orthonormal_vector();
            let exact = medium.sigma_t(&site, across);
            let apart = (only.broadside_per_mm / exact - 1.0).abs();
            let own = only.broadside_per_mm;
            assert!(apart < 4.0 * f32::EPSILON, "{own} {exact} at {c}");
        }
        mixed += usize::from(populations.len() > 1);
    }
    assert!(mixed > 20, "{mixed} mixtures");
    assert!(matches!(medium.scatterers(), Scatterers::Fibres([_, _])));
}

/// Pictures of the kernel and of the walk; the twin has others of the fibres.
#[test]
fn the_kernel_agrees_with_the_walk_through_fibres() {
    let pictures = vec![picture()];
    for (name, level, lights, projection) in [
        ("parallel", 0, parallel(), PINHOLE),
        ("sky", 0, sky(), lens()),
        ("panels", 0, panels(), FLAT),
        ("picture", 0, pictures, FLAT),
        ("coarse", 2, sky(), FLAT),
    ] {
        let medium = cloth_at(level, silk_and_cotton(), VirtualFibreEvent::Plain);
        let scene = scene(AnyMedium::VirtualFibres(medium), lights, projection);
        let settings = settings(0..sized(1024, 65_536), u32::MAX);
        let (a, stats) = by_kernel(&scene, &settings);
        let (b, of_walk) = walked(&scene, &settings);
        assert_eq!(stats.rejected + stats.majorant_violations, 0, "{name}");
        assert_agree(name, &a, &b);
        assert_same_events(name, &stats, &of_walk);

        let others = [
            dielectric([0.0; 3], 6.0, 10.0),
            dielectric([0.02, 0.3, 2.0], 4.0, 15.0),
        ];
        let twin = flat_scene(&scene, &settings).with_fault(Fault::Fibres(&others));
        let twin = walker(twin, Backend::widest());
        let least = least_p(&film(&scene, &settings, twin).0, &b);
        // Margin: the probability at which the twin is rejected.
        assert!(least < 1e-9, "{name}, seed 9: twin {least}");
    }
}

/// Fibres that keep all light under even light: nothing is to be seen.
#[test]
fn white_fibres_vanish_under_even_light() {
    let white = FittedParameters {
        colour_tt: Rgb::WHITE,
        ..FittedParameters::preset("gabardine").unwrap()
    };
    let white = Fibre::from(FittedFibre::new(white).unwrap());
    let fibres = vec![dielectric([0.0; 3], 6.0, 10.0), white];
    let medium = AnyMedium::VirtualFibres(cloth(fibres, VirtualFibreEvent::Plain));
    let scene = scene(medium, vec![white_sky(Hemisphere::All)], FLAT);
    let settings = settings(0..8 * samples(), u32::MAX);
    let (film, stats) = by_kernel(&scene, &settings);
    assert!(stats.collisions > stats.paths);
    for (mean, error) in film.mean() {
        let apart = (mean - 1.0).abs();
        // Margin: most of the bound is four standard errors.
        assert!(apart < 1e-3 + 4.0 * error, "seed 9: {mean} +- {error}");
        assert!(error < 3e-3, "seed 9: {error}");
    }
}

#[test]
fn back_ends_give_the_same_bits_through_fibres() {
    let mut lights = parallel();
    lights.push(picture());
    let medium = cloth(silk_and_cotton(), VirtualFibreEvent::Plain);
    let scene = scene(AnyMedium::VirtualFibres(medium), lights, lens());
    assert_back_ends_alike("fibres", &scene);
}

#[test]
fn rough_fibres_are_left_to_the_walk() {
    let refused = |blur_deg: f32| {
        let fibres = vec![
            dielectric([0.0; 3], 6.0, 10.0),
            dielectric([0.0; 3], blur_deg, 60.0),
        ];
        let medium = AnyMedium::VirtualFibres(cloth(fibres, VirtualFibreEvent::Plain));
        let scene = scene(medium, parallel(), FLAT);
        let made = flatten(&scene, &settings(0..4, u32::MAX), u64::MAX);
        matches!(made, Err(KernelRefusal::Kernel(Refusal::Skewed)))
    };
    assert!(!refused(15.0) && refused(30.0));
}
