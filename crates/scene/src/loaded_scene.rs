//! A scene that was read, checked and made definite, ready to be built.

use crate::auto::{self, Chosen};
use crate::build_options::BuildOptions;
use crate::error::{InputError, Result};
use crate::file_kind::Wanted;
use crate::loader::Loader;
use crate::read;
use crate::scene_build;
use crate::scene_file::{self, SceneFile};
use organza_transport::Scene;
use std::path::{Path, PathBuf};

/// A scene file whose every `model = "auto"` was replaced by what suits it.
#[derive(Debug)]
pub struct LoadedScene {
    /// The file, after all overrides and choices.
    pub file: SceneFile,
    /// Where it is: paths inside are relative to its folder.
    pub path: PathBuf,
    /// What was chosen for cloths of `model = "auto"`, and why.
    pub chosen: Vec<Chosen>,
}

/// Reads and checks a scene file with `key.path=value` overrides, and resolves
/// `model = "auto"`. Nothing is voxelized yet.
///
/// ```no_run
/// use organza_scene::loader::Loader;
/// use std::path::Path;
///
/// # fn main() -> organza_scene::Result<()> {
/// let loader = Loader::new();
/// let overrides = ["render.spp=16".to_owned()];
/// let loaded = organza_scene::load(Path::new("scene.toml"), &overrides, &loader)?;
/// let scene = loaded.build(None, &loader)?;
/// assert_eq!(scene.media.len(), loaded.file.object.len());
/// for warning in loader.warnings() {
///     eprintln!("{warning}");
/// }
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Names the file, the place and the key at fault.
pub fn load(path: &Path, overrides: &[String], loader: &Loader<'_>) -> Result<LoadedScene> {
    LoadedScene::new(scene_file::load(path, overrides, loader)?, path, loader)
}

/// The same for the text of a scene. Paths in it are relative to the folder of
/// `path`, which need not exist and stands in messages.
///
/// ```
/// use organza_scene::loader::Loader;
/// use std::path::Path;
///
/// # fn main() -> organza_scene::Result<()> {
/// let text = r#"
///     [camera]
///     origin_mm = [0.0, 0.0, 5.0]
///     target_mm = [0.0, 0.0, 0.0]
///     width_mm = 1.0
///
///     [[light]]
///     kind = "environment"
///     radiance = [1.0, 1.0, 1.0]
///
///     [[object]]
///     kind = "plane"
///     position_mm = [0.0, 0.0, 0.0]
///     reflectance = [0.5, 0.5, 0.5]
/// "#;
/// let loader = Loader::new();
/// let path = Path::new("in_memory.toml");
/// let scene = organza_scene::from_str(text, path, &[], &loader)?.build(None, &loader)?;
/// assert_eq!((scene.lights.len(), scene.media.len()), (1, 1));
/// let wrong = organza_scene::from_str("[render]\nsp = 1", path, &[], &loader);
/// assert!(wrong.unwrap_err().to_string().ends_with("did you mean `spp`?"));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// As [`load`].
pub fn from_str(
    text: &str,
    path: &Path,
    overrides: &[String],
    loader: &Loader<'_>,
) -> Result<LoadedScene> {
    let file = read::toml_changed(path, text, &[], overrides, Wanted::Scene)?;
    LoadedScene::new(file, path, loader)
}

impl LoadedScene {
    /// Checks a file and resolves `model = "auto"`.
    ///
    /// # Errors
    /// As [`load`].
    pub fn new(mut file: SceneFile, path: &Path, loader: &Loader<'_>) -> Result<LoadedScene> {
        file.render
            .check()
            .map_err(|why| InputError::keyed(format!("render.{why}")).in_file(path))?;
        scene_build::check(&file, path, loader)?;
        let chosen = auto::resolve(&mut file, path, loader)?;
        Ok(LoadedScene {
            file,
            path: path.to_owned(),
            chosen,
        })
    }

    /// Builds everything that the file describes, within `max_memory_bytes`, or what
    /// is free if none. A scene without a camera gets that of a goniometer.
    ///
    /// # Errors
    /// Names the file and key at fault.
    pub fn build(&self, max_memory_bytes: Option<u64>, loader: &Loader<'_>) -> Result<Scene> {
        let options = BuildOptions {
            scene_path: &self.path,
            loader,
            max_memory_bytes,
        };
        scene_build::scene(&self.file, &options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loader::Event;
    use organza_basis::unwatched;
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// A scene in the folder of the project's fabrics.
    fn loaded(text: &str, loader: &Loader<'_>) -> Result<LoadedScene> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/fabrics/");
        from_str(text, &Path::new(folder).join("in_memory.toml"), &[], loader)
    }

    fn cloth(keys: &str) -> String {
        format!("[[object]]\nkind = 'cloth'\nfabric = 'organza.toml'\n{keys}")
    }

    #[test]
    fn a_scene_without_a_camera_is_shown_at_its_finest() {
        let loader = Loader::new();
        let scene = loaded(&cloth("voxel_um = 40.0"), &loader).unwrap();
        assert!(scene.file.camera(&scene.path).is_err());
        assert_eq!(scene.build(None, &loader).unwrap().media.len(), 1);
        let inputs = loader.inputs();
        assert!(inputs[0].path.ends_with("organza.toml"), "{inputs:?}");
        let auto = loaded(&cloth("model = 'auto'"), &loader).unwrap_err();
        assert!(auto.to_string().contains("add a [camera]"), "{auto}");
    }

    #[test]
    fn a_build_stops_when_it_is_told_to() {
        let (told, warned) = (AtomicU32::new(0), AtomicU32::new(0));
        let stop = |event: Event<'_>| match event {
            Event::Done(_) => {
                told.fetch_add(1, Ordering::Relaxed);
                ControlFlow::Break(())
            }
            Event::Warning(_) => unwatched(warned.fetch_add(1, Ordering::Relaxed)),
            _ => ControlFlow::Continue(()),
        };
        let loader = Loader::watched(&stop);
        // Fibres for packing factors are gathered after the voxels, and a warning says where
        // memory does not suffice for them; a stop is none of that.
        for model in ["microflake", "packed", "plies", "fibres"] {
            let text = cloth(&format!("voxel_um = 40.0\nmodel = '{model}'"));
            let scene = loaded(&text, &loader).unwrap();
            let before = told.load(Ordering::Relaxed);
            let why = scene.build(None, &loader).err().unwrap().to_string();
            assert!(why.ends_with("stopped"), "{model}: {why}");
            assert!(loader.is_stopped() && told.load(Ordering::Relaxed) > before);
        }
        assert_eq!(warned.into_inner(), 0);
    }

    #[test]
    fn a_file_that_was_given_takes_the_place_of_one_on_the_disk() {
        let path = Path::new("no/such/folder/scene.toml");
        let text = "[[object]]\nkind = 'cloth'\nfabric = 'a.toml'\nvoxel_um = 60.0";
        let fabric = |per_cm: &str| {
            format!(
                "[draft]\nwif = 'a.wif'\n[warp]\nper_cm = {per_cm}\n[weft]\nper_cm = 20.0\n\
                 [yarn.cotton]\ntex = 20.0"
            )
        };
        let wif = "[WIF]\n[WARP]\nThreads=2\n[WEFT]\nThreads=2\n[THREADING]\n1=1\n2=2\n\
                   [LIFTPLAN]\n1=1\n2=2\n";
        let mut loader = Loader::new();
        let missing = from_str(text, path, &[], &loader).unwrap_err();
        assert!(missing.to_string().contains("no such file"), "{missing}");
        loader.give("no/such/folder/a.toml", "[draft]\nweave = 'plain'");
        loader.give("no/such/folder/a.toml", fabric("20.0"));
        loader.give("no/such/folder/a.wif", wif);
        let scene = from_str(text, path, &[], &loader).unwrap();
        scene.build(None, &loader).unwrap();
        loader.give("no/such/folder/a.toml", fabric("'many'"));
        let wrong = scene.build(None, &loader).err().unwrap().to_string();
        // Nobody has seen the lines of a file in memory, so the message names none.
        let expected = "no/such/folder/a.toml: warp.per_cm: expected a number";
        assert!(wrong.starts_with(expected), "{wrong}");
    }
}
