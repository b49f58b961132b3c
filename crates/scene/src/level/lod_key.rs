//! `lod`: the level of detail of a cloth or a volume.

use serde::Deserialize;

/// `lod`: a level, or a name.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(
    untagged,
    expecting = "expected \"auto\", \"volume\", \"surface\" or a level (0 the finest)"
)]
pub enum Lod {
    /// A level of the octree.
    Level(u8),
    /// A name.
    Name(LodName),
}

impl Default for Lod {
    fn default() -> Lod {
        Lod::Name(LodName::Auto)
    }
}

/// `lod`, a name.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum LodName {
    /// What suits the width of each path's pixel, blended.
    Auto,
    /// The finest level.
    Volume,
    /// The fabric's `[surface]`.
    Surface,
}
