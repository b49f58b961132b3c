//! Explicit fibres in cells against the general walk.

use crate::kernel::packed_fibres::packed;
use crate::kernel::pictures::picture;
use crate::kernel::virtual_fibres::{cotton_and_silk, silk_and_cotton};
use crate::kernel::{
    PINHOLE, assert_agree, film_by, furnace, least_p, lens, panels, parallel, record, samples,
    scene, settings, sky, vector_backends, walked, wide,
};
use glam::{Vec2, Vec3};
use organza_basis::curve::{Segment, SegmentList};
use organza_basis::{Rgb, unwatched};
use organza_kernel::Refusal;
use organza_scatter::{
    DielectricFibre, DielectricParameters, Fibre, MeasuredFibre, MeasuredLobe, Section,
};
use organza_testing::{sized, twisted_weave};
use organza_transport::*;
use std::ops::ControlFlow;
use std::sync::LazyLock;

/// Twisted yarns, and hairs that taper and leave the tile sideways.
pub(crate) fn segments(repeats: bool) -> SegmentList {
    let mut weave = twisted_weave();
    weave.tile.repeats = repeats;
    for hair in 0..8u32 {
        let from = Vec3::new(0.03 * hair as f32, 0.15, 0.1);
        let to = from + Vec3::new(0.2, 0.05 * hair as f32, 0.1);
        weave.segments.push(Segment {
            fibre: 100 + hair,
            yarn: 7,
            end_radius_mm: 0.002,
            ..Segment::straight(from, to, 0.005)
        });
    }
    weave
}

pub fn fibres_of(repeats: bool, materials: Vec<Fibre>) -> AnyMedium {
    let source = segments(repeats);
    let made = ExplicitFibres::new(&source, materials, None, &unwatched).unwrap();
    AnyMedium::ExplicitFibres(made)
}

pub(crate) fn cut() -> AnyMedium {
    let mut cloth = fibres_of(true, silk_and_cotton());
    cloth
        .cut_to(Vec2::new(-0.05, -0.11), Vec2::new(0.45, 0.23))
        .unwrap();
    cloth
}

pub(crate) fn by_cells(
    scene: &Scene,
    settings: &RenderSettings,
    backend: Backend,
) -> (Film, Stats) {
    let named = EngineChoice::Named(record(backend));
    let engine = engine(scene, settings, named, u64::MAX).unwrap();
    film_by(scene, settings, engine)
}

/// A fibre that is not round beside a round one.
pub fn lobed_and_round() -> Vec<Fibre> {
    static LOBED: LazyLock<Fibre> = LazyLock::new(|| {
        let parameters = DielectricParameters {
            ior: 1.55,
            absorption_radii: Rgb::new(0.02, 0.1, 0.5),
            longitudinal_rad: 0.1,
            azimuthal_rad: 0.3,
        };
        let lobed = DielectricFibre::with_section(parameters, Some(Section::Trilobal));
        Fibre::from(lobed.unwrap())
    });
    vec![LOBED.clone(), silk_and_cotton().remove(0)]
}

/// A fibre by its lobes beside a round one.
fn measured_and_round() -> Vec<Fibre> {
    let lobe = |colour, longitudinal_deg, profile: &[f32]| MeasuredLobe {
        colour,
        longitudinal_deg,
        profile: profile.to_vec(),
    };
    let lobes = [
        lobe([0.1; 3], 6.0, &[1.0, 2.0]),
        lobe([0.8, 0.6, 0.3], 12.0, &[5.0, 1.0, 0.5, 0.2]),
    ];
    let measured = MeasuredFibre::new(&lobes).unwrap();
    vec![Fibre::from(measured), silk_and_cotton().remove(0)]
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let flat = wide(0.4);
    let cloth = |repeats| fibres_of(repeats, silk_and_cotton());
    let lobed = || fibres_of(true, lobed_and_round());
    let measured = fibres_of(true, measured_and_round());
    vec![
        ("finite", scene(cloth(false), parallel(), PINHOLE)),
        ("endless", scene(cloth(true), parallel(), flat)),
        ("sky", scene(cloth(true), sky(), lens())),
        ("cut", scene(cut(), parallel(), lens())),
        ("panels", scene(cloth(true), panels(), PINHOLE)),
        ("picture", scene(cloth(false), vec![picture()], PINHOLE)),
        ("sections", scene(lobed(), parallel(), PINHOLE)),
        ("measured", scene(measured, parallel(), PINHOLE)),
        ("sections, sky", scene(lobed(), sky(), flat)),
    ]
}

/// Holds the kernel to the general walk; gives films and counts of both.
pub fn assert_agreement(name: &str, scene: &Scene) -> [(Film, Stats); 2] {
    let settings = agreement_settings();
    let (oracle, of_walk) = walked(scene, &settings);
    let (own, stats) = by_cells(scene, &settings, Backend::widest());
    assert_eq!(stats.rejected, 0, "{name}");
    assert_agree(name, &own, &oracle);
    let depth = |film: &Film| {
        let depths: Vec<f64> = film.pixels().iter().filter_map(|p| p.depth_mm()).collect();
        depths.iter().sum::<f64>() / depths.len().max(1) as f64
    };
    assert!((depth(&own) - depth(&oracle)).abs() < 5e-3, "{name}");
    [(own, stats), (oracle, of_walk)]
}

fn agreement_settings() -> RenderSettings {
    settings(0..sized(512, 65_536), u32::MAX)
}

/// Holds the picture of a known-bad twin by the kernel apart from that of a scene by the walk.
pub fn assert_rejected(name: &str, twin: &Scene, oracle: &Film) {
    let (own, _) = by_cells(twin, &agreement_settings(), Backend::widest());
    let p = least_p(&own, oracle);
    // Margin: the probability at which the twin is rejected.
    assert!(p < 1e-9, "{name}, seed 9: the twin passes with {p}");
}

/// Holds all back ends, numbers of threads and portions of samples to the same bits.
pub fn assert_same_bits(name: &str, scene: &Scene) {
    let settings = settings(0..24, 40);
    let (first, _) = by_cells(scene, &settings, Backend::Scalar);
    for backend in vector_backends().into_iter().chain([Backend::Scalar]) {
        let (film, _) = by_cells(scene, &settings, backend);
        assert!(film == first, "{name}: {backend:?}");
    }
    // Samples in other portions, by another number of threads.
    let walks = engine(scene, &settings, EngineChoice::Fastest, u64::MAX).unwrap();
    let rendering = Rendering::new(scene, settings.clone()).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let film = pool.unwrap().install(|| {
        let mut rendering = rendering.with_engine(walks);
        while rendering.left() > 0 {
            rendering = rendering.take(7, &|_| ControlFlow::Continue(())).unwrap();
        }
        rendering.into_parts().0
    });
    assert!(film == first, "{name}: portions");
}

#[test]
fn cells_agree_with_the_general_walk() {
    // By default sections under parallel light alone.
    for (name, lit) in scenes().into_iter().take(sized(8, 9)) {
        let [_, (oracle, _)] = assert_agreement(name, &lit);
        if name == "endless" {
            let other_cloth = fibres_of(true, cotton_and_silk());
            let twin = scene(other_cloth, parallel(), wide(0.4));
            assert_rejected(name, &twin, &oracle);
        }
    }
}

#[test]
fn back_ends_walk_fibres_alike() {
    for (name, scene) in scenes() {
        assert_same_bits(name, &scene);
    }
}

/// An engine in the least memory that suffices.
pub(crate) fn in_least_memory<'a>(
    scene: &'a Scene,
    settings: &RenderSettings,
    choice: EngineChoice,
) -> Box<dyn Engine + 'a> {
    let mut allowed = 1 << 14;
    loop {
        match engine(scene, settings, choice, allowed) {
            Ok(engine) => return engine,
            Err(KernelRefusal::Kernel(Refusal::Memory(needed, _))) => assert!(needed > allowed),
            Err(why) => panic!("{why}"),
        }
        allowed += 1 << 16;
    }
}

/// Where memory does not suffice for copies in cells, lists of numbers give the same
/// picture bit for bit; where it does not suffice for these either, fibres are refused.
#[test]
fn lists_give_the_picture_of_copies() {
    for (name, scene) in scenes() {
        let settings = settings(0..24, 40);
        let (copies, counts) = by_cells(&scene, &settings, Backend::widest());
        let lists = in_least_memory(&scene, &settings, EngineChoice::Fastest);
        assert!(lists.saved_memory().is_some(), "{name}");
        let (film, stats) = film_by(&scene, &settings, lists);
        assert!(film == copies, "{name}");
        assert_eq!(stats, counts, "{name}");
    }
}

/// Holds fibres that keep all light to white.
pub(crate) fn assert_furnace_is_white(scene: &Scene) {
    let settings = settings(0..samples(), u32::MAX);
    let (film, stats) = by_cells(scene, &settings, Backend::widest());
    assert!(stats.collisions > stats.paths, "{stats:?}");
    // The balance of the lobes keeps energy to 1e-3 an event.
    for (mean, error) in film.mean() {
        // Margin: 3e-3 is for the tables of the lobes, the rest four standard errors.
        assert!((mean - 1.0).abs() < 3e-3 + 4.0 * error, "{mean} +- {error}");
    }
}

/// Fibres that keep all light are not seen under an even sky.
#[test]
fn clear_fibres_vanish_in_a_furnace() {
    assert_furnace_is_white(&furnace(|fibres| fibres_of(true, fibres)));
}

/// Memory is counted before it is taken.
#[test]
fn cells_and_voxels_that_do_not_fit_are_refused() {
    let cloths = [
        fibres_of(true, silk_and_cotton()),
        AnyMedium::VirtualFibres(packed(true, silk_and_cotton())),
    ];
    for cloth in cloths {
        let scene = scene(cloth, parallel(), wide(0.4));
        let refused = engine(&scene, &settings(0..1, 1), EngineChoice::Fastest, 1000).err();
        let refused = refused.map(|e| e.to_string()).unwrap_or_default();
        assert!(refused.contains("more than 1000"), "{refused}");
    }
}
