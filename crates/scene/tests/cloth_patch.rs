//! A patch of cloth as a representation shows it.

use organza_scene::fabric_file::Fabric;
use organza_scene::loader::Loader;
use organza_scene::patches::{AnyPatch, PatchModel, PatchOptions, fabric_patch};
use organza_scene::representation::Representation;
use std::path::Path;

/// The finest level of the endless cloth of a fabric.
pub fn cloth_patch(fabric: &Fabric, path: &Path, model: &str, loader: &Loader<'_>) -> AnyPatch {
    let representation = Representation::named(model).unwrap();
    let shown = PatchModel::Is(representation).of(fabric, path).unwrap();
    let options = PatchOptions {
        loader,
        voxel_um: None,
        level: 0,
        max_memory_bytes: None,
    };
    fabric_patch(fabric, path, shown, &options).unwrap()
}
