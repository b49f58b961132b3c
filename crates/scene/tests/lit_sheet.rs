//! Scenes built in process: a diffuse sheet under a spot, against closed forms.

use glam::Vec3;
use organza_basis::{Moments, PathRng, Rgb};
use organza_scene::loader::Loader;
use organza_scene::scene_file;
use organza_scene::{BuildOptions, scene_build};
use organza_transport::{
    Integrator, Light, LightSearch, RectangleLight, RenderSettings, Stats, render, trace_path,
};
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
                // Margin: most of the bound is four standard errors.
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

/// A folded satin under a large panel, with interreflection: the panel found by shadow rays and
/// walks together has the brightness that it has when walks alone find it. The twins are a
/// twentieth too dark, and count what both find.
#[test]
fn a_panel_on_a_satin_is_what_walks_alone_find() {
    let folder = folder("satin");
    let satin =
        "[surface]\npreset = \"silk-charmeuse\"\n[surface.warp]\nspecular = [0.6, 0.6, 0.6]\n";
    let weave = FABRIC.split("[surface]").next().unwrap();
    let weave = weave.replace("\"plain\"", "\"satin-5-3\"");
    std::fs::write(folder.join("cloth.toml"), format!("{weave}{satin}")).unwrap();
    // A valley of two faces.
    let valley = "v -9 -9 5\nv 0 -9 0\nv 9 -9 5\nv -9 9 5\nv 0 9 0\nv 9 9 5\n\
                  vt 0 0\nvt 1 0\nvt 2 0\nvt 0 2\nvt 1 2\nvt 2 2\n\
                  f 1/1 2/2 5/5 4/4\nf 2/2 3/3 6/6 5/5\n";
    std::fs::write(folder.join("valley.obj"), valley).unwrap();
    let path = folder.join("scene.toml");
    let text = scene(50.0, "")
        .replace("width_mm = 0.01", "width_mm = 6.0")
        .replace(
            "model = \"surface\"",
            "model = \"surface\"\nmesh = \"valley.obj\"\nmm_per_uv = 10.0",
        );
    std::fs::write(&path, text).unwrap();
    let loader = Loader::new();
    let file = scene_file::load(&path, &[], &loader).unwrap();
    let options = BuildOptions {
        scene_path: &path,
        loader: &loader,
        max_memory_bytes: None,
    };
    let mut scene = scene_build::scene(&file, &options).unwrap();
    let mut lit = |search, seed| {
        let (corner, u, v) = (
            Vec3::new(-20.0, -15.0, 12.0),
            30.0 * Vec3::Y,
            Vec3::new(12.0, 0.0, 16.0),
        );
        let panel = RectangleLight::new(corner, u, v, Rgb::WHITE, true).unwrap();
        scene.lights = vec![Light::from(panel.with_search(search))];
        let (mut moments, mut stats) = (Moments::default(), Stats::default());
        for path in 0..60_000u64 {
            let mut rng = PathRng::new(seed, path % 4, path / 4);
            let pixel = glam::UVec2::new((path % 2) as u32, (path / 2 % 2) as u32);
            let traced = trace_path(
                &scene,
                pixel,
                Integrator::Woodcock,
                u32::MAX,
                &mut rng,
                &mut stats,
            );
            moments.add(f64::from(traced.radiance.mean()));
        }
        moments
    };
    let walks = lit(LightSearch::Walk, 81);
    let both = lit(LightSearch::Both, 82);
    let rays = lit(LightSearch::ShadowRays, 83);
    for (name, found) in [("both", both), ("shadow rays", rays)] {
        let sigma = found.standard_error().hypot(walks.standard_error());
        let off = |mean: f64| (mean - walks.mean).abs() / sigma;
        assert!(
            off(found.mean) < 4.5,
            "{name}: {} for {}",
            found.mean,
            walks.mean
        );
        assert!(
            off(0.95 * found.mean) > 4.5,
            "{name}: sigma {sigma} of {}",
            walks.mean
        );
    }
    let twice = rays.mean + walks.mean;
    assert!((twice - walks.mean).abs() > 4.5 * walks.standard_error());
    std::fs::remove_dir_all(folder).unwrap();
}
