//! Transmittance of shadow rays in cloth: ratio tracking against exact
//! stepping, whole and stopped early.
//!
//! Rays start at collisions inside denim and go to a light at 40 degrees. All
//! three are unbiased; criterion times them, and printed beside are steps a
//! ray, variance about the exact value and efficiency, 1 / (variance of an
//! average ray's light x time), where the variance of exact stepping is what
//! the rays differ in.
#![allow(clippy::print_stdout)] // prints variances beside the timings
#![allow(clippy::unwrap_used)] // the tile is the repository's own

use criterion::{Criterion, criterion_group, criterion_main};
use glam::Vec3;
use organza_basis::{Budget, Moments, PathRng, Ray, Rgb};
use organza_transport::{
    FlakeOptics, LocalRay, Medium, SggxOctreeMedium, Stats, exact_transmittance, sample_collision,
    stopped_transmittance, transmittance,
};
use organza_volume::ovox;
use std::hint::black_box;
use std::time::Instant;

const RAYS: usize = 4096;

fn denim() -> SggxOctreeMedium {
    let bytes = include_bytes!("../volumes/denim.ovox");
    let octree = ovox::read(&mut &bytes[..], &mut Budget::new(1 << 30))
        .unwrap()
        .octree;
    let optics = FlakeOptics {
        albedo: Rgb::splat(0.8),
        end_on_ratio: 0.1,
    };
    let materials = octree.material_count();
    SggxOctreeMedium::new(octree, 0, vec![optics; materials]).unwrap()
}

/// Rays to the light from first collisions of light that falls straight in.
fn rays(medium: &SggxOctreeMedium) -> Vec<LocalRay> {
    let bounds = medium.cell_grid().bounds_mm();
    let mut rng = PathRng::from_seed(1);
    let mut stats = Stats::default();
    let toward = Vec3::new(0.5, 0.4, 0.77).normalize();
    let mut rays = Vec::new();
    while rays.len() < RAYS {
        let p = bounds.min + rng.unit2().extend(0.0) * bounds.size();
        let ray = Ray::new(p.with_z(bounds.max.z + 1.0), Vec3::NEG_Z);
        let Some(local) = medium.cell_grid().clip(&ray, f64::INFINITY) else {
            continue;
        };
        if let Some((t, _)) = sample_collision(medium, &local, &mut rng, &mut stats) {
            let at = ray.at(local.t_entry + f64::from(t));
            let shadow = Ray::new(at, toward);
            rays.extend(medium.cell_grid().clip(&shadow, f64::INFINITY));
        }
    }
    rays
}

type Estimator = fn(&SggxOctreeMedium, &LocalRay, &mut PathRng, &mut Stats) -> f32;

const ESTIMATORS: [(&str, Estimator); 3] = [
    ("ratio", transmittance),
    ("exact", |m, r, _, s| exact_transmittance(m, r, s)),
    ("exact, stopped", stopped_transmittance),
];

fn shadow_rays(c: &mut Criterion) {
    let medium = denim();
    let rays = rays(&medium);
    let mut group = c.benchmark_group("shadow_rays");
    group.sample_size(10);
    for (name, estimate) in ESTIMATORS {
        let (mut stats, mut light) = (Stats::default(), Moments::default());
        let mut rng = PathRng::from_seed(2);
        let started = Instant::now();
        for _ in 0..20 {
            for ray in &rays {
                light.add(f64::from(estimate(&medium, ray, &mut rng, &mut stats)));
            }
        }
        let count = 20.0 * RAYS as f64;
        let ns = started.elapsed().as_secs_f64() * 1e9 / count;
        let variance = light.standard_error().powi(2) * count;
        println!(
            "{name}: mean {:.4}, {:.1} steps, variance {variance:.4}, {ns:.0} ns, efficiency {:.1}",
            light.mean,
            stats.shadow_steps as f64 / count,
            1e3 / (variance * ns)
        );
        group.bench_function(name, |b| {
            b.iter(|| {
                let mut stats = Stats::default();
                let sum: f32 = rays
                    .iter()
                    .map(|ray| estimate(&medium, black_box(ray), &mut rng, &mut stats))
                    .sum();
                sum
            });
        });
    }
    group.finish();
}

criterion_group!(benches, shadow_rays);
criterion_main!(benches);
