//! Explicit fibres, traced, against closed forms, brute-force ray optics and the
//! media that stand for them.

use crate::scenes::{direction, octree, orthographic, rendered, sun, white_sky};
use glam::{DVec3, Vec2, Vec3};
use organza_basis::curve::{Segment, SegmentList};
use organza_basis::{Aabb, Moments, PathRng, Rgb, unwatched};
use organza_scatter::{DielectricFibre, DielectricParameters, Fibre};
use organza_testing::{csv_numbers, dielectric_fibre, sized};
use organza_transport::{
    AnyMedium, ExplicitFibres, Film, Hemisphere, Integrator, Light, PathSample, Scene, Stats,
    VirtualFibreEvent, VirtualFibreMedium, trace_from,
};
use std::f32::consts::PI;

const RADIUS_MM: f32 = 0.008;

fn full(small: u64) -> u64 {
    sized(small, 20 * small)
}

fn dielectric(absorption_radii: f32, blur_rad: [f32; 2]) -> Fibre {
    dielectric_fibre(Rgb::splat(absorption_radii), blur_rad[0], blur_rad[1])
}

fn rough(absorption_radii: f32) -> Fibre {
    dielectric(absorption_radii, [0.12, 0.25])
}

/// Parallel fibres along x, strewn over a slab of a packing, overlapping as
/// chance will have it.
fn strewn(packing: f32, size_mm: Vec3, seed: u64) -> SegmentList {
    let area = size_mm.y * size_mm.z;
    let count = (packing * area / (PI * RADIUS_MM * RADIUS_MM)).round() as u32;
    let mut rng = PathRng::new(seed, 7, 0);
    let segments = (0..count)
        .map(|fibre| {
            let at = rng.unit2() * Vec2::new(size_mm.y, size_mm.z);
            let ends = [0.0, size_mm.x].map(|x| Vec3::new(x, at.x, at.y));
            Segment {
                fibre,
                ..Segment::straight(ends[0], ends[1], RADIUS_MM)
            }
        })
        .collect();
    SegmentList::new(Aabb::new(Vec3::ZERO, size_mm), true, segments)
}

fn traced(source: &SegmentList, fibre: Fibre) -> AnyMedium {
    AnyMedium::ExplicitFibres(ExplicitFibres::new(source, vec![fibre], None, &unwatched).unwrap())
}

fn scene(media: Vec<AnyMedium>, lights: Vec<Light>, view: Vec3, size: u32) -> Scene {
    let middle = DVec3::new(0.05, 0.05, 0.06);
    Scene {
        media,
        lights,
        camera: orthographic(middle + 3.0 * view.as_dvec3(), middle, 0.2, size),
    }
}

fn picture(scene: &Scene, spp: u64, seed: u64) -> (Film, Stats) {
    rendered(scene, Integrator::Woodcock, spp, u32::MAX, seed)
}

/// A path under no light.
fn traced_from(
    scene: &Scene,
    ray: (DVec3, DVec3),
    rng: &mut PathRng,
    stats: &mut Stats,
) -> PathSample {
    trace_from(scene, &[], ray, Integrator::Woodcock, u32::MAX, rng, stats)
}

/// Dense fibres that absorb nothing, under light from everywhere, look like no
/// fibres, but for what the lobes' tables are off, summed over a path's events.
/// The twin absorbs a little.
#[test]
fn white_furnace() {
    let everywhere = white_sky(Hemisphere::All);
    let source = strewn(0.4, Vec3::new(0.2, 0.2, 0.12), 1);
    let off = |absorption: f32| {
        let media = vec![traced(&source, rough(absorption))];
        let scene = scene(media, vec![everywhere.clone()], direction(30.0, 70.0), 24);
        let (film, stats) = picture(&scene, full(24), 21);
        let (mean, se) = film.mean()[0];
        let events = stats.collisions as f64 / stats.paths as f64;
        println!("absorption {absorption}: {mean:.5} +- {se:.5}, {events:.1} events");
        (mean - 1.0).abs() / (4.0 * se + 5e-4 * events)
    };
    // Margin: one is four standard errors, and 5e-4 an event for the tables of the lobes.
    assert!(off(0.0) < 1.0, "seed 21");
    assert!(off(0.02) > 1.0, "seed 21: the twin passed");
}

/// What one smooth fibre does not absorb is what brute-force ray optics says, at
/// every inclination. The twin is the next absorption in the table.
#[test]
fn one_cylinder_keeps_the_energy_of_ray_optics() {
    let text = include_str!("../../scatter/tests/data/fibre_lobe_energy.csv");
    let rows = csv_numbers(text);
    assert_eq!(rows.len(), 36);
    // Four inclinations for each of nine fibres. A smooth one takes half a second to tabulate: by
    // default three of them, which have every index and every absorption.
    let fibres = rows.chunks(4).enumerate().step_by(sized(4, 1));
    let mut twin_rejected = 0;
    for (number, inclinations) in fibres {
        let parameters = DielectricParameters {
            ior: inclinations[0][0] as f32,
            absorption_radii: Rgb::splat(inclinations[0][1] as f32),
            longitudinal_rad: 0.01,
            azimuthal_rad: 0.01,
        };
        let fibre = Fibre::from(DielectricFibre::new(parameters).unwrap());
        let bounds_mm = Aabb::new(Vec3::splat(-2.0), Vec3::splat(2.0));
        let segments = vec![Segment::straight(-2.0 * Vec3::X, 2.0 * Vec3::X, 0.1)];
        let source = SegmentList::new(bounds_mm, false, segments);
        let scene = scene(vec![traced(&source, fibre)], Vec::new(), Vec3::Z, 1);
        for (v, row) in inclinations.iter().zip(4 * number as u64..) {
            // The last column is what is still inside after the last lobe.
            let (least, most) = (v[3..8].iter().sum::<f64>(), v[3..9].iter().sum::<f64>());
            let (sin, cos) = (v[2] as f32).to_radians().sin_cos();
            let d = Vec3::new(sin, 0.0, -cos);
            let mut stats = Stats::default();
            let energy: Moments = (0..full(2000))
                .filter_map(|i| {
                    let mut rng = PathRng::new(31, row, i);
                    let h = 0.2 * rng.unit() - 0.1;
                    let from = Vec3::new(0.0, h, 0.0) - 0.2 / cos * d;
                    let ray = (from.as_dvec3(), d.as_dvec3());
                    let sample = traced_from(&scene, ray, &mut rng, &mut stats);
                    (sample.bounces > 0).then(|| 1.0 - f64::from(sample.absorbed.0.x))
                })
                .collect();
            // The lobes' own balance is kept to half a percent.
            let slack = 4.0 * energy.standard_error() + 5e-3;
            let (mean, se) = (energy.mean, energy.standard_error());
            let is_within = mean > least - slack && mean < most + slack;
            assert!(is_within, "seed 31: {v:?}: {mean} +- {se}");
            let other = (energy.mean - (-2.0f64 * v[1]).exp() * most).abs() > slack;
            twin_rejected += u32::from(v[1] > 0.0 && other);
        }
    }
    assert!(twin_rejected > 6, "seed 31: {twin_rejected}");
}

/// Where the light of paths goes: up, down, and straight through.
fn shares(medium: AnyMedium, view: Vec3, size_mm: Vec3, paths: u64, seed: u64) -> [f64; 3] {
    let scene = scene(vec![medium], Vec::new(), Vec3::Z, 1);
    let mut stats = Stats::default();
    let mut sums = [0.0; 3];
    for i in 0..paths {
        let mut rng = PathRng::new(seed, 1, i);
        let from = Vec3::new(rng.unit(), rng.unit(), 0.5) * size_mm + 3.0 * view;
        let ray = (from.as_dvec3(), -view.as_dvec3());
        let path = traced_from(&scene, ray, &mut rng, &mut stats);
        if let Some(escape) = path.escape {
            let kind = match path.first {
                None => 2,
                Some(_) => usize::from((escape.direction.z > 0.0) != (view.z > 0.0)),
            };
            sums[kind] += f64::from(escape.throughput.0.x);
        }
    }
    assert_eq!((stats.rejected, stats.majorant_violations), (0, 0));
    sums.map(|s| s / paths as f64)
}

/// Fibres strewn as thinly as 0.3 % of the volume are what a homogeneous medium
/// of them is: plain virtual scattering has the same reflection, transmission and
/// transparency, at every inclination, and so has the packed event. The twin is
/// a medium a tenth denser.
#[test]
fn thinly_strewn_fibres_are_the_medium() {
    let packing = 0.003;
    let size_mm = Vec3::new(0.5, 4.0, 3.0);
    let fibre = rough(0.1);
    let realisations = full(48);
    let paths = 600;
    let medium = |packing: f32, event: VirtualFibreEvent| {
        // One voxel as high as the slab: nothing of the places is left.
        let source = strewn(packing, size_mm, 2);
        let octree = octree(&source, size_mm.z, 1);
        AnyMedium::VirtualFibres(
            VirtualFibreMedium::new(octree, 0, vec![fibre.clone()], event).unwrap(),
        )
    };
    let mut twin_rejected = false;
    for (k, view) in [direction(10.0, 80.0), direction(50.0, 20.0)]
        .into_iter()
        .enumerate()
    {
        let mut explicit = [Moments::default(); 3];
        for r in 0..realisations {
            let source = strewn(packing, size_mm, 100 + r);
            let one = shares(traced(&source, fibre.clone()), view, size_mm, paths, 41 + r);
            for (m, x) in explicit.iter_mut().zip(one) {
                m.add(x);
            }
        }
        let compare = |medium: &dyn Fn() -> AnyMedium| {
            let blocks =
                (0..realisations / 4).map(|b| shares(medium(), view, size_mm, 4 * paths, 9000 + b));
            let mut volume = [Moments::default(); 3];
            for one in blocks {
                for (m, x) in volume.iter_mut().zip(one) {
                    m.add(x);
                }
            }
            [0, 1, 2].map(|i| {
                let (a, b) = (&explicit[i], &volume[i]);
                let se = a.standard_error().hypot(b.standard_error());
                println!(
                    "view {k}, {i}: {:.5} against {:.5} +- {se:.5}",
                    a.mean, b.mean
                );
                // The packing itself is what the models differ by.
                ((a.mean - b.mean) / (4.0 * se + 2.0 * f64::from(packing) * a.mean)).abs()
            })
        };
        for event in [VirtualFibreEvent::Plain, VirtualFibreEvent::Packed] {
            let off = compare(&|| medium(packing, event));
            assert!(off.iter().all(|&z| z < 1.0), "view {k}, {event:?}: {off:?}");
        }
        let twin = compare(&|| medium(1.1 * packing, VirtualFibreEvent::Plain));
        twin_rejected |= twin.iter().any(|&z| z > 1.0);
    }
    assert!(twin_rejected, "the twin passed");
}

/// Same seed, same bits on any number of threads; another seed, others.
#[test]
fn threads_change_nothing() {
    let sun = sun(-direction(30.0, 20.0), 1.0);
    let on = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let source = strewn(0.3, Vec3::new(0.2, 0.2, 0.12), 3);
            let media = vec![traced(&source, rough(0.1))];
            let scene = scene(media, vec![sun.clone()], direction(10.0, 0.0), 12);
            let (film, stats) = picture(&scene, 4, seed);
            (
                film.mean().map(|(m, se)| (m.to_bits(), se.to_bits())),
                stats,
            )
        })
    };
    let one = on(1, 61);
    assert!(one.1.shadow_rays > 0 && f64::from_bits(one.0[0].0) > 0.0);
    assert_eq!(one, on(3, 61));
    assert_ne!(one.0, on(3, 62).0);
}
