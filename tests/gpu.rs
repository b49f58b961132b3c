//! Pictures by graphics adapters, and by several engines.

use crate::cli::write_grid_scene;
use crate::program::{argv, complaint, exr_channels, folder, organza, succeed};
use std::path::Path;

/// Whether this program can use an adapter, if only one in software.
fn has_adapter(folder: &Path) -> bool {
    let listed = succeed(folder, &["info", "--devices"]);
    let found = listed.contains("interface:");
    if !found {
        organza_testing::skipped(
            "render --engine gpu",
            listed.lines().next().unwrap_or("none"),
        );
    }
    found
}

fn mean(folder: &Path, name: &str) -> f64 {
    let channels = exr_channels(&folder.join(name));
    let green = &channels["G"];
    green.iter().map(|&x| f64::from(x)).sum::<f64>() / green.len() as f64
}

/// A picture that an adapter begins and a processor ends has the samples of both, and says
/// so; so has one that is merged of parts.
#[test]
fn several_engines_make_one_picture() {
    let folder = folder("several-engines");
    write_grid_scene(&folder);
    if !has_adapter(&folder) {
        return;
    }
    let render = |out: &str, more: &[&str]| {
        let run = ["render", "scene.toml", "-o", out];
        succeed(&folder, &[&run[..], more].concat())
    };
    let engine = |name| ["--engine", name];
    render(
        "whole.exr",
        &[&engine("scalar")[..], &["--spp", "64"]].concat(),
    );
    let part = ["--spp", "32", "--checkpoint", "state"];
    render("half.exr", &[&engine("gpu")[..], &part].concat());
    let rest = ["--spp", "64", "--checkpoint", "state", "--resume"];
    render("both.exr", &[&engine("scalar")[..], &rest].concat());
    let told = succeed(&folder, &["info", "both.exr"]);
    assert!(told.contains("gpu+scalar"), "{told}");
    for (name, samples, by) in [("a.exr", "0..32", "gpu"), ("b.exr", "32..64", "scalar")] {
        render(name, &[&engine(by)[..], &["--samples", samples]].concat());
    }
    succeed(&folder, &["merge", "a.exr", "b.exr", "-o", "merged.exr"]);
    let told = succeed(&folder, &["info", "merged.exr"]);
    assert!(told.contains("gpu+scalar"), "{told}");
    for name in ["both.exr", "merged.exr"] {
        let (whole, own) = (mean(&folder, "whole.exr"), mean(&folder, name));
        assert!((own / whole - 1.0).abs() < 0.02, "{name}: {own} {whole}");
    }
    // The walk has other random numbers.
    let walked = argv("--engine walk --spp 64 --checkpoint state --resume");
    let run = ["render", "scene.toml", "-o", "c.exr"];
    let refused = complaint(&folder, &[&run[..], &walked].concat());
    assert!(
        refused.contains("is a checkpoint of the kernel"),
        "{refused}"
    );
}

/// Adapters in software are for tests: `auto` leaves them alone.
#[test]
fn auto_uses_no_adapter_in_software() {
    let folder = folder("no-software");
    write_grid_scene(&folder);
    let listed = succeed(&folder, &["info", "--devices"]);
    if listed.contains("chosen_by_auto: true") {
        organza_testing::skipped("auto without a card", "this computer has one");
        return;
    }
    let run = ["render", "scene.toml", "-o", "a.exr", "--spp", "1"];
    let out = organza(
        &folder,
        &[&run[..], &["--engine", "auto", "--json"]].concat(),
    );
    let told = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(out.status.success() && !told.contains("gpu"), "{told}");
}
