//! Help texts of `--set`, which overrides keys of whatever file a command
//! reads. Most commands read a fabric, as the flag's own help says.

/// For commands that read a scene.
pub const SCENE: &str = "Override any key of the scene file, e.g. --set render.seed=7 or --set object.0.fabric=my.toml (repeatable)";

/// For commands that read either.
pub const FABRIC_OR_SCENE: &str = "Override any key of the fabric or scene file, e.g. --set warp.per_cm=30 for a fabric, --set render.seed=7 for a scene (repeatable)";
