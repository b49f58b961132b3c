//! Tables in RGL's tensor format, written and read back by an evaluator of the tests' own: the
//! planted BRDF must come out again.
use crate::planted::{Planted, random_direction};
use glam::{DVec2, DVec3};
use organza_basis::{PathRng, unwatched, warp};
use organza_measure::{AdaptiveGrid, Effort, measure_adaptive, write_adaptive};
use std::collections::HashMap;
use std::f64::consts::PI;

/// The tensors of a file by name: dimensions and values.
fn tensors(bytes: &[u8]) -> HashMap<String, (Vec<usize>, Vec<f64>)> {
    let number = |at: usize, size: usize| {
        let digits = bytes[at..at + size].iter().rev();
        digits.fold(0usize, |sum, &b| sum << 8 | usize::from(b))
    };
    assert_eq!(&bytes[..14], b"tensor_file\0\x01\0");
    let (mut at, mut found) = (18, HashMap::new());
    for _ in 0..number(14, 4) {
        let length = number(at, 2);
        let name = String::from_utf8(bytes[at + 2..at + 2 + length].to_vec()).unwrap();
        at += 2 + length;
        let (dimensions, kind, start) = (number(at, 2), bytes[at + 2], number(at + 3, 8));
        assert_eq!(start % 8, 0);
        let shape: Vec<usize> = (0..dimensions)
            .map(|d| number(at + 11 + 8 * d, 8))
            .collect();
        at += 11 + 8 * dimensions;
        let count: usize = shape.iter().product();
        let float = |k: usize| f32::from_bits(number(start + 4 * k, 4) as u32);
        let value = |k: usize| match kind {
            1 => f64::from(bytes[start + k]),
            10 => f64::from(float(k)),
            other => panic!("type {other}"),
        };
        found.insert(name, (shape, (0..count).map(value).collect()));
    }
    found
}

/// An evaluator of the format [Dupuy2018].
struct Table(HashMap<String, (Vec<usize>, Vec<f64>)>);

/// Mistakes that an evaluator could make.
#[derive(Clone, Copy, PartialEq)]
enum Mistake {
    None,
    AxesExchanged,
    NoDensity,
    NoCosine,
}

impl Table {
    fn values(&self, name: &str) -> &[f64] {
        &self.0[name].1
    }

    /// The bilinear value of a square of nodes.
    fn square(nodes: &[f64], u: DVec2) -> f64 {
        let side = (nodes.len() as f64).sqrt() as usize;
        let scaled = (u * (side - 1) as f64).clamp(DVec2::ZERO, DVec2::splat(side as f64 - 1.0001));
        let (x, y) = (scaled.x as usize, scaled.y as usize);
        let f = scaled.fract();
        let row = |y: usize| nodes[y * side + x] * (1.0 - f.x) + nodes[y * side + x + 1] * f.x;
        row(y) * (1.0 - f.y) + row(y + 1) * f.y
    }

    /// Slices of a field around a direction of light, mixed by azimuth and polar angle.
    fn slice(&self, name: &str, channel: usize, phi: f64, theta: f64) -> Vec<f64> {
        let shape = &self.0[name].0;
        let size = shape[shape.len() - 1].pow(2);
        let channels = if shape.len() == 5 { shape[2] } else { 1 };
        let place = |nodes: &[f64], x: f64| {
            let k = nodes.partition_point(|&n| n <= x).clamp(1, nodes.len() - 1) - 1;
            (
                k,
                ((x - nodes[k]) / (nodes[k + 1] - nodes[k])).clamp(0.0, 1.0),
            )
        };
        let (p, s) = place(self.values("phi_i"), phi);
        let (t, r) = place(self.values("theta_i"), theta);
        let mut mixed = vec![0.0; size];
        for (dp, dt) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let weight = if dp == 1 { s } else { 1.0 - s } * if dt == 1 { r } else { 1.0 - r };
            let first = (((p + dp) * shape[1] + t + dt) * channels + channel) * size;
            for (m, v) in mixed.iter_mut().zip(&self.values(name)[first..]) {
                *m += weight * v;
            }
        }
        mixed
    }

    /// The share of a density below a place along a row of nodes.
    fn below(nodes: &[f64], x: f64) -> f64 {
        let steps = 4000;
        let at = |k: usize| {
            let scaled = (k as f64 + 0.5) / steps as f64 * (nodes.len() - 1) as f64;
            let i = (scaled as usize).min(nodes.len() - 2);
            nodes[i] + (scaled - i as f64) * (nodes[i + 1] - nodes[i])
        };
        let (mut part, mut all) = (0.0, 0.0);
        for k in 0..steps {
            let share = (x * steps as f64 - k as f64).clamp(0.0, 1.0);
            part += share * at(k);
            all += at(k);
        }
        part / all
    }

    /// The BRDF in a channel.
    fn eval(&self, channel: usize, w_in: DVec3, w_out: DVec3, mistake: Mistake) -> f64 {
        let on_square = |w: DVec3| {
            let u = DVec2::new(
                (w.z.min(1.0).acos() * 2.0 / PI).sqrt(),
                (w.y.atan2(w.x) + PI) / (2.0 * PI),
            );
            if mistake == Mistake::AxesExchanged {
                DVec2::new(u.y, u.x)
            } else {
                u
            }
        };
        let (theta, phi) = (w_in.z.acos(), w_in.y.atan2(w_in.x));
        let half = on_square((w_in + w_out).normalize());
        let visible = self.slice("vndf", 0, phi, theta);
        let side = (visible.len() as f64).sqrt() as usize;
        let sum = |row: &[f64]| row.windows(2).map(|w| w[0] + w[1]).sum::<f64>();
        let sums: Vec<f64> = visible.chunks(side).map(sum).collect();
        let y = (half.y * (side - 1) as f64).min(side as f64 - 1.0001);
        let (k, f) = (y as usize, y.fract());
        let row: Vec<f64> = (0..side)
            .map(|x| visible[k * side + x] * (1.0 - f) + visible[(k + 1) * side + x] * f)
            .collect();
        let sample = DVec2::new(Table::below(&row, half.x), Table::below(&sums, half.y));
        let value = Table::square(&self.slice("rgb", channel, phi, theta), sample);
        let density = Table::square(self.values("ndf"), half)
            / (4.0 * Table::square(self.values("sigma"), on_square(w_in)));
        let density = match mistake {
            Mistake::NoDensity => 1.0,
            _ => density,
        };
        let cosine = match mistake {
            Mistake::NoCosine => 1.0,
            _ => w_out.z,
        };
        value * density / cosine
    }
}

/// Median and largest of numbers.
fn median_and_largest(mut list: Vec<f64>) -> (f64, f64) {
    list.sort_by(f64::total_cmp);
    (list[list.len() / 2], list[list.len() - 1])
}

#[test]
fn an_adaptive_table_holds_the_planted_brdf() {
    let grid = AdaptiveGrid {
        polar: 12,
        azimuths: 32,
        side: 24,
    };
    let effort = Effort::new(2, 1);
    let result = measure_adaptive(&Planted, grid, &effort, &unwatched).unwrap();
    let mut bytes = Vec::new();
    write_adaptive(&result.brdf, "planted", &mut bytes).unwrap();
    let table = Table(tensors(&bytes));
    assert_eq!(table.0["rgb"].0, [33, 12, 3, 24, 24]);
    assert_eq!(table.values("description").len(), 7);
    assert_eq!(table.values("jacobian"), [1.0]);
    let mut rng = PathRng::from_seed(6);
    let pairs: Vec<[DVec3; 2]> = (0..150)
        .map(|_| {
            [
                random_direction(&mut rng, 0.2),
                random_direction(&mut rng, 0.2),
            ]
        })
        .collect();
    let errors = |mistake| {
        let error = |(k, &[a, b]): (usize, &[DVec3; 2])| {
            (table.eval(k % 3, a, b, mistake) / Planted::bsdf(a, b)[k % 3] - 1.0).abs()
        };
        median_and_largest(pairs.iter().enumerate().map(error).collect())
    };
    let (median, worst) = errors(Mistake::None);
    assert!(median < 0.01 && worst < 0.15, "{median} {worst}");
    for mistake in [
        Mistake::AxesExchanged,
        Mistake::NoDensity,
        Mistake::NoCosine,
    ] {
        assert!(errors(mistake).0 > 0.05, "{}", errors(mistake).0);
    }
    let apart = |&[a, b]: &[DVec3; 2]| {
        let (there, back) = (
            table.eval(0, a, b, Mistake::None),
            table.eval(0, b, a, Mistake::None),
        );
        (there / back - 1.0).abs()
    };
    let (median, worst) = median_and_largest(pairs.iter().map(apart).collect());
    assert!(median < 0.015 && worst < 0.25, "{median} {worst}");
    // Energy: the table over the square is the reflectance; so is its luminance, normalised.
    for (azimuth, polar) in [(0, 0), (5, 3), (22, 7)] {
        let theta = result.brdf.theta_rad[polar];
        let phi = result.brdf.phi_rad[azimuth];
        let w = warp::direction_from_angles(theta, phi).as_dvec3();
        let (found, expected) = (
            result.brdf.reflectance(azimuth, polar),
            Planted::share(w, false),
        );
        for (f, e) in found.iter().zip(expected) {
            assert!((f / e - 1.0).abs() < 0.02, "{found:?} {expected:?}");
        }
    }
    for name in ["vndf", "luminance"] {
        let slice = &table.values(name)[..576];
        let weight = |k: usize| if k == 0 || k == 23 { 0.5 } else { 1.0 } / 23.0;
        let nodes = slice.iter().enumerate();
        let weighted = nodes.map(|(k, v)| v * weight(k % 24) * weight(k / 24));
        let whole: f64 = weighted.sum();
        let rounding = 4.0 * f64::from(f32::EPSILON);
        assert!((whole - 1.0).abs() < rounding, "{name}");
    }
}
