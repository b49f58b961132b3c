//! Reading, repairing and meeting meshes.

use glam::{DVec3, Vec2, Vec3};
use organza_basis::{Budget, PathRng, Ray, warp};
use organza_mesh::{DrapedMesh, Error, Mesh, Placement, Vertex, read_obj};
use std::collections::HashMap;

const PLACEMENT: Placement = Placement {
    mm_per_unit: 10.0,
    mm_per_uv: 25.0,
};

/// A unit square in the xy plane with its texture laid along it.
const SQUARE: &str = "\
o square
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
vn 0 0 1
f 1/1/1 2/2/1 3/3/1 4/4/1
";

fn read(text: &str) -> Result<Mesh, Error> {
    read_obj(text.as_bytes(), PLACEMENT, &mut Budget::new(1 << 30))
}

/// A bumpy closed surface around the origin: latitude and longitude.
fn bumpy(rows: u32) -> Mesh {
    let at = |i: u32, j: u32| {
        let (theta, phi) = (
            std::f32::consts::PI * i as f32 / rows as f32,
            std::f32::consts::TAU * j as f32 / (2 * rows) as f32,
        );
        // One point at the seam and at each pole, to the last bit.
        let turn = if i == 0 || i == rows { 0.0 } else { phi };
        let turn = if j == 2 * rows { 0.0 } else { turn };
        let w = warp::direction_from_angles(theta, turn);
        Vertex {
            position_mm: w * (1.0 + 0.2 * (5.0 * theta).sin() * (3.0 * turn).cos()),
            normal: Vec3::ZERO,
            uv_mm: Vec2::new(phi, theta),
        }
    };
    let id = |i: u32, j: u32| i * 2 * rows + j % (2 * rows);
    let (mut triangles, mut corners) = (Vec::new(), Vec::new());
    for i in 0..rows {
        for j in 0..2 * rows {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            triangles.push([a, b, c]);
            corners.push([id(i, j), id(i + 1, j), id(i + 1, j + 1)]);
            triangles.push([a, c, d]);
            corners.push([id(i, j), id(i + 1, j + 1), id(i, j + 1)]);
        }
    }
    Mesh::new(triangles, &corners).unwrap()
}

#[test]
fn a_hit_says_where_on_the_cloth_it_lies() {
    let mesh = DrapedMesh::new(read(SQUARE).unwrap());
    let ray = Ray::new(Vec3::new(2.5, 7.5, 30.0), Vec3::NEG_Z);
    let hit = mesh.hit(&ray, 0.0, f64::INFINITY).unwrap();
    assert!((hit.distance_mm - 30.0).abs() < 1e-6);
    assert!((hit.position_mm - DVec3::new(2.5, 7.5, 0.0)).length() < 1e-6);
    // 10 mm of the world are 25 mm of cloth.
    assert!((hit.uv_mm - Vec2::new(6.25, 18.75)).length() < 4.0 * f32::EPSILON);
    assert!((hit.stretch[0] - Vec3::new(0.4, 0.0, 0.0)).length() < 4.0 * f32::EPSILON);
    assert!((hit.stretch[1] - Vec3::new(0.0, 0.4, 0.0)).length() < 4.0 * f32::EPSILON);
    assert_eq!(
        (hit.frame.s, hit.frame.t, hit.frame.n),
        (Vec3::X, Vec3::Y, Vec3::Z)
    );
    assert!(mesh.hit(&ray, 0.0, 29.0).is_none() && mesh.hit(&ray, 31.0, 99.0).is_none());
    assert!(mesh.hit(&ray, 0.0, 31.0).is_some());
}

#[test]
fn the_hierarchy_finds_what_all_faces_give() {
    let mesh = bumpy(24);
    let faces: Vec<[Vec3; 3]> = mesh
        .triangles()
        .iter()
        .map(|t| t.map(|v| v.position_mm))
        .collect();
    let draped = DrapedMesh::new(mesh);
    let mut rng = PathRng::from_seed(81);
    let mut hits = 0;
    for _ in 0..3000 {
        let origin = 3.0 * warp::uniform_sphere(rng.unit2());
        let direction = (1.2 * warp::uniform_sphere(rng.unit2()) - origin).normalize();
        // By the determinant, in double precision.
        let mut nearest = f64::INFINITY;
        for f in &faces {
            let [a, b, c] = f.map(|v| v.as_dvec3());
            let (o, d) = (origin.as_dvec3(), direction.as_dvec3());
            let (e1, e2) = (b - a, c - a);
            let p = d.cross(e2);
            let det = e1.dot(p);
            let s = o - a;
            let u = s.dot(p) / det;
            let q = s.cross(e1);
            let v = d.dot(q) / det;
            let t = e2.dot(q) / det;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 {
                nearest = nearest.min(t);
            }
        }
        let hit = draped.hit(&Ray::new(origin, direction), 0.0, f64::INFINITY);
        match hit {
            Some(hit) => {
                hits += 1;
                assert!((hit.distance_mm - nearest).abs() < 1e-5, "seed 81");
            }
            None => assert!(nearest.is_infinite(), "seed 81"),
        }
    }
    assert!(hits > 1000);
}

#[test]
fn no_ray_slips_through_a_closed_surface() {
    let mesh = bumpy(16);
    let corners: Vec<Vec3> = mesh
        .triangles()
        .iter()
        .flatten()
        .map(|v| v.position_mm)
        .collect();
    let draped = DrapedMesh::new(mesh);
    let mut rng = PathRng::from_seed(82);
    // From the inside, most of all exactly at corners and edges.
    for k in 0..20_000 {
        let a = corners[rng.below(corners.len() as u32) as usize];
        let target = match k % 3 {
            0 => a,
            1 => 0.5 * (a + corners[(k / 3) % corners.len()]),
            _ => warp::uniform_sphere(rng.unit2()),
        };
        let origin = 0.1 * warp::uniform_sphere(rng.unit2());
        let Some(direction) = (target - origin).try_normalize() else {
            continue;
        };
        assert!(
            draped
                .hit(&Ray::new(origin, direction), 0.0, 10.0)
                .is_some(),
            "seed 82, {k}: {origin} to {target}"
        );
    }
}

#[test]
fn repairs_are_counted() {
    // A face without area, no normals, one mirrored and one collapsed texture.
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\n\
                vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                f 1/1 2/2 3/3\nf 1/1 3/2 4/2\nf 1/1 3/4 4/3\nf 1/1 2/2 5/3\n";
    let mesh = read(text).unwrap();
    let r = mesh.repairs();
    assert_eq!(mesh.triangles().len(), 3);
    assert_eq!((r.dropped_faces, r.computed_normals), (1, 9));
    assert_eq!((r.collapsed_uv, r.mirrored_uv), (1, 1));
    for vertex in mesh.triangles().iter().flatten() {
        assert_eq!(vertex.normal, Vec3::Z);
    }
    // A zero normal in the file is replaced like a missing one.
    let zero = SQUARE.replace("vn 0 0 1", "vn 0 0 0");
    assert_eq!(read(&zero).unwrap().repairs().computed_normals, 6);
    // And every hit is finite all the same.
    let draped = DrapedMesh::new(read(text).unwrap());
    for k in 0..100 {
        let origin = Vec3::new(0.1 * k as f32, 0.07 * k as f32, 5.0);
        if let Some(h) = draped.hit(&Ray::new(origin, Vec3::NEG_Z), 0.0, 10.0) {
            assert!(
                h.frame.s.is_finite() && (h.frame.s.cross(h.frame.t) - h.frame.n).length() < 1e-5
            );
        }
    }
}

#[test]
fn bad_meshes_are_refused_with_a_reason() {
    let message = |text: &str| read(text).unwrap_err().to_string();
    let no_uv = "o rag\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    assert!(message(no_uv).contains("\"rag\": 3 of 3 face corners have no texture"));
    assert!(message("v 0 0 0\nv 1 0 0\nf 1 2 9\n").contains("mesh:"));
    assert!(message("").contains("no face has an area"));
    assert!(message("v a b c\n").contains("position parse error"));
    let nan = SQUARE.replace("v 1 1 0", "v nan 1 0");
    assert!(message(&nan).contains("not finite") || message(&nan).contains("parse"));
    let scale = Placement {
        mm_per_uv: 0.0,
        ..PLACEMENT
    };
    let error = read_obj(SQUARE.as_bytes(), scale, &mut Budget::new(1 << 30))
        .unwrap_err()
        .to_string();
    assert!(error.contains("mm_per_uv = 0"));
    // Bytes of no text at all.
    assert!(
        read_obj(
            &[0xff, 0xfe, 0x00, 0x80],
            PLACEMENT,
            &mut Budget::new(1 << 30)
        )
        .is_err()
    );
}

/// The towel over a rail of `scenes/meshes`: texture coordinates are lengths of cloth, so a
/// ray from above meets the cloth where the rail's arc says.
#[test]
fn a_draped_towel_is_read() {
    let bytes = include_bytes!("../../../scenes/meshes/draped_towel.obj");
    let placement = Placement {
        mm_per_unit: 1.0,
        mm_per_uv: 100.0,
    };
    let mesh = read_obj(bytes, placement, &mut Budget::new(1 << 30)).unwrap();
    assert_eq!(mesh.triangles().len(), 2 * 60 * 48);
    let area: f32 = mesh
        .triangles()
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| v.position_mm);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    // 300 x 420 mm of cloth; chords of the rail and of the folds take less than a percent.
    assert!((0.99..1.0).contains(&(area / 126_000.0)), "{area}");
    let draped = DrapedMesh::new(mesh);
    let down = Ray::new(Vec3::new(1.3, 1.0, 200.0), Vec3::NEG_Z);
    let hit = draped.hit(&down, 0.0, 1e3).unwrap();
    // The first row below the top is 8.75 mm of cloth along a circle of radius 18 mm.
    let row = 8.75f32 / 18.0;
    let v = 210.0 + 8.75 / (18.0 * row.sin());
    assert!((hit.uv_mm - Vec2::new(151.3, v)).length() < 0.02, "{hit:?}");
    assert!(hit.frame.n.z > 0.99, "{hit:?}");
}

/// How many faces have each edge.
fn faces_of_edges(corners: &[[u32; 3]]) -> HashMap<(u32, u32), usize> {
    let mut count = HashMap::new();
    for [a, b, c] in corners {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *count.entry((*from.min(to), *from.max(to))).or_insert(0) += 1;
        }
    }
    count
}

/// A closed surface that is divided where edges are to be short stays closed, and shows the same cloth.
#[test]
fn divided_faces_leave_no_gaps() {
    let mut mesh = bumpy(12);
    let cloth = |mesh: &Mesh| -> f32 {
        let area = |[a, b, c]: &[Vertex; 3]| (b.uv_mm - a.uv_mm).perp_dot(c.uv_mm - a.uv_mm).abs();
        mesh.triangles().iter().map(area).sum()
    };
    let (before, all) = (cloth(&mesh), mesh.triangles().len());
    let longest = |at: Vec2| 0.02 + 0.3 * at.distance(Vec2::new(2.0, 1.5));
    mesh.refine(longest, 1 << 20).unwrap();
    assert!(
        mesh.triangles().len() > 2 * all,
        "{} of {all}",
        mesh.triangles().len()
    );
    assert!((cloth(&mesh) / before - 1.0).abs() < 1e-4);
    for [a, b, c] in mesh.triangles() {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let middle = 0.5 * (from.uv_mm + to.uv_mm);
            assert!(from.uv_mm.distance(to.uv_mm) <= longest(middle));
        }
    }
    // The poles are edges without length in the world, of one face.
    let open = |corners: &[[u32; 3]]| {
        let edges = faces_of_edges(corners);
        edges.values().filter(|&&n| n != 2).count()
    };
    let own = open(mesh.corners());
    assert_eq!(own, open(bumpy(12).corners()));
    // A face that is divided alone opens gaps.
    let mut twin = mesh.corners().to_vec();
    let [a, b, c] = twin[100];
    twin[100] = [a, u32::MAX, c];
    twin.push([u32::MAX, b, c]);
    assert!(open(&twin) > own);
    let refused = bumpy(12).refine(|_| 1e-4, 10_000).unwrap_err();
    assert!(refused.to_string().contains("more than 10000"), "{refused}");
}

/// Faces that are cut along a line lie on one side of it each, and show the same cloth.
#[test]
fn cut_faces_lie_on_one_side() {
    let mut mesh = read(SQUARE).unwrap();
    let area = |mesh: &Mesh| -> f32 {
        let twice = |[a, b, c]: &[Vertex; 3]| (b.uv_mm - a.uv_mm).perp_dot(c.uv_mm - a.uv_mm);
        mesh.triangles().iter().map(|t| 0.5 * twice(t)).sum()
    };
    mesh.cut(|at| at.x, &[7.3, 18.0], 1 << 10).unwrap();
    let taken = mesh.take(|at| at.x > 7.3 && at.x < 18.0);
    assert!(
        (area(&taken) - 25.0 * 10.7).abs() < 1e-3,
        "{}",
        area(&taken)
    );
    assert!((area(&mesh) - 25.0 * 14.3).abs() < 1e-3, "{}", area(&mesh));
    assert!(mesh.cut(|at| at.y, &[3.0], 4).is_err());
}
