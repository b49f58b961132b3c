//! A surface: the fabric's `[surface]` section, at every distance.

use super::{Build, Representation, Tracker};

/// The surface model of the fabric.
pub static SURFACE: Representation = Representation {
    name: "surface",
    title: "the surface model",
    about: "The reflectance model of the fabric's [surface] section",
    colour: [0xd9, 0x70, 0x1a],
    keys: &[],
    trackers: &[Tracker::Woodcock],
    drapes: true,
    is_ready: |fabric, _, _| fabric.file.surface.is_some(),
    check: |fabric, path, _| fabric.surface(path).map(|_| ()),
    build: Build::Surface(|fabric, path, _| fabric.surface(path)),
    fitted: None,
};
