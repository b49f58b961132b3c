//! Thin lenses in scenes.

use crate::cli::write_grid_scene;
use crate::program::{complaint, exr_channels, folder, succeed};

#[test]
fn thin_lenses_are_read_and_checked() {
    let folder = folder("thin-lens");
    write_grid_scene(&folder);
    let scene = std::fs::read_to_string(folder.join("scene.toml")).unwrap();
    let lens = |keys: &str| {
        let camera = format!("kind = \"thin-lens\"\nfov_deg = 20.0\n{keys}");
        std::fs::write(
            folder.join("lens.toml"),
            scene.replace("width_mm = 1.0", &camera),
        )
        .unwrap();
        ["render", "lens.toml", "-o", "lens.exr"]
    };
    let show = |keys: &str| {
        succeed(&folder, &[&lens(keys)[..], &["--spp", "64"]].concat());
        exr_channels(&folder.join("lens.exr"))
    };
    // A sharp picture of a box has pixels that never see it, a blurred one
    // hardly any.
    let clear = |channels: std::collections::BTreeMap<String, Vec<f32>>| {
        channels["through"].iter().filter(|&&x| x == 1.0).count()
    };
    let sharp = clear(show("aperture_mm = 0.01"));
    let blurred = clear(show("aperture_mm = 1.0\nfocus_mm = 1.0"));
    assert!(blurred + 20 < sharp, "{blurred} {sharp}");
    // 20 degrees on 36 mm: the sensor is 102.08 mm away, the focus 3 mm:
    // f = 2.9144 mm, at f/2 1.4572 mm.
    let (by_number, by_diameter) = (show("f_number = 2.0"), show("aperture_mm = 1.4571824"));
    let off = by_number["R"]
        .iter()
        .zip(&by_diameter["R"])
        .filter(|(a, b)| a != b)
        .count();
    assert!(off <= 4, "{off} pixels differ");
    for (keys, words) in [
        (
            "",
            "camera: a thin lens takes either aperture_mm or f_number",
        ),
        (
            "aperture_mm = 1.0\nf_number = 2.0",
            "camera: a thin lens takes either aperture_mm or f_number",
        ),
        (
            "aperture_mm = 1.0\nfocus_mm = -3.0",
            "camera: focus_mm must be positive, found -3",
        ),
        (
            "aperture_mm = 1.0\nsensor_width_mm = 24.0",
            "camera: sensor_width_mm belongs to f_number",
        ),
    ] {
        assert_eq!(
            complaint(&folder, &lens(keys)),
            format!("organza: lens.toml: {words}")
        );
    }
    let arguments = ["render", "scene.toml", "-o", "x.exr"];
    let misplaced = [&arguments[..], &["--set", "camera.focus_mm=2.0"]].concat();
    assert_eq!(
        complaint(&folder, &misplaced),
        "organza: scene.toml: camera: focus_mm belongs to kind = \"thin-lens\""
    );
}
