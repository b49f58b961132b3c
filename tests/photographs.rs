//! Cloth that is fitted to photographs: planted answers come back, other pictures are refused.
//!
//! The photographs are organza's own pictures of a cloth that the fit does not know, blurred and
//! with noise. `cargo test --release --test main photographs:: -- --ignored` fits every kind of weave,
//! also of fine threads and from nearby.

use crate::planted_photographs::{Camera, DISTANT, uniform, write};
use crate::program::{complaint, folder, succeed};
use organza_photograph::is_same_weave;
use organza_scene::fabric_file;
use organza_scene::loader::Loader;
use organza_testing::{assert_contains, sized};
use organza_weave::Draft;
use serde_json::Value;

/// Threads of a photograph along a side, about. The errors of counts and colours fall with their
/// number: single threads differ.
const THREADS: usize = 40;

/// The same where threads have few pixels.
const FINE_THREADS: usize = 60;

/// A cloth and its picture.
#[derive(Clone, Copy)]
struct Planted {
    weave: &'static str,
    per_cm: [f64; 2],
    tex: [f64; 2],
    colours: [[f64; 3]; 2],
    /// Pixels from end to end.
    pixels: usize,
    seed: u64,
    camera: Camera,
    /// Flags of the fit besides the usual ones.
    flags: &'static str,
}

const PLAIN: Planted = Planted {
    weave: "plain",
    per_cm: [22.0, 19.0],
    tex: [22.0, 34.0],
    colours: [[0.55, 0.30, 0.20], [0.25, 0.40, 0.60]],
    pixels: 11,
    seed: 101,
    camera: DISTANT,
    flags: "",
};

/// One seen and lit from nearby through a lens that darkens its corners, one of unknown exposure and
/// lamps, other weaves, and one that is turned.
const MORE: [Planted; 6] = [
    Planted {
        seed: 106,
        camera: Camera {
            near_mm: Some(60.0),
            corners: 0.7,
            ..DISTANT
        },
        flags: "--camera-mm 60 --light-mm 60 --back-light-mm 60 --vignetting fit",
        ..PLAIN
    },
    Planted {
        seed: 107,
        flags: "--fit-white --fit-light",
        ..PLAIN
    },
    Planted {
        weave: "twill-2-2-z",
        per_cm: [26.0, 22.0],
        tex: [24.0, 28.0],
        colours: [[0.30, 0.35, 0.50], [0.62, 0.55, 0.40]],
        seed: 102,
        ..PLAIN
    },
    Planted {
        weave: "twill-3-1-s",
        per_cm: [30.0, 20.0],
        tex: [22.0, 30.0],
        colours: [[0.40, 0.40, 0.40], [0.60, 0.20, 0.20]],
        seed: 103,
        camera: Camera {
            turn_deg: 4.0,
            ..DISTANT
        },
        ..PLAIN
    },
    Planted {
        weave: "satin-5-3",
        per_cm: [40.0, 22.0],
        tex: [14.0, 24.0],
        colours: [[0.60, 0.15, 0.12], [0.50, 0.45, 0.30]],
        seed: 104,
        ..PLAIN
    },
    Planted {
        weave: "basket-2-2",
        per_cm: [18.0, 16.0],
        tex: [30.0, 30.0],
        colours: [[0.50, 0.45, 0.30], [0.20, 0.30, 0.50]],
        seed: 105,
        ..PLAIN
    },
];

/// The fabric from which fits begin: its fibres, but another weave and other yarns.
const START: &str = "[draft]\nweave = \"plain\"\n[warp]\nper_cm = 10.0\n[weft]\nper_cm = 10.0\n\
    [yarn.y]\npreset = \"cotton\"\nfibre_radius_um = 12.0\ntex = 10.0\n";

/// Found values with their standard errors.
struct Answer(Value);

impl Answer {
    fn parameter(&self, name: &str) -> [f64; 2] {
        let all = self.0["parameters"].as_array().unwrap();
        let one = all.iter().find(|p| p["name"] == name).unwrap();
        [&one["value"], &one["se"]].map(|v| v.as_f64().unwrap())
    }

    fn list(&self, name: &str) -> [f64; 2] {
        [0, 1].map(|k| self.0[name][k].as_f64().unwrap())
    }
}

impl Planted {
    /// Repeats of the weave in the tile, so that no thread is seen twice.
    fn repeats(&self) -> [usize; 2] {
        let draft = Draft::named(self.weave).unwrap();
        let count = if self.pixels < 5 {
            FINE_THREADS
        } else {
            THREADS
        };
        [draft.ends(), draft.picks()].map(|n| count.div_ceil(n))
    }

    fn text(&self) -> String {
        let [a, b] = self.tex;
        let fibres = "preset = \"cotton\"\nfibre_radius_um = 12.0";
        format!(
            "seed = {}\n[draft]\nweave = \"{}\"\n\
             [warp]\nyarn = \"a\"\nper_cm = {}\ncolours = [{:?}]\n\
             [weft]\nyarn = \"b\"\nper_cm = {}\ncolours = [{:?}]\n\
             [yarn.a]\n{fibres}\ntex = {a}\n[yarn.b]\n{fibres}\ntex = {b}\n\
             [tile]\nrepeats = {:?}\n",
            self.seed,
            self.weave,
            self.per_cm[0],
            self.colours[0],
            self.per_cm[1],
            self.colours[1],
            self.repeats(),
        )
    }

    /// Fits photographs of it.
    fn fit(&self, spp: &str) -> Answer {
        let folder = folder(&format!("photographs-{}-{}", self.weave, self.seed));
        let draft = Draft::named(self.weave).unwrap();
        let ends = self.repeats()[0] * draft.ends();
        let picks = self.repeats()[1] * draft.picks();
        let size_mm =
            [ends as f64 / self.per_cm[0], picks as f64 / self.per_cm[1]].map(|v| 10.0 * v);
        let width = ends * self.pixels;
        let height = (width as f64 * size_mm[1] / size_mm[0]).round() as usize;
        std::fs::write(folder.join("truth.toml"), self.text()).unwrap();
        std::fs::write(folder.join("yarns.toml"), START).unwrap();
        self.camera
            .photograph(&folder, 2, size_mm, [width, height], self.seed);
        let [light, back_light] = self.camera.lights.map(|[t, p]| format!("{t},{p}"));
        let width_mm = size_mm[0].to_string();
        let words = format!(
            "fit cloth yarns.toml --front front.exr --back back.exr --light {light} \
             --back-light {back_light} --width-mm {width_mm} --white 0.8 --spp {spp} --seed 7 \
             -o fitted.toml --json --quiet {}",
            self.flags
        );
        let printed = succeed(&folder, &words);
        let answer = Answer(serde_json::from_str(&printed).unwrap());
        let fitted = fabric_file::load(&folder.join("fitted.toml"), &[], &Loader::new()).unwrap();
        let found = fitted.cloth.draft().unwrap();
        assert!(
            is_same_weave(&draft, found),
            "{}, seed {}",
            self.weave,
            self.seed
        );
        for (k, spacing) in answer.list("spacing_mm").into_iter().enumerate() {
            let error = spacing * self.per_cm[k] / 10.0 - 1.0;
            // Margin: one bound for all cloths.
            assert!(
                error.abs() < 0.02,
                "{}, seed {}: {error}",
                self.weave,
                self.seed
            );
        }
        answer
    }

    /// Widths as shares of the true ones, then colours, with standard errors.
    fn shares(&self, answer: &Answer) -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
        let share = |[value, se]: [f64; 2], truth: f64| [value / truth - 1.0, se / truth];
        let systems = ["warp", "weft"];
        let widths = systems.into_iter().enumerate().map(|(k, system)| {
            // Threads are as wide as the root of their count; the printed widths are those of a tile,
            // whose threads differ.
            let [tex, se] = share(answer.parameter(&format!("yarn.{system}.tex")), self.tex[k]);
            [(1.0 + tex).sqrt() - 1.0, 0.5 * se]
        });
        let mut colours = Vec::new();
        for (k, system) in systems.into_iter().enumerate() {
            for (c, letter) in ["r", "g", "b"].into_iter().enumerate() {
                let found = answer.parameter(&format!("{system}.colour.{letter}"));
                colours.push(share(found, self.colours[k][c]));
            }
        }
        (widths.collect(), colours)
    }

    /// Fits photographs of it and compares: everything within four standard errors.
    #[allow(clippy::print_stdout)] // figures for the log
    fn comes_back(&self, spp: &str) -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
        let answer = self.fit(spp);
        for colours in answer.0["thread_colours"].as_array().unwrap() {
            assert_eq!(colours.as_array().unwrap().len(), 1, "seed {}", self.seed);
        }
        let (widths, colours) = self.shares(&answer);
        println!(
            "{}, seed {}: widths off by {widths:.4?}, colours by {colours:.4?}",
            self.weave, self.seed
        );
        for [error, se] in widths.iter().chain(&colours) {
            let case = format!("{}, seed {}: {}", self.weave, self.seed, answer.0);
            assert!(error.abs() < 4.0 * se, "{error} +- {se}: {case}");
        }
        (widths, colours)
    }
}

/// Spacing within 2 %, the draft, widths and colours within four standard errors, widths within 5 %, and
/// the plain cloth's colours within 3 %. The twin: cloth a tenth wider, and of colours a quarter brighter, is
/// distinguished.
#[test]
#[ignore = "takes minutes: .ci/full runs it"]
fn planted_cloth_comes_back() {
    let (widths, colours) = PLAIN.comes_back("60");
    let (wider, brighter) = (0.1, 0.25);
    let is_distinguished = |[error, se]: &[f64; 2], change: f64| (error - change).abs() > 4.0 * se;
    assert!(
        widths.iter().all(|w| is_distinguished(w, wider)),
        "{widths:?}"
    );
    assert!(
        colours.iter().all(|c| is_distinguished(c, brighter)),
        "{colours:?}"
    );
    assert!(widths.iter().all(|w| w[0].abs() < 0.05), "{widths:?}");
    assert!(colours.iter().all(|c| c[0].abs() < 0.03), "{colours:?}");
    for planted in MORE {
        let (widths, _) = planted.comes_back("60");
        let case = format!("{}, seed {}: {widths:?}", planted.weave, planted.seed);
        assert!(widths.iter().all(|w| w[0].abs() < 0.05), "{case}");
    }
}

/// Threads of three pixels are found by the waves of their weave: `Planted::fit` compares draft and
/// spacing. The mean of the picture is that of the photograph; colours follow from guessed widths, so their
/// bound is wide (by choice).
#[test]
#[ignore = "takes minutes: .ci/full runs it"]
fn fine_threads_are_recognised() {
    let fine = Planted {
        weave: "twill-3-1-z",
        per_cm: [30.0, 24.0],
        tex: [22.0, 24.0],
        colours: [[0.45, 0.30, 0.20]; 2],
        pixels: 3,
        seed: 108,
        ..PLAIN
    };
    let answer = fine.fit("16");
    let mean = |of: &str| answer.0["sides"][0]["mean"][of][1].as_f64().unwrap();
    let case = format!("seed {}: {}", fine.seed, answer.0);
    let off = mean("picture") / mean("photograph") - 1.0;
    assert!(off.abs() < 0.05, "{off}: {case}");
    let found = answer.parameter("warp.colour.r")[0];
    assert!((found / fine.colours[0][0] - 1.0).abs() < 0.25, "{case}");
}

/// Houndstooth: the colours of single threads come back in step with the draft, so that the cloth has the
/// same pattern, wherever it begins. The twin: a colour of one thread is exchanged.
#[test]
#[ignore = "takes half a minute: .ci/full runs it"]
fn stripes_come_back_in_step_with_the_draft() {
    let folder = folder("photographs-striped");
    let run = [[0.05, 0.05, 0.07], [0.7, 0.68, 0.62]]
        .map(|colour| vec![colour; 4])
        .concat();
    let threads = |per_cm: f64| format!("yarn = \"y\"\nper_cm = {per_cm}\ncolours = {run:?}\n");
    let truth = format!(
        "seed = 109\n[draft]\nweave = \"twill-2-2-z\"\n[warp]\n{}[weft]\n{}[yarn.y]\npreset = \"cotton\"\n\
         fibre_radius_um = 12.0\ntex = 26.0\n[tile]\nrepeats = [6, 6]\n",
        threads(24.0),
        threads(22.0)
    );
    std::fs::write(folder.join("truth.toml"), truth).unwrap();
    let size_mm = [10.0, 240.0 / 22.0];
    DISTANT.photograph(&folder, 1, size_mm, [240, 262], 109);
    let light = DISTANT.lights.map(|[t, p]| format!("{t},{p}"))[0].clone();
    let words = "fit cloth --quick --front front.exr --width-mm 10 --white 0.8 --json --quiet \
        -o fitted.toml --light";
    let words: Vec<&str> = words.split(' ').chain([&*light]).collect();
    let answer: Value = serde_json::from_str(&succeed(&folder, &words)).unwrap();
    let case = format!("seed 109: {answer}");
    assert_eq!(answer["draft"], "twill-2-2-z", "{case}");
    let draft = Draft::named("twill-2-2-z").unwrap();
    let found = [0, 1].map(|k| -> Vec<bool> {
        let list = answer["thread_colours"][k].as_array().unwrap().iter();
        list.map(|c| c[1].as_f64().unwrap() < 0.3).collect()
    });
    let planted: [Vec<bool>; 2] = [0, 1].map(|_| run.iter().map(|c| c[1] < 0.3).collect());
    let is_dark = |threads: &[Vec<bool>; 2], at: [usize; 2]| {
        let k = usize::from(!draft.warp_up(at[0] % 4, at[1] % 4));
        threads[k][at[k] % threads[k].len()]
    };
    let same = |a: &[Vec<bool>; 2], b: &[Vec<bool>; 2]| {
        let all = || (0..8).flat_map(|e| (0..8).map(move |p| [e, p]));
        all().any(|by| all().all(|at| is_dark(a, at) == is_dark(b, [at[0] + by[0], at[1] + by[1]])))
    };
    assert!(same(&planted, &found), "{case}");
    let mut bad = found;
    bad[0][0] = !bad[0][0];
    assert!(!same(&planted, &bad), "{case}");
}

/// The twins: cloth that is not woven, and noise.
#[test]
fn knits_and_noise_are_refused() {
    let folder = folder("photographs-refused");
    let knit = "[draft]\nknit = \"stockinette\"\nwales_per_cm = 14.0\n[weft]\nyarn = \"y\"\n\
        per_cm = 18.0\n[yarn.y]\npreset = \"cotton\"\nfibre_radius_um = 12.0\ntex = 20.0\n\
        [tile]\nrepeats = [2, 2]\n";
    std::fs::write(folder.join("truth.toml"), knit).unwrap();
    let [wales, courses] = sized([6.0, 7.0], [10.0, 12.0]);
    let size_mm = [10.0 * wales / 14.0, 10.0 * courses / 18.0];
    let pixels = sized([144, 132], [240, 224]);
    DISTANT.photograph(&folder, 1, size_mm, pixels, 5);
    let width = size_mm[0].to_string();
    let fit = |front: &str, more: &str| {
        let words = format!(
            "fit cloth --front {front} --width-mm {width} --light 30,45 --white 0.8 --spp 4 \
             -o fitted.toml --quiet {more}"
        );
        complaint(&folder, &words)
    };
    let why = fit("front.exr", "");
    assert_contains(&why, "front.exr: no weave found");
    let grey: Vec<[f32; 3]> = (0..64 * 64)
        .map(|i| [0.3 + 0.2 * uniform(6, i); 3])
        .collect();
    write(&folder.join("grey.exr"), [64, 64], &grey);
    let why = fit("grey.exr", "");
    assert_contains(&why, "grey.exr: no weave found");
    // What does not apply is named.
    for (flag, value) in [
        ("--blur-px", "1"),
        ("--data", "front.exr"),
        ("--back-light", "150,0"),
    ] {
        let why = fit("grey.exr", &format!("{flag} {value}"));
        assert_contains(&why, flag);
    }
    let why = fit("grey.exr", "--crop 0,0,200,100");
    assert_contains(
        &why,
        "--crop: 0,0,200,100 is no part of grey.exr, which has 64 x 64 pixels",
    );
    let said = complaint(&folder, "fit fibres --data a.csv -o f.toml");
    assert_contains(&said, "<FABRIC>");
    let why = complaint(&folder, "fit surface a.toml --front grey.exr -o f.toml");
    assert_contains(
        &why,
        "--front: does not apply to the fit of a surface, but of: plies, cloth",
    );
    assert!(!folder.join("fitted.toml").exists());
}
