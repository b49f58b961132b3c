//! Tensor trees, written and read back by an evaluator of the tests' own: the planted BSDF
//! must come out again.
use crate::planted::{Planted, random_direction};
use glam::{DVec2, DVec3};
use organza_basis::{PathRng, unwatched, warp};
use organza_measure::{TensorTree, TreeLayout, TreeRank, measure_tensor_tree, write_tensor_tree};
use std::f64::consts::PI;

/// A block of a file: a value, a list of cells, or halves.
enum Block {
    Values(Vec<f64>),
    Halves(Vec<Block>),
}

/// Reads the block behind an opening brace.
fn block<'a>(words: &mut impl Iterator<Item = &'a str>) -> Block {
    let (mut values, mut halves) = (Vec::new(), Vec::new());
    loop {
        match words.next().unwrap() {
            "{" => halves.push(block(words)),
            "}" if halves.is_empty() => return Block::Values(values),
            "}" => return Block::Halves(halves),
            number => values.push(number.parse().unwrap()),
        }
    }
}

/// The value at a place of the unit cube of four or three dimensions.
fn look_up(block: &Block, place: &[f64]) -> f64 {
    match block {
        Block::Values(list) => {
            let side = (list.len() as f64).powf(1.0 / place.len() as f64).round();
            let digit = |x: &f64| (x * side).min(side - 1.0).floor();
            let index = place.iter().fold(0.0, |sum, x| sum * side + digit(x));
            list[index as usize]
        }
        Block::Halves(list) => {
            assert_eq!(list.len(), 1 << place.len());
            let upper: Vec<bool> = place.iter().map(|&x| x >= 0.5).collect();
            let bits = upper.iter().enumerate().map(|(d, &u)| usize::from(u) << d);
            let within = place.iter().zip(&upper);
            let inner: Vec<f64> = within.map(|(x, &u)| 2.0 * x - f64::from(u)).collect();
            look_up(&list[bits.sum::<usize>()], &inner)
        }
    }
}

/// The tree of luminance in one direction of a file.
fn tree_of(text: &str, direction: &str) -> Block {
    let data = text
        .split("<WavelengthData>")
        .find(|part| part.contains(&format!(">{direction}<")) && part.contains(">Visible<"));
    let values = data.unwrap().split("<ScatteringData>").nth(1).unwrap();
    let values = values.split("</ScatteringData>").next().unwrap();
    let mut words = values.split_whitespace();
    assert_eq!(words.next(), Some("{"));
    block(&mut words)
}

/// A point of the disk on the square, one quadrant at a time [Shirley1997].
fn on_square(p: DVec2) -> DVec2 {
    let (r, angle) = (p.length(), p.y.abs().atan2(p.x.abs()) / (PI / 4.0));
    let corner = if angle < 1.0 {
        DVec2::new(r, r * angle)
    } else {
        DVec2::new(r * (2.0 - angle), r)
    };
    let sign = DVec2::new(1.0f64.copysign(p.x), 1.0f64.copysign(p.y));
    0.5 * (corner * sign + 1.0)
}

/// The place of two directions in a tree of rank 4; the face of the cloth is the side below
/// z = 0 of the file, half a turn about the warp.
fn place(w_in: DVec3, w_out: DVec3) -> [f64; 4] {
    let turn = |w: DVec3| DVec2::new(-w.x, w.y);
    let (a, b) = (on_square(-turn(w_in)), on_square(turn(w_out)));
    [a.x, a.y, b.x, b.y]
}

fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.212_639 * r + 0.715_169 * g + 0.072_192 * b
}

/// The mean of the planted BSDF over the cells of a tree that contain two directions.
fn cell_mean(w_in: DVec3, w_out: DVec3, depth: i32) -> f64 {
    let side = f64::powi(2.0, depth);
    let cell = place(w_in, w_out).map(|x| (x * side).min(side - 1.0).floor());
    let within = 6;
    let directions = |x: f64, y: f64, towards: DVec3, sign: f64| -> Vec<DVec3> {
        let of = |k: usize| {
            let u = DVec2::new((k % within) as f64, (k / within) as f64) + 0.5;
            let u = (DVec2::new(x, y) + u / within as f64) / side;
            let disk = sign * warp::concentric_disk(u.as_vec2()).as_dvec2();
            let z = (1.0 - disk.length_squared()).sqrt() * towards.z.signum();
            DVec3::new(-disk.x, disk.y, z)
        };
        (0..within * within).map(of).collect()
    };
    let incident = directions(cell[0], cell[1], w_in, -1.0);
    let exitant = directions(cell[2], cell[3], w_out, 1.0);
    let values = incident.iter().flat_map(|&a| {
        let to = exitant.iter();
        to.map(move |&b| luminance(Planted::bsdf(a, b)))
    });
    values.sum::<f64>() / (incident.len() * exitant.len()) as f64
}

/// Mean squared distance of a file from the planted BSDF at random directions, in standard
/// errors of the cells; `twist` changes how directions are looked up.
fn tree_distance(text: &str, tree: &TensorTree, twist: impl Fn([f64; 4]) -> [f64; 4]) -> f64 {
    let mut rng = PathRng::from_seed(21);
    let signs = [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)];
    let names = [
        "Reflection Front",
        "Reflection Back",
        "Transmission Front",
        "Transmission Back",
    ];
    let matrices = [
        &tree.reflection[0],
        &tree.reflection[1],
        &tree.transmission[0],
        &tree.transmission[1],
    ];
    let (mut sum, mut count) = (0.0, 0.0);
    for ((name, (from, to)), matrix) in names.iter().zip(signs).zip(matrices) {
        let root = tree_of(text, name);
        let noise = matrix.iter().map(|c| f64::from(c.variance)).sum::<f64>() / matrix.len() as f64;
        for _ in 0..60 {
            let (mut a, mut b) = (
                random_direction(&mut rng, 0.0),
                random_direction(&mut rng, 0.0),
            );
            a.z *= from;
            b.z *= to;
            let found = look_up(&root, &twist(place(a, b)));
            sum += (found - cell_mean(a, b, 2)).powi(2) / noise;
            count += 1.0;
        }
    }
    sum / count
}

#[test]
fn a_tensor_tree_holds_the_planted_bsdf() {
    let layout = TreeLayout::new(TreeRank::Anisotropic, 2).unwrap();
    let (tree, _) = measure_tensor_tree(&Planted, layout, 4000, 21, &unwatched).unwrap();
    let written = |tolerance| {
        let mut bytes = Vec::new();
        let kept = write_tensor_tree(&tree, "a <b>", tolerance, &mut bytes).unwrap();
        (String::from_utf8(bytes).unwrap(), kept)
    };
    let (text, kept) = written(None);
    assert!(kept == 1.0 && text.contains("a &lt;b&gt;") && text.contains("TensorTree4"));
    // Mean squares of 240 normal variables are within 1 +- 0.37 in all but one of 10,000
    // cases; cells differ in their noise, the weights of luminance from equal ones.
    let distance = tree_distance(&text, &tree, |p| p);
    assert!((0.5..1.6).contains(&distance), "seed 21: {distance}");
    for (name, twin) in [
        (
            "weft for warp",
            tree_distance(&text, &tree, |[a, b, c, d]| [b, a, d, c]),
        ),
        (
            "no half turn",
            tree_distance(&text, &tree, |[a, b, c, d]| [1.0 - a, b, 1.0 - c, d]),
        ),
        (
            "towards the light",
            tree_distance(&text, &tree, |[a, b, c, d]| [1.0 - a, 1.0 - b, c, d]),
        ),
    ] {
        assert!(twin > 3.0, "seed 21: {name}: {twin}");
    }
    // Joined cells keep the energy, and their values to the tolerance.
    let (pruned, kept) = written(Some(0.3));
    assert!(kept < 0.7 && pruned.len() < text.len(), "{kept}");
    let cells = |text: &str| -> Vec<f64> {
        let root = tree_of(text, "Reflection Front");
        let at = |k: usize| [k % 4, k / 4 % 4, k / 16 % 4, k / 64].map(|i| (i as f64 + 0.5) / 4.0);
        (0..256).map(|k| look_up(&root, &at(k))).collect()
    };
    let (full, joined) = (cells(&text), cells(&pruned));
    let sum = |list: &[f64]| list.iter().sum::<f64>();
    assert!((sum(&joined) / sum(&full) - 1.0).abs() < 32.0 * f64::from(f32::EPSILON));
    let apart = full.iter().zip(&joined).map(|(a, b)| (a - b).powi(2));
    let all = full.iter().map(|a| a * a).sum::<f64>();
    assert!((apart.sum::<f64>() / all).sqrt() < 0.3);
    let normal = tree.along_normal();
    let found = tree.hemispherical(&tree.reflection[0], normal);
    // The cell beside the normal reaches to 45 degrees; its mean is the quadrature of its rays.
    let mut expected = 0.0;
    for k in 0..16 {
        let u = (DVec2::new((k % 4) as f64, (k / 4) as f64) + 0.5) / 16.0 + 0.5;
        let disk = -warp::concentric_disk(u.as_vec2()).as_dvec2();
        let w = DVec3::new(-disk.x, disk.y, (1.0 - disk.length_squared()).sqrt());
        expected += Planted::share(w, false)[0] / 16.0;
    }
    let ratio = found[0] / expected;
    assert!((ratio - 1.0).abs() < 0.03, "seed 21: {found:?} {expected}");
}

/// At rank 3 the value depends on the polar angle of the light and on the exitant direction
/// relative to it: the mean over all azimuths of the cloth.
#[test]
fn a_tree_of_rank_3_is_the_mean_over_azimuths() {
    let layout = TreeLayout::new(TreeRank::Isotropic, 4).unwrap();
    let (tree, _) = measure_tensor_tree(&Planted, layout, 200_000, 4, &unwatched).unwrap();
    let mut bytes = Vec::new();
    write_tensor_tree(&tree, "x", None, &mut bytes).unwrap();
    let root = tree_of(&String::from_utf8(bytes).unwrap(), "Reflection Front");
    // Polar angles and azimuth between the directions, degrees.
    let errors = |turned: f64| {
        let mut worst = 0.0f64;
        for (light, eye, apart) in [(20.0, 60.0, 0.0), (50.0, 70.0, 180.0), (50.0, 60.0, 120.0)] {
            let [light, eye, apart] = [light, eye, apart].map(f64::to_radians);
            let mut mean = 0.0;
            for turn in 0..64 {
                let azimuth = turn as f64 * PI / 32.0;
                let at = |theta: f64, phi: f64| {
                    DVec2::from_angle(phi).extend(0.0) * theta.sin() + DVec3::Z * theta.cos()
                };
                mean +=
                    luminance(Planted::bsdf(at(light, azimuth), at(eye, azimuth + apart))) / 64.0;
            }
            // Onwards from the light is along +x; the half turn about the warp turns azimuths.
            let onward = DVec2::from_angle(PI - apart + turned) * eye.sin();
            let square = on_square(onward);
            let place = [0.5 - 0.5 * light.sin(), square.x, square.y];
            worst = worst.max((look_up(&root, &place) / mean - 1.0).abs());
        }
        worst
    };
    // Cells of 16 x 16 and noise of 5 %.
    assert!(errors(0.0) < 0.2, "seed 4: {}", errors(0.0));
    assert!(errors(PI) > 0.4, "seed 4: {}", errors(PI));
    let unused = look_up(&root, &[0.7, 0.2, 0.2]);
    assert_eq!(unused, 0.0);
}
