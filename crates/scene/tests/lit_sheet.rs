//! Scenes built in process: a diffuse sheet under a spot, against closed forms.

#![allow(clippy::unwrap_used)] // helpers outside test functions unwrap too

use organza_scene::loader::Loader;
use organza_scene::scene_file;
use organza_scene::{BuildOptions, scene_build};
use organza_transport::{Integrator, RenderSettings, render};
use std::ops::ControlFlow;
use std::path::PathBuf;

const FABRIC: &str = r#"
[draft]
weave = "plain"
[warp]
yarn = "cotton"
per_cm = 20.0
[weft]
yarn = "cotton"
per_cm = 20.0
[yarn.cotton]
preset = "cotton"
tex = 20.0
fibres_per_ply = 10
[surface]
model = "diffuse"
reflectance = [0.5, 0.4, 0.3]
transmittance = [0.2, 0.2, 0.2]
openness = 0.1
"#;

/// The scene from above or below; the spot hangs above the point in view.
fn scene(z_mm: f32, spot: &str) -> String {
    format!(
        r#"
[camera]
origin_mm = [0.0, 0.0, {z_mm:.1}]
target_mm = [0.0, 0.0, 0.0]
width_mm = 0.01
resolution = [2, 2]
[[light]]
kind = "spot"
position_mm = [0.0, 0.0, 200.0]
intensity = [4e4, 4e4, 4e4]
{spot}
[[object]]
kind = "cloth"
fabric = "cloth.toml"
model = "surface"
"#
    )
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("organza-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("cloth.toml"), FABRIC).unwrap();
    folder
}

/// Mean radiance and its standard error, by channel.
fn picture(folder: &std::path::Path, text: &str) -> Result<[(f64, f64); 3], String> {
    let path = folder.join("scene.toml");
    std::fs::write(&path, text).unwrap();
    let loader = Loader::new();
    let file = scene_file::load(&path, &[], &loader).map_err(|e| e.to_string())?;
    let options = BuildOptions {
        scene_path: &path,
        loader: &loader,
        max_memory_bytes: None,
    };
    let scene = scene_build::scene(&file, &options).map_err(|e| e.to_string())?;
    let settings = RenderSettings {
        integrator: Integrator::Woodcock,
        samples: 0..4000,
        max_bounces: u32::MAX,
        seed: 7,
        crop: None,
    };
    let (film, _) = render(&scene, &settings, &|_| ControlFlow::Continue(())).unwrap();
    Ok(film.mean())
}

#[test]
fn a_diffuse_sheet_under_a_spot_has_its_closed_form() {
    let folder = folder("lit-sheet");
    let cone = "direction = [0.0, 0.0, -1.0]\nhalf_angle_deg = 5.0\n";
    // Irradiance 1 at the sheet; the walk meets it with its cover of 0.9, and what
    // leaves it meets nothing more.
    for (z_mm, shares) in [(50.0, [0.5, 0.4, 0.3]), (-50.0, [0.2, 0.2, 0.2])] {
        for spot in ["", cone] {
            let got = picture(&folder, &scene(z_mm, spot)).unwrap();
            for ((mean, se), share) in got.into_iter().zip(shares) {
                let expected = share / std::f64::consts::PI;
                let off = (mean - expected).abs();
                assert!(
                    off < 4.0 * se + 2e-3 * expected,
                    "seed 7, {z_mm}: {mean} +- {se} for {expected}"
                );
                // A tenth more is found.
                assert!((mean - 1.1 * expected).abs() > 4.0 * se, "seed 7, {z_mm}");
            }
        }
    }
    // Turned away, the spot is dark.
    let away = cone.replace("-1.0", "1.0");
    let dark = picture(&folder, &scene(50.0, &away)).unwrap();
    assert_eq!(dark.map(|(mean, _)| mean), [0.0; 3]);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn mistakes_in_a_spot_name_the_light() {
    let folder = folder("lit-sheet-mistakes");
    let message = picture(&folder, &scene(50.0, "half_angle_deg = 20.0")).unwrap_err();
    assert!(
        message.contains("light[0]: direction: expected"),
        "{message}"
    );
    let message = picture(&folder, &scene(50.0, "half_angle = 20.0")).unwrap_err();
    assert!(message.contains("unknown field `half_angle`"), "{message}");
    std::fs::remove_dir_all(folder).unwrap();
}
