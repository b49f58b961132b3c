//! Speed of the surface model, and what the quadrature costs.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use glam::{Vec2, Vec3};
use organza_basis::{PathRng, warp};
use organza_scatter::{Footprint, Surface};
use organza_surface::quadrature::Rule;
use organza_surface::real::Direction;
use organza_surface::segment::{Fit, Pair, SegmentParameters, YarnSegment};
use organza_surface::spec::PRESETS;
use organza_surface::{SurfaceSpec, WovenSurface};
use std::hint::black_box;

/// Directions and places, many enough that branches are not learnt by heart.
fn queries(count: usize) -> Vec<(Vec3, Vec3, Vec2)> {
    let mut rng = PathRng::from_seed(1);
    (0..count)
        .map(|_| {
            let w_in = warp::cosine_hemisphere(rng.unit2());
            let w_out = warp::cosine_hemisphere(rng.unit2());
            (w_in, w_out, 50.0 * rng.unit2())
        })
        .collect()
}

fn cloth(name: &str) -> WovenSurface {
    match SurfaceSpec::preset(name).and_then(SurfaceSpec::build) {
        Ok(cloth) => cloth,
        Err(e) => panic!("{name}: {e}"),
    }
}

/// The integral as the thesis takes it: 11 equal steps of u, trapezoid rule.
fn trapezoid(segment: &YarnSegment<f32>, pair: &Pair<f32>, length_mm: f32, nodes: usize) -> f32 {
    let mut sum = 0.0;
    for i in 0..nodes {
        let y = length_mm * (i as f32 / (nodes - 1) as f32 - 0.5);
        let weight = if i == 0 || i == nodes - 1 { 0.5 } else { 1.0 };
        sum += weight * segment.texture(pair, 0.0, y);
    }
    sum / (nodes - 1) as f32 * segment.area_mm2()
}

fn surface(c: &mut Criterion) {
    let q = queries(1024);
    let mut group = c.benchmark_group("surface");
    for (name, _) in PRESETS {
        let cloth = cloth(name);
        let mut k = 0;
        let mut next = || {
            k = (k + 1) % q.len();
            q[k]
        };
        group.bench_function(format!("texture/{name}"), |b| {
            b.iter(|| {
                let (w_in, w_out, at) = next();
                black_box(cloth.eval(w_out, w_in, Footprint::point(at)))
            });
        });
        group.bench_function(format!("reflectance/{name}"), |b| {
            b.iter(|| {
                let (w_in, w_out, _) = next();
                black_box(cloth.eval(w_out, w_in, Footprint::FAR))
            });
        });
        let mut rng = PathRng::from_seed(2);
        for (label, far) in [("texture", false), ("mean", true)] {
            let footprint = |at| {
                if far {
                    Footprint::FAR
                } else {
                    Footprint::point(at)
                }
            };
            group.bench_function(format!("sample/{label}/{name}"), |b| {
                b.iter(|| {
                    let (_, w_out, at) = next();
                    black_box(cloth.sample(w_out, footprint(at), &mut rng))
                });
            });
            group.bench_function(format!("pdf/{label}/{name}"), |b| {
                b.iter(|| {
                    let (w_in, w_out, at) = next();
                    black_box(cloth.pdf(w_out, w_in, footprint(at)))
                });
            });
        }
    }
    group.bench_function("build/denim", |b| {
        b.iter_batched(|| "denim", cloth, BatchSize::SmallInput);
    });
    group.finish();
}

/// One staple segment by both rules: time, and the error in the names.
fn quadrature(c: &mut Criterion) {
    let mut rng = PathRng::from_seed(3);
    let (width_mm, length_mm) = (1.0, 3.0);
    let p = SegmentParameters {
        twist_rad: -0.52,
        u_max_rad: 0.5,
        kappa: 0.0,
        width_mm,
        length_mm,
        alpha: 0.01,
        beta: 4.0,
        smoothing: 0.0,
        highlight_width: 1.0,
        fit: Fit::Refuse,
    };
    let (Ok(segment), Ok(exact)) = (YarnSegment::<f32>::new(&p), YarnSegment::<f64>::new(&p))
    else {
        panic!("the segment is valid");
    };
    let judge = Rule::<f64>::for_accuracy(1e-8);
    let cases: Vec<(Pair<f32>, f64)> = (0..1000)
        .map(|_| {
            let (i, o) = (
                warp::cosine_hemisphere(rng.unit2()),
                warp::cosine_hemisphere(rng.unit2()),
            );
            let wide = |w: Vec3| Direction::new(w.x.into(), w.y.into(), w.z.into());
            let pair = Pair::new(Direction::new(i.x, i.y, i.z), Direction::new(o.x, o.y, o.z));
            (
                pair,
                exact.reflectance(&Pair::new(wide(i), wide(o)), &judge),
            )
        })
        .collect();
    let mean = cases.iter().map(|c| c.1).sum::<f64>() / cases.len() as f64;
    // Mean absolute error over the mean value.
    let error = |f: &dyn Fn(&Pair<f32>) -> f32| {
        let sum: f64 = cases.iter().map(|(p, e)| (f64::from(f(p)) - e).abs()).sum();
        sum / cases.len() as f64 / mean
    };
    let mut group = c.benchmark_group("surface-quadrature");
    let mut k = 0;
    for nodes in [11, 21, 41, 81, 161] {
        let rule = |p: &Pair<f32>| trapezoid(&segment, p, length_mm as f32, nodes);
        group.bench_function(
            format!("trapezoid/{nodes} nodes/error {:.1e}", error(&rule)),
            |b| {
                b.iter(|| {
                    k = (k + 1) % cases.len();
                    black_box(rule(&cases[k].0))
                });
            },
        );
    }
    for accuracy in [1e-2, 1e-3, 1e-4, 1e-6] {
        let rule = Rule::for_accuracy(accuracy);
        let gauss = |p: &Pair<f32>| segment.reflectance(p, &rule);
        let name = format!(
            "between ends/{} nodes/error {:.1e}",
            rule.node_count(),
            error(&gauss)
        );
        group.bench_function(name, |b| {
            b.iter(|| {
                k = (k + 1) % cases.len();
                black_box(gauss(&cases[k].0))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, surface, quadrature);
criterion_main!(benches);
