//! Explicit fibres: rays are intersected with every fibre of the cloth.

use super::virtual_fibres::FITTED_FIBRES;
use super::{Build, Representation, Tracker};

/// Explicit fibres.
pub static EXPLICIT_FIBRES: Representation = Representation {
    name: "fibres",
    title: "explicit fibres",
    about: "Every fibre of the fabric: the ground truth of the others",
    colour: [0xc2, 0x3b, 0x6b],
    keys: &[],
    trackers: &[Tracker::Kernel, Tracker::Cached, Tracker::Woodcock],
    drapes: true,
    is_ready: |_, _, _| true,
    check: |fabric, path, _| fabric.fibre_models(path).map(|_| ()),
    build: Build::ExplicitFibres(|fabric, path, max_memory_bytes, loader| {
        fabric.explicit_fibres(path, max_memory_bytes, loader)
    }),
    fitted: Some(&FITTED_FIBRES),
};
