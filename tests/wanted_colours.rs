//! Colours of fibres found so that the cloth reflects a wanted colour.

use crate::program::{argv, complaint, files_left, folder, succeed};
use std::path::Path;

/// A plain weave of two yarns.
const CLOTH: &str = "[draft]\nweave = \"plain\"\n[warp]\nyarn = \"a\"\nper_cm = 30.0\n\
    colours = [[0.6, 0.4, 0.2]]\n[weft]\nyarn = \"b\"\nper_cm = 28.0\n\
    colours = [[0.3, 0.4, 0.4]]\n[yarn.a]\npreset = \"cotton\"\ntex = 20.0\n\
    [yarn.b]\npreset = \"cotton\"\ntex = 20.0\n";

const WANTED: [f64; 3] = [0.3, 0.12, 0.05];

/// Share of light reflected from 8 degrees off the normal, with its standard error, measured with
/// a seed that no fit uses.
fn reflected(folder: &Path, fabric: &str) -> [[f64; 2]; 3] {
    let seed = "--seed 91 --spp 4096 --model fibres --albedo --pairs beams.csv --quiet -o seen.csv";
    succeed(folder, &[&["measure", fabric], &argv(seed)[..]].concat());
    let text = std::fs::read_to_string(folder.join("seen.csv")).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    let count = rows.len() as f64;
    std::array::from_fn(|c| {
        let mean = rows.iter().map(|row| row[2 + c]).sum::<f64>() / count;
        let squares: f64 = rows.iter().map(|row| row[5 + c].powi(2)).sum();
        [mean, squares.sqrt() / count]
    })
}

#[test]
fn the_cloth_reflects_the_wanted_colour_when_measured_anew() {
    let folder = folder("wanted-colours");
    std::fs::write(folder.join("cloth.toml"), CLOTH).unwrap();
    let beams = "theta_i,phi_i\n8,0\n8,90\n8,180\n8,270\n";
    std::fs::write(folder.join("beams.csv"), beams).unwrap();
    let fit = "fit colour cloth.toml --colour 0.3,0.12,0.05 --spp 4096 --json -o dyed.toml";
    let printed = succeed(&folder, &argv(fit));
    assert!(printed.contains("Met: the cloth reflects"), "{printed}");
    // Two measurements of as many paths: that of the search and this one.
    let misses = |seen: [[f64; 2]; 3]| {
        let each = seen.into_iter().zip(WANTED);
        each.map(|([mean, se], wanted)| (mean - wanted).abs() / (2f64.sqrt() * se).hypot(0.0005))
            .fold(0.0, f64::max)
    };
    let seen = reflected(&folder, "dyed.toml");
    assert!(misses(seen) < 4.5, "seed 91: {seen:?}");
    // The twin: fibres of the wanted colour do not make a cloth of this colour.
    let twin = CLOTH
        .replace("[0.6, 0.4, 0.2]", "[0.3, 0.12, 0.05]")
        .replace("[0.3, 0.4, 0.4]", "[0.3, 0.12, 0.05]");
    std::fs::write(folder.join("twin.toml"), twin).unwrap();
    let seen = reflected(&folder, "twin.toml");
    assert!(misses(seen) > 4.5, "seed 91: {seen:?}");
    // Yarns keep their proportions: green is as bright in both, red half as bright in b.
    let dyed: toml::Table = std::fs::read_to_string(folder.join("dyed.toml"))
        .unwrap()
        .parse()
        .unwrap();
    let colour = |yarn: &str, c: usize| dyed["optics"][yarn]["colour"][c].as_float().unwrap();
    assert!((colour("b", 0) / colour("a", 0) - 0.5).abs() < 1e-6);
    assert!((colour("b", 1) / colour("a", 1) - 1.0).abs() < 1e-6);
}

#[test]
fn colours_out_of_reach_and_unknown_yarns_are_refused() {
    let folder = folder("wanted-colours-refused");
    std::fs::write(folder.join("cloth.toml"), CLOTH).unwrap();
    for (flags, words) in [
        ("--colour white", "--colour: cannot be reached: red 0."),
        ("--colour 1.5,0,0", "expected shares of light from 0 to 1"),
        ("", "--colour: expected the colour of the cloth"),
        (
            "--colour red --yarn aa",
            "--yarn: the cloth has no yarn \"aa\"; did you mean",
        ),
    ] {
        let fit = format!("fit colour cloth.toml --spp 256 --quiet -o dyed.toml {flags}");
        let why = complaint(&folder, &argv(&fit));
        assert!(why.contains(words), "{flags}: {why}");
    }
    assert_eq!(files_left(&folder), ["cloth.toml"]);
}
