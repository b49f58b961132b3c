//! The scene that a studio makes for what is no scene.

use super::{Render, RenderJob};
use crate::studio;
use anyhow::Result;
use organza_scene::subject::{self, Making};
use organza_work::building::watched;

/// A render of the scene that a studio makes for a fabric, a draft or a weave; `None` where a scene is
/// named.
///
/// # Errors
/// There is nothing of this name, or no cloth can be made of it.
pub fn in_studio(args: &RenderJob) -> Result<Option<RenderJob>> {
    let (of_scene, of_fabric) = studio::overrides(&args.set, args.fit_yarn);
    let making = Making {
        studio: args.studio.map(|name| name.0),
        overrides: &of_fabric,
    };
    let made = watched(&args.context, |loader| {
        Ok(subject::scene_for(&args.scene, making, loader)?)
    })?;
    if let (None, true) = (&made, args.fit_yarn) {
        let why = "is a scene; name its fabric, or set fit_yarn = true there";
        let scene = args.scene.display();
        return Err(organza_work::of_option(
            "fit_yarn",
            format!("{scene} {why}"),
        ));
    }
    Ok(made.map(|made| RenderJob {
        context: args.context.with_made(made.given()),
        request: Render {
            set: of_scene,
            scene: made.scene_path,
            ..args.request.clone()
        },
    }))
}
