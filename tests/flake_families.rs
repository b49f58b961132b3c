//! Families of micro-flakes on the command line, and in files for other programs.

use crate::fabrics::cotton;
use crate::program::{bytes, complaint, files_left, folder, succeed};
use organza_testing::assert_contains;
use std::fs;
use std::path::Path;

const SCENE: &str = r#"[camera]
kind = "orthographic"
origin_mm = [0.0, 0.0, 5.0]
target_mm = [0.0, 0.0, 0.0]
up = [0.0, 1.0, 0.0]
width_mm = 1.0
resolution = [8, 6]
[render]
spp = 8
[[light]]
kind = "directional"
direction = [0.3, 0.0, 1.0]
irradiance = [1.0, 1.0, 1.0]
[[object]]
kind = "cloth"
fabric = "cloth.toml"
lod = 0
extent_mm = [-0.5, -0.5, 0.5, 0.5]
"#;

/// A cloth whose fabric names a family of micro-flakes, and its scene.
fn cloth(folder: &Path, family: &str) {
    let fabric = cotton("plain", "tex = 20.0\nfibres_per_ply = 40", 60.0);
    let text = format!("{fabric}[scattering]\nmodel = 'microflake'\nflake = '{family}'\n");
    fs::write(folder.join("cloth.toml"), text).unwrap();
    fs::write(folder.join("scene.toml"), SCENE).unwrap();
}

/// The kernel takes other families than mirrors, and shows them as they are.
#[test]
fn the_kernel_renders_flakes_that_transmit() {
    let folder = folder("flake-families-kernel");
    let render = |name: &str| {
        let arguments = [
            "render",
            "scene.toml",
            "-o",
            name,
            "--stats",
            "--engine",
            "cpu",
        ];
        let said = succeed(&folder, &arguments);
        let backend = said.lines().find(|l| l.starts_with("backend")).unwrap();
        assert!(!backend.contains("walk"), "{backend}");
        bytes(&folder, name)
    };
    cloth(&folder, "sggx-transmitting");
    let transmitting = render("transmitting.exr");
    cloth(&folder, "sggx-specular");
    assert!(render("mirrors.exr") != transmitting);
}

/// Files for other programs have no transmitted light: the export to Mitsuba is refused, and
/// grids are written with a note. Mirrors are the twin, which are written without one.
#[test]
fn other_programs_get_no_transmitted_light() {
    let folder = folder("flake-families-export");
    let export = ["export", "mitsuba", "scene.toml", "-o", "out", "--quiet"];
    let lost = "light that flakes transmit is lost";
    cloth(&folder, "sggx-transmitting");
    let before = files_left(&folder);
    let said = complaint(&folder, &export);
    assert_contains(&said, "transmit no light");
    assert_contains(&said, "flake = \"sggx-specular\"");
    assert_eq!(files_left(&folder), before);
    for (name, noted) in [("a.vol", true), ("a.nrrd", true), ("a.ovox", false)] {
        let said = succeed(&folder, &["voxelize", "cloth.toml", "-o", name]);
        assert_eq!(said.contains(lost), noted, "{name}: {said}");
    }

    cloth(&folder, "sggx-specular");
    let said = succeed(&folder, "voxelize cloth.toml -o b.vol");
    assert!(!said.contains(lost), "{said}");
    succeed(&folder, &export);
}
