//! Pictures by the cache of radiance against pictures by whole paths.

use crate::kernel::explicit_fibres::{by_cells, cut, fibres_of};
use crate::kernel::packed_fibres::packed;
use crate::kernel::pictures::picture;
use crate::kernel::virtual_fibres::silk_and_cotton;
use crate::kernel::{
    FLAT, furnace, lens, panels, parallel, record, scene, settings, several_cloths, sky,
    vector_backends, wide,
};
use glam::DVec3;
use organza_basis::{Moments, hypothesis::t_test};
use organza_testing::sized;
use organza_transport::*;
use std::ops::ControlFlow;
use std::sync::Arc;

fn plan(mode: CacheMode) -> CachePlan {
    CachePlan {
        mode,
        work: sized(100_000, 40_000_000),
        bytes: CachePlan::BYTES,
        block_error: 1.0,
        kept: None,
    }
}

fn by_cache(
    scene: &Scene,
    settings: &RenderSettings,
    plan: &CachePlan,
    by: Backend,
) -> (Film, CacheReport) {
    let named = EngineChoice::Named(record(by));
    let walks = engine(scene, settings, named, u64::MAX).unwrap();
    let rendering = Rendering::new(scene, settings.clone()).unwrap();
    let rendering = rendering.with_engine(walks);
    let go = |_| ControlFlow::Continue(());
    let rendering = rendering.with_cache(plan, &go).unwrap();
    let report = rendering.cache().unwrap().clone();
    let all = settings.samples.end;
    let rendering = rendering.take(all, &|_| ControlFlow::Continue(())).unwrap();
    (rendering.into_parts().0, report)
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let flat = wide(0.4);
    let cloth = |repeats| fibres_of(repeats, silk_and_cotton());
    let mut all = vec![
        ("endless", scene(cloth(true), parallel(), flat)),
        ("sky", scene(cloth(true), sky(), lens())),
        ("cut", scene(cut(), parallel(), lens())),
        ("panels", scene(cloth(true), panels(), flat)),
        ("picture", scene(cloth(false), vec![picture()], flat)),
    ];
    all.extend(several_cloths::scenes());
    all
}

/// What the pictures of some seeds have more than the mean by whole paths, relative.
fn gains(scene: &Scene, plan: &CachePlan, mean: f64) -> Moments {
    let mut gains = Moments::default();
    for seed in 0..8 {
        let settings = RenderSettings {
            seed: 100 + seed,
            ..settings(0..sized(256, 16_384), u32::MAX)
        };
        let (film, _) = by_cache(scene, &settings, plan, Backend::widest());
        gains.add(film.mean()[1].0 / mean - 1.0);
    }
    gains
}

/// The mean of a picture is that by whole paths, under all lights, flat and among several
/// bodies; with a dimmer exact picture it is not.
#[test]
#[ignore = "takes half a minute: .ci/full runs it"]
fn the_mean_is_that_of_whole_paths() {
    let mut weights = 0.0f64;
    for (name, scene) in scenes().into_iter().take(sized(2, 64)) {
        let exact = settings(0..sized(8_192, 131_072), u32::MAX);
        let (film, _) = by_cells(&scene, &exact, Backend::widest());
        let (mean, error) = film.mean()[1];
        let error = error / mean;
        for mode in [CacheMode::SecondFibre, CacheMode::FirstFibre] {
            let gains = gains(&scene, &plan(mode), mean);
            let own = gains.variance() / gains.count as f64;
            let all = (own + error * error).sqrt();
            assert!(
                gains.mean.abs() < 4.0 * all,
                "seed 100, {name}, {mode:?}: {} +- {all}",
                gains.mean
            );
            weights += 1.0 / (all * all);
        }
    }
    // All together tell pictures that are 4 % dimmer apart.
    let error = 1.0 / weights.sqrt();
    assert!(error < 0.01, "seed 100: +- {error}");
}

/// White fibres under a white sky: every bin and the picture is white.
#[test]
fn a_furnace_stays_white() {
    let scene = furnace(|fibres| fibres_of(true, fibres));
    for mode in [CacheMode::SecondFibre, CacheMode::FirstFibre] {
        let mut means = Moments::default();
        for seed in 0..8 {
            let settings = RenderSettings {
                seed: 200 + seed,
                ..settings(0..1024, u32::MAX)
            };
            let (film, report) = by_cache(&scene, &settings, &plan(mode), Backend::widest());
            means.add(film.mean()[1].0);
            let [error, se] = report.mean_error;
            let most = 3e-3 + 5.0 * se;
            assert!(error.abs() < most, "seed 200, {mode:?}: {error} +- {se}");
        }
        let error = means.standard_error();
        // 3e-3 is for the tables of the lobes.
        let is_near = (means.mean - 1.0).abs() < 3e-3 + 4.0 * error;
        assert!(is_near, "seed 200, {mode:?}: {} +- {error}", means.mean);
        assert!(t_test(&means, 1.02).p_value < 1e-4, "the twin: {means:?}");
    }
}

/// Back ends and numbers of threads learn the same and give the same bits.
#[test]
fn all_learn_the_same() {
    let plan = CachePlan {
        work: sized(25_000, 200_000),
        ..plan(CacheMode::FirstFibre)
    };
    let mut filled = 0;
    for (name, scene) in scenes().into_iter().step_by(sized(3, 1)) {
        let settings = settings(0..24, 40);
        let (first, report) = by_cache(&scene, &settings, &plan, Backend::Scalar);
        for (i, threads) in [1, 3].into_iter().enumerate() {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                // By default one of both for each number of threads.
                for backend in vector_backends()
                    .into_iter()
                    .skip(i * sized(1, 0))
                    .step_by(sized(2, 1))
                {
                    let (film, again) = by_cache(&scene, &settings, &plan, backend);
                    assert_eq!(again.digest, report.digest, "{name}, {backend:?}");
                    assert!(film == first, "{name}, {backend:?}, {threads} threads");
                }
            });
        }
        let other = RenderSettings {
            seed: 10,
            ..settings.clone()
        };
        let (_, other) = by_cache(&scene, &other, &plan, Backend::widest());
        if report.bins != [0, 0] {
            assert_ne!(other.digest, report.digest, "{name}");
            filled += 1;
        }
    }
    assert!(filled > sized(2, 4), "{filled} scenes have bins");
}

/// Light that one picture has learned serves another camera: by way of bytes, the mean is that of
/// whole paths, nothing is learned at later fibres, and all back ends and threads use it alike.
#[test]
fn kept_light_serves_another_camera() {
    let cloth = |repeats| fibres_of(repeats, silk_and_cotton());
    let mut views = vec![(
        "sky",
        scene(cloth(true), sky(), lens()),
        scene(cloth(true), sky(), FLAT),
    )];
    // By default one without lamps, whose noise would take more samples.
    let several = || several_cloths::scenes().swap_remove(sized(1, 0)).1;
    let mut moved = several();
    moved.camera = Camera::new(
        moved.camera.projection(),
        CameraPose {
            origin_mm: moved.camera.pose().origin_mm + DVec3::new(0.1, 0.1, 0.0),
            ..moved.camera.pose()
        },
        moved.camera.resolution(),
        PixelFilter::Tent,
    )
    .unwrap();
    views.push(("several", several(), moved));
    for (name, from, to) in views {
        let modes = [CacheMode::SecondFibre, CacheMode::FirstFibre];
        for mode in modes.into_iter().take(sized(1, 2)) {
            let plan = plan(mode);
            let settings = settings(0..24, u32::MAX);
            let named = EngineChoice::Named(record(Backend::widest()));
            let walks = engine(&from, &settings, named, u64::MAX).unwrap();
            let go = |_| ControlFlow::Continue(());
            let rendering = Rendering::new(&from, settings.clone()).unwrap();
            assert!(rendering.kept_light().is_none());
            let rendering = rendering.with_engine(walks).with_cache(&plan, &go).unwrap();
            let bytes = rendering.kept_light().unwrap().to_bytes();
            let light = KeptLight::from_bytes(&bytes).unwrap();
            let other = AnyMedium::VirtualFibres(packed(true, silk_and_cotton()));
            let other = scene(other, sky(), FLAT);
            let other = engine(&other, &settings, named, u64::MAX).unwrap();
            assert!(!other.takes_light(&light), "{name}, {mode:?}");
            let kept = CachePlan {
                kept: Some(Arc::new(light)),
                ..plan
            };
            let exact = RenderSettings {
                samples: 0..sized(2_048, 131_072),
                ..settings.clone()
            };
            let (film, _) = by_cells(&to, &exact, Backend::widest());
            let (mean, error) = film.mean()[1];
            let gains = gains(&to, &kept, mean);
            let all = gains.standard_error().hypot(error / mean);
            assert!(
                gains.mean.abs() < 4.0 * all,
                "seed 100, {name}, {mode:?}: {} +- {all}",
                gains.mean
            );
            // A picture that is 10 % dimmer would fail.
            assert!(all < 0.025, "seed 100, {name}, {mode:?}: +- {all}");
            let (first, report) = by_cache(&to, &settings, &kept, Backend::Scalar);
            assert_eq!(report.paths, 0, "{name}, {mode:?}");
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
            let (film, again) = pool
                .unwrap()
                .install(|| by_cache(&to, &settings, &kept, Backend::widest()));
            assert_eq!(again.digest, report.digest, "{name}, {mode:?}");
            assert!(film == first, "{name}, {mode:?}");
        }
    }
}
