//! Cloth that is not plainly woven, through voxels, measurements and curves: pile with print and
//! finish, nonwovens, nets.

use crate::program::{argv, complaint, exr_channels, folder, succeed};
use organza_testing::assert_contains;
use std::path::{Path, PathBuf};

fn fabric(name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/fabrics");
    let path: PathBuf = root.join(name).with_extension("toml");
    path.to_str().unwrap().to_owned()
}

/// A small tile of a fabric, as an argument of `--set`.
fn small(name: &str) -> &'static str {
    if name.starts_with("nonwoven") {
        "nonwoven.tile_mm=[0.8, 0.8]"
    } else {
        "tile.repeats=[1, 1]"
    }
}

#[test]
fn printed_and_finished_pile_is_voxelized() {
    let folder = folder("pile-voxels");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::copy(
        root.join("scenes/first_light.png"),
        folder.join("image.png"),
    )
    .unwrap();
    let image = folder.join("image.png");
    let print = format!("print.image={:?}", image.to_str().unwrap());
    for name in ["velvet", "terry", "corduroy"] {
        let path = fabric(&format!("pile/{name}"));
        let volume = format!("{name}.ovox");
        let brushed = "yarn.ground.finish=\"brushed\"";
        let set = format!("--set {brushed} --set tile.repeats=[1,1] --set");
        let rest = format!("-o {volume} --voxel-um 40 --quiet {set}");
        let voxelize = [&["voxelize", &path][..], &argv(&rest), &[&print]].concat();
        succeed(&folder, &voxelize);
        let listed = succeed(&folder, &["info", &volume, "--json"]);
        let listed: serde_json::Value = serde_json::from_str(&listed).unwrap();
        let height = |end: &str| listed["box"][end][2].as_f64().unwrap();
        // The pile stands above the ground.
        assert!(height("max_mm") > 1.2, "{name}: {listed}");
    }
}

#[test]
fn nonwovens_and_nets_become_curves_and_are_refused_as_surfaces() {
    let folder = folder("other-curves");
    std::fs::write(folder.join("one.csv"), "theta_i,phi_i\n10,0\n").unwrap();
    for name in [
        "nonwoven/wool_felt",
        "nonwoven/needle_felt",
        "nonwoven/spunbond",
        "lace/tulle",
        "lace/leno",
    ] {
        let path = fabric(name);
        let obj = ["weave", &path, "--set", small(name), "--level", "fibre"];
        succeed(&folder, &[&obj[..], &["-o", "curves.obj"]].concat());
        let text = std::fs::read_to_string(folder.join("curves.obj")).unwrap();
        assert!(text.lines().filter(|l| l.starts_with("l ")).count() > 50);
        let measure = ["measure", &path, "--set", small(name)];
        let surface = argv("--albedo --pairs one.csv --model surface -o out.csv");
        let words = complaint(&folder, &[&measure[..], &surface].concat());
        assert_contains(&words, "has no [surface] section");
        assert!(!folder.join("out.csv").exists());
    }
    let woven = "[draft]\nweave = \"plain\"\n[nonwoven]\nfibre = \"wool\"\n\
                 areal_density_g_per_m2 = 50.0\nthickness_mm = 0.5\nlength_mm = 20.0\n\
                 tile_mm = [2.0, 2.0]\n";
    std::fs::write(folder.join("both.toml"), woven).unwrap();
    let words = complaint(&folder, "info both.toml");
    assert_contains(&words, "both.toml: draft: a nonwoven has no threads");
    let wrong = woven
        .replace("[draft]\nweave = \"plain\"\n", "")
        .replace("fibre", "fiber");
    std::fs::write(folder.join("wrong.toml"), wrong).unwrap();
    let words = complaint(&folder, "info wrong.toml");
    assert!(
        words.contains("fiber") && words.contains("fibre"),
        "{words}"
    );
}

/// Reflected and transmitted shares of red light with their standard errors, at 10 degrees.
fn shares(folder: &Path, name: &str, model: &[&str]) -> [(f64, f64); 2] {
    let path = fabric(name);
    let measure = ["measure", &path, "--set", small(name)];
    let rest = argv("--albedo --pairs one.csv --spp 400 --quiet -o out.csv --model");
    succeed(folder, &[&measure[..], &rest, model].concat());
    let text = std::fs::read_to_string(folder.join("out.csv")).unwrap();
    let [keys, row] = [0, 1].map(|i| text.lines().nth(i).unwrap().split(',').collect::<Vec<_>>());
    let value = |key: &str| {
        let column = keys.iter().position(|k| *k == key).unwrap();
        row[column].parse::<f64>().unwrap()
    };
    ["reflected_r", "transmitted_r"].map(|key| (value(key), value(&format!("se_{key}"))))
}

/// Packed fibres stand for the explicit ones. The twin, micro-flakes of the clear filaments of
/// the spunbond, reflects far more.
#[test]
fn packed_fibres_reflect_and_transmit_as_explicit_ones() {
    let folder = folder("other-shares");
    std::fs::write(folder.join("one.csv"), "theta_i,phi_i\n10,0\n").unwrap();
    let in_voxels = |model: &'static str| [model, "--voxel-um", "30"];
    let off = |a: [(f64, f64); 2], b: [(f64, f64); 2]| {
        let pairs = a.into_iter().zip(b);
        let errors = pairs.map(|(a, b)| (a.0 - b.0).abs() / a.1.hypot(b.1));
        errors.fold(0.0, f64::max)
    };
    for name in ["nonwoven/spunbond", "lace/leno"] {
        let explicit = shares(&folder, name, &["fibres"]);
        let packed = shares(&folder, name, &in_voxels("packed"));
        let errors = off(explicit, packed);
        assert!(errors < 4.0, "seed 0, {name}: {explicit:?}, {packed:?}");
        if name == "nonwoven/spunbond" {
            let flakes = shares(&folder, name, &in_voxels("microflake"));
            assert!(off(explicit, flakes) > 4.0, "{explicit:?}, {flakes:?}");
        }
    }
}

/// Under an even sky, seen from above: light from the grooves of the corduroy over that from the
/// middles of its ridges, one value a ridge.
fn groove_over_ridge(folder: &Path, set: &[&str]) -> Vec<f64> {
    let scene = format!(
        "[render]\nspp = 16\nseed = 3\n[camera]\norigin_mm = [0.0, 0.0, 20.0]\n\
         target_mm = [0.0, 0.0, 0.0]\nup = [0.0, 1.0, 0.0]\nwidth_mm = {WIDTH_MM}\n\
         resolution = [64, 16]\n[[light]]\nkind = \"environment\"\nradiance = [1.0, 1.0, 1.0]\n\
         hemisphere = \"front\"\n[[object]]\nkind = \"cloth\"\nfabric = {:?}\nmodel = \"fibres\"\n",
        folder.join("corduroy.toml").to_str().unwrap()
    );
    let mut text = std::fs::read_to_string(fabric("pile/corduroy")).unwrap();
    // The camera sees no more of the ridges.
    for line in set.iter().chain(&["repeats = [12, 3]"]) {
        let (key, _) = line.split_once(" = ").unwrap();
        let old = text.lines().find(|l| l.starts_with(key)).unwrap();
        text = text.replace(old, line);
    }
    std::fs::write(folder.join("corduroy.toml"), text).unwrap();
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    succeed(folder, "render scene.toml -o top.exr --quiet");
    let channels = exr_channels(&folder.join("top.exr"));
    let (red, width) = (&channels["R"], 64);
    // Ridges of 16 pixels; the grooves lie where two of them meet.
    let light = |ridge: usize, columns: std::ops::Range<usize>| {
        let count = columns.len() as f64;
        let column = |c: usize| (0..16).map(move |row| row * width + (ridge * 16 + c) % width);
        let pixels = columns.flat_map(column);
        pixels.map(|p| f64::from(red[p])).sum::<f64>() / count
    };
    let ratio = |ridge| light(ridge, 14..18) / light(ridge, 6..10);
    (0..4).map(ratio).collect()
}

/// Four ridges: the tile's width.
const WIDTH_MM: f64 = 9.230_769;

/// The grooves of corduroy are darker than its ridges. The twin has smooth, upright fibres, which
/// show their ends, so that its ridges are darker.
#[test]
fn grooves_of_corduroy_are_dark() {
    let folder = folder("corduroy");
    let mean = |set: &[&str]| {
        let all = groove_over_ridge(&folder, set);
        let mean = all.iter().sum::<f64>() / 4.0;
        let square: f64 = all.iter().map(|r| (r - mean).powi(2)).sum();
        (mean, (square / 12.0).sqrt())
    };
    let (shipped, se) = mean(&[]);
    let (upright, upright_se) = mean(&["wave = 0.0", "lean_deviation_deg = 4.0"]);
    // Of four values: three standard errors are exceeded by chance once in 35 times.
    assert!(shipped + 3.0 * se < 1.0, "seed 3: {shipped} +- {se}");
    assert!(
        upright - 3.0 * upright_se > 1.0,
        "seed 3: {upright} +- {upright_se}"
    );
}
