//! Polynomial texture maps, written and read back by a reader of the tests' own: planted
//! polynomials must come out again, and what no polynomial of second degree shows is residual.
use glam::{UVec2, Vec2, Vec3};
use organza_basis::{PathRng, Rgb, unwatched};
use organza_measure::{
    Exit, MapEffort, PatchResponse, TexelGrid, measure_polynomial_map, write_polynomial_map,
};
use organza_transport::Stats;

const SEED: u64 = 20;

/// Planted values in steps of 1/255: a channel's polynomial that changes over the cloth.
fn planted(place_mm: Vec2, channel: usize) -> [f32; 6] {
    let bright = 1.0 - 0.2 * channel as f32;
    let tilt = 15.0 * (place_mm.x - place_mm.y);
    [-20.0, -35.0, 12.0, tilt, -0.5 * tilt, 200.0 * bright]
}

fn value(c: &[f32; 6], u: f32, v: f32) -> f32 {
    c[0] * u * u + c[1] * v * v + c[2] * u * v + c[3] * u + c[4] * v + c[5]
}

/// A sheet that looks as planted; with `ripple`, with a third harmonic that no map can hold,
/// with `noise`, with an even spread of values about the planted one.
#[derive(Clone, Copy, Default)]
struct Sheet {
    ripple: f32,
    noise: f32,
}

impl PatchResponse for Sheet {
    fn estimate_bsdf(&self, _: Vec3, _: Vec3, _: &mut PathRng, _: &mut Stats) -> Rgb {
        unreachable!("maps ask at places")
    }

    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_in: Vec3,
        w_out: Vec3,
        rng: &mut PathRng,
        _: &mut Stats,
    ) -> Rgb {
        assert!(w_out.z > 0.999_999);
        // Texels of 1 mm hold one polynomial each.
        let place_mm = place_mm.floor();
        let extra = self.ripple * (3.0 * w_in.y.atan2(w_in.x)).cos();
        let extra = extra + self.noise * 12f32.sqrt() * (rng.unit() - 0.5);
        let shown = |c| value(&planted(place_mm, c), w_in.x, w_in.y) + extra;
        Rgb::from([0, 1, 2].map(|c| shown(c) / 255.0 / (std::f32::consts::PI * w_in.z)))
    }

    fn estimate_exit(&self, _: Vec3, _: &mut PathRng, _: &mut Stats) -> Exit {
        unreachable!("maps ask for no exits")
    }
}

const GRID: TexelGrid = TexelGrid {
    low_mm: Vec2::ZERO,
    size_mm: Vec2::new(3.0, 2.0),
    texels: UVec2::new(3, 2),
};

const EFFORT: MapEffort = MapEffort {
    lamps: 48,
    paths: 16,
    seed: SEED,
};

/// Coefficients by channel, row from the bottom, column and term.
fn read(bytes: &[u8]) -> Vec<[f32; 6]> {
    let mut at = 0;
    let mut line = || {
        let end = at + bytes[at..].iter().position(|&b| b == b'\n').unwrap();
        let text = String::from_utf8(bytes[at..end].to_vec()).unwrap();
        at = end + 1;
        text
    };
    let head = [line(), line(), line(), line()];
    assert_eq!(head, ["PTM_1.2", "PTM_FORMAT_RGB", "3", "2"]);
    let numbers =
        |text: String| -> Vec<f32> { text.split(' ').map(|n| n.parse().unwrap()).collect() };
    let (scale, bias) = (numbers(line()), numbers(line()));
    assert_eq!(bytes.len() - at, 3 * 3 * 2 * 6);
    let texel = |t: &[u8]| std::array::from_fn(|k| (f32::from(t[k]) - bias[k]) * scale[k]);
    bytes[at..].chunks(6).map(texel).collect()
}

#[test]
fn planted_polynomials_come_out() {
    let map = measure_polynomial_map(&Sheet::default(), &GRID, &EFFORT, &unwatched).unwrap();
    // Values of up to 1 in f32.
    assert!(map.residual < 1e-5 && map.noise < 1e-5, "{}", map.residual);
    for (k, texel) in map.coefficients.iter().enumerate() {
        for (channel, found) in texel.iter().enumerate() {
            let place = Vec2::new((k % 3) as f32, 1.0 - (k / 3) as f32);
            for (c, truth) in found.iter().zip(planted(place, channel)) {
                assert!((c * 255.0 - truth).abs() < 1e-2, "{found:?}");
            }
        }
    }
}

#[test]
fn files_hold_display_values() {
    let map = measure_polynomial_map(&Sheet::default(), &GRID, &EFFORT, &unwatched).unwrap();
    let mut bytes = Vec::new();
    write_polynomial_map(&map, &mut bytes).unwrap();
    let found = read(&bytes);
    // The largest difference of file and cloth at some lamps, rows from the bottom or the top,
    // values encoded or not.
    let worst = |from_top: bool, encoded: bool| {
        let mut worst = 0f32;
        for (k, c) in found.iter().enumerate() {
            let (channel, row, column) = (k / 6, k / 3 % 2, k % 3);
            let row = if from_top { 1 - row } else { row };
            let truth = planted(Vec2::new(column as f32, row as f32), channel);
            for (u, v) in [(0.0, 0.0), (0.6, 0.3), (-0.5, 0.7), (0.2, -0.9)] {
                let shown = value(c, u, v) / 255.0;
                let decoded = Rgb::linear_from_srgb(shown);
                let shown = if encoded { decoded } else { shown };
                worst = worst.max((255.0 * shown - value(&truth, u, v)).abs());
            }
        }
        worst
    };
    // Half a step of each coefficient, and what a second degree misses of the curve of sRGB.
    assert!(worst(false, true) < 1.5, "{}", worst(false, true));
    assert!(worst(true, true) > 8.0, "rows in the wrong order pass");
    let linear = worst(false, false);
    assert!(linear > 8.0, "linear values pass for display values");
}

#[test]
fn residual_and_noise_are_told_apart() {
    let measure =
        |sheet: Sheet| measure_polynomial_map(&sheet, &GRID, &EFFORT, &unwatched).unwrap();
    let clean = measure(Sheet {
        ripple: 8.0,
        noise: 0.0,
    });
    // A third harmonic of 8 has a deviation of 5.7 and is nearly orthogonal to the terms.
    let off = (255.0 * clean.residual / (8.0 / 2f64.sqrt()) - 1.0).abs();
    assert!(off < 0.1, "{}", clean.residual);
    assert!(clean.noise < 4.0 * f64::from(f32::EPSILON));
    // A deviation of 8 over 16 paths is 2 of the mean, in 36 x 48 - 36 x 6 degrees of freedom:
    // the residual's own deviation is 2 %.
    let noisy = measure(Sheet {
        ripple: 0.0,
        noise: 8.0,
    });
    let ratio = noisy.residual / noisy.noise;
    let off = (255.0 * noisy.noise / 2.0 - 1.0).abs();
    assert!(off < 0.1, "seed {SEED}: {}", noisy.noise);
    // Margin: four standard errors of 0.02, and 0.02 for the fit.
    let margin = 4.0 * 0.02 + 0.02;
    assert!((ratio - 1.0).abs() < margin, "seed {SEED}: {ratio}");
    // The known-bad twin: a ripple that is taken for noise.
    let both = measure(Sheet {
        ripple: 8.0,
        noise: 8.0,
    });
    assert!(both.residual / both.noise > 2.0, "seed {SEED}");
}
