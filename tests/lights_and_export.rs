//! Lights and planes of scene files, and scenes written for another renderer.

use crate::cli::write_grid_scene;
use crate::in_process::{mistake, picture};
use crate::program::{complaint, folder, succeed};
use organza_testing::{assert_contains, table_rows};
use std::path::Path;

/// Writes the grid scene with more text, and returns it.
fn scene_with(folder: &Path, more: &str) -> String {
    write_grid_scene(folder);
    let path = folder.join("scene.toml");
    let text = std::fs::read_to_string(&path).unwrap() + more;
    std::fs::write(path, &text).unwrap();
    text
}

/// Lines after the scene, and a part of the message.
const MISTAKES: &str = r#"
[[light]]; kind = "environment" | light[1]: an environment takes either radiance or file
[[light]]; kind = "environment"; radiance = [1.0, 1.0, 1.0]; scale = 2.0 | light[1]: scale belongs to an environment with a file
[[light]]; kind = "environment"; file = "none.exr" | none.exr: no such file
[[light]]; kind = "environment"; file = "not.exr" | not.exr: expected an OpenEXR (.exr), Radiance (.hdr) or TIFF (.tif) picture
[[light]]; kind = "environment"; file = "short.hdr" | short.hdr:
[[object]]; kind = "plane"; position_mm = [0.0, 0.0, -1.0]; reflectance = [1.0, 2.0, 0.0] | object[1]: reflectance: expected three numbers from 0 to 1
extent_mm = [0.0, 0.0, 1.0, 1.0] | object[0]: extent_mm belongs to repeat_xy = true
repeat_xy = true; extent_mm = [1.0, 0.0, 0.0, 1.0] | object[0]: extent_mm: expected x0, y0, x1, y1
"#;

#[test]
fn mistakes_in_lights_and_planes_are_reported_with_their_key() {
    let folder = folder("light_mistakes");
    std::fs::write(folder.join("not.exr"), "no picture").unwrap();
    let hdr = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n";
    std::fs::write(folder.join("short.hdr"), hdr).unwrap();
    let oblique = "[[light]]\nkind = \"rectangle\"\ncorner_mm = [0.0, 0.0, 1.0]\n\
        edge_u_mm = [1.0, 0.0, 0.0]\nedge_v_mm = [1.0, 1.0, 0.0]\nradiance = [1.0, 1.0, 1.0]\n";
    assert_contains(
        &mistake(&folder, &scene_with(&folder, oblique)),
        "light[1]: edge_u_mm, edge_v_mm: the edges are not perpendicular",
    );
    for [more, expected] in table_rows(MISTAKES) {
        let more = more.replace("; ", "\n") + "\n";
        let message = mistake(&folder, &scene_with(&folder, &more));
        assert!(message.contains(expected), "{more}\n{message}");
    }
}

/// The same file on any number of threads; what a name or a cloth does not allow is refused.
#[test]
fn fibres_are_written_as_usd() {
    let folder = folder("export-usd");
    let fabric = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/fabrics/organza.toml");
    let usd = |out: &'static str, more: &[&'static str]| {
        [&["export", "usd", fabric, "-o", out, "--quiet"], more].concat()
    };
    succeed(&folder, &usd("a.usda", &["--threads", "1"]));
    succeed(&folder, &usd("b.usda", &["--threads", "3"]));
    let [a, b] = ["a.usda", "b.usda"].map(|name| std::fs::read(folder.join(name)).unwrap());
    assert!(a == b && a.len() > 100_000, "{} and {}", a.len(), b.len());
    assert_contains(&complaint(&folder, &usd("c.usdc", &[])), "ends in .usda");
    let said = complaint(&folder, &usd("c.usda", &["--max-memory", "10k"]));
    assert_contains(&said, "with its curves");
    assert!(!folder.join("c.usda").exists());
}

/// Every light, a plane, a cut cloth and an environment from a file render and
/// are written for Mitsuba; what it does not support is reported.
#[test]
fn scenes_are_written_for_mitsuba() {
    let folder = folder("export");
    let lights = "repeat_xy = true\nextent_mm = [-0.5, -0.3, 0.7, 0.3]\n\
        [[light]]\nkind = \"rectangle\"\ncorner_mm = [0.0, 0.0, 1.0]\nedge_u_mm = [0.0, 1.0, 0.0]\n\
        edge_v_mm = [1.0, 0.0, 0.0]\nradiance = [1.0, 2.0, 3.0]\ntwo_sided = true\n\
        [[light]]\nkind = \"directional\"\ndirection = [0.0, 0.0, 1.0]\nirradiance = [1.0, 1.0, 1.0]\n\
        [[object]]\nkind = \"plane\"\nposition_mm = [0.0, 0.0, -1.0]\nreflectance = [0.5, 0.5, 0.5]\n";
    let film = picture(&folder, &scene_with(&folder, lights), &[]).film;
    assert!(film.mean().iter().all(|(mean, _)| *mean > 0.0));
    let export = ["export", "mitsuba", "scene.toml", "-o", "out"];
    succeed(&folder, &export);
    let xml = std::fs::read_to_string(folder.join("out/scene.xml")).unwrap();
    for part in [
        "<sensor type=\"orthographic\">",
        "<emitter type=\"constant\">",
        "<emitter type=\"directional\">",
        "<shape type=\"rectangle\">",
        "<medium type=\"heterogeneous\" name=\"interior\">",
        "<bsdf type=\"twosided\">",
    ] {
        assert!(xml.contains(part), "{part} in\n{xml}");
    }
    assert_eq!(xml.matches("<emitter type=\"area\">").count(), 2);
    // Periods of 0.4 mm from -0.2 mm on: from -0.6 to 1.0, and from -0.6 to 0.6.
    let sigma_t = std::fs::read(folder.join("out/object0.sigma_t.vol")).unwrap();
    assert_eq!(sigma_t.len(), 48 + 4 * 4 * 3);
    let float = |i: usize| f32::from_le_bytes(sigma_t[i..i + 4].try_into().unwrap());
    let corners = [24, 28, 36, 40].map(float);
    for (got, expected) in corners.into_iter().zip([-0.6, -0.6, 1.0, 0.6]) {
        assert!((got - expected).abs() < 4.0 * f32::EPSILON, "{corners:?}");
    }

    scene_with(&folder, "repeat_xy = true\n");
    assert_contains(&complaint(&folder, &export), "--repeats NX,NY");
    let three: Vec<&str> = export.iter().copied().chain(["--repeats", "3,1"]).collect();
    succeed(&folder, &three);
    let sigma_t = std::fs::read(folder.join("out/object0.sigma_t.vol")).unwrap();
    assert_eq!(sigma_t.len(), 48 + 4 * 3);
    let two_skies = "[[light]]\nkind = \"environment\"\nradiance = [1.0, 1.0, 1.0]\n";
    scene_with(&folder, two_skies);
    assert_contains(&complaint(&folder, &export), "one environment at most");
}
