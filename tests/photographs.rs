//! Cloth that is fitted to photographs: planted answers come back, other pictures are refused.
//!
//! The photographs are organza's own pictures of a cloth that the fit does not know, blurred and
//! with noise. `ORGANZA_FULL=1 cargo test --release --test main photographs::` fits every kind
//! of weave.

use crate::program::{complaint, folder, succeed};
use glam::{UVec2, Vec2};
use organza_measure::{Angles, Pair, TexelGrid, measure_texture};
use organza_photograph::is_same_weave;
use organza_scene::fabric_file;
use organza_scene::loader::Loader;
use organza_scene::patches::{Matter, PatchOptions};
use organza_scene::representation::{EXPLICIT_FIBRES, ShownAs};
use organza_testing::is_full;
use organza_weave::Draft;
use serde_json::Value;
use std::path::Path;

/// Value of white paper in the pictures.
const WHITE: f32 = 0.8;
/// Standard deviation of the noise, as a share of each pixel.
const NOISE: f32 = 0.03;

/// A cloth and its picture.
struct Planted {
    weave: &'static str,
    per_cm: [f64; 2],
    tex: [f64; 2],
    colours: [[f64; 3]; 2],
    /// Pixels from thread to thread, in the ratio of the spacings, so that pixels are square.
    pixels: [u32; 2],
    seed: u64,
}

const PLAIN: Planted = Planted {
    weave: "plain",
    per_cm: [22.0, 19.0],
    tex: [22.0, 34.0],
    colours: [[0.55, 0.30, 0.20], [0.25, 0.40, 0.60]],
    pixels: [19, 22],
    seed: 101,
};

/// The other kinds of weave.
const MORE: [Planted; 4] = [
    Planted {
        weave: "twill-2-2-z",
        per_cm: [26.0, 22.0],
        tex: [24.0, 28.0],
        colours: [[0.30, 0.35, 0.50], [0.62, 0.55, 0.40]],
        pixels: [11, 13],
        seed: 102,
    },
    Planted {
        weave: "twill-3-1-s",
        per_cm: [30.0, 20.0],
        tex: [22.0, 30.0],
        colours: [[0.40, 0.40, 0.40], [0.60, 0.20, 0.20]],
        pixels: [12, 18],
        seed: 103,
    },
    Planted {
        weave: "satin-5-3",
        per_cm: [40.0, 22.0],
        tex: [14.0, 24.0],
        colours: [[0.60, 0.15, 0.12], [0.50, 0.45, 0.30]],
        pixels: [11, 20],
        seed: 104,
    },
    Planted {
        weave: "basket-2-2",
        per_cm: [18.0, 16.0],
        tex: [30.0, 30.0],
        colours: [[0.50, 0.45, 0.30], [0.20, 0.30, 0.50]],
        pixels: [16, 18],
        seed: 105,
    },
];

/// A number from 0 to 1 that seed and place decide.
fn uniform(seed: u64, i: u64) -> f32 {
    let mut z = (seed << 40 ^ i).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ z >> 31) >> 40) as f32 / (1u64 << 24) as f32
}

/// About normal, of variance one.
fn normal(seed: u64, i: u64) -> f32 {
    let sum: f32 = (0..12).map(|k| uniform(seed, 12 * i + k)).sum();
    sum - 6.0
}

/// Rows of a picture that repeats, made longer than `least` pixels, blurred and with noise.
fn taken(
    tile: &[[f32; 3]],
    size: [usize; 2],
    least: usize,
    seed: u64,
) -> ([usize; 2], Vec<[f32; 3]>) {
    let whole = size.map(|n| least.div_ceil(n) * n);
    let value = |x: usize, y: usize| {
        let mut sum = [0.0f32; 3];
        for (j, v) in [0.25, 0.5, 0.25].into_iter().enumerate() {
            for (i, u) in [0.25, 0.5, 0.25].into_iter().enumerate() {
                let (x, y) = (x + size[0] - 1 + i, y + size[1] - 1 + j);
                let texel = tile[y % size[1] * size[0] + x % size[0]];
                (0..3).for_each(|c| sum[c] += u * v * texel[c]);
            }
        }
        sum
    };
    let rows = (0..whole[0] * whole[1]).map(|k| {
        let (x, y) = (k % whole[0], k / whole[0]);
        let clean = value(x, y);
        std::array::from_fn(|c| clean[c] * (1.0 + NOISE * normal(seed, (3 * k + c) as u64)))
    });
    (whole, rows.collect())
}

fn write(path: &Path, [width, height]: [usize; 2], rows: &[[f32; 3]]) {
    let pixel = |x: usize, y: usize| {
        let [r, g, b] = rows[y * width + x].map(|v| v.max(0.0));
        (r, g, b)
    };
    exr::prelude::write_rgb_file(path, width, height, pixel).unwrap();
}

/// The light in front and behind, degrees.
const LIGHTS: [[f64; 2]; 2] = [[30.0, 45.0], [150.0, 45.0]];

/// Photographs of a fabric in a folder, as `front.exr` and `back.exr`, and the width of the cloth
/// in them, mm. `pixels` is the size of the picture of one tile.
fn photograph(folder: &Path, text: &str, pixels: UVec2, seed: u64) -> f64 {
    let mut loader = Loader::new();
    loader.give("truth.toml", text);
    let path = Path::new("truth.toml");
    let fabric = fabric_file::load(path, &[], &loader).unwrap();
    let options = PatchOptions {
        loader: &loader,
        voxel_um: None,
        level: 0,
        max_memory_bytes: None,
    };
    let shown = ShownAs::usual(&EXPLICIT_FIBRES);
    let patch = Matter::new(&fabric, path, shown, &options).unwrap();
    let patch = patch.patch(&fabric, path, &options).unwrap();
    let size_mm: Vec2 = fabric.tile_mm();
    let grid = TexelGrid {
        low_mm: Vec2::ZERO,
        size_mm,
        texels: pixels,
    };
    let angles = |[theta_deg, phi_deg]: [f64; 2]| Angles { theta_deg, phi_deg };
    let mut width_mm = 0.0;
    for (k, (light, name)) in LIGHTS
        .into_iter()
        .zip(["front.exr", "back.exr"])
        .enumerate()
    {
        let pair = Pair {
            incident: angles(light),
            exitant: angles([0.0, 0.0]),
        };
        let texture = measure_texture(&patch, pair, &grid, 10, seed + k as u64).unwrap();
        let gain = WHITE * std::f32::consts::PI;
        let tile: Vec<[f32; 3]> = (texture.mean.iter()).map(|v| v.map(|v| v * gain)).collect();
        let size = [pixels.x as usize, pixels.y as usize];
        let (whole, rows) = taken(&tile, size, 180, seed + 10 + k as u64);
        width_mm = f64::from(size_mm.x) * (whole[0] / size[0]) as f64;
        write(&folder.join(name), whole, &rows);
    }
    width_mm
}

/// The fabric from which fits begin: its fibres, but another weave and other yarns.
const START: &str = "[draft]\nweave = \"plain\"\n[warp]\nper_cm = 10.0\n[weft]\nper_cm = 10.0\n\
    [yarn.y]\npreset = \"cotton\"\nfibre_radius_um = 12.0\ntex = 10.0\n";

impl Planted {
    /// Repeats of the weave in the picture of one tile: more crossings than a repeat may have, so
    /// that single fibres do not look like a part of the weave.
    fn repeats(&self) -> usize {
        let threads = Draft::named(self.weave).unwrap().ends();
        6usize.div_ceil(threads).max(2)
    }

    /// The fabric, several repeats of the weave in each direction.
    fn text(&self) -> String {
        let [a, b] = self.tex;
        let n = self.repeats();
        let fibres = "preset = \"cotton\"\nfibre_radius_um = 12.0";
        format!(
            "seed = {}\n[draft]\nweave = \"{}\"\n\
             [warp]\nyarn = \"a\"\nper_cm = {}\ncolours = [{:?}]\n\
             [weft]\nyarn = \"b\"\nper_cm = {}\ncolours = [{:?}]\n\
             [yarn.a]\n{fibres}\ntex = {a}\n[yarn.b]\n{fibres}\ntex = {b}\n\
             [tile]\nrepeats = [{n}, {n}]\n",
            self.seed, self.weave, self.per_cm[0], self.colours[0], self.per_cm[1], self.colours[1],
        )
    }

    /// Fits photographs of it, compares spacing and draft, and prints how far off widths and
    /// colours are, which do not come back within a few per cent yet.
    #[allow(clippy::print_stdout)] // figures for the log
    fn comes_back(&self, spp: &str) {
        let folder = folder(&format!("photographs-{}", self.weave));
        let draft = Draft::named(self.weave).unwrap();
        let pixels = UVec2::new(draft.ends() as u32, draft.picks() as u32);
        let pixels = pixels * self.repeats() as u32;
        let pixels = pixels * UVec2::from(self.pixels);
        let width_mm = photograph(&folder, &self.text(), pixels, self.seed);
        std::fs::write(folder.join("yarns.toml"), START).unwrap();
        let width = width_mm.to_string();
        let printed = succeed(
            &folder,
            &[
                "fit",
                "yarns.toml",
                "--what",
                "cloth",
                "--front",
                "front.exr",
                "--back",
                "back.exr",
                "--light",
                "30,45",
                "--back-light",
                "150,45",
                "--width-mm",
                &width,
                "--white",
                "0.8",
                "--spp",
                spp,
                "--seed",
                "7",
                "-o",
                "fitted.toml",
                "--json",
                "--quiet",
            ],
        );
        let answer: Value = serde_json::from_str(&printed).unwrap();
        let case = format!("{}, seed {}: {printed}", self.weave, self.seed);
        let mut loader = Loader::new();
        loader.give("truth.toml", self.text());
        let truth = fabric_file::load(Path::new("truth.toml"), &[], &loader).unwrap();
        let figures = truth.cloth.figures();
        let widths = [figures.warp, figures.weft].map(|f| f.unwrap().width_mm);
        let number = |v: &Value| v.as_f64().unwrap();
        let fitted = fabric_file::load(&folder.join("fitted.toml"), &[], &Loader::new()).unwrap();
        let found = fitted.cloth.draft().unwrap();
        assert!(is_same_weave(&draft, found), "{case}");
        let off = |found: f64, truth: f64| found / truth - 1.0;
        for k in 0..2 {
            let spacing = number(&answer["spacing_mm"][k]);
            assert!(off(spacing, 10.0 / self.per_cm[k]).abs() < 0.02, "{case}");
            let width = off(number(&answer["widths_mm"][k]), widths[k]);
            let colours: [f64; 3] = std::array::from_fn(|c| {
                let found = number(&answer["parameters"][2 + 3 * k + c]["value"]);
                off(found, self.colours[k][c])
            });
            println!(
                "{}: width off by {width:.3}, colours by {colours:.3?}",
                self.weave
            );
        }
    }
}

/// Spacing within 2 % and the draft, one yarn for each system.
#[test]
fn planted_cloth_comes_back() {
    PLAIN.comes_back("4");
    if is_full() {
        MORE.iter().for_each(|p| p.comes_back("16"));
    }
}

/// The twins: cloth that is not woven, and noise.
#[test]
fn knits_and_noise_are_refused() {
    let folder = folder("photographs-refused");
    let knit = "[draft]\nknit = \"stockinette\"\nwales_per_cm = 14.0\n[weft]\nyarn = \"y\"\n\
        per_cm = 18.0\n[yarn.y]\npreset = \"cotton\"\nfibre_radius_um = 12.0\ntex = 20.0\n\
        [tile]\nrepeats = [2, 2]\n";
    let width = photograph(&folder, knit, UVec2::new(48, 40), 5).to_string();
    let fit = |front: &str, more: &[&str]| {
        let words = [
            "fit",
            "--what",
            "cloth",
            "--front",
            front,
            "--width-mm",
            &width,
            "--light",
            "30,45",
            "--white",
            "0.8",
            "--spp",
            "4",
            "-o",
            "fitted.toml",
            "--quiet",
        ];
        complaint(&folder, &[&words[..], more].concat())
    };
    let why = fit("front.exr", &[]);
    assert!(why.contains("front.exr: no weave found"), "{why}");
    let grey: Vec<[f32; 3]> = (0..128 * 128)
        .map(|i| [0.3 + 0.2 * uniform(6, i); 3])
        .collect();
    write(&folder.join("grey.exr"), [128, 128], &grey);
    let why = fit("grey.exr", &[]);
    assert!(why.contains("grey.exr: no weave found"), "{why}");
    // What does not apply is named.
    for (flag, value) in [
        ("--blur-px", "1"),
        ("--data", "front.exr"),
        ("--back-light", "150,0"),
    ] {
        let why = fit("grey.exr", &[flag, value]);
        assert!(why.contains(flag), "{why}");
    }
    let why = complaint(
        &folder,
        &["fit", "--what", "fibres", "--data", "a.csv", "-o", "f.toml"],
    );
    assert!(why.contains("<FABRIC>"), "{why}");
    let why = complaint(
        &folder,
        &["fit", "a.toml", "--front", "grey.exr", "-o", "f.toml"],
    );
    assert!(
        why.contains("--front: applies only to --what cloth"),
        "{why}"
    );
    assert!(!folder.join("fitted.toml").exists());
}
