//! The scene that is made for a cloth.

use clap::ValueEnum;
use clap::builder::PossibleValue;
use organza_scene::studio::Studio;
use std::sync::LazyLock;

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

/// Overrides of a made scene and of its fabric, whose yarns are to fit or not.
pub fn overrides(set: &[String], fit_yarn: bool) -> (Vec<String>, Vec<String>) {
    let of_scene = |set: &String| {
        let key = set.split(['.', '=']).next().unwrap_or_default();
        SCENE_KEYS.contains(&key.trim())
    };
    let (scene, mut fabric): (Vec<_>, Vec<_>) = set.iter().cloned().partition(of_scene);
    fabric.extend(fit_yarn.then(|| "fit_yarn=true".to_owned()));
    (scene, fabric)
}
