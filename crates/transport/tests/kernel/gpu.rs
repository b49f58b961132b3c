//! The engine for graphics adapters against the engine for processors, its oracle. On a
//! computer without adapters the tests say so and pass; llvmpipe will do.

use crate::kernel::energy::white_slab;
use crate::kernel::pictures::picture;
use crate::kernel::virtual_fibres::silk_and_cotton;
use crate::kernel::{
    FLAT, PINHOLE, assert_agree, cloth, cut_grid, film, flake_families, flat_scene, grid, grid_of,
    least_p, lens, panels, parallel, scene, settings, sky, virtual_fibres, walker, wide,
};
use crate::scenes::sun;
use glam::{DVec3, UVec2, UVec3, Vec3};
use organza_basis::{Aabb, Rgb, Sym3};
use organza_kernel::gpu::{Division, GpuEngine, check_source};
use organza_kernel::proofs::Fault;
use organza_kernel::{Refusal, Reserve};
use organza_testing::sized;
use organza_transport::*;
use std::ops::ControlFlow;
use std::sync::Arc;

/// How the work of tests is divided: little, for programs on a processor.
const SMALL: Division = Division {
    lanes: 256,
    steps: Some(64),
    table_bytes: None,
};

/// An engine for a scene; `None`, with a line of its own, without adapters.
fn engine(flat: &Arc<FlatScene>, division: Division) -> Option<GpuEngine> {
    available(GpuEngine::for_voxels(flat, Some(division))).map(|made| made.unwrap())
}

/// What was made, or why it was refused; `None`, with a line of its own, without adapters.
pub fn available<T>(made: Result<T, Refusal>) -> Option<Result<T, Refusal>> {
    if let Err(Refusal::Unavailable { needs, .. }) = made {
        organza_testing::skipped("engine gpu", &format!("this computer lacks {needs}"));
        return None;
    }
    Some(made)
}

/// The film of an adapter, if there is one.
fn by_adapter(scene: &Scene, settings: &RenderSettings, flat: FlatScene) -> Option<(Film, Stats)> {
    let engine = engine(&Arc::new(flat), SMALL)?;
    Some(film(scene, settings, engine))
}

fn by_processor(scene: &Scene, settings: &RenderSettings, flat: FlatScene) -> (Film, Stats) {
    film(scene, settings, walker(flat, Backend::widest()))
}

/// Other random numbers than [`settings`].
fn other_settings(settings: &RenderSettings) -> RenderSettings {
    RenderSettings {
        seed: 10,
        ..settings.clone()
    }
}

fn fibres() -> AnyMedium {
    let fibres = virtual_fibres::cloth(silk_and_cotton(), VirtualFibreEvent::Plain);
    AnyMedium::VirtualFibres(fibres)
}

/// Every part of the programs is needed by one of these.
fn scenes() -> Vec<(&'static str, Scene)> {
    let wide = wide(0.7);
    let grid = |repeats| AnyMedium::Grid(grid(repeats));
    let mixtures = || AnyMedium::FlakeOctree(cloth());
    let all = || [parallel(), sky(), panels(), vec![picture()]].concat();
    vec![
        ("finite", scene(grid(false), parallel(), PINHOLE)),
        ("endless", scene(grid(true), parallel(), FLAT)),
        ("sky", scene(grid(false), sky(), lens())),
        ("mixtures", scene(mixtures(), parallel(), FLAT)),
        ("panels", scene(grid(false), panels(), PINHOLE)),
        ("cut, panels", scene(cut_grid(), panels(), wide)),
        ("picture", scene(grid(true), vec![picture()], lens())),
        ("virtual fibres", scene(fibres(), parallel(), FLAT)),
        ("virtual fibres, all lights", scene(fibres(), all(), wide)),
    ]
}

/// With the same random numbers, most paths go the same way on both; with one event, nearly
/// all. Sources are valid for every adapter.
#[test]
fn paths_on_an_adapter_are_those_of_a_processor() {
    for (i, (name, scene)) in scenes().into_iter().enumerate() {
        let flat = Arc::new(flat_scene(&scene, &settings(0..1, 8)));
        let source = GpuEngine::source_for_voxels(&flat).unwrap();
        check_source(&source).unwrap_or_else(|e| panic!("{name}: {e}"));
        // By default pixels of the others are compared, below.
        if i % sized(2, 1) > 0 {
            continue;
        }
        for (max_bounces, expected) in [(1, 0.95), (8, 0.75)] {
            let settings = settings(0..1, max_bounces);
            let made = || flat_scene(&scene, &settings);
            let Some((own, stats)) = by_adapter(&scene, &settings, made()) else {
                return;
            };
            let (oracle, counts) = by_processor(&scene, &settings, made());
            assert_eq!(stats.paths, counts.paths, "{name}");
            assert_eq!(stats.rejected + stats.majorant_violations, 0, "{name}");
            let pairs = || own.pixels().iter().zip(oracle.pixels());
            let same = pairs().filter(|(p, q)| {
                let (a, b) = (p.mean().0, q.mean().0);
                let near = (a - b).abs().max_element() <= 1e-3 * b.abs().max_element() + 1e-5;
                near && p.mean_bounces() == q.mean_bounces() && p.yarn() == q.yarn()
            });
            let share = same.count() as f64 / own.pixels().len() as f64;
            assert!(share > expected, "{name}: {share} of paths are the same");
        }
    }
    // The twin: other random numbers.
    let (name, scene) = &scenes()[0];
    let settings = settings(0..1, 1);
    let other = other_settings(&settings);
    let (a, _) = by_processor(scene, &settings, flat_scene(scene, &settings));
    let (b, _) = by_processor(scene, &settings, flat_scene(scene, &other));
    let same = a.pixels().iter().zip(b.pixels()).filter(|(p, q)| p == q);
    assert!(same.count() < 18, "{name}");
}

fn samples() -> u64 {
    sized(1024, 32_768)
}

#[test]
fn an_adapter_agrees_with_a_processor_pixel_by_pixel() {
    let (first, step) = sized((1, 2), (0, 1));
    for (name, scene) in scenes().into_iter().skip(first).step_by(step) {
        let settings = settings(0..samples(), u32::MAX);
        let other = other_settings(&settings);
        let Some((own, stats)) = by_adapter(&scene, &settings, flat_scene(&scene, &settings))
        else {
            return;
        };
        let (oracle, counts) = by_processor(&scene, &other, flat_scene(&scene, &other));
        assert_eq!(stats.rejected + stats.majorant_violations, 0, "{name}");
        assert_agree(name, &own, &oracle);
        let per_path = |work: u64, stats: &Stats| work as f64 / stats.paths as f64;
        let (a, b) = (
            per_path(stats.tentative, &stats),
            per_path(counts.tentative, &counts),
        );
        assert!((a / b - 1.0).abs() < 0.1, "{name}: {a} {b} look-ups a path");
        let counts = |film: &Film| film.pixels().iter().map(Pixel::count).collect::<Vec<_>>();
        assert_eq!(counts(&own), counts(&oracle), "{name}");
        assert_depths_agree(name, &own, &oracle, samples(), 0.3);
    }
}

/// Holds what is seen through, and depths, to those of more samples; fibres that a pixel shows
/// lie in so thick a layer.
pub fn assert_depths_agree(name: &str, own: &Film, oracle: &Film, samples: u64, layer_mm: f64) {
    for (p, q) in own.pixels().iter().zip(oracle.pixels()) {
        let n = samples as f64;
        let through = f64::from(q.straight_through());
        let error = (2.0 * through * (1.0 - through) / n).sqrt() + 4.0 / n;
        let apart = f64::from(p.straight_through()) - through;
        assert!(apart.abs() < 5.0 * error, "{name}: {apart} of {error}");
        if let (Some(d), Some(e)) = (p.depth_mm(), q.depth_mm())
            && through < 0.9
        {
            // A depth deviates by half of the layer at most.
            let error = 0.5 * layer_mm / (n * (1.0 - through)).sqrt();
            assert!((d - e).abs() < 5.0 * error, "{name}: depth {d}, {e}");
        }
    }
}

/// What a comparison must find: less albedo by a fiftieth, light found twice or never, no
/// exact rays, other fibres.
#[test]
fn twins_on_an_adapter_are_rejected() {
    let settings = settings(0..sized(1024, 131_072), u32::MAX);
    let other = other_settings(&settings);
    let p_of = |own: &Scene, scene: &Scene, fault: Option<Fault<'_>>| {
        let mut flat = flat_scene(own, &settings);
        if let Some(fault) = fault {
            flat = flat.with_fault(fault);
        }
        let (film, _) = by_adapter(own, &settings, flat)?;
        let (oracle, _) = by_processor(scene, &other, flat_scene(scene, &other));
        Some(least_p(&film, &oracle))
    };
    let darker = |albedo: f32| {
        let medium = AnyMedium::Grid(grid_of(true, albedo));
        scene(medium, sky(), PINHOLE)
    };
    let (bright, dark) = (darker(1.0), darker(0.98));
    let Some(right) = p_of(&bright, &bright, None) else {
        return;
    };
    assert!(right > 1e-4, "seed 9: {right}");
    let wrong = p_of(&dark, &bright, None).unwrap();
    assert!(wrong < 1e-6, "albedo, seed 9: {wrong}");
    let lamps = scene(AnyMedium::Grid(grid(true)), vec![picture()], PINHOLE);
    for fault in [Fault::LampsTwice, Fault::NoLamps] {
        let wrong = p_of(&lamps, &lamps, Some(fault)).unwrap();
        assert!(wrong < 1e-6, "lamps, seed 9: {wrong}");
    }
    let woven = scene(fibres(), parallel(), PINHOLE);
    let dyed = organza_testing::dielectric_fibre(Rgb::splat(0.5), 0.09, 0.2);
    let dyed = [dyed.clone(), dyed];
    let wrong = p_of(&woven, &woven, Some(Fault::Fibres(&dyed))).unwrap();
    assert!(wrong < 1e-6, "fibres, seed 9: {wrong}");
    // Exact rays set a wrong table right.
    let right = p_of(&woven, &woven, Some(Fault::OpticalDepths)).unwrap();
    assert!(right > 1e-4, "tables, seed 9: {right}");
}

#[test]
fn the_same_seed_gives_the_same_bits_however_work_is_divided() {
    let all = [parallel(), sky(), vec![picture()]].concat();
    let scene = scene(fibres(), all, lens());
    let settings = settings(0..6, 40);
    let flat = Arc::new(flat_scene(&scene, &settings));
    let of = |division| Some(film(&scene, &settings, engine(&flat, division)?));
    let Some(first) = of(SMALL) else {
        return;
    };
    assert!(first.1.collisions > 100);
    for division in [
        SMALL,
        Division {
            lanes: 64,
            steps: Some(7),
            ..SMALL
        },
        Division {
            lanes: 128,
            steps: None,
            table_bytes: Some(flat.memory_bytes().div_ceil(3)),
        },
    ] {
        assert!(of(division).unwrap() == first, "{division:?}");
    }
    let mut parts = Rendering::new(&scene, settings.clone())
        .unwrap()
        .with_engine(Box::new(engine(&flat, SMALL).unwrap()));
    for samples in [1, 3, 2] {
        parts = parts.take(samples, &|_| ControlFlow::Continue(())).unwrap();
    }
    assert!(*parts.film() == first.0, "in passes");
}

/// Samples brighter than the sums of a slot hold are counted one by one.
#[test]
fn very_bright_samples_are_kept() {
    let wide = Projection::Perspective { fov_rad: 2.5 };
    let mut scene = scene(AnyMedium::Grid(grid(false)), sky(), wide);
    let middle = scene.media[0].cell_grid().unwrap().bounds_mm().centre();
    let corner = middle - Vec3::new(4.0, 4.0, 3.0);
    let (u, v) = (8.0 * Vec3::X, 8.0 * Vec3::Y);
    let lamp = RectangleLight::new(corner, u, v, Rgb::WHITE, true).unwrap();
    scene.lights = vec![lamp.into()];
    let settings = settings(0..4, 3);
    let mut flat = flat_scene(&scene, &settings);
    flat = flat.with_fault(Fault::Dim(1e-4));
    let twin = flat_scene(&scene, &settings).with_fault(Fault::Dim(1e-4));
    let Some((own, _)) = by_adapter(&scene, &settings, flat) else {
        return;
    };
    let (oracle, _) = by_processor(&scene, &settings, twin);
    let (a, b) = (own.mean()[0].0, oracle.mean()[0].0);
    assert!(b > 0.01 && (a / b - 1.0).abs() < 0.2, "{a} {b}");
    assert!(own.pixels().iter().all(|p| p.count() == 4));
}

/// White fibres are invisible in even light after tens of events. The twin rounds a factor
/// of every event.
#[test]
fn white_fibres_keep_all_light_on_an_adapter() {
    let settings = settings(0..sized(1024, 2048), u32::MAX);
    let scene = white_slab(7.0, 250, 0.05);
    let made = || flat_scene(&scene, &settings);
    let Some((own, stats)) = by_adapter(&scene, &settings, made()) else {
        return;
    };
    assert!(stats.collisions > 5 * stats.paths);
    let is_near = |(mean, error): (f64, f64)| (mean - 1.0).abs() < 1e-3 + 4.0 * error;
    let mean = own.mean()[1];
    assert!(is_near(mean) && mean.1 < 2e-3, "seed 9: {mean:?}");
    let twin = made().with_fault(Fault::RoundedScale);
    let (twin, _) = by_adapter(&scene, &settings, twin).unwrap();
    assert!(!is_near(twin.mean()[1]), "seed 9: {:?}", twin.mean());
}

/// The slab of `tests/slab.rs`, for which an independent renderer computed the BSDF.
#[test]
fn the_slab_has_the_bsdf_of_an_independent_renderer() {
    let rows =
        organza_testing::csv_numbers(include_str!("../../../../tests/data/slab_mitsuba.csv"));
    let bounds = Aabb::new(Vec3::new(-0.2, -0.2, -0.15), Vec3::new(0.2, 0.2, 0.15));
    let dims = UVec3::new(3, 2, 12);
    let mut twin_rejected = 0;
    for row in rows.iter().step_by(sized(4, 1) as usize) {
        let direction = |theta_deg: f64, phi_deg: f64| {
            let (theta, phi) = (theta_deg.to_radians(), phi_deg.to_radians());
            let sin = theta.sin();
            DVec3::new(sin * phi.cos(), sin * phi.sin(), theta.cos())
        };
        let (w_in, w_out) = (direction(row[0], row[1]), direction(row[2], row[3]));
        let medium = GridMedium::new(
            bounds,
            true,
            Interpolation::Nearest,
            Grid::new(dims, vec![[20.0]; 72]).unwrap(),
            Grid::constant(Sym3::axial(Vec3::X, 1.0, 0.04).to_array()),
            Grid::constant([0.95, 0.8, 0.5]),
        );
        let face = DVec3::new(0.0, 0.0, 0.15f64.copysign(w_out.z));
        let pose = CameraPose::new(face + 3.0 * w_out, face, DVec3::new(0.3, 1.0, 0.1));
        let projection = Projection::Orthographic { width_mm: 0.1 };
        let scene = Scene {
            media: vec![AnyMedium::Grid(medium.unwrap())],
            lights: vec![sun(-w_in.as_vec3(), 1.0)],
            camera: Camera::new(projection, pose, UVec2::splat(16), PixelFilter::Box).unwrap(),
        };
        let settings = settings(0..sized(256, 4096), u32::MAX);
        let Some((film, _)) = by_adapter(&scene, &settings, flat_scene(&scene, &settings)) else {
            return;
        };
        let cosine = w_in.z.abs();
        for (c, (mean, error)) in film.mean().into_iter().enumerate() {
            let error = (error / cosine).hypot(row[7 + c]);
            let apart = |value: f64| (value - row[4 + c]).abs() / error;
            let own = apart(mean / cosine);
            assert!(
                own < 4.5,
                "seed 9, {row:?}, channel {c}: {own} standard errors"
            );
            twin_rejected += usize::from(apart(1.05 * mean / cosine) > 4.5);
        }
    }
    assert!(twin_rejected > 0);
}

/// A lost device leaves its block as it was; an engine in reserve goes on from there.
#[test]
fn another_engine_goes_on_where_a_device_is_lost() {
    let scene = scene(AnyMedium::Grid(grid(false)), parallel(), lens());
    let settings = settings(0..6, 40);
    let flat = Arc::new(flat_scene(&scene, &settings));
    let Some(gpu) = engine(&flat, SMALL) else {
        return;
    };
    let handle = Arc::new(gpu);
    let rendering = Rendering::new(&scene, settings.clone()).unwrap();
    let alone = rendering.with_engine(Box::new(Shared(Arc::clone(&handle))));
    let alone = alone.take(2, &|_| ControlFlow::Continue(())).unwrap();
    let begun = alone.film().clone();
    let spare = Arc::clone(&flat);
    let backed = Reserve::new(Box::new(Shared(Arc::clone(&handle))), move || {
        Ok(Box::new(VoxelEngine::new(
            Arc::clone(&spare),
            Backend::widest(),
        )?))
    });
    handle.lose();
    let lost = alone.take(2, &|_| ControlFlow::Continue(())).err().unwrap();
    assert!(matches!(lost, RenderError::Lost(_)), "{lost}");
    assert!(lost.to_string().contains("lost on purpose"), "{lost}");
    let rendering = Rendering::new(&scene, settings.clone()).unwrap();
    let rendering = rendering
        .resume((begun, None), Stats::default(), 2)
        .unwrap();
    let mut rendering = rendering.with_engine(Box::new(backed));
    rendering = rendering.take(4, &|_| ControlFlow::Continue(())).unwrap();
    let engine = rendering.engine().unwrap();
    assert!(engine.loss().is_some());
    assert_eq!(engine.name(), format!("gpu+{}", Backend::widest().name()));
    assert!(rendering.film().pixels().iter().all(|p| p.count() == 6));
    // The samples that were left are those of the processor.
    let (whole, _) = film(
        &scene,
        &RenderSettings {
            samples: 2..6,
            ..settings
        },
        VoxelEngine::new(flat, Backend::widest()).unwrap(),
    );
    let bounces: f64 = whole.pixels().iter().map(|p| 4.0 * p.mean_bounces()).sum();
    let pixels = rendering.film().pixels().iter();
    let all: f64 = pixels.map(|p| 6.0 * p.mean_bounces()).sum();
    assert!(all >= bounces);
}

/// An engine that something else can lose.
struct Shared(Arc<GpuEngine>);

impl Engine for Shared {
    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn memory_bytes(&self) -> u64 {
        self.0.memory_bytes()
    }

    fn rows_per_block(&self, rows: u32, threads: u32) -> u32 {
        self.0.rows_per_block(rows, threads)
    }

    fn take(&self, block: &mut organza_kernel::Block<'_>) -> Result<Stats, organza_kernel::Lost> {
        self.0.take(block)
    }
}

/// What an adapter cannot hold is refused with the figures.
#[test]
fn tables_beyond_the_limits_are_refused() {
    let scene = scene(AnyMedium::Grid(grid(false)), parallel(), lens());
    let flat = Arc::new(flat_scene(&scene, &settings(0..1, 1)));
    let tiny = Division {
        table_bytes: Some(256),
        ..SMALL
    };
    let Some(made) = available(GpuEngine::for_voxels(&flat, Some(tiny))) else {
        return;
    };
    match made.err() {
        Some(Refusal::Binding(needed, most)) => {
            assert!(needed > most && most >= 256, "{needed} {most}");
        }
        other => panic!("{other:?}"),
    }
}

/// Shaders have mirrors of the SGGX distribution alone; the others are left to processors.
#[test]
fn other_families_of_flakes_are_refused() {
    for family in FlakeFamily::all() {
        let cloth = flake_families::cloth(family, [0.9; 2]);
        let scene = scene(cloth, parallel(), FLAT);
        let made = Arc::new(flat_scene(&scene, &settings(0..1, 8)));
        let source = GpuEngine::source_for_voxels(&made);
        let is_refused = matches!(source, Err(Refusal::NotYet(_)));
        let expected = family != FlakeFamily::SGGX_SPECULAR;
        assert_eq!(is_refused, expected, "{family:?}");
    }
}
