//! `organza bench` and `model = "auto"`, tiny.

use crate::fabrics::few_fibres;
use crate::program::{complaint, folder, succeed};
use organza_testing::assert_contains;
use std::path::Path;

const VOXEL_UM: f32 = 160.0;

/// The command on a little cloth in large voxels, with few paths.
fn bench() -> String {
    let spp = organza_testing::sized("--spp 2 --truth-spp 4", "--spp 8 --truth-spp 16");
    format!(
        "bench plain.toml -o report --quick --resolution 4 {spp} \
         --set render.max_bounces=8 --set render.cache_learning=0.01"
    )
}

/// A cloth for which the program chooses.
const SCENE_OF_AUTO: &str = r#"
[camera]
origin_mm = [0.0, 0.0, 5.0]
target_mm = [0.0, 0.0, 0.0]
width_mm = 2.0
resolution = [6, 6]
[[light]]
kind = "directional"
direction = [0.3, 0.2, -0.9]
irradiance = [2.0, 2.0, 2.0]
[[object]]
kind = "cloth"
fabric = "plain.toml"
model = "auto"
tolerance = 0.3
"#;

fn json(folder: &Path, name: &str) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(folder.join(name)).unwrap()).unwrap()
}

#[test]
fn a_bench_judges_every_choice_and_goes_on_where_it_was() {
    let folder = folder("bench");
    std::fs::write(folder.join("plain.toml"), few_fibres(VOXEL_UM)).unwrap();
    let (widths, count) = organza_testing::sized(("--pixel-mm 0.1", 2), ("", 4));
    let bench = format!("{} {widths}", bench());
    let said = succeed(&folder, &bench);
    assert_contains(
        &said,
        "plain, pixels of 0.1 mm (34 cm away), lit from the front, within 2.0 %: ",
    );
    let report = folder.join("report");
    let first = json(&report, "report.json");
    let views = first["fabrics"][0]["views"].as_array().unwrap();
    assert_eq!(views.len(), count);
    for view in views {
        let results = view["results"].as_array().unwrap();
        let refused = view["refused"].as_array().unwrap();
        // Seven ways at the fabric's own voxels, three at level 1, explicit fibres in the
        // kernel without and with a cache, and the reference.
        assert_eq!(results.len() + refused.len(), 13, "{view}");
        assert_eq!(results.last().unwrap()["choice"]["tracker"], "cached");
        assert_eq!(results[0]["choice"]["model"], "fibres");
        assert_eq!(results[0]["rmse"]["value"], 0.0);
        assert!(results.iter().any(|r| r["on_front"] == true));
        for r in results {
            assert!(r["seconds_to_noise_1"].as_f64().unwrap() > 0.0, "{r}");
            assert!(r["memory_bytes"].as_u64().unwrap() > 1 << 20, "{r}");
        }
        assert_eq!(view["recommended"].as_array().unwrap().len(), 4);
    }
    let page = std::fs::read_to_string(report.join("report.html")).unwrap();
    assert!(
        page.contains("What to take") && !page.contains("http"),
        "stands alone"
    );
    let table = std::fs::read_to_string(report.join("choices.csv")).unwrap();
    let judged: usize = views
        .iter()
        .map(|v| v["results"].as_array().unwrap().len())
        .sum();
    assert_eq!(table.lines().count(), 1 + judged);
    // Again, with another program's picture of one view: nothing is rendered anew,
    // so that the figures are the same to the last bit.
    let (colour, noise) = ([[0.2, 0.2, 0.2]; 16], [[1e-6, 1e-6, 1e-6]; 16]);
    let peer = serde_json::json!({ "pictures": [{
        "program": "grey", "scene": "plain-0.1mm-front", "setup_s": 0.1, "render_s": 1.0,
        "mean": colour, "variance": noise,
    }]});
    std::fs::write(folder.join("peer.json"), peer.to_string()).unwrap();
    let with_peer = format!("{bench} --peer peer.json");
    succeed(&folder, &with_peer);
    let second = json(&report, "report.json");
    let view = |report: &serde_json::Value| report["fabrics"][0]["views"][0]["results"].clone();
    assert_eq!(view(&first), view(&second));
    assert_eq!(
        second["fabrics"][0]["views"][0]["peers"][0]["program"],
        "grey"
    );
    assert_eq!(
        complaint(&folder, "bench denin -o report"),
        "organza: denin: expected the name of a fabric file (.toml) or one of denim, charmeuse, \
         organza; did you mean \"denim\"?"
    );
    let small = peer.to_string().replace("\"variance\"", "\"variances\"");
    std::fs::write(folder.join("peer.json"), small).unwrap();
    let words = complaint(&folder, &with_peer);
    assert!(
        words.starts_with("organza: peer.json: unknown field `variances`"),
        "{words}"
    );
}

/// One width of pixels, and every representation by its usual tracker: the reference as well.
#[test]
fn a_bench_of_usual_trackers_compares_with_fibres_in_the_kernel() {
    let folder = folder("bench_usual");
    std::fs::write(folder.join("plain.toml"), few_fibres(VOXEL_UM)).unwrap();
    succeed(
        &folder,
        &format!("{} --trackers usual --pixel-mm 0.05,0.2", bench()),
    );
    let report = json(&folder.join("report"), "report.json");
    let views = report["fabrics"][0]["views"].as_array().unwrap();
    assert_eq!(views.len(), 4, "two widths, lit from two sides");
    // Four pixels across a gap, lit from the front: black, which ends this view only.
    assert_eq!(views[0]["results"].as_array().unwrap().len(), 0);
    let why = views[0]["refused"][0]["why"].as_str().unwrap();
    assert_contains(why, "black");
    for view in &views[2..] {
        let results = view["results"].as_array().unwrap();
        assert_eq!(view["pixel_mm"], 0.2, "{view}");
        assert_eq!(results[0]["choice"]["model"], "fibres");
        assert_eq!(results[0]["choice"]["tracker"], "kernel");
        let regular = results
            .iter()
            .filter(|r| r["choice"]["tracker"] == "regular");
        assert_eq!(regular.count(), 0, "{view}");
        let fibres = results.iter().filter(|r| r["choice"]["model"] == "fibres");
        let trackers: Vec<_> = fibres.map(|r| r["choice"]["tracker"].as_str()).collect();
        assert_eq!(trackers, [Some("kernel"), Some("cached")], "{view}");
    }
    auto_uses_the_bench_beside_a_fabric(&folder);
}

/// A bench that was copied beside its fabric is what `model = "auto"` chooses by.
fn auto_uses_the_bench_beside_a_fabric(folder: &Path) {
    std::fs::write(folder.join("scene.toml"), SCENE_OF_AUTO).unwrap();
    let info = || succeed(folder, "info scene.toml");
    let beside = folder.join("plain.choices.csv");
    assert!(info().contains("the fabric most like it"));
    std::fs::copy(folder.join("report/choices.csv"), &beside).unwrap();
    let said = info();
    assert_contains(&said, "measured in plain.choices.csv");
    // Of another cloth.
    let fabric = std::fs::read_to_string(folder.join("plain.toml")).unwrap();
    std::fs::write(
        folder.join("plain.toml"),
        fabric.replace("fibre_radius_um = 12.0", "fibre_radius_um = 14.0"),
    )
    .unwrap();
    let said = succeed(folder, "render scene.toml -o a.exr --spp 1");
    let warning = "plain.choices.csv: was measured on another fabric than plain.toml; \
                   model = \"auto\" leaves it out";
    assert!(
        said.contains(warning) && said.contains("the fabric most like it"),
        "{said}"
    );
    // Damaged.
    let rows = std::fs::read_to_string(&beside).unwrap();
    std::fs::write(&beside, rows.replacen(",fibres,", ",fibers,", 1)).unwrap();
    let words = complaint(folder, "info scene.toml");
    assert!(
        words.starts_with("organza: plain.choices.csv: line 2: ")
            && words.ends_with("expected the choices.csv of `organza bench`"),
        "{words}"
    );
}

/// With `auto` a picture is bit for bit that of the choice it names.
#[test]
fn auto_takes_what_it_says() {
    let folder = folder("auto");
    std::fs::write(folder.join("plain.toml"), few_fibres(VOXEL_UM)).unwrap();
    let scene = SCENE_OF_AUTO;
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    let render = "render scene.toml -o a.exr --spp 4 --json";
    let said = succeed(&folder, &render);
    let printed: serde_json::Value =
        serde_json::from_str(&said[said.find('{').unwrap()..=said.rfind('}').unwrap()]).unwrap();
    let chosen = &printed["chosen"][0];
    assert_eq!(chosen["lit"][0], "front");
    let words = chosen["what"].as_str().unwrap();
    assert_contains(
        &said,
        &format!("scene.toml: object[0]: auto takes {words}: "),
    );
    let info = succeed(&folder, "info scene.toml --json");
    let info: serde_json::Value = serde_json::from_str(&info).unwrap();
    assert_eq!(info["chosen"][0]["what"], chosen["what"]);
    let choice = &chosen["recommendation"]["taken"]["choice"];
    let model = choice["model"].as_str().unwrap();
    let voxels = if matches!(model, "surface" | "table") {
        String::new()
    } else if model == "fibres" {
        "lod = \"volume\"\n".to_owned()
    } else {
        let scale = choice["voxel_scale"].as_f64().unwrap();
        format!(
            "voxel_um = {:?}\nlod = {}\n",
            f64::from(VOXEL_UM) * scale,
            choice["level"]
        )
    };
    let named = scene
        .replace(
            "model = \"auto\"",
            &format!("model = \"{model}\"\n{voxels}"),
        )
        .replace("tolerance = 0.3\n", "");
    std::fs::write(folder.join("named.toml"), named).unwrap();
    succeed(&folder, "render named.toml -o b.exr --spp 4");
    let sums = |name: &str| crate::program::exr_channels(&folder.join(name));
    assert!(sums("a.exr") == sums("b.exr"));
}

/// The fabrics that the program carries are those that users find.
#[test]
fn built_in_fabrics_are_the_shipped_ones() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let carried = root.join("crates/report/src/bench/fabrics");
    for entry in std::fs::read_dir(carried).unwrap() {
        let entry = entry.unwrap();
        let shipped = root.join("scenes/fabrics").join(entry.file_name());
        let (one, other) = (std::fs::read(entry.path()), std::fs::read(&shipped));
        assert!(one.unwrap() == other.unwrap(), "{}", shipped.display());
    }
}

/// A picture that learns its light takes explicit fibres with a cache, and without one where that
/// is too far off; a scene that sets the key has its way.
#[test]
fn auto_counts_with_the_cache_of_a_picture() {
    let folder = folder("auto_cache");
    let fabric = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fabrics/denim.toml");
    let taken = |edge: u32, tolerance: f64, cache: &str| {
        let scene = format!(
            "[render]\n{cache}\n[camera]\nkind = \"orthographic\"\n\
             origin_mm = [0.0, -500.0, 866.0]\ntarget_mm = [0.0, 0.0, 0.0]\n\
             width_mm = {}\nresolution = [{edge}, {edge}]\n\
             [[light]]\nkind = \"environment\"\nradiance = [1.0, 1.0, 1.0]\n\
             hemisphere = \"front\"\n\
             [[object]]\nkind = \"cloth\"\nmodel = \"auto\"\ntolerance = {tolerance}\n\
             fabric = {fabric:?}\n",
            0.03 * f64::from(edge),
        );
        std::fs::write(folder.join("scene.toml"), scene).unwrap();
        let info = succeed(&folder, "info scene.toml --json");
        let info: serde_json::Value = serde_json::from_str(&info).unwrap();
        let choice = info["chosen"][0]["recommendation"]["taken"]["choice"].clone();
        let [model, tracker] = ["model", "tracker"].map(|k| choice[k].as_str().unwrap().to_owned());
        format!("{model} {tracker}")
    };
    assert_eq!(taken(1024, 0.2, ""), "fibres cached");
    // Too small to learn anything.
    assert_eq!(taken(128, 0.05, ""), "fibres kernel");
    assert_eq!(taken(1024, 0.2, "cache = \"off\""), "fibres kernel");
    // The cache is off by about a tenth in such pixels.
    assert_eq!(taken(1024, 0.05, ""), "fibres kernel");
    let insists = taken(1024, 0.05, "cache = \"second-fibre\"");
    assert!(
        !insists.ends_with("kernel") || !insists.starts_with("fibres"),
        "{insists}"
    );
}
