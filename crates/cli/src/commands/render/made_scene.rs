//! The scene that a studio makes for what is no scene.

use super::RenderArgs;
use crate::building::watched;
use crate::error::of_option;
use crate::flags::CommonArgs;
use anyhow::Result;
use organza_scene::subject::{self, Making};

/// The flags of a render of the scene that a studio makes for a fabric, a draft or a weave;
/// `None` where a scene is named.
///
/// # Errors
/// There is nothing of this name, or no cloth can be made of it.
pub fn in_studio(args: &RenderArgs) -> Result<Option<RenderArgs>> {
    let (of_scene, of_fabric) = args.studio.overrides(&args.common.set);
    let making = Making {
        studio: args.studio.studio.map(|name| name.0),
        overrides: &of_fabric,
    };
    let made = watched(&args.common, &args.cache, |loader| {
        Ok(subject::scene_for(&args.scene, making, loader)?)
    })?;
    if let (None, true) = (&made, args.studio.fit_yarn) {
        return Err(of_option(
            "fit_yarn",
            format!(
                "{} is a scene; name its fabric, or set fit_yarn = true there",
                args.scene.display()
            ),
        ));
    }
    Ok(made.map(|made| RenderArgs {
        common: CommonArgs {
            set: of_scene,
            host: args.common.host.with_made(made.given()),
            ..args.common.clone()
        },
        scene: made.scene_path,
        ..args.clone()
    }))
}
