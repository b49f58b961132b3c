//! Far-field tables in single precision against their formula in double precision, which is
//! written here from the definition of the hats.

use glam::{DVec3, Vec3};
use organza_basis::{PathRng, warp};
use organza_scatter::{Footprint, Surface};
use organza_surface::table::{FarTable, Rings, TableParts};
use std::f64::consts::{FRAC_PI_2, TAU};

const SEED: u64 = 0x7ab;

/// Polar angles and numbers of nodes.
const RINGS: [(f32, u32); 4] = [
    (0.0, 1),
    (0.5, 6),
    (1.2, 10),
    (std::f32::consts::FRAC_PI_2, 8),
];

fn parts() -> TableParts {
    let rings = Rings::new(&RINGS).unwrap();
    let mut rng = PathRng::from_seed(SEED);
    let n = rings.sphere();
    let range = [[-5.0, -2.6], [-6.0, -2.7], [-9.0, -3.0]];
    let factors = (0..n)
        .map(|_| [0, 1, 2].map(|_| 0.5 + rng.unit()))
        .collect();
    let codes = (0..n * (n + 1) / 2)
        .map(|_| [0, 1, 2].map(|_| rng.below(256) as u8))
        .collect();
    TableParts {
        gaps: (0..rings.hemisphere()).map(|_| 0.1 * rng.unit()).collect(),
        rings,
        range,
        factors,
        codes,
    }
}

/// The hats of all nodes in a direction.
fn hats(w: DVec3) -> Vec<f64> {
    let theta = w.x.hypot(w.y).atan2(w.z.abs());
    let turn = w.y.atan2(w.x).rem_euclid(TAU);
    let angles: Vec<f64> = RINGS.iter().map(|r| f64::from(r.0)).collect();
    let mut list = Vec::new();
    for (ring, &(_, count)) in RINGS.iter().enumerate() {
        let here = if ring == 3 { FRAC_PI_2 } else { angles[ring] };
        let along = if theta < here {
            let before = angles[ring - 1];
            ((theta - before) / (here - before)).max(0.0)
        } else if ring < 3 {
            ((angles[ring + 1] - theta) / (angles[ring + 1] - here)).max(0.0)
        } else {
            1.0
        };
        for node in 0..count {
            let step = TAU / f64::from(count);
            let apart = (turn - step * f64::from(node)).rem_euclid(TAU);
            let apart = apart.min(TAU - apart);
            let tent = (1.0 - apart / step).max(0.0);
            let about = if count == 1 { 1.0 } else { tent };
            list.push(along * about);
        }
    }
    let none = vec![0.0; list.len()];
    match w.z < 0.0 {
        true => [none, list].concat(),
        false => [list, none].concat(),
    }
}

/// The value of two directions, by channel.
fn exact(parts: &TableParts, w_out: Vec3, w_in: Vec3) -> [f64; 3] {
    let [x, y] = [w_out, w_in].map(|w| hats(w.as_dvec3().normalize()));
    let nonzero = |hats: &[f64]| -> Vec<(usize, f64)> {
        let all = hats.iter().copied().enumerate();
        all.filter(|(_, hat)| *hat != 0.0).collect()
    };
    let [x, y] = [nonzero(&x), nonzero(&y)];
    std::array::from_fn(|c| {
        let mut sum = 0.0;
        for &(a, u) in &x {
            for &(b, v) in &y {
                let (high, low) = (a.max(b), a.min(b));
                let byte = parts.codes[high * (high + 1) / 2 + low][c];
                let [least, most] = parts.range[c].map(f64::from);
                let value = match byte {
                    0 => 0.0,
                    byte => (least + (most - least) * f64::from(byte - 1) / 254.0).exp(),
                };
                let factors = [a, b].map(|node| f64::from(parts.factors[node][c]));
                sum += u * v * value * factors[0] * factors[1];
            }
        }
        sum
    })
}

/// Directions everywhere, and those that are hard: at the poles and a little beside them,
/// grazing, at the azimuth where turns begin, at nodes.
fn directions() -> Vec<Vec3> {
    let mut rng = PathRng::from_seed(SEED + 1);
    let mut list: Vec<Vec3> = (0..60).map(|_| warp::uniform_sphere(rng.unit2())).collect();
    for theta in [
        0.0,
        1e-4,
        1e-2,
        0.5,
        1.2,
        1.57,
        std::f32::consts::FRAC_PI_2 - 1e-6,
    ] {
        for turn in [
            0.0,
            -1e-7,
            1e-7,
            std::f32::consts::PI,
            std::f32::consts::FRAC_PI_3,
            -2.0,
        ] {
            let w = warp::direction_from_angles(theta, turn);
            list.extend([w, w * Vec3::new(1.0, 1.0, -1.0)]);
        }
    }
    list
}

#[test]
fn tables_follow_double_precision() {
    let parts = parts();
    let table = FarTable::new(parts.clone()).unwrap();
    let at = Footprint::FAR;
    let (mut worst, mut near_pole) = (0.0f64, 0.0f64);
    for w_out in directions() {
        for w_in in directions() {
            let found = table.eval(w_out, w_in, at).0.to_array().map(f64::from);
            let expected = exact(&parts, w_out, w_in);
            let largest = expected.iter().copied().fold(0.0, f64::max);
            for (a, b) in found.into_iter().zip(expected) {
                let error = (a - b).abs() / largest;
                let is_near = [w_out, w_in].iter().any(|w| w.z.abs() > 0.999);
                match is_near {
                    true => near_pole = near_pole.max(error),
                    false => worst = worst.max(error),
                }
            }
        }
    }
    println!("worst {worst:.2e}, near a pole {near_pole:.2e}");
    // 2.4e-6 was seen. Near a pole the angle is the arc cosine of nearly one, which single
    // precision knows to 5e-4 radians; 1.9e-3 was seen.
    assert!(worst < 4.5e-6, "seed {SEED:#x}: {worst:e}");
    assert!(near_pole < 3.5e-3, "seed {SEED:#x}: {near_pole:e}");
    // Known bad: another direction by a hundredth.
    let [a, b] = [0.7, 0.71].map(|theta| warp::direction_from_angles(theta, 1.0));
    let found = f64::from(table.eval(a, a, at).0.x);
    let twin = exact(&parts, b, a)[0];
    assert!((found - twin).abs() > 1e-3 * twin, "the twin passed");
}
