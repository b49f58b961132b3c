//! Tables: reciprocity, energy, sampling and files.

use super::*;
use glam::Vec2;
use organza_basis::hypothesis::SphereGrid;
use organza_basis::warp;
use organza_testing::sized;
use serde_json::json;
use textures::{striped, stripes};

mod textures;

/// A cloth with highlights and colour that absorbs nothing in its green channel.
fn parts() -> TableParts {
    let degrees = [
        (0.0, 1),
        (15.0, 8),
        (40.0, 16),
        (65.0, 20),
        (80.0, 16),
        (90.0, 8),
    ];
    let rings = Rings::new(&degrees.map(|(t, n): (f32, u32)| (t.to_radians(), n))).unwrap();
    let n = rings.sphere();
    let mut rng = PathRng::from_seed(21);
    let at: Vec<Vec3> = (0..n)
        .map(|k| {
            let drawn = (0..32).map(|_| rings.draw(k, &mut rng)).sum::<Vec3>();
            drawn.normalize()
        })
        .collect();
    let value = |a: Vec3, b: Vec3| {
        let half = (a.truncate() + b.truncate()).length();
        let side = if a.z * b.z > 0.0 { 1.0 } else { 0.3 };
        f64::from(side * (0.05 + (-12.0 * half * half).exp()))
    };
    let mut values = Vec::new();
    for a in 0..n {
        for b in 0..=a {
            let v = value(at[a], at[b]);
            values.push([v, 0.5 + v, 0.2 * v]);
        }
    }
    let hemisphere = rings.hemisphere();
    balance(&MeasuredMatrix {
        values,
        shares: vec![[0.6, 0.85, 0.2]; n],
        gaps: vec![0.15; hemisphere],
        rings,
    })
    .parts
}

fn table() -> FarTable {
    FarTable::new(parts()).unwrap()
}

fn direction(rng: &mut PathRng) -> Vec3 {
    warp::uniform_sphere(rng.unit2())
}

#[test]
fn values_are_reciprocal_to_the_bit_and_not_negative() {
    let table = table();
    let mut rng = PathRng::from_seed(31);
    for _ in 0..20_000 {
        let [a, b] = [direction(&mut rng), direction(&mut rng)];
        let there = table.eval(a, b, Footprint::FAR);
        let back = table.eval(b, a, Footprint::FAR);
        assert_eq!(there.0, back.0, "seed 31: {a} {b}");
        assert!(there.is_valid(), "seed 31: {a} {b}");
        let [there, back] = [a, -a].map(|w| table.gap(w, Footprint::FAR));
        assert!((there - back).abs() < 4.0 * f32::EPSILON);
    }
}

#[test]
fn a_white_furnace_stays_white() {
    let table = table();
    let mut rng = PathRng::from_seed(41);
    for _ in 0..200 {
        let w = direction(&mut rng);
        // Between the nodes as at them: green is not absorbed.
        let total = table.albedo(w) + Rgb::splat(table.gap(w, Footprint::FAR));
        assert!((total.0.y - 1.0).abs() < 1e-3, "seed 41: {w}: {total:?}");
        // Drawn light has the same total, and never more than its share.
        let mut sum = organza_basis::Moments::default();
        for _ in 0..2000 {
            let drawn = table.sample(w, Footprint::FAR, &mut rng);
            sum.add(drawn.map_or(0.0, |s| f64::from(s.weight.0.y)));
        }
        let expected = 0.85 / (1.0 - f64::from(table.gap(w, Footprint::FAR)));
        let z = (sum.mean - expected) / sum.standard_error().max(1e-6);
        assert!(z.abs() < 5.0, "seed 41: {w}: {} for {expected}", sum.mean);
    }
}

#[test]
fn samples_have_the_density_of_the_value() {
    let table = table();
    for (seed, w) in [
        (51, Vec3::new(0.1, 0.2, 0.97)),
        (52, Vec3::new(0.6, -0.6, -0.53)),
        (53, Vec3::new(-0.99, 0.0, 0.1)),
    ] {
        let w = w.normalize();
        let met = 1.0 - table.gap(w, Footprint::FAR);
        let grid = SphereGrid::new(Vec3::Z, 24, 24).admitting(2e-3);
        let run = |pdf: &dyn Fn(Vec3) -> f64| {
            let mut rng = PathRng::from_seed(seed);
            grid.chi_square(
                200_000,
                || table.sample(w, Footprint::FAR, &mut rng).map(|s| s.w_in),
                pdf,
            )
        };
        let true_pdf = |v: Vec3| f64::from(table.pdf(w, v, Footprint::FAR) / met);
        let verdict = run(&true_pdf);
        assert!(verdict.p_value > 1e-4, "seed {seed}: {verdict:?}");
        // A density that is turned by eleven degrees is detected.
        let turned = |v: Vec3| {
            let turn = Vec2::from_angle(0.2).rotate(v.truncate());
            true_pdf(turn.extend(v.z))
        };
        assert!(run(&turned).p_value < 1e-4, "seed {seed}");
    }
}

#[test]
fn samples_say_what_pdf_and_eval_say() {
    let table = table();
    let mut rng = PathRng::from_seed(61);
    for _ in 0..2000 {
        let w = direction(&mut rng);
        let Some(s) = table.sample(w, Footprint::FAR, &mut rng) else {
            continue;
        };
        assert_eq!(s.pdf, table.pdf(w, s.w_in, Footprint::FAR));
        let weight = table.eval(w, s.w_in, Footprint::FAR) * (s.w_in.z.abs() / s.pdf);
        let off = (weight.0 - s.weight.0).abs().max_element();
        assert!(off < 4.0 * f32::EPSILON, "seed 61");
    }
    assert_eq!(table.sample(Vec3::X, Footprint::FAR, &mut rng), None);
    assert!(table.eval(Vec3::X, Vec3::Z, Footprint::FAR).is_black());
}

#[test]
fn files_keep_tables_and_damage_is_noticed() {
    let parts = parts();
    let about = json!({ "fabric": "test" });
    let bytes = write_table(&parts, None, &about).unwrap();
    let (table, read) = read_table(&bytes).unwrap();
    assert_eq!((&table, &read), (&FarTable::new(parts).unwrap(), &about));
    assert_eq!(read_table(b"OFA"), Err(TableFileError::Magic));
    for k in (8..bytes.len()).step_by(97) {
        assert!(read_table(&bytes[..k]).is_err(), "cut at {k}");
        let mut wrong = bytes.clone();
        wrong[k] ^= 0x10;
        assert!(read_table(&wrong).is_err(), "byte {k}");
    }
    let mut long = bytes;
    long.push(0);
    let what = "something follows the table";
    assert_eq!(read_table(&long), Err(TableFileError::Length(what)));
}

#[test]
fn parts_that_create_light_are_refused() {
    let mut parts = parts();
    parts.gaps[3] = 0.5;
    let why = FarTable::new(parts.clone()).unwrap_err();
    assert!(matches!(why, NoTable::Energy { .. }), "{why}");
    parts.gaps[3] = f32::NAN;
    assert!(matches!(
        FarTable::new(parts.clone()),
        Err(NoTable::Number(_))
    ));
    parts.gaps.pop();
    assert_eq!(FarTable::new(parts), Err(NoTable::Lengths));
}

#[test]
fn usual_tables_fit_into_a_megabyte() {
    let rings = Rings::usual();
    let n = rings.sphere();
    let table = FarTable::new(TableParts {
        gaps: vec![0.0; rings.hemisphere()],
        range: [[0.0, 1.0]; 3],
        factors: vec![[0.0; 3]; n],
        codes: vec![[0; 3]; n * (n + 1) / 2],
        rings,
    });
    let bytes = table.unwrap().memory_bytes();
    assert!(bytes <= 1_000_000, "{bytes}");
}

/// Nanoseconds of one call, the best of several batches: other work on the machine only adds.
fn best_ns(mut call: impl FnMut(usize) -> f32) -> f64 {
    const CALLS: usize = 4096;
    let mut best = f64::INFINITY;
    for _ in 0..30 {
        let started = std::time::Instant::now();
        let sum: f32 = (0..CALLS).map(&mut call).sum();
        let ns = started.elapsed().as_secs_f64() * 1e9 / CALLS as f64;
        assert!(sum.is_finite());
        best = best.min(ns);
    }
    best
}

/// With `--nocapture` it prints the times.
#[test]
fn values_and_samples_take_less_than_a_microsecond() {
    let rings = Rings::usual();
    let n = rings.sphere();
    let mut rng = PathRng::from_seed(71);
    let codes = (0..n * (n + 1) / 2)
        .map(|_| [rng.bits() as u8 | 1; 3])
        .collect();
    let table = FarTable::new(TableParts {
        gaps: vec![0.1; rings.hemisphere()],
        range: [[-3.0, 0.0]; 3],
        factors: vec![[0.5; 3]; n],
        codes,
        rings,
    })
    .unwrap();
    let list: Vec<Vec3> = (0..4097).map(|_| direction(&mut rng)).collect();
    let eval = best_ns(|k| table.eval(list[k], list[k + 1], Footprint::FAR).0.x);
    let pdf = best_ns(|k| table.pdf(list[k], list[k + 1], Footprint::FAR));
    let sample = best_ns(|k| {
        let drawn = table.sample(list[k], Footprint::FAR, &mut rng);
        drawn.map_or(0.0, |s| s.weight.0.x)
    });
    println!("eval {eval:.0} ns, pdf {pdf:.0} ns, sample {sample:.0} ns");
    assert!(eval < 1000.0 && pdf < 1000.0 && sample < 1000.0);
}

#[test]
fn files_keep_textures() {
    let (parts, about) = (parts(), json!({"fabric": "stripes"}));
    let texture = stripes();
    let bytes = write_table(&parts, Some(&texture), &about).unwrap();
    let (read, _) = read_table(&bytes).unwrap();
    assert_eq!(read, striped());
    let plain = write_table(&parts, None, &about).unwrap();
    let mut newer = plain[..plain.len() - 32].to_vec();
    newer[8] = 3;
    assert_eq!(read_table(&sealed(newer)), Err(TableFileError::Version(3)));
    // Every shorter file is refused, and every texture that is none.
    for length in (bytes.len() - 4000..bytes.len() - 32).step_by(37) {
        let cut = sealed(bytes[..length].to_vec());
        assert!(read_table(&cut).is_err(), "{length}");
    }
    let first = plain.len() - 36;
    for at in (first..first + 120).step_by(sized(7, 1)) {
        let mut broken = bytes[..bytes.len() - 32].to_vec();
        broken[at] = 0xff;
        // No number may make it panic or take memory without bound.
        let _ = read_table(&sealed(broken));
    }
    let wide = TextureLayout {
        size: glam::UVec2::new(3, 4),
        ..texture.layout
    };
    let wrong = [
        TextureParts {
            layout: wide,
            ..texture.clone()
        },
        TextureParts {
            gaps: vec![0; 3],
            ..texture.clone()
        },
        TextureParts {
            scales: vec![f32::NAN; texture.scales.len()],
            ..texture
        },
    ];
    for parts in wrong {
        assert!(Texture::new(&parts).is_err());
    }
}
