//! What a page shows and changes: a scene, and the fabrics that it names, as TOML that keeps
//! its comments.

use organza_scene::InputError;
use organza_scene::fabric_file::FabricFile;
use organza_scene::file_kind::Wanted;
use organza_scene::loader::{Loader, OnEvent};
use organza_scene::read::{self, beside};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml_edit::DocumentMut;

/// A scene with its fabrics.
#[derive(Clone, Debug)]
pub struct Document {
    /// The folder that pages may read drafts from and save to.
    pub folder: PathBuf,
    /// Where the scene is, or would be: paths inside are relative to its folder.
    pub scene_path: PathBuf,
    /// The scene.
    pub scene: DocumentMut,
    /// The fabrics that cloths of the scene name, each once.
    pub fabrics: Vec<FabricDocument>,
}

/// A fabric of a [`Document`].
#[derive(Clone, Debug)]
pub struct FabricDocument {
    /// Its name in the scene.
    pub name: String,
    /// Where it is, or would be.
    pub path: PathBuf,
    /// Its text.
    pub text: DocumentMut,
    /// A draft that is on no disk: its name in the text, and its bytes.
    pub dropped: Option<(String, Arc<[u8]>)>,
    /// Whether no file holds this text.
    pub is_changed: bool,
}

impl Document {
    /// A loader that reads the fabrics as they are here.
    pub fn loader<'p>(&self, on_event: Option<OnEvent<'p>>) -> Loader<'p> {
        let mut loader = on_event.map_or_else(Loader::new, Loader::watched);
        for fabric in &self.fabrics {
            loader.give(fabric.path.clone(), fabric.text.to_string());
            if let Some((name, bytes)) = &fabric.dropped {
                loader.give(beside(&fabric.path, name), bytes.to_vec());
            }
        }
        loader
    }

    /// The fabric that the scene calls so.
    pub fn fabric_named(&self, name: &str) -> Option<usize> {
        self.fabrics.iter().position(|fabric| fabric.name == name)
    }

    /// All that the matter of the scene is made from, as text: where it is the same, the
    /// matter is.
    pub fn matter_text(&self) -> String {
        let list = |key: &str| self.scene.get(key).map(ToString::to_string);
        let mut text = list("object").unwrap_or_default();
        // The integrator can turn every cloth into explicit fibres.
        let integrator = self.scene.get("render").and_then(|r| r.get("integrator"));
        text.extend(integrator.map(ToString::to_string));
        for fabric in &self.fabrics {
            text.push('\0');
            text.push_str(&fabric.text.to_string());
            if let Some((_, bytes)) = &fabric.dropped {
                text.push_str(&String::from_utf8_lossy(bytes));
            }
        }
        text
    }

    /// The tables of all lights, as text.
    pub fn light_text(&self) -> String {
        self.scene
            .get("light")
            .map(ToString::to_string)
            .unwrap_or_default()
    }

    /// A message with names as pages show them: without the folder.
    pub fn in_words(&self, message: &str) -> String {
        message.replace(&format!("{}/", self.folder.display()), "")
    }

    /// The name of the scene's file.
    pub fn title(&self) -> String {
        file_name(&self.scene_path)
    }
}

impl FabricDocument {
    /// The fabric's keys.
    ///
    /// # Errors
    /// Names the place and the key at fault.
    pub fn read(&self) -> Result<FabricFile, InputError> {
        let text = self.text.to_string();
        read::toml_changed(&self.path, &text, &[], &[], Wanted::Fabric)
    }
}

/// The last part of a path.
pub(crate) fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}
