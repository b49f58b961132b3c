//! The other formats, and the shell around a mesh.

use base64::Engine;
use glam::{DVec3, Mat3, Vec2, Vec3};
use organza_basis::{Budget, PathRng, Ray, warp};
use organza_mesh::{
    Error, Folds, Mesh, NOBODY, Placement, Shell, ShellSpan, ShellTables, ShellTetrahedron, Vertex,
    read_gltf, read_obj, read_ply,
};

const PLACEMENT: Placement = Placement {
    mm_per_unit: 10.0,
    mm_per_uv: 25.0,
};

const OBJ: &str = "o square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\n";

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\n\
    property float x\nproperty float y\nproperty float z\n\
    property float nx\nproperty float ny\nproperty float nz\n\
    property float s\nproperty float t\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n1 1 0 0 0 1 1 1\n0 1 0 0 0 1 0 1\n4 0 1 2 3\n";

fn ply_binary() -> Vec<u8> {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4\n\
        property float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_index\n\
        property list uchar float texcoord\nend_header\n";
    let mut bytes = header.as_bytes().to_vec();
    let corners = [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for [x, y] in corners {
        [x, y, 0.0]
            .iter()
            .for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    bytes.push(4);
    (0i32..4).for_each(|i| bytes.extend(i.to_le_bytes()));
    bytes.push(8);
    corners
        .iter()
        .flatten()
        .for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes
}

/// The square with its buffer inside the text; texture coordinates run down in
/// this format. `change` may damage the text.
fn gltf(change: impl Fn(String) -> String) -> String {
    let mut buffer = Vec::new();
    let mut put = |x: f32| buffer.extend(x.to_le_bytes());
    let corners = [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for c in corners {
        [c[0], c[1], 0.0].into_iter().for_each(&mut put);
    }
    for c in corners {
        [c[0], 1.0 - c[1]].into_iter().for_each(&mut put);
    }
    for i in [0u16, 1, 2, 0, 2, 3] {
        buffer.extend(i.to_le_bytes());
    }
    let data = base64::engine::general_purpose::STANDARD.encode(&buffer);
    change(format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"mesh":0,"translation":[0,0,0]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}},"indices":2}}]}}],
        "accessors":[
        {{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
        {{"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"}},
        {{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":32}},
        {{"buffer":0,"byteOffset":80,"byteLength":12}}],
        "buffers":[{{"byteLength":92,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
    ))
}

/// More than any mesh here takes.
fn budget() -> Budget {
    Budget::new(1 << 20)
}

fn nothing_beside(_: &str) -> std::io::Result<Vec<u8>> {
    Err(std::io::ErrorKind::NotFound.into())
}

fn from_gltf(text: &str) -> Result<Mesh, Error> {
    read_gltf(text.as_bytes(), PLACEMENT, &nothing_beside, &mut budget())
}

#[test]
fn every_format_gives_the_same_square() {
    let obj = read_obj(OBJ.as_bytes(), PLACEMENT, &mut budget()).unwrap();
    for (name, mesh) in [
        (
            "text PLY",
            read_ply(PLY.as_bytes(), PLACEMENT, &mut budget()).unwrap(),
        ),
        (
            "binary PLY",
            read_ply(&ply_binary(), PLACEMENT, &mut budget()).unwrap(),
        ),
        ("glTF", from_gltf(&gltf(|t| t)).unwrap()),
    ] {
        assert_eq!(mesh.triangles(), obj.triangles(), "{name}");
        assert_eq!(mesh.corners(), obj.corners(), "{name}");
    }
}

#[test]
fn damage_is_reported_and_never_panics() {
    let bare = PLY.replace(
        "property float s\nproperty float t\n",
        "property float a\nproperty float b\n",
    );
    let said = read_ply(bare.as_bytes(), PLACEMENT, &mut budget())
        .unwrap_err()
        .to_string();
    assert!(said.contains("no texture coordinates"), "{said}");
    let outside = PLY.replace("4 0 1 2 3\n", "4 0 1 2 -3\n");
    let said = read_ply(outside.as_bytes(), PLACEMENT, &mut budget())
        .unwrap_err()
        .to_string();
    assert!(said.contains("of 4") || said.contains("texture"), "{said}");
    for (from, to) in [
        ("\"count\":6", "\"count\":600"),
        ("\"count\":6", "\"count\":0"),
        ("\"byteOffset\":80", "\"byteOffset\":4294967296"),
        ("5123", "5126"),
        ("\"VEC2\"", "\"VEC3\""),
        ("base64,", "base64,#"),
        ("\"indices\":2", "\"indices\":2,\"mode\":5"),
        (",\"TEXCOORD_0\":1", ""),
    ] {
        let text = gltf(|t| t.replace(from, to));
        assert!(from_gltf(&text).is_err(), "{from} -> {to}");
    }
    for cut in 0..PLY.len() {
        let _ = read_ply(&PLY.as_bytes()[..cut], PLACEMENT, &mut budget());
    }
    // Binary glTF that is shorter than its own header.
    for length in 0..12u8 {
        let bytes = [&b"glTF"[..], &[2, 0, 0, 0, length, 0, 0, 0]].concat();
        let read = read_gltf(&bytes, PLACEMENT, &nothing_beside, &mut budget());
        let message = read.map(|_| ()).unwrap_err().to_string();
        let words = format!("has {length} bytes, fewer than the header");
        assert!(message.contains(&words), "{message}");
    }
    let binary = ply_binary();
    for cut in 0..binary.len() {
        assert!(read_ply(&binary[..cut], PLACEMENT, &mut budget()).is_err());
    }
}

/// Small files that once took minutes, gigabytes or a panic.
#[test]
fn files_that_promise_more_than_they_hold_are_refused() {
    let says = |read: Result<Mesh, Error>, words: &str| {
        let said = read.unwrap_err().to_string();
        assert!(said.contains(words), "{said}");
    };
    // Each node names the next one twice: 2^28 visits.
    let chain: Vec<String> = (0..28)
        .map(|i| format!("{{\"children\":[{0},{0}]}}", i + 1))
        .collect();
    let shared = format!(
        "{{\"asset\":{{\"version\":\"2.0\"}},\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{},{{}}]}}",
        chain.join(",")
    );
    says(from_gltf(&shared), "nodes[28] has more than one parent");
    let nowhere = r#"{"asset":{"version":"2.0"},
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}]}"#;
    says(
        from_gltf(nowhere),
        "meshes[0]: POSITION names accessor 0 of 0",
    );
    // A mesh that many nodes show takes its memory for each.
    let many = gltf(|t| {
        let nodes = vec!["{\"mesh\":0}"; 4000].join(",");
        let roots: Vec<String> = (0..4000).map(|i| i.to_string()).collect();
        let t = t.replace("{\"mesh\":0,\"translation\":[0,0,0]}", &nodes);
        t.replace("\"nodes\":[0]", &format!("\"nodes\":[{}]", roots.join(",")))
    });
    says(from_gltf(&many), "bytes are allowed");

    let ply = |header: &str| format!("ply\nformat binary_little_endian 1.0\n{header}end_header\n");
    let endless = ply("element vertex 4000000000\n");
    let read = |text: &str| read_ply(text.as_bytes(), PLACEMENT, &mut budget());
    says(read(&endless), "4000000000 elements `vertex`");
    let padding = "comment x\n".repeat(2000);
    let wide = ply(&format!(
        "{padding}element vertex 20000\nproperty float x\nproperty float y\n"
    ));
    says(read(&wide), "bytes are allowed");

    let fan = format!("{OBJ}f{}\n", " 1/1/1".repeat(20_000));
    let read = |text: &str| read_obj(text.as_bytes(), PLACEMENT, &mut budget());
    says(read(&fan), "bytes are allowed");
}

/// A cylinder of cloth, 8 x 4 mm.
fn bent(radius_mm: f32, cells: u32) -> Mesh {
    let vertex = |i: u32, j: u32| {
        let uv_mm = Vec2::new(8.0 * i as f32 / cells as f32, 4.0 * j as f32 / cells as f32);
        let (s, c) = (uv_mm.x / radius_mm).sin_cos();
        let normal = Vec3::new(s, 0.0, c);
        Vertex {
            position_mm: radius_mm * normal + Vec3::new(0.0, uv_mm.y, 0.0),
            normal,
            uv_mm,
        }
    };
    let (mut triangles, mut corners) = (Vec::new(), Vec::new());
    for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
        let quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
        for face in [[0, 1, 2], [0, 2, 3]] {
            triangles.push(face.map(|k: usize| vertex(quad[k].0, quad[k].1)));
            corners.push(face.map(|k| quad[k].0 * (cells + 1) + quad[k].1));
        }
    }
    Mesh::new(triangles, &corners).unwrap()
}

fn along(ray: &Ray) -> (DVec3, DVec3) {
    (ray.origin, ray.direction.as_dvec3())
}

fn spans(shell: &Shell, ray: &Ray) -> Vec<ShellSpan> {
    let mut list = Vec::new();
    shell.visit_spans(along(ray), f64::INFINITY, |span| {
        list.push(*span);
        f64::INFINITY
    });
    list.sort_by(|a, b| a.t0.total_cmp(&b.t0));
    list
}

/// Parts join without gap, overlap or jump of the cloth: prisms are cut alike on
/// both sides of every edge.
#[test]
fn spans_join_in_the_world_and_in_the_cloth() {
    let shell = Shell::new(&bent(3.0, 12), -0.2, 0.3).unwrap();
    assert_eq!(shell.folds(), Folds::default());
    let mut rng = PathRng::from_seed(8);
    let (mut joins, mut off) = (0, 0.0);
    for _ in 0..3000 {
        let (turn, y) = (0.4 + 1.6 * rng.unit(), 0.5 + 3.0 * rng.unit());
        let aim = Vec3::new(turn.sin(), 0.0, turn.cos()) * (2.8 + 0.4 * rng.unit());
        let w = warp::uniform_sphere(rng.unit2());
        let list = spans(&shell, &Ray::new(aim + Vec3::Y * y - 9.0 * w, w));
        assert!(!list.is_empty(), "seed 8");
        for pair in list.windows(2) {
            let gap = pair[1].t0 - pair[0].t1;
            // Where a ray runs nearly in a shared face rounding grows.
            assert!(gap > -2e-3, "seed 8: overlap of {gap}");
            if gap < 1e-3 {
                off += gap.abs();
                let end = pair[0].cloth_mm + (pair[0].t1 - pair[0].t0) * pair[0].step;
                assert!((end - pair[1].cloth_mm).length() < 5e-3, "seed 8: {pair:?}");
                joins += 1;
            }
        }
        for span in &list {
            let turned = span.world_from_cloth;
            let off = turned.transpose() * turned - Mat3::IDENTITY;
            assert!(off.to_cols_array().iter().all(|x| x.abs() < 1e-5));
            // Bent, but hardly stretched.
            assert!(
                (span.step.length() - 1.0).abs() < 0.15,
                "{}",
                span.step.length()
            );
            let z = span.cloth_mm.z;
            assert!((-0.2001..=0.3001).contains(&z), "{z}");
        }
    }
    assert!(joins > 5000, "{joins}");
    assert!(
        off / f64::from(joins) <= 1e-12,
        "mean gap or overlap {} mm",
        off / f64::from(joins)
    );
}

#[test]
fn a_ray_across_sees_the_whole_thickness() {
    let shell = Shell::new(&bent(3.0, 24), -0.2, 0.3).unwrap();
    let turn = 1.2f32;
    let out = Vec3::new(turn.sin(), 0.0, turn.cos());
    let ray = Ray::new(5.0 * out + 1.7 * Vec3::Y, -out);
    let list = spans(&shell, &ray);
    let inside: f64 = list.iter().map(|s| s.t1 - s.t0).sum();
    assert!((inside - 0.5).abs() < 8e-4, "{inside}");
    let first = list[0].cloth_mm;
    // Weft by arc length, warp, and in at the top.
    assert!(
        (first - DVec3::new(3.6, 1.7, 0.3)).length() < 1e-4,
        "{first}"
    );
    // Faces of a ninth of a radian lie up to 3.25 (1 - cos(1/18)) = 0.005 mm inside.
    assert!((shell.distance_mm(along(&ray)).unwrap() - 1.75).abs() < 6e-3);
}

#[test]
fn a_bend_tighter_than_the_cloth_is_reported() {
    let shell = Shell::new(&bent(0.2, 80), -0.5, 0.5).unwrap();
    assert!(shell.folds().inverted > 0);
}

/// How much of a ray lies in the tetrahedra of a shell's tables, mm: through all boxes that it
/// meets; and whether each is left into its neighbour, where that is named.
fn length_by_tables(tables: &ShellTables, ray: &Ray) -> f64 {
    let (origin, way) = (ray.origin.as_vec3(), ray.direction);
    let clip = |low: Vec3, high: Vec3| {
        let (a, b) = ((low - origin) / way, (high - origin) / way);
        a.min(b).max_element() <= a.max(b).min_element()
    };
    let within = |t: &ShellTetrahedron| {
        let w = t.weights_from_world * (origin - t.corner_mm);
        let slope = t.weights_from_world * way;
        let all = [1.0 - w.element_sum(), w.x, w.y, w.z];
        let slopes = [-slope.element_sum(), slope.x, slope.y, slope.z];
        let (mut t0, mut t1, mut exit) = (0.0f32, f32::INFINITY, 4);
        for k in 0..4 {
            let t = -all[k] / slopes[k];
            if slopes[k] > 0.0 {
                t0 = t0.max(t);
            } else if t < t1 {
                (t1, exit) = (t, k);
            }
        }
        (t0, t1, exit)
    };
    let (mut at, mut length) = (0, 0.0);
    while let Some(here) = tables.boxes.get(at) {
        if !clip(here.min_mm, here.max_mm) {
            at = here.skip as usize;
            continue;
        }
        for t in &tables.tetrahedra[here.first as usize..][..here.count as usize] {
            let (t0, t1, exit) = within(t);
            if t0 + 1e-3 >= t1 {
                continue;
            }
            length += f64::from(t1 - t0);
            if let Some(next) = tables.tetrahedra.get(t.neighbours[exit] as usize) {
                let (begins, ends, _) = within(next);
                assert!(
                    begins >= ends || (begins - t1).abs() < 1e-3,
                    "{t1} {begins}"
                );
            }
        }
        at += 1;
    }
    length
}

#[test]
fn tables_hold_the_same_shell() {
    let point_mm = DVec3::new(0.5, 2.0, 2.5);
    let shell = Shell::new(&bent(3.0, 12), -0.2, 0.3).unwrap();
    let tables = shell.tables(point_mm);
    assert!(tables.tetrahedra.iter().all(|t| t.is_alone));
    let open = tables.tetrahedra.iter().flat_map(|t| t.neighbours);
    let open = open.filter(|&n| n == NOBODY).count();
    // Below and above, and at four edges of 12 faces of two triangles each.
    assert_eq!(open, 2 * 2 * 12 * 12 + 4 * 12 * 2);
    for (own, t) in tables.tetrahedra.iter().enumerate() {
        for next in t.neighbours.iter().filter(|&&n| n != NOBODY) {
            let back = tables.tetrahedra[*next as usize].neighbours;
            assert!(back.contains(&(own as u32)));
        }
    }
    let mut rng = PathRng::from_seed(8);
    for _ in 0..1000 {
        let aim = DVec3::new(2.0, 2.0, 2.2) + DVec3::from(warp::uniform_sphere(rng.unit2()));
        let w = warp::uniform_sphere(rng.unit2());
        let ray = Ray::new(aim - 5.0 * w.as_dvec3(), w);
        let whole: f64 = spans(&shell, &ray).iter().map(|s| s.t1 - s.t0).sum();
        let from_point = Ray::new(ray.origin - point_mm, w);
        let found = length_by_tables(&tables, &from_point);
        // Parts below a thousandth are left out.
        assert!((found - whole).abs() < 2e-2, "seed 8: {found} {whole}");
    }
    // Where the shell folds over itself, some tetrahedra have others in their room.
    let folded = Shell::new(&bent(0.2, 80), -0.5, 0.5).unwrap();
    let alone = folded.tables(DVec3::ZERO).tetrahedra;
    assert!(alone.iter().any(|t| !t.is_alone));
}

/// From its first tetrahedron on a ray is led through the stretches that are found by the boxes.
#[test]
fn steps_lead_through_the_shell() {
    let seed = 11;
    let shell = Shell::new(&bent(3.0, 12), -0.2, 0.3).unwrap();
    let mut rng = PathRng::from_seed(seed);
    let mut several = 0;
    for _ in 0..1000 {
        let aim = DVec3::new(2.0, 2.0, 2.2) + DVec3::from(warp::uniform_sphere(rng.unit2()));
        let ray = Ray::new(aim, warp::uniform_sphere(rng.unit2()));
        let found = spans(&shell, &ray);
        let Some(first) = found.first() else {
            continue;
        };
        let (mut at, mut from, mut count) = (Some(first.tetrahedron), first.t0, 0);
        let mut last = first.tetrahedron;
        while let Some(own) = at {
            let step = shell.step(own, along(&ray), from);
            if let Some(span) = step.span.filter(|span| span.t1 - span.t0 > 1e-9) {
                let other = found.iter().find(|s| s.tetrahedron == own);
                let other = other.unwrap_or_else(|| panic!("seed {seed}: {span:?}"));
                let ends = (span.t0 - other.t0).abs().max((span.t1 - other.t1).abs());
                let place = span.cloth_mm.distance(other.cloth_mm);
                assert!(
                    ends < 1e-9 && place < 1e-9,
                    "seed {seed}: {span:?} {other:?}"
                );
                let middle = ray.at(0.5 * (span.t0 + span.t1));
                assert_eq!(shell.tetrahedron_at(last, middle), Some(own));
                last = own;
                count += 1;
            }
            (at, from) = (step.beyond, step.end_mm);
        }
        // What comes after a gap is another way through the shell.
        let after = found.iter().filter(|s| s.t0 < from && s.t1 - s.t0 > 1e-9);
        assert_eq!(after.count(), count, "seed {seed}");
        several += u32::from(count > 2);
    }
    assert!(several > 100, "seed {seed}: {several}");
    // Where others lie in the room of a tetrahedron, nothing leads there.
    let folded = Shell::new(&bent(0.2, 80), -0.5, 0.5).unwrap();
    let mut shared = 0;
    for _ in 0..200 {
        let ray = Ray::new(DVec3::new(0.0, 1.0, 0.0), warp::uniform_sphere(rng.unit2()));
        for span in spans(&folded, &ray).iter().filter(|span| !span.is_alone) {
            let middle = ray.at(0.5 * (span.t0 + span.t1));
            assert_eq!(folded.tetrahedron_at(span.tetrahedron, middle), None);
            shared += 1;
        }
    }
    assert!(shared > 0, "seed {seed}");
}

/// A ray finds the same stretches wherever mesh and texture lie, to far less than a fibre.
/// The twin's places are rounded to single precision, as they once were.
#[test]
fn places_in_the_cloth_do_not_depend_on_where_the_mesh_is() {
    let seed = 9;
    let at = |shift: Vec3, uv: Vec2| {
        let mesh = bent(3.0, 12);
        let moved = mesh.triangles().iter().map(|t| {
            t.map(|v| Vertex {
                // Steps of 1/16 mm, which single precision holds at 100 m.
                position_mm: (16.0 * v.position_mm).round() / 16.0 + shift,
                uv_mm: (16.0 * v.uv_mm).round() / 16.0 + uv,
                ..v
            })
        });
        let mesh = Mesh::new(moved.collect(), mesh.corners()).unwrap();
        Shell::new(&mesh, -0.2, 0.3).unwrap()
    };
    let here = at(Vec3::ZERO, Vec2::ZERO);
    let first = |shell: &Shell, ray: (DVec3, DVec3)| {
        let mut list = Vec::new();
        shell.visit_spans(ray, f64::INFINITY, |span| {
            list.push(*span);
            f64::INFINITY
        });
        list.sort_by(|a, b| a.t0.total_cmp(&b.t0));
        list
    };
    for shift_mm in [1e2f32, 1e4, 1e5] {
        let shift = Vec3::new(shift_mm, -shift_mm, 0.5 * shift_mm);
        let uv = Vec2::new(-shift_mm, 0.25 * shift_mm);
        let there = at(shift, uv);
        let mut rng = PathRng::from_seed(seed);
        let (mut worst, mut rounded) = (0.0f64, 0.0f64);
        for _ in 0..200 {
            let turn = 0.4 + 1.6 * rng.unit();
            let aim = Vec3::new(turn.sin(), 0.0, turn.cos()) * 3.0 + Vec3::Y * (1.0 + rng.unit());
            let w = warp::uniform_sphere(rng.unit2()).as_dvec3().normalize();
            let from = aim.as_dvec3() - 2.0 * w;
            let near = first(&here, (from, w));
            let far = first(&there, (from + shift.as_dvec3(), w));
            assert_eq!(near.len(), far.len(), "seed {seed}, {shift_mm} mm");
            for (a, b) in near.iter().zip(&far) {
                let back = b.cloth_mm - uv.extend(0.0).as_dvec3();
                worst = worst.max((back - a.cloth_mm).length());
                let single = b.cloth_mm.as_vec3().as_dvec3() - uv.extend(0.0).as_dvec3();
                rounded = rounded.max((single - a.cloth_mm).length());
            }
        }
        // A thousandth of a radius of the thinnest fibre.
        assert!(
            worst < 1e-6,
            "seed {seed}, {shift_mm} mm: off by {worst} mm"
        );
        assert!(
            rounded > 1e-6,
            "{shift_mm} mm: the twin is off by {rounded} mm"
        );
    }
}

/// The place in the cloth, from 0 to 2 mm high, of a point inside of a face, at a height over the mesh.
fn place_mm(mesh: &Mesh, z: f64) -> DVec3 {
    let shell = Shell::new(mesh, 0.0, 2.0).unwrap();
    let mut found = None;
    // A level ray that passes the place.
    let ray = (DVec3::new(-50.0, 4.1, z), DVec3::X);
    shell.visit_spans(ray, f64::INFINITY, |span| {
        let t = 54.3 - span.t0;
        if (0.0..span.t1 - span.t0).contains(&t) {
            found = Some(span.cloth_mm + t * span.step);
        }
        f64::INFINITY
    });
    found.unwrap()
}

/// Pressed cloth sinks from above: its lower side stays, and what is between moves in proportion.
#[test]
fn pressed_cloth_keeps_its_lower_side() {
    let mut mesh = read_obj(OBJ.as_bytes(), PLACEMENT, &mut budget()).unwrap();
    mesh.press(2.0, |_| 0.5);
    for z in [-0.99, 0.0, 0.49] {
        let expected = (z + 1.0) / 1.5 * 2.0;
        let found = place_mm(&mesh, z).z;
        assert!(
            (found - expected).abs() < 1e-5,
            "{z}: {found}, not {expected}"
        );
    }
    // However deep it is pressed, a tenth of it is left.
    mesh = read_obj(OBJ.as_bytes(), PLACEMENT, &mut budget()).unwrap();
    mesh.press(2.0, |_| 7.0);
    assert!((place_mm(&mesh, -0.9).z - 1.0).abs() < 1e-5);
}

/// Cloth that leans stands over other places of the fabric plane the higher it is, and its ground as
/// far beside on the other side of the mesh.
#[test]
fn what_leans_moves_with_its_height() {
    let mut mesh = read_obj(OBJ.as_bytes(), PLACEMENT, &mut budget()).unwrap();
    let upright = [-0.9, 0.0, 0.9].map(|z| place_mm(&mesh, z));
    // 25 mm of cloth lie on 10 mm of mesh.
    mesh.lean(|_| Vec2::new(0.3, -0.1));
    for (z, upright) in [-0.9, 0.0, 0.9].into_iter().zip(upright) {
        let leaning = place_mm(&mesh, z);
        let moved = (upright - leaning) / 2.5;
        let expected = DVec3::new(0.3 * z, -0.1 * z, 0.0);
        assert!(moved.abs_diff_eq(expected, 1e-5), "{z}: {moved}");
    }
}

/// Flattened cloth keeps its middle on the mesh, and flattening takes its share of what pressing left.
#[test]
fn flattened_cloth_keeps_its_middle() {
    let mut mesh = read_obj(OBJ.as_bytes(), PLACEMENT, &mut budget()).unwrap();
    mesh.flatten(|_| 0.5);
    for z in [-0.49, 0.0, 0.2] {
        assert!((place_mm(&mesh, z).z - (1.0 + 2.0 * z)).abs() < 1e-5);
    }
    mesh = read_obj(OBJ.as_bytes(), PLACEMENT, &mut budget()).unwrap();
    mesh.press(2.0, |_| 0.5);
    mesh.flatten(|_| 0.5);
    // From -1 to 0.5 mm before; now half as thick about the same middle.
    assert!((place_mm(&mesh, -0.25).z - 1.0).abs() < 1e-5);
    assert!((place_mm(&mesh, 0.1).z - (1.0 + 0.35 / 0.375)).abs() < 1e-5);
}

/// Strips of a mesh that are torn apart move by themselves, without a fold, and lean as they did.
#[test]
fn strips_that_are_torn_apart_move_alone() {
    let mut mesh = read_obj(OBJ.as_bytes(), PLACEMENT, &mut budget()).unwrap();
    mesh.press(2.0, |_| 0.5);
    mesh.flatten(|_| 0.5);
    let whole = [-0.25, 0.1].map(|z| place_mm(&mesh, z));
    let lines = [5.0, 10.0, 15.0, 20.0];
    mesh.cut(|at| at.x, &lines, 1 << 10).unwrap();
    mesh.refine(|_| 4.0, 1 << 12).unwrap();
    for (z, whole) in [-0.25, 0.1].into_iter().zip(whole) {
        assert!((place_mm(&mesh, z) - whole).length() < 1e-5);
    }
    let mut mesh = read_obj(OBJ.as_bytes(), PLACEMENT, &mut budget()).unwrap();
    mesh.cut(|at| at.x, &lines, 1 << 10).unwrap();
    let strip = |at: Vec2| lines.partition_point(|line| *line < at.x);
    let up_mm = |part: usize| 2.0 * part as f32;
    mesh.tear(strip, |part, _| Vec3::new(0.0, 0.0, up_mm(part)));
    let shell = Shell::new(&mesh, -0.1, 0.1).unwrap();
    assert_eq!(shell.folds(), Folds::default());
    // Beside and between lines; 25 mm of cloth lie on 10 mm.
    for (x, part) in [(1.0, 0), (6.0, 1), (9.9, 1), (10.1, 2), (24.0, 4)] {
        let from = (0.4 * Vec2::new(x, 9.0)).extend(50.0).as_dvec3();
        let mut first = f64::INFINITY;
        shell.visit_spans((from, DVec3::NEG_Z), f64::INFINITY, |span| {
            first = first.min(span.t0);
            f64::INFINITY
        });
        let height = 50.0 - first as f32;
        assert!((height - 0.1 - up_mm(part)).abs() < 1e-3, "{x}: {height}");
    }
    let refused = mesh.cut(|at| at.y, &lines, 8).unwrap_err();
    assert!(matches!(refused, Error::TooLarge { .. }));
}

/// A hole opens where points go aside: rays pass it, no cloth folds over, and beside it lies the cloth
/// that lay in it.
#[test]
fn holes_open_without_a_fold() {
    let radius_mm = 0.5f32;
    let middle = Vec2::new(11.0, 9.0);
    let mut mesh = read_obj(OBJ.as_bytes(), PLACEMENT, &mut budget()).unwrap();
    let away = |at: Vec2| (at - middle).length();
    mesh.refine(|at| 0.3 * away(at).max(0.02), 1 << 16).unwrap();
    mesh.shift(|at| {
        let push = radius_mm * (1.0 - away(at) / 3.0).max(0.0).powi(2);
        (away(at) > 0.02).then(|| push / away(at) * (at - middle))
    })
    .unwrap();
    let shell = Shell::new(&mesh, -0.1, 0.1).unwrap();
    assert_eq!(shell.folds(), Folds::default());
    // Where the cloth was not moved, 25 mm of it lie on 10 mm.
    let place = |at: Vec2| (0.4 * at).extend(5.0).as_dvec3();
    for k in 0..40 {
        let direction = Vec2::from_angle(k as f32);
        let at = |away_mm: f32| {
            let mut found = None;
            let ray = (place(middle + away_mm * direction), DVec3::NEG_Z);
            shell.visit_spans(ray, f64::INFINITY, |span| {
                found = Some(span.cloth_mm.truncate().as_vec2().distance(middle));
                f64::INFINITY
            });
            found
        };
        assert_eq!(at(0.9 * radius_mm), None);
        assert!(at(1.15 * radius_mm).unwrap() < 0.4 * radius_mm);
        assert!((at(4.0).unwrap() - 4.0).abs() < 1e-3);
    }
    let nothing = mesh.shift(|_| None).unwrap_err();
    assert!(matches!(nothing, Error::Empty { .. }));
}
