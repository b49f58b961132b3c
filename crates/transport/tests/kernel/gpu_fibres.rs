//! Explicit fibres on graphics adapters against the engine for processors, its oracle.

use crate::kernel::explicit_fibres::{cut, fibres_of, in_least_memory, lobed_and_round};
use crate::kernel::gpu::{assert_depths_agree, available};
use crate::kernel::packed_fibres::{cut_packed, hybrid, packed};
use crate::kernel::pictures::picture;
use crate::kernel::virtual_fibres::{cotton_and_silk, silk_and_cotton};
use crate::kernel::{
    self, FLAT, PINHOLE, assert_agree, furnace, least_p, lens, panels, parallel, scene, settings,
    several_cloths, sky, wide,
};
use glam::Vec3;
use organza_basis::Rgb;
use organza_scatter::Fibre;
use organza_testing::sized;
use organza_transport::*;

/// The film of an engine; `None`, with a line of its own, without adapters.
fn film(scene: &Scene, settings: &RenderSettings, name: &str) -> Option<(Film, Stats)> {
    let choice = EngineChoice::Named(engine_named(name).unwrap());
    let made = engine(scene, settings, choice, u64::MAX).map_err(|why| match why {
        KernelRefusal::Kernel(why) => why,
        why => panic!("{why}"),
    });
    available(made).map(|made| kernel::film_by(scene, settings, made.unwrap()))
}

fn samples() -> u64 {
    sized(256, 16_384)
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let wide = wide(0.7);
    let fibres = |repeats| fibres_of(repeats, silk_and_cotton());
    let all = || [parallel(), sky(), panels(), vec![picture(), spot()]].concat();
    let mut scenes = vec![
        ("alone", scene(fibres(false), parallel(), PINHOLE)),
        ("endless", scene(fibres(true), parallel(), FLAT)),
        ("sky", scene(fibres(true), sky(), lens())),
        ("panels", scene(fibres(false), panels(), PINHOLE)),
        ("picture", scene(fibres(true), vec![picture()], lens())),
        ("cut, all lights", scene(cut(), all(), wide)),
        (
            "sections",
            scene(
                fibres_of(true, lobed_and_round()),
                [sky(), parallel()].concat(),
                FLAT,
            ),
        ),
        (
            "packed",
            scene(voxels(false, silk_and_cotton()), sky(), PINHOLE),
        ),
        ("packed, cut", scene(cut_packed(), all(), lens())),
        (
            "hybrid, events",
            scene(hybrid(true, 1, f32::INFINITY), parallel(), FLAT),
        ),
        (
            "hybrid, weight",
            scene(hybrid(true, 0, 0.5), vec![picture(), spot()], lens()),
        ),
    ];
    scenes.extend(several_cloths::scenes());
    scenes
}

fn voxels(repeats: bool, fibres: Vec<Fibre>) -> AnyMedium {
    AnyMedium::VirtualFibres(packed(repeats, fibres))
}

/// A lamp close by, whose edge lies on the cloth.
fn spot() -> Light {
    Light::from(SpotLight {
        position_mm: Vec3::new(0.3, 0.1, 1.2),
        intensity: Rgb::new(1.5, 1.0, 0.5),
        axis: Vec3::NEG_Z,
        half_angle_rad: 0.25,
        falloff_rad: 0.15,
    })
}

#[test]
fn explicit_fibres_on_an_adapter_agree_with_a_processor() {
    // By default one that ends in packed fibres and one of several bodies, bent ones too.
    let (first, step) = sized((2, 7), (0, 1));
    for (name, scene) in scenes().into_iter().skip(first).step_by(step) {
        let settings = settings(0..samples(), u32::MAX);
        let other = RenderSettings {
            seed: 10,
            samples: 0..sized(512, 65_536),
            ..settings.clone()
        };
        let Some((own, stats)) = film(&scene, &settings, "gpu") else {
            return;
        };
        let (oracle, counts) = film(&scene, &other, Backend::widest().name()).unwrap();
        assert_eq!(stats.rejected, 0, "{name}");
        assert_agree(name, &own, &oracle);
        let events = |s: &Stats| s.collisions as f64 / s.paths as f64;
        let (a, b) = (events(&stats), events(&counts));
        // Under lamps a processor divides paths, and an adapter does not.
        let alike = (a / b - 1.0).abs() < 0.05;
        assert!(alike || name != "sky", "{name}: {a} {b} events a path");
        // Some scenes have several cloths, or a table.
        let layer_mm = if scene.media.len() > 1 { 1.0 } else { 0.25 };
        assert_depths_agree(name, &own, &oracle, samples(), layer_mm);
    }
}

/// The twins: fibres of which one absorbs a fiftieth more of what it transmits, round ones in
/// place of others, and other fibres over a mesh.
#[test]
fn other_fibres_on_an_adapter_are_rejected() {
    let of = |absorption: f32| {
        let fibre: Fibre = organza_testing::dielectric_fibre(Rgb::splat(absorption), 0.09, 0.17);
        scene(fibres_of(true, vec![fibre.clone(), fibre]), sky(), FLAT)
    };
    let bent = |fibres| {
        scene(
            several_cloths::draped(fibres),
            several_cloths::over_mesh(),
            FLAT,
        )
    };
    let settings = settings(0..sized(128, 65_536), u32::MAX);
    let other = RenderSettings {
        seed: 10,
        ..settings.clone()
    };
    let lobed = lobed_and_round();
    let round = vec![lobed[1].clone(); 2];
    let under_sky = |fibres| scene(fibres_of(true, fibres), sky(), FLAT);
    let twins = [
        ("absorption", of(0.01), of(0.02)),
        ("sections", under_sky(lobed), under_sky(round)),
        ("bent", bent(silk_and_cotton()), bent(cotton_and_silk())),
    ];
    for (name, right, wrong) in twins.into_iter().skip(sized(1, 0)) {
        let (oracle, _) = film(&right, &other, Backend::widest().name()).unwrap();
        let Some((own, _)) = film(&right, &settings, "gpu") else {
            return;
        };
        assert_agree(name, &own, &oracle);
        let (twin, _) = film(&wrong, &settings, "gpu").unwrap();
        let p = least_p(&twin, &oracle);
        assert!(p < 1e-6, "{name}, seed 9: {p}");
    }
}

/// Clear fibres lose no light: they vanish in even light.
#[test]
fn clear_fibres_vanish_in_even_light_on_an_adapter() {
    let settings = settings(0..sized(512, 65_536), u32::MAX);
    // With what the tables of lobes may be off.
    for (scene, table_error) in [
        (furnace(|fibres| fibres_of(true, fibres)), 2e-3),
        (furnace(|fibres| voxels(true, fibres)), 3e-3),
    ] {
        let Some((own, stats)) = film(&scene, &settings, "gpu") else {
            return;
        };
        assert!(stats.collisions > stats.paths);
        assert_eq!(stats.majorant_violations, 0);
        for (mean, error) in own.mean() {
            let off = (mean - 1.0).abs();
            assert!(off < table_error + 4.0 * error, "seed 9: {mean} {error}");
        }
    }
}

#[test]
fn explicit_fibres_give_the_same_bits_twice_on_an_adapter() {
    let all = [parallel(), sky(), panels(), vec![picture()]].concat();
    let settings = settings(0..6, 40);
    for cloth in [
        fibres_of(true, silk_and_cotton()),
        several_cloths::draped(silk_and_cotton()),
    ] {
        let scene = scene(cloth, all.clone(), lens());
        let Some(first) = film(&scene, &settings, "gpu") else {
            return;
        };
        assert!(first.1.collisions > 100);
        assert!(film(&scene, &settings, "gpu").unwrap() == first);
    }
}

/// Where memory does not suffice for copies in cells, an adapter has copies all the same.
#[test]
fn lists_give_the_bits_of_copies_on_an_adapter() {
    let scene = scene(fibres_of(true, silk_and_cotton()), sky(), lens());
    let settings = settings(0..6, 40);
    let Some((copies, _)) = film(&scene, &settings, "gpu") else {
        return;
    };
    let choice = EngineChoice::Named(engine_named("gpu").unwrap());
    let lists = in_least_memory(&scene, &settings, choice);
    assert!(kernel::film_by(&scene, &settings, lists).0 == copies);
}
