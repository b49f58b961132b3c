//! Scenes that are built: matter is kept while what it was made from stays the same, and
//! camera and lights are changed in its place.

use crate::document::Document;
use crate::news::Shown;
use organza_scene::level::{Lod, LodName};
use organza_scene::loader::Loader;
use organza_scene::object::ObjectTable;
use organza_scene::representation::ModelKey;
use organza_scene::scene_file::{IntegratorName, SceneFile};
use organza_scene::{InputError, LoadedScene, light_pictures, scene_build};
use organza_transport::Scene;

/// Scenes that are kept beside the one that is shown.
const MAX_KEPT: usize = 2;

/// A scene with what it was made from.
pub struct Matter {
    /// Its file, where `auto` is replaced by what was chosen.
    pub file: SceneFile,
    /// The scene.
    pub scene: Scene,
    /// What its cloths are shown as.
    pub shown: Vec<Shown>,
    /// What reading and building it warned of.
    pub warnings: Vec<String>,
    /// See [`Document::matter_text`].
    text: String,
    /// What was made of it: choices of `auto`, and the camera where it decides on levels.
    made: String,
    /// See [`Document::light_text`].
    lights: String,
}

/// The scenes that are built, the newest last.
#[derive(Default)]
pub struct Built(Vec<Matter>);

impl Built {
    /// The newest scene, seen by the camera and under the lights of a document, if its
    /// matter is that of the document: perhaps at other levels than the camera needs.
    ///
    /// # Errors
    /// Those of lights and camera.
    pub fn nearly(
        &mut self,
        document: &Document,
        file: &SceneFile,
        loader: &Loader<'_>,
    ) -> Result<Option<&mut Matter>, InputError> {
        let text = document.matter_text();
        match self.0.last_mut().filter(|matter| matter.text == text) {
            Some(matter) => {
                matter.look(document, file, loader)?;
                Ok(Some(matter))
            }
            None => Ok(None),
        }
    }

    /// The scene of a document, built if it is not kept. With `max_memory_bytes` no other
    /// scene is kept while it is built.
    ///
    /// # Errors
    /// Names the file and the key at fault.
    pub fn exactly(
        &mut self,
        document: &Document,
        file: SceneFile,
        max_memory_bytes: Option<u64>,
        limit_bytes: u64,
        loader: &Loader<'_>,
    ) -> Result<&mut Matter, InputError> {
        let text = document.matter_text();
        let loaded = LoadedScene::new(file, &document.scene_path, loader)?;
        let made = made(document, &loaded);
        if let Some(at) = self.0.iter().position(|m| m.text == text && m.made == made) {
            let mut matter = self.0.remove(at);
            matter.look(document, &loaded.file, loader)?;
            matter.file = loaded.file;
            self.0.push(matter);
        } else {
            match max_memory_bytes {
                Some(_) => self.0.clear(),
                None if self.0.len() >= MAX_KEPT => drop(self.0.remove(0)),
                None => {}
            }
            let scene = match loaded.build(Some(limit_bytes), loader) {
                // Memory that kept scenes take may be all that is missing.
                Err(_) if !self.0.is_empty() && !loader.is_stopped() => {
                    self.0.clear();
                    let free = organza_scene::memory::free_memory_bytes();
                    loaded.build(Some(limit_bytes.max(free)), loader)?
                }
                built => built?,
            };
            let warnings = loader.warnings();
            self.0.push(Matter {
                scene,
                shown: shown(document, &loaded),
                warnings: warnings
                    .iter()
                    .map(|w| document.in_words(&w.to_string()))
                    .collect(),
                text,
                made,
                lights: document.light_text(),
                file: loaded.file,
            });
        }
        self.0
            .last_mut()
            .ok_or_else(|| InputError::new("no scene was built"))
    }
}

impl Matter {
    /// Takes camera and lights of a document.
    fn look(
        &mut self,
        document: &Document,
        file: &SceneFile,
        loader: &Loader<'_>,
    ) -> Result<(), InputError> {
        let path = &document.scene_path;
        self.scene.camera = scene_build::camera(file, path)?;
        let lights = document.light_text();
        if lights != self.lights {
            self.scene.lights = light_pictures::lights(&file.light, path, None, loader)?;
            self.lights = lights;
        }
        Ok(())
    }
}

/// What was decided about the matter of a scene beside its text.
fn made(document: &Document, loaded: &LoadedScene) -> String {
    let mut made: String = loaded
        .chosen
        .iter()
        .map(|c| format!("{};", c.what))
        .collect();
    if loaded.file.object.iter().any(has_levels) {
        // Levels are laid out for the widths of the camera's pixels.
        made.extend(document.scene.get("camera").map(ToString::to_string));
    }
    made
}

/// Whether a camera decides which levels of an object are built.
fn has_levels(object: &ObjectTable) -> bool {
    let by_camera = |lod: Lod| lod == Lod::Name(LodName::Auto);
    match object {
        ObjectTable::Cloth(cloth) => {
            let without = |key: &ModelKey| match key {
                ModelKey::Is(model) => model.voxels().is_none(),
                _ => false,
            };
            by_camera(cloth.lod) && !cloth.model.as_ref().is_some_and(without)
        }
        ObjectTable::Volume(_) => true,
        ObjectTable::Plane(_) | ObjectTable::Grid(_) => false,
    }
}

/// What the cloths of a scene are shown as.
fn shown(document: &Document, loaded: &LoadedScene) -> Vec<Shown> {
    let one = |(object, table): (usize, &ObjectTable)| {
        let chosen = loaded.chosen.iter().find(|c| c.object == object);
        if let Some(chosen) = chosen {
            return Some(Shown {
                object,
                what: chosen.what.clone(),
                why: Some(chosen.why.clone()),
            });
        }
        let ObjectTable::Cloth(cloth) = table else {
            return None;
        };
        let own = document.fabric_named(&cloth.fabric);
        let own = own.and_then(|i| document.fabrics.get(i)?.read().ok());
        let own = own.map(|fabric| fabric.scattering).unwrap_or_default();
        let model = match cloth.scattering().over(own) {
            _ if loaded.file.render.integrator == IntegratorName::Fibres => "explicit fibres",
            Ok(shown) => shown.representation.title,
            Err(_) => return None,
        };
        let lod = match cloth.lod {
            Lod::Level(level) => format!(", level {level}"),
            Lod::Name(LodName::Surface) => ", as a surface".into(),
            Lod::Name(_) => String::new(),
        };
        Some(Shown {
            object,
            what: model.to_owned() + &lod,
            why: None,
        })
    };
    let objects = loaded.file.object.iter().enumerate();
    objects.filter_map(one).collect()
}
