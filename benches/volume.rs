//! The voxelizer's rate, look-ups of voxels at random points, files.
#![allow(clippy::print_stdout)] // prints sizes beside the timings

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use glam::{UVec3, Vec3};
use organza_basis::curve::SegmentList;
use organza_basis::{Aabb, Budget, Mixture, PathRng, Segment, SegmentSource, Tile, unwatched};
use organza_scatter::{FlakeMaterials, FlakeOptics};
use organza_volume::{GridSet, Octree, VoxelizeOptions, ovox, vdb, voxelize};
use std::f32::consts::TAU;
use std::hint::black_box;

/// Crossed layers of yarns of 400 twisted fibres: 0.41 of a yarn is fibre.
struct Layers {
    yarns: u32,
    fibres: u32,
}

const SPACING_MM: f32 = 0.4;
const STEP_MM: f32 = 0.02;

impl SegmentSource for Layers {
    fn tile(&self) -> Tile {
        let side = SPACING_MM * self.yarns as f32;
        Tile {
            bounds_mm: Aabb::new(Vec3::new(0.0, 0.0, -0.3), Vec3::new(side, side, 0.3)),
            repeats: true,
        }
    }

    fn batch_count(&self) -> usize {
        2 * self.yarns as usize
    }

    fn for_each_in_batch(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        let yarn = batch as u32;
        let warp = yarn >= self.yarns;
        let across = ((yarn % self.yarns) as f32 + 0.5) * SPACING_MM;
        let steps = (self.yarns as f32 * SPACING_MM / STEP_MM).round() as u32;
        let mut rng = PathRng::new(1, u64::from(yarn), 0);
        for fibre in 0..self.fibres {
            let u = rng.unit2();
            let out = 0.14 * u.x.sqrt();
            let point = |i: u32| {
                let along = i as f32 * STEP_MM;
                let (sin, cos) = (TAU * (u.y + along / 1.2)).sin_cos();
                let z = if warp { 0.14 } else { -0.14 } + out * sin;
                let side = across + out * cos;
                if warp {
                    Vec3::new(side, along, z)
                } else {
                    Vec3::new(along, side, z)
                }
            };
            for i in 0..steps {
                let s = Segment::straight(point(i), point(i + 1), 0.0045);
                emit(&Segment {
                    yarn,
                    fibre,
                    material: u16::from(warp),
                    ..s
                });
            }
        }
    }

    fn material_count(&self) -> usize {
        2
    }
}

fn tile(yarns: u32) -> Octree {
    let source = Layers { yarns, fibres: 400 };
    voxelize(&source, &VoxelizeOptions::default(), &unwatched).unwrap_or_else(|e| panic!("{e}"))
}

fn voxelizer(c: &mut Criterion) {
    // Segments ready in memory: the rate is the voxelizer's alone.
    let source = Layers {
        yarns: 6,
        fibres: 400,
    };
    let mut segments = Vec::new();
    for batch in 0..source.batch_count() {
        source.for_each_in_batch(batch, &mut |s| segments.push(*s));
    }
    let list = SegmentList {
        tile: source.tile(),
        segments,
    };
    let mut group = c.benchmark_group("voxelize");
    group.sample_size(10);
    group.throughput(Throughput::Elements(list.segments.len() as u64));
    for voxel_um in [10.0f32, 20.0] {
        let options = VoxelizeOptions {
            voxel_mm: 0.001 * voxel_um,
            ..VoxelizeOptions::default()
        };
        group.bench_function(format!("{voxel_um} um, all threads"), |b| {
            b.iter(|| voxelize(&list, &options, &unwatched));
        });
    }
    group.finish();
}

fn look_ups(c: &mut Criterion) {
    let tree = tile(8);
    let bytes = tree.memory_bytes() as f64 / tree.occupied_voxels() as f64;
    println!(
        "octree, {} levels: {bytes:.1} bytes per occupied finest voxel",
        tree.level_count()
    );
    let dims = tree.dims(0);
    let mut rng = PathRng::from_seed(2);
    let points: Vec<UVec3> = (0..1 << 16)
        .map(|_| UVec3::new(rng.below(dims.x), rng.below(dims.y), rng.below(dims.z)))
        .collect();
    let mut group = c.benchmark_group("look-up");
    group.throughput(Throughput::Elements(points.len() as u64));
    let mut of = |name: &str, value: &dyn Fn(UVec3) -> f32| {
        group.bench_function(name, |b| {
            b.iter(|| points.iter().map(|p| value(*p)).sum::<f32>());
        });
    };
    of("broadside extinction", &|p| tree.broadside_per_mm(0, p));
    of("whole mixture", &|p| tree.mixture(0, p).broadside_per_mm());
    of("majorant of a 4^3 region", &|p| {
        tree.majorant_per_mm(2, p >> 2u32)
    });
    group.finish();
}

fn files(c: &mut Criterion) {
    let tree = tile(4);
    let mut bytes = Vec::new();
    ovox::write(&tree, &[], &mut bytes).unwrap_or_else(|e| panic!("{e}"));
    println!(
        ".ovox: {} bytes for {} in memory",
        bytes.len(),
        tree.memory_bytes()
    );
    let mut group = c.benchmark_group("files");
    group.sample_size(10);
    group.throughput(Throughput::Bytes(tree.memory_bytes()));
    group.bench_function(".ovox write", |b| {
        b.iter_batched(
            Vec::new,
            |mut out| ovox::write(&tree, &[], &mut out).map(|()| out),
            BatchSize::LargeInput,
        );
    });
    group.bench_function(".ovox read", |b| {
        b.iter(|| ovox::read(&mut &bytes[..], &mut Budget::new(u64::MAX)))
    });
    let optics = FlakeOptics::new(organza_basis::Rgb::WHITE, 0.1);
    let materials = FlakeMaterials::new(vec![optics; tree.material_count()]);
    let merge = |mixture: &Mixture| materials.merged(mixture);
    group.bench_function(".vdb grids and write", |b| {
        b.iter(|| {
            vdb::write(
                &vdb::grids_from_octree(&tree, 0, true, &merge),
                vdb::Codec::Zip,
                &mut Vec::new(),
            )
        });
    });
    group.bench_function(".vol triple", |b| {
        b.iter(|| black_box(GridSet::from_octree(&tree, 0, &merge)));
    });
    group.finish();
}

criterion_group!(benches, voxelizer, look_ups, files);
criterion_main!(benches);
