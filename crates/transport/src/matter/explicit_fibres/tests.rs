use super::*;
use glam::{Vec3, Vec3Swizzles};
use organza_basis::Aabb;
use organza_basis::curve::SegmentList;
use organza_basis::{PathRng, Segment, warp};
use organza_scatter::FibreFrame;
use std::f32::consts::TAU;

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
    SegmentList {
        tile: Tile { bounds_mm, repeats },
        segments,
    }
}

fn traced(repeats: bool) -> ExplicitFibres {
    ExplicitFibres::new(&yarns(repeats), fitted(), None, &|_| ()).unwrap()
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

/// The distance to a hull of two spheres, by the nearest of spheres along it:
/// knows of no cone.
fn outside_mm(piece: &FibrePiece, p: DVec3) -> f64 {
    let sphere = |t: f64| {
        let radius = piece.radius_a + t * (piece.radius_b - piece.radius_a);
        p.distance(piece.axis_point(t)) - radius
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..80 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if sphere(a) < sphere(b) {
            high = b;
        } else {
            low = a;
        }
    }
    sphere(0.5 * (low + high))
}

/// Against sphere tracing: thin pieces, long ones, tapered ones, balls; rays
/// along them and from hundreds of radii away. A twin in single precision misses
/// what it should not.
#[test]
fn entries_are_where_the_surface_is() {
    let (mut hits, mut single_misses) = (0, 0);
    for i in 0..6000 {
        let mut rng = PathRng::new(11, 0, i);
        let length = [0.0, 0.001, 0.02, 1.0][(i % 4) as usize];
        let way = warp::uniform_sphere(rng.unit2()).as_dvec3();
        let radius_a = 0.002 + 0.01 * f64::from(rng.unit());
        let piece = FibrePiece {
            a: DVec3::new(1.0, 2.0, 0.5),
            b: DVec3::new(1.0, 2.0, 0.5) + length * way,
            radius_a,
            radius_b: if i % 3 == 0 { radius_a } else { 0.5 * radius_a },
            cut_a: DVec3::ZERO,
            cut_b: DVec3::ZERO,
        };
        let near = piece.axis_point(f64::from(rng.unit()))
            + 1.1 * radius_a * warp::uniform_sphere(rng.unit2()).as_dvec3();
        let mut d = warp::uniform_sphere(rng.unit2()).as_dvec3();
        if i % 5 == 0 {
            d = (d + 50.0 * way).normalize();
        }
        let o = near - d * [0.0, 0.1, 30.0][(i % 3) as usize];
        let got = piece.entry(o, d, 0.0, f64::INFINITY);
        if outside_mm(&piece, o) < 0.0 {
            assert_eq!(got, None, "seed 11, {i}: starts inside");
            continue;
        }
        // A step never passes a surface; one shorter than a picometre has met it.
        let (mut t, mut least) = (0.0, f64::INFINITY);
        for _ in 0..20_000 {
            let step = outside_mm(&piece, o + t * d);
            least = least.min(step);
            t += step;
            if step < 1e-12 || t > 40.0 {
                break;
            }
        }
        if least < 1e-12 {
            let t_got = got.unwrap_or(f64::INFINITY);
            let off = outside_mm(&piece, o + t_got * d).abs();
            assert!(
                (t_got - t).abs() < 1e-5 && off < 1e-9,
                "seed 11, {i}: {got:?} {t}"
            );
            hits += 1;
            single_misses += u32::from(!single_precision_hit(&piece, o, d));
        } else if let Some(t) = got {
            // Grazes that sphere tracing gives up on.
            assert!(
                least < 1e-9,
                "seed 11, {i}: entered at {t}, passed by {least}"
            );
        }
    }
    println!("{hits} hits; single precision misses {single_misses}");
    assert!(hits > 2000 && single_misses > 10, "{hits} {single_misses}");
}

/// The textbook test of an endless cylinder, in `f32` from where the ray starts.
fn single_precision_hit(piece: &FibrePiece, o: DVec3, d: DVec3) -> bool {
    let (o, d) = (o.as_vec3(), d.as_vec3());
    let (oa, axis) = (o - piece.a.as_vec3(), (piece.b - piece.a).as_vec3());
    let square = axis.length_squared();
    if square == 0.0 {
        return true;
    }
    let radius = piece.radius_a.max(piece.radius_b) as f32;
    let (v, y) = (d.dot(axis), oa.dot(axis));
    let a = square - v * v;
    let b = square * oa.dot(d) - y * v;
    let c = square * oa.length_squared() - y * y - radius * radius * square;
    b * b - a * c >= 0.0
}

/// The hierarchy and the walk through copies against every piece of every copy
/// around. None may be missed.
#[test]
fn the_walk_finds_what_a_look_at_everything_finds() {
    for repeats in [false, true] {
        let traced = traced(repeats);
        let around = if repeats { 6 } else { 0 };
        let box_mm = traced.cell_grid.bounds_mm();
        let mut all = Vec::new();
        for y in -around..=around {
            for x in -around..=around {
                let shift_mm = DVec2::new(f64::from(x), f64::from(y)) * traced.period_mm;
                let pieces = traced.curves.pieces();
                all.extend(pieces.map(|i| traced.curves.piece(i, shift_mm)));
            }
        }
        let (mut hits, mut stats) = (0, Stats::default());
        for (i, mut ray) in rays(12, 480, box_mm).enumerate() {
            let middle = box_mm.centre();
            let o = ray.origin;
            let least = if traced
                .cell_grid
                .clip(&ray, f64::INFINITY)
                .is_some_and(|c| c.t_entry == 0.0)
            {
                traced.start_mm
            } else {
                0.0
            };
            let limit = 2.0 + (ray.origin - middle.as_dvec3()).length();
            let d = ray.direction.as_dvec3();
            let nearest = all
                .iter()
                .filter_map(|p| p.entry(o, d, least, limit))
                .reduce(f64::min);
            let got = traced.first_hit(&ray, limit, &mut stats);
            let ahead = nearest.map(|t| ray.at(t));
            // Copies beyond those listed are not looked at.
            let far = |p: DVec3| (p - middle.as_dvec3()).abs().max_element() > 0.6;
            let met = got.map(|(t, _)| ray.at(t));
            if repeats && (ahead.is_some_and(far) || met.is_some_and(far)) {
                continue;
            }
            match (nearest, got) {
                (Some(t), Some((t_got, _))) => {
                    let slack = 1e-6 + 1e-6 * t;
                    assert!((t_got - t).abs() < slack, "seed 12, {i}: {t} {t_got}");
                    hits += 1;
                    assert!(traced.blocks(&ray, f64::INFINITY, &mut stats));
                    // From inside the slab, a far origin moved by periods.
                    ray.origin.x += 3.0 * 0.4;
                    assert_eq!(
                        traced.blocks(&ray, f64::INFINITY, &mut stats),
                        repeats || hit_again(&all, &ray)
                    );
                }
                (None, None) => {}
                (Some(_), None) => panic!("seed 12, ray {i}: missed {nearest:?}"),
                (None, Some((t, _))) => panic!("seed 12, ray {i}: nothing is at {t}"),
            }
        }
        assert!(hits > 50, "{hits}");
    }
}

fn hit_again(all: &[FibrePiece], ray: &Ray) -> bool {
    let (o, d) = (ray.origin, ray.direction.as_dvec3());
    all.iter()
        .any(|p| p.entry(o, d, 8e-6, f64::INFINITY).is_some())
}

/// From outside no ray gets to the axis of a fibre without having entered, and
/// from inside none meets a wall at a joint or at a face of the tile.
#[test]
fn fibres_are_closed_from_outside_and_open_from_inside() {
    let mut source = yarns(true);
    source.segments.retain(|s| s.fibre == 17);
    let traced = ExplicitFibres::new(&source, fitted(), None, &|_| ()).unwrap();
    let mut stats = Stats::default();
    for i in 0..20_000u32 {
        let mut rng = PathRng::new(13, 0, u64::from(i));
        let piece = i % 24;
        let at = traced.curves.piece(piece, DVec2::ZERO);
        // Also right in the joints.
        let share = [0.0, 1.0, 1e-5, rng.unit()][(i / 24 % 4) as usize];
        let axis = at.axis_point(f64::from(share)).as_vec3();
        let d = warp::uniform_sphere(rng.unit2());
        // The sign is arbitrary, the copy too.
        let out = axis - 0.05 * d + 0.8 * Vec3::X;
        let mut in_tile = out.as_dvec3();
        in_tile.x = in_tile.x.rem_euclid(traced.period_mm.x);
        if traced.fibres_at(in_tile) > 0 {
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
    let tile = Tile {
        bounds_mm,
        repeats: false,
    };
    let segments = vec![Segment::straight(Vec3::NEG_X, Vec3::X, 0.1)];
    let source = SegmentList { tile, segments };
    let traced = ExplicitFibres::new(&source, fitted(), None, &|_| ()).unwrap();
    let mut stats = Stats::default();
    for k in -19..20 {
        let h = k as f32 / 20.0;
        let d = Vec3::new(0.6, 0.0, -0.8);
        let ray = Ray::new(Vec3::new(-0.4, 0.1 * h, 0.5), d);
        let (t, hit) = traced.first_hit(&ray, f64::INFINITY, &mut stats).unwrap();
        let frame = FibreFrame::new(hit.tangent, -d);
        // t x d is the side that offsets count toward.
        let side = Vec3::Y.dot(frame.side);
        assert!(
            (hit.offset - h * side).abs() < 4.0 * f32::EPSILON,
            "{h}: {}",
            hit.offset
        );
        let mut rng = PathRng::from_seed(14);
        for _ in 0..50 {
            let w_in = warp::uniform_sphere(rng.unit2());
            let exit = ray.at(t).as_vec3() + traced.exit_mm(&hit, -d, w_in, &mut rng);
            let rho = exit.yz();
            assert!((rho.length() - 0.1).abs() < 4.0 * f32::EPSILON, "{exit}");
            assert!(rho.dot(w_in.yz()) > -1e-5, "{exit} {w_in}");
            let again = traced.first_hit(&Ray::new(exit, w_in), f64::INFINITY, &mut stats);
            assert!(again.is_none(), "seed 14: {exit} {w_in}");
        }
    }
}

/// Other scattering needs neither other cells nor another hierarchy.
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
    assert!(Arc::ptr_eq(&one.hierarchy, &other.hierarchy));
    // Cut fibres have cells of their own.
    other.cell_grid_mut();
    assert!(other.in_cells.get().is_none());
    let none = one.with_scattering(Vec::new()).err();
    assert!(matches!(none, Some(ExplicitFibresError::Materials { .. })));
}

#[test]
fn what_cannot_be_traced_is_refused() {
    let fail = |source: &SegmentList, fibres, memory| {
        ExplicitFibres::new(source, fibres, memory, &|_| ()).err()
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
    assert_eq!(
        fail(&source, fitted(), None),
        Some(ExplicitFibresError::Empty)
    );
    source.segments.clear();
    assert_eq!(
        fail(&source, fitted(), None),
        Some(ExplicitFibresError::Empty)
    );
}

/// Two fibres through each other: a lens of known volume is shared.
#[test]
fn overlap_is_measured() {
    let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.4));
    let tile = Tile {
        bounds_mm,
        repeats: true,
    };
    let line = |y: f32, fibre: u32| Segment {
        fibre,
        ..Segment::straight(Vec3::new(0.0, y, 0.2), Vec3::new(1.0, y, 0.2), 0.1)
    };
    let segments = vec![line(0.5, 0), line(0.6, 1)];
    let source = SegmentList { tile, segments };
    let traced = ExplicitFibres::new(&source, fitted(), None, &|_| ()).unwrap();
    let got = traced.measure_overlap(100_000, 15);
    let disc = 0.01 * std::f64::consts::PI;
    let lens = 0.01 * (2.0 * std::f64::consts::FRAC_PI_3 - 0.75f64.sqrt());
    // Four standard errors of a share counted with 100,000 points: 0.0035.
    assert!(
        (got.sum - 2.0 * disc / 0.4).abs() < 0.006,
        "seed 15: {got:?}"
    );
    assert!(
        (got.union - (2.0 * disc - lens) / 0.4).abs() < 0.004,
        "seed 15: {got:?}"
    );
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
    let [a, b] = [&plain, &printed].map(|source| Curves::gather(source, &|| ()));
    assert_eq!(count_joints(&printed), b.joints.len() as u64);
    assert!(b.curves.len() > a.curves.len());
    let (of_a, of_b): (Vec<u32>, Vec<u32>) = (a.pieces().collect(), b.pieces().collect());
    assert_eq!(of_a.len(), of_b.len());
    let mut materials = [0, 0];
    for (&i, &j) in of_a.iter().zip(&of_b) {
        let shape = |curves: &Curves, k| {
            let p = curves.piece(k, DVec2::ZERO);
            let tangents = [0.0, 1.0].map(|share| curves.tangent(k, share));
            (p.a, p.b, p.radius_a, p.radius_b, p.cut_a, p.cut_b, tangents)
        };
        assert_eq!(shape(&a, i), shape(&b, j), "piece {i}");
        let (before, after) = (a.curve_of(i), b.curve_of(j));
        assert_eq!((before.yarn, before.fibre), (after.yarn, after.fibre));
        // Hairs are one segment each: their material is that of its middle.
        if after.fibre < 100 {
            let x = 0.5 * (shape(&b, j).0.x + shape(&b, j).1.x);
            assert_eq!(after.material, u16::from(x > 0.2), "piece {i} at {x} mm");
        }
        materials[usize::from(after.material)] += 1;
    }
    assert!(materials[0] > 300 && materials[1] > 300, "{materials:?}");
}
