//! Films of direct light against pictures of paths that have one event.

use crate::kernel::explicit_fibres::{cut, fibres_of};
use crate::kernel::packed_fibres::{hybrid, packed};
use crate::kernel::several_cloths;
use crate::kernel::virtual_fibres::silk_and_cotton;
use crate::kernel::{cloth, grid, lens, panels, parallel, record, scene, settings, sky};
use organza_basis::hypothesis::z_test;
use organza_testing::sized;
use organza_transport::*;
use std::ops::ControlFlow;

/// Pictures of a scene and of its direct light; by the general walk without an engine.
fn films(scene: &Scene, settings: &RenderSettings, by: Option<Backend>) -> (Film, Film) {
    cached_films(scene, settings, by, false)
}

/// The same, with a cache that ends paths at the second fibre.
fn cached_films(
    scene: &Scene,
    settings: &RenderSettings,
    by: Option<Backend>,
    is_cached: bool,
) -> (Film, Film) {
    let rendering = Rendering::new(scene, settings.clone()).unwrap();
    let rendering = match by {
        Some(by) => {
            let named = EngineChoice::Named(record(by));
            rendering.with_engine(engine(scene, settings, named, u64::MAX).unwrap())
        }
        None => rendering,
    };
    let all = settings.samples.end;
    let plan = CachePlan::of_picture(CacheMode::SecondFibre, 1, sized(0.01, 0.5));
    let rendering = match is_cached {
        true => rendering
            .with_cache(&plan, &|_| ControlFlow::Continue(()))
            .unwrap(),
        false => rendering,
    };
    let rendering = rendering.with_direct();
    let rendering = rendering.take(all, &|_| ControlFlow::Continue(())).unwrap();
    let direct = rendering.direct().unwrap().clone();
    (rendering.into_parts().0, direct)
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let flat = Projection::Orthographic { width_mm: 0.4 };
    let fibres = |repeats| fibres_of(repeats, silk_and_cotton());
    let packed = AnyMedium::VirtualFibres(packed(true, silk_and_cotton()));
    let mut all = vec![
        ("sky", scene(fibres(true), sky(), lens())),
        ("panels", scene(fibres(true), panels(), flat)),
        ("parallel", scene(fibres(true), parallel(), flat)),
        ("cut", scene(cut(), panels(), lens())),
        ("packed", scene(packed, parallel(), flat)),
        ("hybrid", scene(hybrid(true, 1, 1.0), sky(), flat)),
        ("grid", scene(AnyMedium::Grid(grid(true)), sky(), lens())),
        (
            "voxels",
            scene(AnyMedium::FlakeOctree(cloth()), parallel(), flat),
        ),
    ];
    all.extend(several_cloths::scenes());
    all
}

/// Direct light is what paths of one event find. Paths that are not divided find it by the same
/// random numbers, so that the sums are the same.
#[test]
fn direct_light_is_that_of_one_event() {
    let (mut others, mut twins) = (Vec::new(), 0);
    for (name, scene) in scenes() {
        let whole = settings(0..sized(256, 16_384), u32::MAX);
        let single = settings(whole.samples.clone(), 1);
        for by in [None, Some(Backend::widest())] {
            let (all, direct) = films(&scene, &whole, by);
            let (of_one, again) = films(&scene, &single, by);
            assert_eq!(of_one.mean(), again.mean(), "{name}, {by:?}");
            let means = |film: &Film| film.pixels().iter().map(|p| p.mean()).collect::<Vec<_>>();
            if means(&direct) != means(&of_one) {
                others.push((name, by.is_some()));
            }
            let held = |film: &Film| {
                let (m, n) = (film.mean()[1], of_one.mean()[1]);
                z_test(m.0, n.0, m.1.hypot(n.1)).p_value
            };
            assert!(
                held(&direct) > 1e-4,
                "{name}, {by:?}, seed 9: {}",
                held(&direct)
            );
            // The twin: light of all events.
            twins += usize::from(held(&all) < 1e-4);
        }
    }
    // There the kernel divides paths at the first event, and each part may find a panel.
    let divided = [("panels", true), ("cut", true)];
    assert_eq!(others, divided, "films of other sums");
    // Light of a cache is none of it.
    for (name, scene) in scenes() {
        let by = Some(Backend::widest());
        let whole = settings(0..sized(256, 16_384), u32::MAX);
        let (_, direct) = cached_films(&scene, &whole, by, true);
        let (of_one, _) = films(&scene, &settings(whole.samples.clone(), 1), by);
        let (m, n) = (direct.mean()[1], of_one.mean()[1]);
        let p = z_test(m.0, n.0, m.1.hypot(n.1)).p_value;
        assert!(p > 1e-4, "{name}, cached, seed 9: {p}");
    }
    assert!(twins > 8, "{twins} twins are rejected");
}

/// Portions, threads and back ends give the same film, and the picture beside it is that of
/// a render without it.
#[test]
fn films_of_direct_light_are_the_same_on_all_ways() {
    for (name, scene) in scenes() {
        let settings = settings(0..24, 40);
        let (all, direct) = films(&scene, &settings, Some(Backend::Scalar));
        let named = EngineChoice::Named(record(Backend::widest()));
        let walks = engine(&scene, &settings, named, u64::MAX).unwrap();
        let rendering = Rendering::new(&scene, settings.clone()).unwrap();
        let mut rendering = rendering.with_engine(walks).with_direct();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let rendering = pool.unwrap().install(|| {
            while rendering.left() > 0 {
                let taken = rendering.taken();
                let half = rendering.direct().cloned();
                let (film, stats) = (rendering.film().clone(), *rendering.stats());
                rendering = rendering.resume((film, half), stats, taken.end).unwrap();
                rendering = rendering.take(7, &|_| ControlFlow::Continue(())).unwrap();
            }
            rendering
        });
        assert!(rendering.direct() == Some(&direct), "{name}");
        assert!(rendering.film() == &all, "{name}");
        let (film, stats) = (all.clone(), *rendering.stats());
        let alone = rendering.resume((film, None), stats, 24);
        assert!(matches!(alone, Err(RenderError::ForeignFilm)), "{name}");
    }
}
