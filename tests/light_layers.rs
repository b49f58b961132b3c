//! Direct light and the error of the cache as layers of pictures, and light kept for other ones.

use crate::cli::write_silk_scene;
use crate::program::{bytes, complaint, exr_channels, folder, succeed};
use organza_requests::{Context, Render, Request};
use organza_testing::assert_contains;
use std::path::Path;
use std::sync::Arc;

/// A picture that learns a little.
const CACHED: &str = "render scene.toml --set object.0.model=fibres \
    --set render.cache=second-fibre --set render.cache_learning=0.01";

fn render(folder: &Path, name: &str, more: &str) -> Vec<u8> {
    succeed(folder, &format!("{CACHED} -o {name} {more}"));
    bytes(folder, name)
}

/// Parts and checkpoints keep both layers; direct and indirect light add up to the
/// picture, which is the same without them.
#[test]
fn layers_are_kept_and_add_up() {
    let folder = folder("light-layers");
    write_silk_scene(&folder);
    let direct = "--set render.direct=true";
    let with = |more: &str| format!("{direct} {more}");
    let whole = render(&folder, "whole.exr", &with("--spp 12"));
    render(&folder, "a.exr", &with("--samples 0..5 --threads 1"));
    render(&folder, "b.exr", &with("--samples 5..12 --engine scalar"));
    succeed(&folder, "merge b.exr a.exr -o merged.exr");
    let strip = |file: &str| {
        // The files differ in the names of engines alone.
        let channels = exr_channels(&folder.join(file));
        assert!(channels.contains_key("cache_error"), "{file}");
        assert!(channels.contains_key("direct_sums.00"), "{file}");
        channels
            .into_iter()
            .map(|(name, values)| {
                (
                    name,
                    values.into_iter().map(f32::to_bits).collect::<Vec<_>>(),
                )
            })
            .collect::<Vec<_>>()
    };
    assert!(strip("merged.exr") == strip("whole.exr"));
    let saved = "--checkpoint state --spp";
    render(&folder, "part.exr", &with(&format!("{saved} 5")));
    let resumed = format!("{saved} 12 --resume");
    assert!(render(&folder, "resumed.exr", &with(&resumed)) == whole);

    let channels = exr_channels(&folder.join("whole.exr"));
    let alone = "--set render.direct=false --spp 12";
    render(&folder, "alone.exr", alone);
    let without = exr_channels(&folder.join("alone.exr"));
    assert!(!without.contains_key("direct.R"));
    assert_eq!(channels["cache_error"].len(), 144);
    for c in ["R", "G", "B"] {
        assert_eq!(channels[c], without[c]);
        let (direct, indirect) = (format!("direct.{c}"), format!("indirect.{c}"));
        let parts = channels[&direct].iter().zip(&channels[&indirect]);
        for ((d, i), all) in parts.zip(&channels[c]) {
            assert!((d + i - all).abs() <= 1e-6 * all.abs(), "{d} {i} {all}");
        }
        let sum = |name: &str| channels[name].iter().sum::<f32>();
        assert!(sum(&direct) > 0.0 && sum(&indirect) > 0.0, "{c}");
        assert!(
            channels[&format!("direct.variance.{c}")]
                .iter()
                .all(|v| *v >= 0.0)
        );
    }
    let said = complaint(&folder, "merge alone.exr b.exr -o x.exr");
    assert_contains(&said, "the scenes differ");
    let first = "--set render.cache=first-fibre --set render.direct=true";
    let refused = complaint(&folder, &format!("{CACHED} -o x.exr {first}"));
    assert_contains(&refused, "render.direct: ");
}

/// Light of one picture serves another camera, and nothing else that it is not of.
#[test]
fn light_is_kept_for_other_cameras() {
    let folder = folder("kept-light");
    write_silk_scene(&folder);
    let moved = "--set camera.origin_mm=[1.0,0.2,5.0]";
    let own = render(&folder, "a.exr", "--save-light silk.light");
    assert!(
        render(&folder, "b.exr", "") == own,
        "saving changes nothing"
    );
    let load = "--load-light silk.light";
    let loaded = |name: &str, more: &str| {
        let all = format!("{moved} {load} {more}");
        render(&folder, name, &all)
    };
    let one = loaded("c.exr", "--seed 3 --threads 1");
    assert!(loaded("d.exr", "--seed 3") == one);
    assert!(render(&folder, "e.exr", &format!("{moved} --seed 3")) != one);

    // In memory, as other files.
    let flags = format!("{CACHED} {moved}");
    let set = flags.split(" --set ").skip(1);
    let request = Render {
        scene: folder.join("scene.toml"),
        seed: Some(3),
        load_light: Some("given.light".into()),
        set: set.map(str::to_owned).collect(),
        ..Render::default()
    };
    let light = [("given.light", bytes(&folder, "silk.light"))];
    let context = Context {
        given: Arc::new(light.into_iter().collect()),
        ..Context::default()
    };
    request.run(&context).unwrap();
    let missing = request.run(&Context::default()).err().unwrap();
    assert!(missing.is_missing, "{missing}");

    let refuse = |more: &str| complaint(&folder, &format!("{CACHED} -o x.exr {more}"));
    let other = "--set light.0.irradiance=[1.0,3.0,3.0]";
    let why = refuse(&format!("{load} {other}"));
    assert_contains(&why, "silk.light: is light of another cloth");
    let why = refuse(&format!("{load} --set render.cache=off"));
    assert_contains(&why, "--load-light: this picture has no cache");
    let why = refuse(&format!("{load} --save-light silk.light"));
    assert_contains(&why, "silk.light");
    let why = refuse("--save-light x.light --engine walk");
    assert_contains(&why, "--save-light: this picture has no cache");
    let why = refuse("--save-light x.light --checkpoint x.light");
    assert_contains(&why, "expected two files");
    let mut damaged = bytes(&folder, "silk.light");
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    std::fs::write(folder.join("silk.light"), &damaged).unwrap();
    let why = refuse(load);
    assert_contains(&why, "does not match its checksum");
    std::fs::write(folder.join("silk.light"), &damaged[..20]).unwrap();
    let why = refuse(load);
    assert_contains(&why, "silk.light: is cut short");
    assert!(!folder.join("x.exr").exists());
}
