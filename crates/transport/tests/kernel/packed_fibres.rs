//! Packed fibres in the kernel, with the events of explicit ones, against the general walk.

use crate::kernel::explicit_fibres::{
    assert_agreement, assert_furnace_is_white, assert_same_bits, by_cells, fibres_of, segments,
};
use crate::kernel::pictures::picture;
use crate::kernel::virtual_fibres::silk_and_cotton;
use crate::kernel::{
    PINHOLE, agree, assert_agree, assert_same_events, film, furnace, least_p, lens, panels,
    parallel, samples, scene, settings, sky, vector_backends, walked, wide,
};
use crate::scenes::{octree, white_sky};
use glam::Vec2;
use organza_basis::unwatched;
use organza_kernel::FibreEngine;
use organza_kernel::fibres::{FibreMatter, FibreScene};
use organza_kernel::proofs::PackedFault;
use organza_scatter::Fibre;
use organza_testing::sized;
use organza_transport::*;
use organza_volume::{MaterialPacking, MeasuredPacking, PackingFactor};
use std::sync::Arc;

/// Twisted fibres of two materials and six yarns, with packing factors that differ.
pub fn packed(repeats: bool, fibres: Vec<Fibre>) -> VirtualFibreMedium {
    packed_at(0, repeats, fibres)
}

/// The same at a level, whose coarse voxels keep their outlines.
fn packed_at(level: u8, repeats: bool, fibres: Vec<Fibre>) -> VirtualFibreMedium {
    let mut source = segments(repeats);
    if !repeats {
        // Hairs leave the tile.
        source.segments.retain(|s| s.yarn != 7);
    }
    let octree = octree(&source, 0.006, 1 + level);
    let factor = |mean: f32| {
        Some(PackingFactor {
            mean,
            standard_error: 0.0,
        })
    };
    let of_material = |more: f32| MaterialPacking {
        own_yarn: factor(1.4 + more),
        other_yarn: factor(1.1 + more),
        outside: factor(0.8 + more),
    };
    let packing = MeasuredPacking {
        walks: 1,
        levels: vec![vec![of_material(0.0), of_material(0.3)]; 1 + usize::from(level)],
    };
    let octree = octree.with_packing(Some(packing)).unwrap();
    let medium = VirtualFibreMedium::new(octree, level, fibres, VirtualFibreEvent::Packed).unwrap();
    assert_eq!(medium.level(), level);
    medium
}

fn cloth(repeats: bool) -> AnyMedium {
    AnyMedium::VirtualFibres(packed(repeats, silk_and_cotton()))
}

pub fn cut_packed() -> AnyMedium {
    let mut cloth = cloth(true);
    cloth
        .cut_to(Vec2::new(-0.05, -0.11), Vec2::new(0.45, 0.23))
        .unwrap();
    cloth
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let flat = wide(0.4);
    let coarse = AnyMedium::VirtualFibres(packed_at(2, true, silk_and_cotton()));
    vec![
        ("coarse", scene(coarse, sky(), flat)),
        ("finite", scene(cloth(false), parallel(), PINHOLE)),
        ("endless", scene(cloth(true), parallel(), flat)),
        ("sky", scene(cloth(true), sky(), lens())),
        ("cut, panels", scene(cut_packed(), panels(), lens())),
        ("picture", scene(cloth(true), vec![picture()], PINHOLE)),
    ]
}

/// Explicit fibres until a path changes to packed ones.
pub fn hybrid(repeats: bool, first_events: u32, while_weight: f32) -> AnyMedium {
    let mut source = segments(repeats);
    source.segments.retain(|s| repeats || s.yarn != 7);
    let explicit = ExplicitFibres::new(&source, silk_and_cotton(), None, &unwatched).unwrap();
    let switch = Switch {
        first_events,
        while_weight,
    };
    let both = HybridFibres::new(explicit, packed(repeats, silk_and_cotton()), switch);
    AnyMedium::HybridFibres(Box::new(both.unwrap()))
}

/// The picture of a scene of packed fibres with a fault.
fn faulty(scene: &Scene, settings: &RenderSettings, fault: PackedFault) -> Film {
    let [AnyMedium::VirtualFibres(medium)] = &scene.media[..] else {
        panic!("not virtual fibres");
    };
    let matter = FibreMatter::of_packed(medium, u64::MAX).unwrap();
    let laid_out = FibreScene::new(
        Arc::new(matter.with_fault(fault)),
        &scene.lights,
        &scene.camera,
        settings.seed,
        settings.max_bounces.min(MAX_EVENTS),
    );
    let engine = FibreEngine::new(Arc::new(laid_out), Backend::widest()).unwrap();
    film(scene, settings, engine).0
}

/// Holds the kernel to the general walk, and to its number of events.
fn assert_agreement_in_events(name: &str, scene: &Scene) {
    let [(_, own), (_, of_walk)] = assert_agreement(name, scene);
    assert_eq!(own.majorant_violations, 0, "{name}");
    assert_same_events(name, &own, &of_walk);
}

#[test]
fn packed_fibres_agree_with_the_general_walk() {
    for (name, scene) in scenes() {
        assert_agreement_in_events(name, &scene);
    }
}

/// Extinction a fifth too low, and paths that start where they came in.
#[test]
fn faults_of_packed_fibres_are_rejected() {
    let flat = wide(0.4);
    let scene = scene(cloth(true), vec![white_sky(Hemisphere::Back)], flat);
    let settings = settings(0..sized(2048, 131_072), u32::MAX);
    let (oracle, _) = walked(&scene, &settings);
    let (own, _) = by_cells(&scene, &settings, Backend::widest());
    assert!(agree(&own, &oracle).1.p_value > 1e-4);
    for fault in [PackedFault::Extinction(0.8), PackedFault::StartAtEntry] {
        let least = least_p(&faulty(&scene, &settings, fault), &oracle);
        // Margin: the probability at which the twin is rejected.
        assert!(least < 1e-9, "{fault:?}, seed 9: {least}");
    }
}

#[test]
fn back_ends_walk_packed_fibres_alike() {
    for (name, scene) in scenes() {
        assert_same_bits(name, &scene);
    }
}

/// Packed fibres that keep all light are not seen under an even sky.
#[test]
fn clear_packed_fibres_vanish_in_a_furnace() {
    assert_furnace_is_white(&furnace(|fibres| {
        AnyMedium::VirtualFibres(packed(true, fibres))
    }));
}

#[test]
fn packed_fibres_are_not_laid_out_without_events() {
    let scene = scene(cloth(true), parallel(), wide(0.4));
    let refused = flatten(&scene, &settings(0..1, 1), 1 << 30).err();
    assert_eq!(refused, Some(KernelRefusal::Packed));
}

#[test]
fn hybrid_fibres_agree_with_the_general_walk() {
    let flat = wide(0.4);
    let mut cut = hybrid(true, 2, f32::INFINITY);
    cut.cut_to(Vec2::new(-0.05, -0.11), Vec2::new(0.45, 0.23))
        .unwrap();
    for (name, medium, lights) in [
        ("one event", hybrid(true, 1, f32::INFINITY), parallel()),
        ("weight", hybrid(true, 0, 0.5), parallel()),
        ("finite", hybrid(false, 1, f32::INFINITY), sky()),
        ("cut", cut, panels()),
    ] {
        let scene = scene(medium, lights, flat);
        assert_agreement_in_events(name, &scene);
        let few = settings(0..24, 40);
        let (first, _) = by_cells(&scene, &few, Backend::Scalar);
        for backend in vector_backends() {
            let (film, _) = by_cells(&scene, &few, backend);
            assert!(film == first, "{name}: {backend:?}");
        }
    }
}

/// Paths that never change are those of explicit fibres: bit for bit where light comes from
/// everywhere alike, for only explicit fibres divide paths under lamps. Those that change at
/// once see the volume's picture.
#[test]
fn hybrid_fibres_end_in_explicit_and_packed_ones() {
    let flat = wide(0.4);
    let under = |lights, medium, samples| {
        let scene = scene(medium, lights, flat);
        by_cells(&scene, &settings(0..samples, u32::MAX), Backend::widest()).0
    };
    let picture = |medium, samples| under(parallel(), medium, samples);
    let never = || hybrid(true, u32::MAX, f32::INFINITY);
    let fibres = || fibres_of(true, silk_and_cotton());
    assert!(under(sky(), never(), 24) == under(sky(), fibres(), 24));
    let explicit = picture(fibres(), samples());
    let mut others = settings(0..samples(), u32::MAX);
    others.seed = 10;
    let scene = scene(never(), parallel(), flat);
    let (film, _) = by_cells(&scene, &others, Backend::widest());
    assert_agree("never, seed 10 against", &film, &explicit);
    let at_once = picture(hybrid(true, 0, f32::INFINITY), samples());
    assert_agree("at once", &at_once, &picture(cloth(true), samples()));
    // The known-bad twin: explicit fibres.
    assert!(least_p(&at_once, &explicit) < 1e-9, "seed 9");
}
