//! Scenes that tests build and render without starting the program.

use organza_scene::loader::Loader;
use organza_scene::{LoadedScene, from_str};
use organza_transport::{EngineChoice, Film, RenderSettings, Rendering, Scene, engine};
use std::ops::ControlFlow;
use std::path::Path;

/// A picture, and the warnings on the way to it.
pub struct Picture {
    pub film: Film,
    pub warnings: Vec<String>,
}

/// Reads, checks and builds the text of a scene. Paths in it are relative to `folder`.
pub fn build(
    folder: &Path,
    text: &str,
    overrides: &[String],
    loader: &Loader<'_>,
) -> Result<(LoadedScene, Scene), String> {
    let path = folder.join("scene.toml");
    let loaded = from_str(text, &path, overrides, loader).map_err(|e| e.to_string())?;
    let scene = loaded.build(None, loader).map_err(|e| e.to_string())?;
    Ok((loaded, scene))
}

/// Renders the text of a scene, with `key.path=value` overrides, as `organza render` does:
/// by the fastest engine that supports it, otherwise by the general walk.
pub fn picture(folder: &Path, text: &str, overrides: &[String]) -> Picture {
    let loader = Loader::new();
    let (loaded, scene) = build(folder, text, overrides, &loader).unwrap();
    let table = &loaded.file.render;
    let settings = RenderSettings {
        integrator: table.integrator.into(),
        samples: 0..u64::from(table.spp),
        max_bounces: table.max_bounces.unwrap_or(u32::MAX),
        seed: table.seed,
        crop: None,
    };
    let mut rendering = Rendering::new(&scene, settings.clone()).unwrap();
    if let Ok(engine) = engine(&scene, &settings, EngineChoice::Processor, u64::MAX) {
        rendering = rendering.with_engine(engine);
    }
    let rendering = rendering.take(u64::MAX, &|_| ControlFlow::Continue(()));
    Picture {
        film: rendering.unwrap().into_parts().0,
        warnings: loader.warnings().iter().map(ToString::to_string).collect(),
    }
}

/// The message with which the text of a scene is refused: one line that names the file
/// `scene.toml`.
pub fn mistake(folder: &Path, text: &str) -> String {
    let message = build(folder, text, &[], &Loader::new())
        .map(|_| ())
        .unwrap_err();
    assert_eq!(message.lines().count(), 1, "{message}");
    message
}
