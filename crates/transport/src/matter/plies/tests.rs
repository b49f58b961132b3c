//! Plies against the explicit fibres of one straight ply, and their geometry.

use super::*;
use crate::Integrator;
use glam::DVec2;
use organza_basis::curve::SegmentList;
use organza_basis::{Aabb, Segment, unwatched};
use organza_scatter::PlyCorrection;

const FIBRE_MM: f32 = 0.006;
/// Around all fibres.
const PLY_MM: f32 = 0.06;
const FIBRES: u32 = 45;
const HALF_LENGTH_MM: f32 = 3.0;

fn fibre() -> Fibre {
    organza_testing::dielectric_fibre(Rgb::new(0.0, 0.02, 0.1), 0.12, 0.3)
}

fn in_tile(repeats: bool, segments: Vec<Segment>) -> SegmentList {
    let half = Vec3::new(HALF_LENGTH_MM, 0.2, 0.1);
    SegmentList::new(Aabb::new(-half, half), repeats, segments)
}

/// Discs that do not overlap, thrown at random into a circle.
fn thrown(seed: u64) -> Vec<DVec2> {
    let mut rng = PathRng::from_seed(seed);
    let mut places: Vec<DVec2> = Vec::new();
    while places.len() < FIBRES as usize {
        let p = (rng.unit2().as_dvec2() * 2.0 - 1.0) * f64::from(PLY_MM);
        let inside = p.length() < f64::from(PLY_MM - FIBRE_MM);
        let free = places
            .iter()
            .all(|q| p.distance(*q) > 2.0 * f64::from(FIBRE_MM));
        if inside && free {
            places.push(p);
        }
    }
    places
}

/// A ray without end.
fn along(ray: &Ray) -> Query<'_> {
    Query {
        ray,
        reach_mm: f64::INFINITY,
        tracking: Integrator::Woodcock.into(),
        over: None,
    }
}

/// A straight ply along x, fibre by fibre; they wind about it by so much.
fn fibre_by_fibre(seed: u64, twist_rad_per_mm: f64) -> ExplicitFibres {
    let mut segments = Vec::new();
    let steps = if twist_rad_per_mm == 0.0 { 1 } else { 600 };
    for (i, start) in thrown(seed).iter().enumerate() {
        let place = |k: i32| {
            let x = f64::from(HALF_LENGTH_MM) * (2.0 * f64::from(k) / f64::from(steps) - 1.0);
            let at = DVec2::from_angle(twist_rad_per_mm * x).rotate(*start);
            Vec3::new(x as f32, at.x as f32, at.y as f32)
        };
        for k in 0..steps {
            let tangent = |k: i32| (place(k + 1) - place(k - 1)).normalize();
            segments.push(Segment {
                start_tangent: tangent(k),
                end_tangent: tangent(k + 1),
                fibre: i as u32,
                ..Segment::straight(place(k), place(k + 1), FIBRE_MM)
            });
        }
    }
    let source = in_tile(false, segments);
    ExplicitFibres::new(&source, vec![fibre()], None, &unwatched).unwrap()
}

/// Radius of the even disc with the second moment of fibres whose axes fill a circle.
fn even_mm() -> f32 {
    (PLY_MM - FIBRE_MM).hypot(FIBRE_MM)
}

fn parameters(twist_rad_per_mm: f32) -> PlyParameters {
    PlyParameters {
        radius_mm: even_mm(),
        fibre_radius_mm: FIBRE_MM,
        fibres: FIBRES as f32,
        twist_rad_per_mm,
        correction: PlyCorrection::default(),
    }
}

fn made(
    source: &SegmentList,
    parameters: PlyParameters,
    max_memory_bytes: Option<u64>,
) -> Result<Plies, PliesError> {
    let (plies, fibres) = ([Some(parameters)], vec![fibre()]);
    Plies::new(source, &plies, fibres, max_memory_bytes, &unwatched)
}

fn as_ply(parameters: PlyParameters, repeats: bool) -> Plies {
    let reach = if repeats { 1.0 } else { 1.0001 };
    let end = Vec3::X * HALF_LENGTH_MM * reach;
    // Several pieces: joints must not be seen.
    let at = |k: i32| -end + 2.0 * end * (k as f32 / 60.0);
    let segments = (0..60).map(|k| Segment::straight(at(k), at(k + 1), even_mm()));
    let source = in_tile(repeats, segments.collect());
    made(&source, parameters, None).unwrap()
}

/// Reflected and transmitted light of each channel, of light on the width of a ply.
fn split(target: &dyn RayTarget, theta_deg: f32, seed: u64, paths: u64) -> [Vec3; 2] {
    let (sin, cos) = theta_deg.to_radians().sin_cos();
    let d = Vec3::new(sin, 0.0, -cos);
    let mut sums = [Vec3::ZERO; 2];
    let mut stats = Stats::default();
    for path in 0..paths {
        let mut rng = PathRng::new(seed, 0, path);
        let at = Vec3::new(0.2 * rng.unit(), PLY_MM * (2.0 * rng.unit() - 1.0), 0.0);
        let mut ray = Ray::new(at - 0.3 * d, d);
        let mut weight = Vec3::ONE;
        for _ in 0..4000 {
            let Some(met) = target.collide(along(&ray), &mut rng, &mut stats) else {
                sums[usize::from(ray.direction.z < 0.0)] += weight / paths as f32;
                break;
            };
            let w_out = -ray.direction;
            let Some(next) = met.sample(w_out, &mut rng) else {
                break;
            };
            weight *= next.weight.0;
            if weight.max_element() < 0.1 {
                if rng.unit() < 0.5 {
                    break;
                }
                weight *= 2.0;
            }
            let from = ray.at(met.t) + met.exit_mm(w_out, next.w_in, &mut rng).as_dvec3();
            ray = Ray::new(from, next.w_in);
        }
    }
    sums
}

/// Reflection and transmission of one ply as its fibres have them, over arrangements of the
/// fibres: an independent truth. A ply of a quarter of its fibres is known to be wrong.
#[test]
fn a_ply_reflects_and_transmits_as_its_fibres_do() {
    let (mut worst, mut least): (f32, f32) = (0.0, 1.0);
    let cases = [
        (0.0, 0.0, 101),
        (45.0, 0.0, 102),
        (30.0, 5.0, 103),
        (65.0, 5.0, 104),
    ];
    for (theta, twist, seed) in cases.into_iter().step_by(organza_testing::sized(2, 1)) {
        let mut truth = [Vec3::ZERO; 2];
        for arrangement in 0..6 {
            let fibres = fibre_by_fibre(200 + arrangement, f64::from(twist));
            let one = split(&fibres, theta, seed + 1000 * arrangement, 1500);
            truth = [0, 1].map(|side| truth[side] + one[side] / 6.0);
        }
        let got = split(&as_ply(parameters(twist), false), theta, seed, 9000);
        let thin = PlyParameters {
            fibres: 0.25 * FIBRES as f32,
            ..parameters(twist)
        };
        let twin = split(&as_ply(thin, false), theta, seed, 9000);
        println!("{theta} degrees, twist {twist}, seed {seed}: fibres {truth:?}");
        println!("  ply {got:?}\n  twin {twin:?}");
        let off = |a: &[Vec3; 2]| {
            let apart = |side: usize| (a[side] - truth[side]).abs().max_element();
            apart(0).max(apart(1))
        };
        worst = worst.max(off(&got));
        least = least.min(off(&twin));
    }
    // Noise of 9000 paths: 0.005 a figure; the rest is that packed fibres have gaps.
    assert!(worst < 0.05, "seeds 101 to 104: {worst}");
    assert!(least > 0.08, "seeds 101 to 104: {least}");
}

/// Joints neither stop nor add light, and the transmittance asked for shadow rays is the
/// share of rays that pass.
#[test]
fn what_passes_is_what_shadow_rays_are_told() {
    let sparse = PlyParameters {
        fibres: 4.0,
        ..parameters(0.0)
    };
    let plies = as_ply(sparse, true);
    let (mut stats, mut sums, n) = (Stats::default(), [0.0f64; 2], 20_000);
    for i in 0..n {
        let mut rng = PathRng::new(105, 0, i);
        let d = Vec3::new(0.5 * rng.unit(), 0.3 * rng.unit(), -1.0).normalize();
        // Copies to both sides are met as well; exactly at joints in every fourth case.
        let x = if i % 4 == 0 {
            0.1 * (i % 60) as f32
        } else {
            6.0 * rng.unit()
        };
        let ray = Ray::new(Vec3::new(x, 0.8 * rng.unit(), 0.0) - 0.4 * d, d);
        sums[0] += f64::from(plies.pass(along(&ray), &mut rng, &mut stats));
        let met = plies.collide(along(&ray), &mut rng, &mut stats);
        sums[1] += f64::from(u8::from(met.is_none()));
    }
    let [told, passed] = sums.map(|s| s / n as f64);
    // Four standard errors of a share.
    let room = 4.0 * (told * (1.0 - told) / n as f64).sqrt();
    assert!((told - passed).abs() < room, "seed 105: {told} {passed}");
    let gaps = 1.0 - 2.0 * f64::from(even_mm()) / 0.4;
    assert!(told > gaps && told < 1.0, "{told}");
}

/// Endless: the same cloth is met from far away as from near.
#[test]
fn copies_of_the_tile_are_alike() {
    let plies = as_ply(parameters(2.0), true);
    let mut stats = Stats::default();
    for i in 0..500 {
        let mut rng = PathRng::new(106, 0, i);
        let d = Vec3::new(rng.unit() - 0.5, rng.unit() - 0.5, -0.5).normalize();
        let from = Vec3::new(6.0 * rng.unit() - 3.0, 0.4 * rng.unit() - 0.2, 0.0) - 0.2 * d;
        let there = from + Vec3::new(6.0 * 5.0, -0.4 * 11.0, 0.0);
        let mut meet = |from: Vec3| {
            let mut rng = PathRng::new(107, 0, i);
            let ray = Ray::new(from, d);
            plies
                .collide(along(&ray), &mut rng, &mut stats)
                .map(|met| met.t)
        };
        match (meet(from), meet(there)) {
            (Some(a), Some(b)) => assert!(
                (a - b).abs() < f64::from(32.0 * f32::EPSILON),
                "seed 106, {i}: {a} {b}"
            ),
            (a, b) => assert_eq!(a.is_some(), b.is_some(), "seed 106, {i}"),
        }
    }
}

#[test]
fn what_cannot_be_plies_is_refused() {
    let segments = vec![Segment::straight(-Vec3::X, Vec3::X, 0.1)];
    let source = in_tile(false, segments);
    let make = |fibres: f32, memory| {
        let parameters = PlyParameters {
            fibres,
            ..parameters(0.0)
        };
        made(&source, parameters, memory).err()
    };
    assert_eq!(make(10.0, None), None);
    assert_eq!(make(0.0, None), Some(PliesError::Ply(0)));
    assert!(matches!(
        make(10.0, Some(10)),
        Some(PliesError::Curves(ExplicitFibresError::Memory { .. }))
    ));
    assert!(source.material_count() <= 1);
}
