//! Flags on the scene that is made for a cloth.

use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use organza_scene::studio::Studio;
use std::sync::LazyLock;

/// How a fabric, a draft or a weave is shown.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct StudioArgs {
    /// Camera and lights for a fabric, a draft or a weave [default: swatch]; a scene has its own
    #[arg(long, value_name = "STUDIO", value_enum)]
    pub studio: Option<StudioName>,
    /// Make yarns that the threads have no room for finer until they fit
    #[arg(long)]
    pub fit_yarn: bool,
}

/// A studio, as `--studio` names it.
#[derive(Clone, Copy, Debug)]
pub struct StudioName(pub Studio);

impl ValueEnum for StudioName {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<StudioName>> =
            LazyLock::new(|| Studio::ALL.map(|(studio, ..)| StudioName(studio)).to_vec());
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let about = Studio::ALL.iter().find(|(studio, ..)| *studio == self.0);
        about.map(|(_, name, help)| PossibleValue::new(*name).help(*help))
    }
}

/// Top-level keys of scenes: other overrides are a fabric's.
const SCENE_KEYS: [&str; 4] = ["render", "camera", "light", "object"];

impl StudioArgs {
    /// Overrides of a made scene and of its fabric.
    pub fn overrides(&self, set: &[String]) -> (Vec<String>, Vec<String>) {
        let of_scene = |set: &&String| {
            let key = set.split(['.', '=']).next().unwrap_or_default();
            SCENE_KEYS.contains(&key.trim())
        };
        let (scene, mut fabric): (Vec<_>, Vec<_>) = set.iter().partition(of_scene);
        let fit = "fit_yarn=true".to_owned();
        if self.fit_yarn {
            fabric.push(&fit);
        }
        let owned = |list: Vec<&String>| list.into_iter().cloned().collect();
        (owned(scene), owned(fabric))
    }
}
