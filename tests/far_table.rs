//! `organza table` and `model = "table"`: a cloth with a known BSDF is found again, whatever the
//! threads and interruptions, and what cannot be shown is refused.

use crate::fabrics::{SHEET, cotton};
use crate::in_process::{build, mistake, picture};
use crate::program::{bytes, complaint, folder, succeed};
use organza_scene::loader::Loader;
use organza_testing::{assert_contains, csv_numbers};
use organza_transport::{EngineChoice, Film, Integrator, RenderSettings, Rendering, engine};
use std::ops::ControlFlow;
use std::path::Path;

/// Nodes of the tables that the program makes.
const NODES: usize = 738;

fn sheet(folder: &Path) {
    let yarn = "tex = 30.0\nfibres_per_ply = 40\nfibre_radius_um = 8.0";
    std::fs::write(
        folder.join("cloth.toml"),
        cotton("plain", yarn, 40.0) + SHEET,
    )
    .unwrap();
}

fn make(folder: &Path, out: &str, more: &str) -> String {
    let spp = if more.contains("--spp") {
        ""
    } else {
        "--spp 512"
    };
    let table = "table cloth.toml --model surface --held-out 32 --held-out-spp 2";
    succeed(folder, &format!("{table} -o {out} {spp} {more}"))
}

#[test]
fn a_known_sheet_is_found_again() {
    let folder = folder("far_table");
    sheet(&folder);
    let printed = make(&folder, "cloth.bsdf", "--json");
    assert_contains(&printed, "\"nodes\": 738");
    let pairs =
        "theta_i,phi_i,theta_o,phi_o\n10,20,40,200\n60,0,150,70\n130,10,20,33\n80,5,75,185\n";
    std::fs::write(folder.join("pairs.csv"), pairs).unwrap();
    let measure = "measure cloth.toml --model table --pairs pairs.csv";
    succeed(&folder, &format!("{measure} -o out.csv"));
    let rows = csv_numbers(&String::from_utf8(bytes(&folder, "out.csv")).unwrap());
    let [reflected, transmitted] = [[0.4, 0.5, 0.1], [0.2, 0.3, 0.3]];
    for (row, truth) in rows
        .iter()
        .zip([reflected, transmitted, transmitted, reflected])
    {
        for (found, share) in row[4..7].iter().zip(truth) {
            let value = share * std::f64::consts::FRAC_1_PI;
            // 512 paths over 738 nodes, from both ends and over 16 pairs of nodes: about 22
            // paths a value, 0.21; the smallest share has a tenth of them in its hues.
            let off = (found / value - 1.0).abs();
            // Margin: five standard errors.
            assert!(off < 5.0 * 0.21, "{found} for {value}");
        }
    }
    // Shares have the noise of 512 paths from a few nodes.
    std::fs::write(
        folder.join("from.csv"),
        "theta_i,phi_i\n0,0\n50,40\n150,10\n",
    )
    .unwrap();
    let albedo = "measure cloth.toml --model table --albedo --pairs from.csv";
    let rest = "--spp 20000 -o albedo.json";
    succeed(&folder, &format!("{albedo} {rest}"));
    let text = String::from_utf8(bytes(&folder, "albedo.json")).unwrap();
    let found: serde_json::Value = serde_json::from_str(&text).unwrap();
    for row in found["albedo"].as_array().unwrap() {
        let mean = |key: &str| row[key]["mean"][1].as_f64().unwrap();
        let (scattered, direct) = (mean("reflected") + mean("transmitted"), mean("direct"));
        assert!((direct - 0.2).abs() < 0.07, "{row}");
        // Red is known to the noise of the table's own paths, which 20000 others do not lower.
        let red = |of: &str| row["absorbed"][of][0].as_f64().unwrap();
        let off = (red("mean") - 0.2).abs();
        assert!(off < 5.0 * red("se") && red("se") > 0.003, "{row}");
        assert!(red("se") < 0.1, "{row}");
        // Nothing is absorbed, whatever the noise of the shares.
        assert!((scattered + direct - 1.0).abs() < 0.02, "{row}");
        assert!(
            (mean("reflected") / scattered - 0.625).abs() < 0.08,
            "{row}"
        );
    }
    let open = |key: &str| found[key].as_f64().unwrap();
    assert!(open("se_openness") > 0.006, "{}", open("se_openness"));
    assert!((open("openness") - 0.2).abs() < 5.0 * open("se_openness"));
    let about = succeed(&folder, "info cloth.bsdf --json");
    let about: serde_json::Value = serde_json::from_str(&about).unwrap();
    assert_eq!(
        (&about["kind"], &about["nodes"]),
        (&"table".into(), &NODES.into())
    );
    assert_eq!(about["errors"][0]["kind"], "reflected");
    assert!(about["memory_bytes"].as_u64().unwrap() <= 1_000_000);
    assert!(bytes(&folder, "cloth.bsdf").len() <= 1_000_000);
}

#[test]
fn tables_do_not_depend_on_threads_or_interruptions() {
    let folder = folder("far_table_again");
    sheet(&folder);
    let spp = "--spp 64 --threads";
    make(&folder, "one.bsdf", &format!("{spp} 1"));
    let with_journal = format!("{spp} 3 --journal journal");
    make(&folder, "two.bsdf", &with_journal);
    // As if the machine had stopped in the middle.
    let journal = bytes(&folder, "journal");
    std::fs::write(folder.join("journal"), &journal[..journal.len() / 2]).unwrap();
    make(&folder, "three.bsdf", &with_journal);
    let one = bytes(&folder, "one.bsdf");
    assert!(one == bytes(&folder, "two.bsdf") && one == bytes(&folder, "three.bsdf"));
    make(&folder, "other.bsdf", "--spp 64 --seed 1");
    assert!(one != bytes(&folder, "other.bsdf"));
}

#[test]
fn scenes_show_tables_and_say_what_is_missing() {
    let folder = folder("far_table_scenes");
    sheet(&folder);
    let scene = |object: &str| {
        format!(
            r#"[render]
spp = 64
[camera]
kind = "orthographic"
origin_mm = [0.0, 0.0, 200.0]
target_mm = [0.0, 0.0, 0.0]
up = [0.0, 1.0, 0.0]
width_mm = 100.0
resolution = [8, 8]
[[light]]
kind = "environment"
radiance = [1.0, 1.0, 1.0]
[[object]]
kind = "cloth"
fabric = "cloth.toml"
{object}
"#
        )
    };
    let shown = scene("model = \"table\"");
    let missing = mistake(&folder, &shown);
    assert_contains(&missing, "organza table");
    make(&folder, "cloth.bsdf", "");
    let furnace = picture(&folder, &shown, &[]);
    assert!(furnace.warnings.is_empty(), "{:?}", furnace.warnings);
    // What is sent on and what passes: 0.8, 1 and 0.6 of the light; 4096 paths.
    let mean = furnace.film.mean().map(|channel| channel.0);
    assert!((mean[1] - 1.0).abs() < 0.01, "{mean:?}");
    assert!(
        (mean[0] - 0.8).abs() < 0.05 && (mean[2] - 0.6).abs() < 0.05,
        "{mean:?}"
    );
    // A far cloth is its table.
    let far = picture(&folder, &scene("lod = \"auto\""), &[]);
    assert!(far.warnings.is_empty(), "{:?}", far.warnings);
    // Another cloth is not.
    let changed = std::fs::read_to_string(folder.join("cloth.toml")).unwrap();
    let changed = changed.replace("tex = 30.0", "tex = 31.0");
    std::fs::write(folder.join("cloth.toml"), changed).unwrap();
    let stale = picture(&folder, &shown, &["render.spp=1".into()]);
    assert!(
        stale.warnings[0].contains("with other yarns"),
        "{:?}",
        stale.warnings
    );
}

/// Pixels of 0.7 repeats show fibres in some paths and the table in others: the kernel takes the
/// former, the walk the latter, and both together are a picture by the walk alone.
#[test]
fn fibres_become_their_table_with_distance() {
    const SEED: u64 = 3;
    let folder = folder("far_table_levels");
    sheet(&folder);
    make(&folder, "cloth.bsdf", "");
    let scene = |lod: &str| {
        format!(
            r#"[render]
seed = {SEED}
[camera]
kind = "orthographic"
origin_mm = [0.0, 20.0, 40.0]
target_mm = [0.0, 0.0, 0.0]
width_mm = 6.2
resolution = [8, 8]
[[light]]
kind = "directional"
direction = [0.3, 0.0, -1.0]
irradiance = [1.0, 1.0, 1.0]
[[object]]
kind = "cloth"
fabric = "cloth.toml"
model = "fibres"
lod = "{lod}"
"#
        )
    };
    let film = |lod: &str, by_kernel: bool, takes: &[u64]| {
        let (_, scene) = build(&folder, &scene(lod), &[], &Loader::new()).unwrap();
        let settings = RenderSettings {
            integrator: Integrator::Woodcock,
            samples: 0..takes.iter().sum(),
            max_bounces: u32::MAX,
            seed: SEED,
            crop: None,
        };
        let mut rendering = Rendering::new(&scene, settings.clone()).unwrap();
        if by_kernel {
            let engine = engine(&scene, &settings, EngineChoice::Processor, u64::MAX);
            rendering = rendering.with_engine(engine.unwrap());
        }
        for samples in takes {
            let watch = |_| ControlFlow::Continue(());
            rendering = rendering.take(*samples, &watch).unwrap();
        }
        rendering.into_parts().0
    };
    let kernel = film("auto", true, &[512]);
    let is_near = |other: &Film| {
        let mut both = kernel.mean().into_iter().zip(other.mean());
        both.all(|(a, b)| (a.0 - b.0).abs() < 4.0 * a.1.hypot(b.1))
    };
    let walk = film("auto", false, &[512]);
    let (a, b) = (kernel.mean(), walk.mean());
    assert!(is_near(&walk), "seed {SEED}: kernel {a:?}, walk {b:?}");
    // The same comparison tells fibres alone, of another colour than the table, from the blend.
    let fibres = film("volume", true, &[512]);
    assert!(
        !is_near(&fibres),
        "seed {SEED}: {a:?}, fibres {:?}",
        fibres.mean()
    );
    // Whole numbers, however the samples are parted.
    let parted = film("auto", true, &[5, 17, 490]);
    assert_eq!(parted.mean(), kernel.mean());
}

/// A table with texture has light and dark places where the fibres have them.
#[test]
fn threads_are_seen_in_a_table() {
    const SEED: u64 = 4;
    let folder = folder("far_table_texture");
    let yarn = "tex = 30.0\nfibres_per_ply = 20\nfibre_radius_um = 15.0";
    std::fs::write(folder.join("cloth.toml"), cotton("plain", yarn, 40.0)).unwrap();
    let scene = |model: &str| {
        format!(
            r#"[render]
seed = {SEED}
spp = 256
[camera]
kind = "orthographic"
origin_mm = [0.0, 30.0, 60.0]
target_mm = [0.0, 0.0, 0.0]
width_mm = 1.6
resolution = [10, 10]
[[light]]
kind = "directional"
direction = [0.5, 0.0, -1.0]
irradiance = [1.0, 1.0, 1.0]
[[object]]
kind = "cloth"
fabric = "cloth.toml"
model = "{model}"
"#
        )
    };
    let pixels = |model: &str| -> Vec<f64> {
        let film = picture(&folder, &scene(model), &[]).film;
        let green = film.pixels().iter().map(|p| f64::from(p.mean().0.y));
        green.collect()
    };
    let make = |texels: &str| {
        let table = "table cloth.toml -o cloth.bsdf --spp 64 --texel-spp 64 --held-out 0 --json";
        succeed(&folder, &format!("{table} --texels {texels}"))
    };
    let made = make(organza_testing::sized("64", "256"));
    assert_contains(&made, "\"texels\"");
    // What was not measured, without held-out pairs, is not taken for good.
    assert_contains(&made, "\"error_at_most\": null");
    let textured = pixels("table");
    assert!(!make("0").contains("\"texels\""));
    let plain = pixels("table");
    let fibres = pixels("fibres");
    let found = correlation(&textured, &fibres);
    // With so few paths, and nodes 20 degrees apart.
    assert!(found > 0.7, "seed {SEED}: {found}");
    // A table without texture has only its noise.
    let twin = correlation(&plain, &fibres);
    // Margin: a twin; the table itself is asked for more.
    assert!(twin < 0.4, "seed {SEED}: {twin}");
}

/// The correlation of two lists.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (at, bt) = (mean(a), mean(b));
    let both = |x: &[f64], xt: f64, y: &[f64], yt: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - xt) * (y - yt)).sum()
    };
    both(a, at, b, bt) / (both(a, at, a, at) * both(b, bt, b, bt)).sqrt()
}

#[test]
fn wrong_requests_are_refused() {
    let folder = folder("far_table_refused");
    sheet(&folder);
    let say = |more: &str| complaint(&folder, &format!("table cloth.toml {more}"));
    assert!(say("-o cloth.xml").contains("ends in .bsdf"));
    assert!(say("-o a.bsdf --model table").contains("from a table"));
    let few = say("-o a.bsdf --target-error 0.1 --held-out 0");
    assert_contains(&few, "--held-out");
    std::fs::write(folder.join("cloth.bsdf"), b"tensor_file\0").unwrap();
    let said = complaint(&folder, "info cloth.bsdf");
    assert_contains(&said, "is not a table of organza");
    assert!(!folder.join("a.bsdf").exists());
}
