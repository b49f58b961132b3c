use super::*;
use glam::{DVec2, Vec3, Vec3Swizzles};
use organza_basis::curve::SegmentList;
use organza_basis::{Aabb, PathRng, Segment, unwatched, warp};
use organza_kernel::fibres::exhaustive::Exhaustive;
use organza_scatter::FibreFrame;
use std::f32::consts::TAU;
use std::ops::ControlFlow;

const RADIUS_MM: f32 = 0.008;

fn fitted() -> Vec<Fibre> {
    vec![organza_testing::fitted_fibre("gabardine")]
}

/// Twisted fibres along x through a tile whose faces they cross; hairs that
/// leave it sideways by more than a period.
fn yarns(repeats: bool) -> SegmentList {
    let (period, steps) = (0.4f32, 24);
    let mut segments = Vec::new();
    for fibre in 0..40u32 {
        let (r, phase) = (0.015 * (fibre as f32 / 4.0).sqrt(), 2.4 * fibre as f32);
        let place = |i: i32| {
            let x = period * i as f32 / steps as f32;
            let (sin, cos) = (phase + TAU * x / period).sin_cos();
            Vec3::new(x, 0.03 + r * cos, 0.1 + r * sin)
        };
        for i in 0..steps {
            let tangent = |i: i32| (place(i + 1) - place(i - 1)).normalize();
            segments.push(Segment {
                start_tangent: tangent(i),
                end_tangent: tangent(i + 1),
                fibre,
                ..Segment::straight(place(i), place(i + 1), RADIUS_MM)
            });
        }
    }
    for hair in 0..6u32 {
        let from = Vec3::new(0.06 * hair as f32, 0.05, 0.1);
        let to = from + Vec3::new(0.3, 0.15 * hair as f32, 0.05);
        segments.push(Segment {
            fibre: 100 + hair,
            end_radius_mm: 0.3 * RADIUS_MM,
            ..Segment::straight(from, to, RADIUS_MM)
        });
    }
    let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::new(period, 0.25, 0.2));
    SegmentList::new(bounds_mm, repeats, segments)
}

fn traced(repeats: bool) -> ExplicitFibres {
    ExplicitFibres::new(&yarns(repeats), fitted(), None, &unwatched).unwrap()
}

/// Rays that pass near the matter, from near or far; some along the fibres,
/// some in the plane of the cloth.
fn rays(seed: u64, count: u64, box_mm: Aabb) -> impl Iterator<Item = Ray> {
    (0..count).map(move |i| {
        let mut rng = PathRng::new(seed, 0, i);
        let u = Vec3::new(rng.unit(), rng.unit(), rng.unit());
        let mut d = warp::uniform_sphere(rng.unit2());
        match i % 4 {
            0 => d = (d + 30.0 * Vec3::X).normalize(),
            1 => d = (d * Vec3::new(1.0, 1.0, 0.05)).normalize(),
            // Zeros of either sign.
            2 => d = [-Vec3::Z, Vec3::Z, -Vec3::Y, Vec3::Y][(i / 16 % 4) as usize],
            _ => {}
        }
        let back = [0.0, 0.3, 3.0, 30.0][(i / 4 % 4) as usize];
        Ray::new(box_mm.min + u * box_mm.size() - back * d, d)
    })
}

/// Hits and shadows up to a limit against trying every piece.
#[test]
fn the_walk_finds_what_trying_every_piece_finds() {
    for repeats in [false, true] {
        let traced = traced(repeats);
        let box_mm = traced.cell_grid.bounds_mm();
        let tried = everything(&traced);
        let (mut hits, mut stats) = (0, Stats::default());
        for (i, ray) in rays(12, 480, box_mm).enumerate() {
            let back_mm = [0.0, 0.3, 3.0, 30.0][i / 4 % 4];
            if repeats && back_mm > 1.0 {
                // Only a few copies are tried.
                continue;
            }
            let (d, limit) = (ray.direction.as_dvec3(), back_mm + 0.5);
            let outside = traced.cell_grid.clip(&ray, f64::INFINITY);
            let is_inside = outside.is_none_or(|c| c.t_entry == 0.0);
            let least = if is_inside { 8e-6 } else { 0.0 };
            let nearest = tried.first(ray.origin, d, (least, limit));
            let got = traced.first_hit(&ray, limit, &mut stats).map(|hit| hit.0);
            if nearest.is_some_and(|n| n.cosine < 0.02) {
                continue;
            }
            let is_met = nearest.is_some();
            assert_eq!(got.is_some(), is_met, "seed 12, {i}: {got:?} {nearest:?}");
            let is_blocked = traced.blocks(&ray, limit, &mut stats);
            assert_eq!(got.is_some(), is_blocked, "seed 12, {i}");
            if let (Some(t), Some(nearest)) = (got, nearest) {
                let apart = (t - nearest.distance_mm).abs() * nearest.cosine;
                let most = 1e-3 * nearest.radius_mm;
                assert!(apart < most, "seed 12, {i}: {t} {nearest:?}");
                assert!(!traced.blocks(&ray, t - 1e-4, &mut stats), "seed 12, {i}");
                hits += 1;
            }
        }
        assert!(hits > 50, "{hits}");
    }
}

/// All pieces in some copies of the tile.
fn everything(fibres: &ExplicitFibres) -> Exhaustive<'_> {
    let (grid, strands) = (&fibres.cell_grid, fibres.curves.strands());
    let size = grid.bounds_mm().size().truncate().as_dvec2();
    let period_mm = if grid.repeats() { size } else { DVec2::ZERO };
    let [origin, middle] = [fibres.origin_mm, grid.bounds_mm().centre()].map(|p| p.as_dvec3());
    Exhaustive::near(strands, origin, period_mm, middle, 1.5)
}

/// From outside no ray gets to the axis of a fibre without having entered, and
/// from inside none meets a wall at a joint or at a face of the tile.
#[test]
fn fibres_are_closed_from_outside_and_open_from_inside() {
    let mut source = yarns(true);
    source.segments.retain(|s| s.fibre == 17);
    let traced = ExplicitFibres::new(&source, fitted(), None, &unwatched).unwrap();
    let tried = everything(&traced);
    let mut stats = Stats::default();
    for i in 0..20_000u32 {
        let mut rng = PathRng::new(13, 0, u64::from(i));
        let piece = i % 24;
        let [a, b] = [piece, piece + 1].map(|k| traced.curves.joints[k as usize].position);
        // Also right in the joints.
        let share = [0.0, 1.0, 1e-5, rng.unit()][(i / 24 % 4) as usize];
        let axis = a.lerp(b, share);
        let d = warp::uniform_sphere(rng.unit2());
        // The sign is arbitrary, the copy too.
        let out = axis - 0.05 * d + 0.8 * Vec3::X;
        if tried.holding(out.as_dvec3()) > 0 {
            continue;
        }
        let (t, _) = traced
            .first_hit(&Ray::new(out, d), f64::INFINITY, &mut stats)
            .unwrap_or_else(|| panic!("seed 13, {i}: missed {axis} along {d}"));
        assert!(t <= f64::from(0.05 - 0.9 * RADIUS_MM), "seed 13, {i}: {t}");
        let mut along = traced.curves.tangent(piece, share);
        along = (along + 0.1 * d).normalize();
        let inside = Ray::new(axis, along);
        let reach = 0.7 * RADIUS_MM / 0.1;
        let wall = traced.first_hit(&inside, f64::from(reach), &mut stats);
        assert!(wall.is_none(), "seed 13, {i}: {wall:?}");
    }
}

#[test]
fn offsets_are_those_of_the_cylinder_and_exits_lie_on_it() {
    let bounds_mm = Aabb::new(Vec3::splat(-1.0), Vec3::ONE);
    let segments = vec![Segment::straight(Vec3::NEG_X, Vec3::X, 0.1)];
    let source = SegmentList::new(bounds_mm, false, segments);
    let traced = ExplicitFibres::new(&source, fitted(), None, &unwatched).unwrap();
    let mut stats = Stats::default();
    for k in -19..20 {
        let h = k as f32 / 20.0;
        let d = Vec3::new(0.6, 0.0, -0.8);
        let ray = Ray::new(Vec3::new(-0.4, 0.1 * h, 0.5), d);
        let (t, hit) = traced.first_hit(&ray, f64::INFINITY, &mut stats).unwrap();
        let frame = FibreFrame::new(hit.tangent, -d);
        // t x d is the side that offsets count toward.
        let side = Vec3::Y.dot(frame.side);
        let off = (hit.offset - h * side).abs();
        assert!(off < 32.0 * f32::EPSILON, "{h}: {}", hit.offset);
        let mut rng = PathRng::from_seed(14);
        for _ in 0..50 {
            let w_in = warp::uniform_sphere(rng.unit2());
            let exit = ray.at(t).as_vec3() + traced.exit_mm(&hit, w_in, &mut rng);
            let rho = exit.yz();
            assert!((rho.length() - 0.1).abs() < 32.0 * f32::EPSILON, "{exit}");
            assert!(rho.dot(w_in.yz()) > -1e-5, "{exit} {w_in}");
            let again = traced.first_hit(&Ray::new(exit, w_in), f64::INFINITY, &mut stats);
            assert!(again.is_none(), "seed 14: {exit} {w_in}");
        }
    }
}

/// Other scattering needs no other cells.
#[test]
fn other_scattering_shares_cells() {
    let one = traced(true);
    let other = one.with_scattering(vec![organza_testing::fitted_fibre("silk")]);
    let Ok(mut other) = other else {
        panic!("{:?}", other.err());
    };
    let in_cells = |fibres: &ExplicitFibres| fibres.alone_in_cells(u64::MAX).map(|_| ());
    assert_eq!((in_cells(&one), in_cells(&other)), (Ok(()), Ok(())));
    assert!(Arc::ptr_eq(&one.in_cells, &other.in_cells) && one.in_cells.get().is_some());
    // Cut fibres have cells of their own.
    other.cell_grid_mut();
    assert!(other.in_cells.get().is_none());
    let none = one.with_scattering(Vec::new()).err();
    assert!(matches!(none, Some(ExplicitFibresError::Materials { .. })));
}

#[test]
fn a_stop_leaves_no_fibres() {
    let stop = |_| ControlFlow::Break(());
    let stopped = ExplicitFibres::new(&yarns(true), fitted(), None, &stop).err();
    assert_eq!(stopped, Some(ExplicitFibresError::Stopped(Stopped)));
}

#[test]
fn what_cannot_be_traced_is_refused() {
    let fail = |source: &SegmentList, fibres, memory| {
        ExplicitFibres::new(source, fibres, memory, &unwatched).err()
    };
    let mut source = yarns(true);
    let error = fail(&source, fitted(), Some(1000));
    assert!(matches!(error, Some(ExplicitFibresError::Memory { .. })));
    let error = fail(&source, Vec::new(), None);
    assert!(matches!(error, Some(ExplicitFibresError::Materials { .. })));
    source.segments[7].start_mm.x = f32::NAN;
    source.segments[70].end_radius_mm = f32::INFINITY;
    source.segments[90].end_mm = source.segments[90].start_mm;
    assert_eq!(fail(&source, fitted(), None), None);
    for s in &mut source.segments {
        (s.start_radius_mm, s.end_radius_mm) = (0.0, -1.0);
    }
    let found = fail(&source, fitted(), None);
    assert_eq!(found, Some(ExplicitFibresError::Empty));
    source.segments.clear();
    let found = fail(&source, fitted(), None);
    assert_eq!(found, Some(ExplicitFibresError::Empty));
}

/// A fibre whose material changes along it, as by a print, has each material where the source
/// has it, and the shape that it has with one material.
#[test]
fn materials_change_along_a_fibre_and_shapes_do_not() {
    let plain = yarns(true);
    let mut printed = plain.clone();
    for s in &mut printed.segments {
        s.material = u16::from(s.start_mm.x.midpoint(s.end_mm.x) > 0.2);
    }
    let gather = |source| Curves::gather(source, u64::MAX, &|| unwatched(()));
    let [a, b] = [&plain, &printed].map(|source| gather(source).unwrap().unwrap());
    assert_eq!(count_joints(&printed), b.joints.len() as u64);
    assert!(b.curves.len() > a.curves.len());
    let (of_a, of_b): (Vec<u32>, Vec<u32>) = (
        a.strands().pieces().collect(),
        b.strands().pieces().collect(),
    );
    assert_eq!(of_a.len(), of_b.len());
    let mut materials = [0, 0];
    for (&i, &j) in of_a.iter().zip(&of_b) {
        let shape = |curves: &Curves, k| {
            [k, k + 1].map(|k| {
                let j = curves.joints[k as usize];
                (j.position, j.radius_mm, j.tangent, j.cut)
            })
        };
        assert_eq!(shape(&a, i), shape(&b, j), "piece {i}");
        let (before, after) = (a.curve_of(i), b.curve_of(j));
        assert_eq!((before.yarn, before.fibre), (after.yarn, after.fibre));
        // Hairs are one segment each: their material is that of its middle.
        if after.fibre < 100 {
            let x = 0.5 * (shape(&b, j)[0].0.x + shape(&b, j)[1].0.x);
            assert_eq!(after.material, u16::from(x > 0.2), "piece {i} at {x} mm");
        }
        materials[usize::from(after.material)] += 1;
    }
    assert!(materials[0] > 300 && materials[1] > 300, "{materials:?}");
}
