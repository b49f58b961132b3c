//! Films of direct light against pictures of paths that have one event.

use crate::kernel::explicit_fibres::{cut, fibres_of};
use crate::kernel::packed_fibres::{hybrid, packed};
use crate::kernel::virtual_fibres::silk_and_cotton;
use crate::kernel::{
    cloth, grid, lens, panels, parallel, record, scene, settings, several_cloths, sky, wide,
};
use organza_basis::hypothesis::z_test;
use organza_testing::sized;
use organza_transport::*;
use std::ops::ControlFlow;

/// By the general walk without an engine.
fn rendering<'a>(
    scene: &'a Scene,
    settings: &RenderSettings,
    by: Option<Backend>,
) -> Rendering<'a> {
    let rendering = Rendering::new(scene, settings.clone()).unwrap();
    let Some(by) = by else {
        return rendering;
    };
    let named = EngineChoice::Named(record(by));
    rendering.with_engine(engine(scene, settings, named, u64::MAX).unwrap())
}

/// Pictures of a scene and of its direct light.
fn films(scene: &Scene, settings: &RenderSettings, by: Option<Backend>) -> (Film, Film) {
    of_both(rendering(scene, settings, by), settings)
}

fn of_both(rendering: Rendering<'_>, settings: &RenderSettings) -> (Film, Film) {
    let all = settings.samples.end;
    let rendering = rendering.with_direct();
    let rendering = rendering.take(all, &|_| ControlFlow::Continue(())).unwrap();
    let direct = rendering.direct().unwrap().clone();
    (rendering.into_parts().0, direct)
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let flat = wide(0.4);
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

/// How probable means so far apart are in pictures of the same light.
fn p_of_means(a: &Film, b: &Film) -> f64 {
    let (m, n) = (a.mean()[1], b.mean()[1]);
    z_test(m.0, n.0, m.1.hypot(n.1)).p_value
}

/// Direct light is what paths of one event find. Paths that are not divided find it by the same
/// random numbers, so that the sums are the same.
#[test]
fn direct_light_is_that_of_one_event() {
    let (mut others, mut twins) = (Vec::new(), 0);
    let whole = settings(0..sized(64, 16_384), u32::MAX);
    let single = settings(whole.samples.clone(), 1);
    let engines = [None, Some(Backend::widest())];
    for (i, (name, scene)) in scenes().into_iter().enumerate() {
        // By default the general walk takes every other scene.
        for by in engines.into_iter().skip(i % sized(2, 1)) {
            let (all, direct) = films(&scene, &whole, by);
            let (of_one, again) = films(&scene, &single, by);
            assert_eq!(of_one.mean(), again.mean(), "{name}, {by:?}");
            let means = |film: &Film| film.pixels().iter().map(|p| p.mean()).collect::<Vec<_>>();
            if means(&direct) != means(&of_one) {
                others.push((name, by.is_some()));
            }
            let p = p_of_means(&direct, &of_one);
            assert!(p > 1e-4, "{name}, {by:?}, seed 9: {p}");
            // The twin: light of all events.
            twins += usize::from(p_of_means(&all, &of_one) < 1e-4);
            if by.is_none() {
                continue;
            }
            // Light of a cache, which ends paths at the second fibre, is none of it.
            let plan = CachePlan::of_picture(CacheMode::SecondFibre, 1, sized(0.01, 0.5));
            let cached = rendering(&scene, &whole, by);
            let cached = cached.with_cache(&plan, &|_| ControlFlow::Continue(()));
            let (_, direct) = of_both(cached.unwrap(), &whole);
            let p = p_of_means(&direct, &of_one);
            assert!(p > 1e-4, "{name}, cached, seed 9: {p}");
        }
    }
    // There the kernel divides paths at the first event, and each part may find a panel.
    let divided = [("panels", true), ("cut", true)];
    assert_eq!(others, divided, "films of other sums");
    assert!(twins > 8, "{twins} twins are rejected");
}

/// Portions, threads and back ends give the same film, and the picture beside it is that of
/// a render without it.
#[test]
fn films_of_direct_light_are_the_same_however_they_are_made() {
    for (name, scene) in scenes() {
        let settings = settings(0..24, 40);
        let (all, direct) = films(&scene, &settings, Some(Backend::Scalar));
        let mut rendering = rendering(&scene, &settings, Some(Backend::widest())).with_direct();
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
