//! Paths through a woven tile of micro-flakes: the general walk against the
//! vector kernel on each of its back ends.
//!
//! The tile is that of `benches/peers/mitsuba_speed.py`: 96 x 96 x 40 voxels of
//! a plain weave, 70 /mm inside yarns, end-on ratio 0.25, albedo 0.9, 0.7, 0.5,
//! seen straight on at 128 x 128 pixels. Criterion times 16 samples of every
//! pixel; printed beside are collisions a path, the variance of a sample and
//! efficiency, 1 / (variance of the mean pixel x seconds of one thread).
#![allow(clippy::print_stdout)] // prints variances beside the timings
#![allow(clippy::unwrap_used)] // the tile is made here

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec3, UVec2, UVec3, Vec3};
use organza_basis::{Aabb, PathRng, Rgb, Sym3};
use organza_transport::{
    AnyMedium, Backend, Camera, CameraPose, DirectionalLight, EngineChoice, EnvironmentLight, Grid,
    GridMedium, Hemisphere, Integrator, Interpolation, Light, PixelFilter, Projection,
    RenderSettings, Rendering, Scene, engine, engine_named,
};
use std::f32::consts::TAU;
use std::ops::ControlFlow;
use std::time::Instant;

const SIZE_MM: f32 = 0.96;
const HEIGHT_MM: f32 = 0.4;
const SAMPLES: u64 = 16;

/// Whether a point is inside a yarn, and along what.
fn plain_weave(p: Vec3) -> Option<Vec3> {
    for family in 0..2 {
        let (along, across) = if family == 0 { (p.x, p.y) } else { (p.y, p.x) };
        for yarn in 0..2 {
            let up = if family == yarn { 0.085 } else { -0.085 };
            let phase = TAU * (along / SIZE_MM - 0.25);
            let beside = (across - (yarn as f32 + 0.5) * SIZE_MM / 2.0).abs();
            let beside = beside.min(SIZE_MM - beside) / 0.2;
            let above = (p.z - up * phase.cos()) / 0.085;
            if beside * beside + above * above < 1.0 {
                let slope = -up * phase.sin() * TAU / SIZE_MM;
                let level = if family == 0 { Vec3::X } else { Vec3::Y };
                return Some((level + slope * Vec3::Z).normalize());
            }
        }
    }
    None
}

/// The tile; `varied` has a density that differs from voxel to voxel.
fn tile(repeats: bool, varied: bool) -> GridMedium {
    let dims = UVec3::new(96, 96, 40);
    let min = Vec3::new(0.0, 0.0, -HEIGHT_MM / 2.0);
    let bounds = Aabb::new(min, min + Vec3::new(SIZE_MM, SIZE_MM, HEIGHT_MM));
    let mut rng = PathRng::from_seed(1);
    let (mut density, mut sggx) = (Vec::new(), Vec::new());
    for i in 0..dims.element_product() {
        let c = UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y));
        let p = min + (c.as_vec3() + 0.5) / dims.as_vec3() * bounds.size();
        let along = plain_weave(p);
        let here = if varied {
            -40.0 * (1.0 - rng.unit()).ln()
        } else {
            70.0
        };
        density.push([along.map_or(0.0, |_| here)]);
        sggx.push(Sym3::axial(along.unwrap_or(Vec3::Z), 1.0, 0.25 * 0.25).to_array());
    }
    GridMedium::new(
        bounds,
        repeats,
        Interpolation::Nearest,
        Grid::new(dims, density).unwrap(),
        Grid::new(dims, sggx).unwrap(),
        Grid::constant([0.9, 0.7, 0.5]),
    )
    .unwrap()
}

fn parallel() -> Vec<Light> {
    [[0.4, 0.3, -0.866_025_4], [-0.3, 0.2, 0.932_737_9]]
        .map(|d| {
            Light::from(DirectionalLight {
                direction: Vec3::from_array(d).normalize(),
                irradiance: Rgb::WHITE,
            })
        })
        .to_vec()
}

fn sky() -> Vec<Light> {
    vec![Light::from(EnvironmentLight {
        radiance: Rgb::WHITE,
        hemisphere: Hemisphere::All,
    })]
}

fn scene(medium: GridMedium, lights: Vec<Light>) -> Scene {
    let middle = DVec3::new(0.48, 0.48, 0.0);
    let pose = CameraPose {
        origin_mm: middle + 3.0 * DVec3::Z,
        target_mm: middle,
        up: DVec3::Y,
    };
    let projection = Projection::Orthographic {
        width_mm: f64::from(SIZE_MM),
    };
    Scene {
        media: vec![AnyMedium::Grid(medium)],
        lights,
        camera: Camera::new(projection, pose, UVec2::splat(128), PixelFilter::Box).unwrap(),
    }
}

/// One picture, by the kernel if there is one.
fn render<'a>(scene: &'a Scene, backend: Option<Backend>) -> Rendering<'a> {
    let settings = RenderSettings {
        integrator: Integrator::Woodcock,
        samples: 0..SAMPLES,
        max_bounces: u32::MAX,
        seed: 1,
        crop: None,
    };
    let mut rendering = Rendering::new(scene, settings.clone()).unwrap();
    if let Some(backend) = backend {
        let choice = EngineChoice::Named(engine_named(backend.name()).unwrap());
        let engine = engine(scene, &settings, choice, u64::MAX).unwrap();
        rendering = rendering.with_engine(engine);
    }
    rendering
}

fn transport(c: &mut Criterion) {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let one = one.unwrap();
    let back_ends = [
        None,
        Some(Backend::Scalar),
        Some(Backend::Avx2),
        Some(Backend::Avx512),
    ];
    for (name, scene) in [
        ("tile", scene(tile(false, false), parallel())),
        ("endless", scene(tile(true, false), parallel())),
        ("varied", scene(tile(false, true), parallel())),
        ("sky", scene(tile(false, false), sky())),
    ] {
        let mut group = c.benchmark_group(name);
        group.sample_size(10);
        group.throughput(Throughput::Elements(SAMPLES * 128 * 128));
        for backend in back_ends {
            if backend.is_some_and(|b| !b.is_available()) {
                continue;
            }
            let label = backend.map_or("walk", Backend::name);
            let go = |rendering: Rendering<'_>| {
                let go = || rendering.take(SAMPLES, &|_| ControlFlow::Continue(()));
                one.install(go).unwrap().into_parts()
            };
            let rendering = render(&scene, backend);
            let started = Instant::now();
            let (film, stats) = go(rendering);
            let seconds = started.elapsed().as_secs_f64();
            let variances = film
                .pixels()
                .iter()
                .flat_map(|p| (0..3).map(|c| p.moments(c).variance() / p.moments(c).count as f64));
            let variance = variances.sum::<f64>() / (3 * film.pixels().len()) as f64;
            println!(
                "{name}, {label}: {:.2} collisions a path, variance of a sample {:.5}, efficiency {:.0}",
                stats.collisions as f64 / stats.paths as f64,
                variance * SAMPLES as f64,
                1.0 / (variance * seconds)
            );
            group.bench_function(label, |b| {
                b.iter_batched(
                    || render(&scene, backend),
                    go,
                    criterion::BatchSize::PerIteration,
                );
            });
        }
        group.finish();
    }
}

criterion_group!(benches, transport);
criterion_main!(benches);
