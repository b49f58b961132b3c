//! The kernel against the general walk, its oracle.

mod blocks;
mod direct_light;
mod energy;
mod engines;
mod explicit_fibres;
mod flake_families;
#[cfg(feature = "gpu")]
mod gpu;
#[cfg(feature = "gpu")]
mod gpu_fibres;
mod long_tables;
mod near_lights;
mod packed_fibres;
mod pictures;
mod radiance_cache;
mod several_cloths;
mod virtual_fibres;

use crate::scenes::{octree, white_sky};
use glam::{DVec3, UVec2, UVec3, Vec2, Vec3};
use organza_basis::hypothesis::{Verdict, z_test};
use organza_basis::{Aabb, PathRng, Rgb, Sym3};
use organza_kernel::proofs::Fault;
use organza_kernel::{Block, Lost, Refusal, Unsuited};
use organza_scatter::Fibre;
use organza_testing::{dielectric_fibre, little_weave, sized};
use organza_transport::*;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, LazyLock};

/// Voxels of the test tile: no multiple of anything, not cubic.
const DIMS: UVec3 = UVec3::new(13, 11, 9);
const SIZE_MM: Vec3 = Vec3::new(0.26, 0.2, 0.16);

/// Two crossing bundles of fibres with air around them; density varies from
/// voxel to voxel.
fn grid(repeats: bool) -> GridMedium {
    grid_of(repeats, 1.0)
}

/// The same with albedos times a factor.
fn grid_of(repeats: bool, factor: f32) -> GridMedium {
    let mut rng = PathRng::from_seed(77);
    let (mut density, mut sggx, mut albedo) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..DIMS.element_product() {
        let c = UVec3::new(i % DIMS.x, i / DIMS.x % DIMS.y, i / (DIMS.x * DIMS.y));
        let p = (c.as_vec3() + 0.5) / DIMS.as_vec3() - 0.5;
        let low = (p.y * 2.5).powi(2) + (p.z * 6.0 + 1.2).powi(2) < 1.0;
        let high = (p.x * 2.5).powi(2) + (p.z * 6.0 - 1.2).powi(2) < 1.0;
        let inside = if low || high { 1.0 } else { 0.0 };
        density.push([inside * (5.0 + 60.0 * rng.unit() * rng.unit())]);
        let (axis, own) = if low {
            (Vec3::new(1.0, 0.2, 0.3), [0.95, 0.8, 0.6])
        } else {
            (Vec3::new(0.1, 1.0, -0.2), [0.5, 0.9, 0.99])
        };
        sggx.push(Sym3::axial(axis.normalize(), 1.0, 0.06).to_array());
        albedo.push(own.map(|a| factor * a));
    }
    let min_mm = Vec3::new(0.1, -0.2, 0.0);
    GridMedium::new(
        Aabb::new(min_mm, min_mm + SIZE_MM),
        repeats,
        Interpolation::Nearest,
        Grid::new(DIMS, density).unwrap(),
        Grid::new(DIMS, sggx).unwrap(),
        Grid::new(DIMS, albedo).unwrap(),
    )
    .unwrap()
}

/// Fibres that cross in the same voxels: mixtures of two populations.
fn cloth() -> FlakeOctreeMedium {
    cloth_at(0)
}

/// The same at a level of detail, up to 2.
fn cloth_at(level: u8) -> FlakeOctreeMedium {
    let octree = octree(&little_weave(0.0, 0), 0.02, 2.max(level + 1));
    let optics = FlakeOptics::new(Rgb::new(0.9, 0.7, 0.5), 0.1);
    FlakeOctreeMedium::new(octree, level, vec![optics], FlakeFamily::SGGX_SPECULAR).unwrap()
}

fn parallel() -> Vec<Light> {
    let of = |d: Vec3, e: f32| {
        let irradiance = Rgb::new(e, 1.0, 0.5 * e);
        Light::from(DirectionalLight::new(d.normalize(), irradiance))
    };
    let front = of(Vec3::new(0.5, 0.3, -0.8), 1.0);
    vec![front, of(Vec3::new(-0.4, 0.2, 0.9), 1.5)]
}

fn sky() -> Vec<Light> {
    let of = |radiance, hemisphere| Light::from(EnvironmentLight::new(radiance, hemisphere));
    vec![
        of(Rgb::new(0.7, 0.8, 1.0), Hemisphere::All),
        of(Rgb::new(0.5, 0.2, 0.1), Hemisphere::Back),
    ]
}

/// One panel beside the camera, and one behind the matter that is seen through it.
fn panels() -> Vec<Light> {
    let panel = |corner, u, v, radiance, two_sided| {
        Light::from(RectangleLight::new(corner, u, v, radiance, two_sided).unwrap())
    };
    vec![
        panel(
            Vec3::new(0.4, -0.6, 0.9),
            Vec3::new(0.0, 0.9, 0.0),
            Vec3::new(0.3, 0.0, -0.3),
            Rgb::new(4.0, 2.0, 1.0),
            true,
        ),
        panel(
            Vec3::new(0.0, -0.3, -0.5),
            Vec3::new(0.5, 0.0, 0.0),
            Vec3::new(0.0, 0.5, 0.0),
            Rgb::new(0.5, 1.0, 1.0),
            false,
        ),
    ]
}

/// The endless grid, cut to a rectangle of other sizes than a period.
fn cut_grid() -> AnyMedium {
    let mut grid = AnyMedium::Grid(grid(true));
    grid.cut_to(Vec2::new(-0.05, -0.31), Vec2::new(0.45, 0.03))
        .unwrap();
    grid
}

const PINHOLE: Projection = Projection::Perspective { fov_rad: 0.25 };
const FLAT: Projection = wide(0.3);

const fn wide(width_mm: f64) -> Projection {
    Projection::Orthographic { width_mm }
}

fn lens() -> Projection {
    Projection::ThinLens {
        fov_rad: 0.3,
        aperture_mm: 0.1,
        focus_mm: 0.8,
    }
}

fn scene(medium: AnyMedium, lights: Vec<Light>, projection: Projection) -> Scene {
    let middle = medium.cell_grid().unwrap().bounds_mm().centre().as_dvec3();
    let pose = CameraPose::new(middle + DVec3::new(0.2, -0.3, 0.8), middle, DVec3::Y);
    let filter = match projection {
        Projection::Orthographic { .. } => PixelFilter::Tent,
        Projection::Perspective { .. } => PixelFilter::Box,
        Projection::ThinLens { .. } => PixelFilter::Gaussian,
    };
    Scene {
        media: vec![medium],
        lights,
        camera: Camera::new(projection, pose, UVec2::new(7, 5), filter).unwrap(),
    }
}

/// Cloth whose two fibres keep all light, under an even white sky: white in every pixel.
fn furnace(cloth: impl Fn(Vec<Fibre>) -> AnyMedium) -> Scene {
    static CLEAR: LazyLock<Fibre> = LazyLock::new(|| dielectric_fibre(Rgb::BLACK, 0.1, 0.17));
    let cloth = cloth(vec![CLEAR.clone(), CLEAR.clone()]);
    scene(cloth, vec![white_sky(Hemisphere::All)], wide(0.4))
}

fn settings(samples: Range<u64>, max_bounces: u32) -> RenderSettings {
    RenderSettings {
        integrator: Integrator::Woodcock,
        samples,
        max_bounces,
        seed: 9,
        crop: None,
    }
}

/// The film of the general walk, and its counts.
fn walked(scene: &Scene, settings: &RenderSettings) -> (Film, Stats) {
    taken(Rendering::new(scene, settings.clone()).unwrap(), settings)
}

/// The film of an engine, and its counts.
fn film(scene: &Scene, settings: &RenderSettings, engine: impl Engine + 'static) -> (Film, Stats) {
    film_by(scene, settings, Box::new(engine))
}

fn film_by<'a>(
    scene: &'a Scene,
    settings: &RenderSettings,
    engine: Box<dyn Engine + 'a>,
) -> (Film, Stats) {
    let rendering = Rendering::new(scene, settings.clone()).unwrap();
    taken(rendering.with_engine(engine), settings)
}

fn taken(rendering: Rendering<'_>, settings: &RenderSettings) -> (Film, Stats) {
    let all = settings.samples.end;
    let rendering = rendering.take(all, &|_| ControlFlow::Continue(())).unwrap();
    rendering.into_parts()
}

/// The film of the widest lanes through voxels, and its counts.
fn by_kernel(scene: &Scene, settings: &RenderSettings) -> (Film, Stats) {
    film(scene, settings, kernel(scene, settings, Backend::widest()))
}

/// The back ends beside the scalar one that this processor has.
fn vector_backends() -> Vec<Backend> {
    let (has, lacks): (Vec<_>, Vec<_>) = [Backend::Avx2, Backend::Avx512]
        .into_iter()
        .partition(|backend| backend.is_available());
    for backend in lacks {
        let why = "this processor does not have it";
        organza_testing::skipped(&format!("back end {}", backend.name()), why);
    }
    has
}

fn flat_scene(scene: &Scene, settings: &RenderSettings) -> FlatScene {
    flatten(scene, settings, u64::MAX).unwrap()
}

fn walker(flat: FlatScene, backend: Backend) -> VoxelEngine {
    VoxelEngine::new(Arc::new(flat), backend).unwrap()
}

fn kernel(scene: &Scene, settings: &RenderSettings, backend: Backend) -> VoxelEngine {
    walker(flat_scene(scene, settings), backend)
}

fn record(backend: Backend) -> &'static EngineRecord {
    engine_named(backend.name()).unwrap()
}

/// Whether two films are of one picture: all pixels and channels together, and
/// their mean.
fn agree(a: &Film, b: &Film) -> (Verdict, Verdict) {
    let (mut squares, mut values) = (0.0, 0.0);
    for (p, q) in a.pixels().iter().zip(b.pixels()) {
        for c in 0..3 {
            let (m, n) = (p.moments(c), q.moments(c));
            let variance = m.variance() / m.count as f64 + n.variance() / n.count as f64;
            if variance > 0.0 {
                squares += (m.mean - n.mean).powi(2) / variance;
                values += 1.0;
            }
        }
    }
    // Channels of a pixel are nearly one value: a third as many.
    let spread = z_test(squares / values, 1.0, (2.0 * 3.0 / values).sqrt());
    let (m, n) = (a.mean()[0], b.mean()[0]);
    (spread, z_test(m.0, n.0, m.1.hypot(n.1)))
}

/// The lesser probability of both verdicts.
fn least_p(a: &Film, b: &Film) -> f64 {
    let (spread, mean) = agree(a, b);
    spread.p_value.min(mean.p_value)
}

/// Holds two films to one picture.
fn assert_agree(name: &str, a: &Film, b: &Film) {
    let (spread, mean) = agree(a, b);
    assert!(spread.p_value > 1e-4, "{name}, seed 9: pixels {spread:?}");
    assert!(mean.p_value > 1e-4, "{name}, seed 9: mean {mean:?}");
}

/// Holds paths to as many events.
fn assert_same_events(name: &str, a: &Stats, b: &Stats) {
    let per_path = |s: &Stats| s.collisions as f64 / s.paths as f64;
    let (m, n) = (per_path(a), per_path(b));
    assert!((m / n - 1.0).abs() < 0.05, "{name}: {m}, {n} events a path");
}

/// Holds all back ends through voxels to the same bits.
fn assert_back_ends_alike(name: &str, scene: &Scene) {
    let settings = settings(0..6, 40);
    let of = |backend| film(scene, &settings, kernel(scene, &settings, backend));
    let one = of(Backend::Scalar);
    for backend in vector_backends() {
        assert!(of(backend) == one, "{name}, {backend:?}");
    }
}

fn samples() -> u64 {
    sized(2048, 65_536)
}

#[test]
fn the_kernel_agrees_with_the_general_walk() {
    let grid = |repeats| AnyMedium::Grid(grid(repeats));
    let mixtures = |level| AnyMedium::FlakeOctree(cloth_at(level));
    let scenes = [
        ("finite", scene(grid(false), parallel(), PINHOLE)),
        ("endless", scene(grid(true), parallel(), FLAT)),
        ("sky", scene(grid(false), sky(), lens())),
        ("mixtures", scene(mixtures(0), parallel(), FLAT)),
        ("mixtures, level 2", scene(mixtures(2), parallel(), FLAT)),
        ("cut, panels", scene(cut_grid(), panels(), wide(0.7))),
        ("endless sky", scene(grid(true), sky(), PINHOLE)),
        ("panels", scene(grid(false), panels(), PINHOLE)),
        ("mixtures, level 1", scene(mixtures(1), parallel(), FLAT)),
        ("cut", scene(cut_grid(), parallel(), wide(0.7))),
        ("mixtures, sky", scene(mixtures(0), sky(), FLAT)),
    ];
    // By default those that share least.
    for (name, scene) in scenes.into_iter().take(sized(6, 11)) {
        let settings = settings(0..samples(), u32::MAX);
        let (a, stats) = by_kernel(&scene, &settings);
        let (b, _) = walked(&scene, &settings);
        assert_eq!(stats.rejected + stats.majorant_violations, 0, "{name}");
        assert_agree(name, &a, &b);
        for (p, q) in a.pixels().iter().zip(b.pixels()) {
            let n = samples() as f64;
            let through = f64::from(q.straight_through());
            let error = (2.0 * through * (1.0 - through) / n).sqrt() + 4.0 / n;
            let apart = f64::from(p.straight_through()) - through;
            assert!(apart.abs() < 5.0 * error, "{name}: {apart} of {error}");
            assert!(p.count() == q.count());
            if let (Some(d), Some(e)) = (p.depth_mm(), q.depth_mm())
                && through < 0.9
            {
                assert!((d - e).abs() < 0.02, "{name}: depth {d}, {e}");
                // Crossed fibres have no main direction.
                let crossed = name.starts_with("mixtures");
                let along = p.tangent().dot(q.tangent()).abs();
                assert!(crossed || along > 0.95, "{name}");
            }
            let (m, n) = (p.mean_bounces(), q.mean_bounces());
            assert!((m - n).abs() < 0.15 * n + 0.05, "{name}: bounces {m}, {n}");
        }
    }
}

/// Exact rays set even a wrong table right; without them it is rejected.
#[test]
fn a_table_without_exact_rays_is_rejected() {
    let scene = scene(AnyMedium::Grid(grid(false)), parallel(), wide(0.2));
    let settings = settings(0..2048, 1);
    let (oracle, _) = walked(&scene, &settings);
    let wrong_table = || flat_scene(&scene, &settings).with_fault(Fault::OpticalDepths);
    let right = walker(wrong_table(), Backend::widest());
    let (right, stats) = film(&scene, &settings, right);
    assert!(stats.shadow_rays > 0);
    assert_agree("exact rays", &right, &oracle);
    let twin = wrong_table().with_fault(Fault::NoExactRays);
    let twin = walker(twin, Backend::widest());
    let (wrong, stats) = film(&scene, &settings, twin);
    assert_eq!(stats.shadow_rays, 0);
    assert!(agree(&wrong, &oracle).0.p_value < 1e-9, "seed 9");
}

#[test]
fn back_ends_threads_and_passes_give_the_same_bits() {
    let mut lights = parallel();
    lights.push(pictures::picture());
    lights.append(&mut panels());
    let (above, down) = (Vec3::new(0.1, 0.2, 0.8), Vec3::NEG_Z);
    let disc = DiscLight::new(above, down, 0.1, Rgb::WHITE, true);
    lights.push(disc.unwrap().into());
    lights.push(SpotLight::point(above, Rgb::splat(0.02)).into());
    let scene = scene(AnyMedium::FlakeOctree(cloth()), lights, lens());
    let settings = settings(0..6, 40);
    let scalar = kernel(&scene, &settings, Backend::Scalar);
    let (film_of_one, stats) = film(&scene, &settings, scalar);
    for backend in vector_backends() {
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.unwrap().install(|| {
                let made = kernel(&scene, &settings, backend);
                let (whole, counts) = film(&scene, &settings, made);
                assert_eq!(whole, film_of_one, "{backend:?}, {threads} threads");
                assert_eq!(counts, stats, "{backend:?}, {threads} threads");
            });
        }
        let mut parts = Rendering::new(&scene, settings.clone())
            .unwrap()
            .with_engine(Box::new(kernel(&scene, &settings, backend)));
        for samples in [1, 3, 2] {
            parts = parts.take(samples, &|_| ControlFlow::Continue(())).unwrap();
        }
        assert_eq!(*parts.film(), film_of_one, "{backend:?} in passes");
    }
}
