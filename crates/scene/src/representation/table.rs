//! A table: the mean BSDF of the cloth, as `organza table` measured it.

use super::{Build, Representation, Tracker};
use crate::far_table;

/// The table beside the fabric.
pub static TABLE: Representation = Representation {
    name: "table",
    title: "the table",
    about: "The measured mean reflectance and transmittance, which organza table makes",
    colour: [0x2f, 0x8f, 0x6f],
    keys: &[],
    trackers: &[Tracker::Woodcock],
    drapes: true,
    is_ready: far_table::is_there,
    check: |fabric, path, loader| far_table::surface(fabric, path, loader).map(|_| ()),
    build: Build::Surface(far_table::surface),
    fitted: None,
};
