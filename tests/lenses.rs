//! Thin lenses in scenes.

use crate::cli::write_grid_scene;
use crate::in_process::{mistake, picture};
use crate::program::folder;
use organza_testing::table_rows;
use organza_transport::{Film, Pixel};

/// Keys of a thin lens, and the end of the message.
const WRONG: &str = "
 | camera: a thin lens takes either aperture_mm or f_number
aperture_mm = 1.0; f_number = 2.0 | camera: a thin lens takes either aperture_mm or f_number
aperture_mm = 1.0; focus_mm = -3.0 | camera: focus_mm must be positive, found -3
aperture_mm = 1.0; sensor_width_mm = 24.0 | camera: sensor_width_mm belongs to f_number
";

#[test]
fn thin_lenses_are_read_and_checked() {
    let folder = folder("thin-lens");
    write_grid_scene(&folder);
    let scene = std::fs::read_to_string(folder.join("scene.toml")).unwrap();
    let lens = |keys: &str| {
        let camera = format!("kind = \"thin-lens\"\nfov_deg = 20.0\n{keys}");
        scene.replace("width_mm = 1.0", &camera)
    };
    let show = |keys: &str| picture(&folder, &lens(keys), &["render.spp=64".to_owned()]).film;
    // A sharp picture of a box has pixels that never see it, a blurred one
    // hardly any.
    let clear = |film: Film| {
        let through = film.pixels().iter().map(Pixel::straight_through);
        through.filter(|&x| x == 1.0).count()
    };
    let sharp = clear(show("aperture_mm = 0.01"));
    let blurred = clear(show("aperture_mm = 1.0\nfocus_mm = 1.0"));
    assert!(blurred + 20 < sharp, "{blurred} {sharp}");
    // 20 degrees on 36 mm: the sensor is 102.08 mm away, the focus 3 mm:
    // f = 2.9144 mm, at f/2 1.4572 mm.
    let (by_number, by_diameter) = (show("f_number = 2.0"), show("aperture_mm = 1.4571824"));
    let pixels = by_number.pixels().iter().zip(by_diameter.pixels());
    let off = pixels.filter(|(a, b)| a.mean().0.x != b.mean().0.x).count();
    assert!(off <= 4, "{off} pixels differ");
    for [keys, words] in table_rows(WRONG) {
        let message = mistake(&folder, &lens(&keys.replace("; ", "\n")));
        let expected = format!("scene.toml: {words}");
        assert!(message.ends_with(&expected), "{message}");
    }
    let misplaced = scene.replace("width_mm = 1.0", "width_mm = 1.0\nfocus_mm = 2.0");
    let message = mistake(&folder, &misplaced);
    let expected = "scene.toml: camera: focus_mm belongs to kind = \"thin-lens\"";
    assert!(message.ends_with(expected), "{message}");
}
