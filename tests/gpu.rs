//! Pictures by graphics adapters, and by several engines.

use crate::cli::write_grid_scene;
use crate::program::{complaint, exr_channels, folder, organza, succeed};
use organza_testing::assert_contains;
use std::path::Path;

/// Whether this program can use an adapter, if only one in software.
fn has_adapter(folder: &Path) -> bool {
    let listed = succeed(folder, "info --devices");
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
    let render = |out: &str, more: &str| {
        succeed(
            &folder,
            &format!("render scene.toml -o {out} --engine {more}"),
        )
    };
    render("whole.exr", "scalar --spp 64");
    render("half.exr", "gpu --spp 32 --checkpoint state");
    render("both.exr", "scalar --spp 64 --checkpoint state --resume");
    assert_contains(&succeed(&folder, "info both.exr"), "gpu+scalar");
    for (name, samples, by) in [("a.exr", "0..32", "gpu"), ("b.exr", "32..64", "scalar")] {
        render(name, &format!("{by} --samples {samples}"));
    }
    succeed(&folder, "merge a.exr b.exr -o merged.exr");
    assert_contains(&succeed(&folder, "info merged.exr"), "gpu+scalar");
    for name in ["both.exr", "merged.exr"] {
        let (whole, own) = (mean(&folder, "whole.exr"), mean(&folder, name));
        assert!((own / whole - 1.0).abs() < 0.02, "{name}: {own} {whole}");
    }
    // The walk has other random numbers.
    let walked = "--engine walk --spp 64 --checkpoint state --resume";
    let run = "render scene.toml -o c.exr";
    let refused = complaint(&folder, &format!("{run} {walked}"));
    assert_contains(&refused, "is a checkpoint of the kernel");
}

/// Adapters in software are for tests: `auto` leaves them alone.
#[test]
fn auto_uses_no_adapter_in_software() {
    let folder = folder("no-software");
    write_grid_scene(&folder);
    let listed = succeed(&folder, "info --devices");
    if listed.contains("chosen_by_auto: true") {
        organza_testing::skipped("auto without a card", "this computer has one");
        return;
    }
    let run = "render scene.toml -o a.exr --spp 1";
    let out = organza(&folder, &format!("{run} --engine auto --json"));
    let told = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(out.status.success() && !told.contains("gpu"), "{told}");
}
