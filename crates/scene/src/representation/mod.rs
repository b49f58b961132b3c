//! The ways to show a cloth, one file each: [`REPRESENTATIONS`] lists them.
//!
//! A new representation is a file here with a [`Representation`] and a line in
//! [`REPRESENTATIONS`]. Scene and fabric files, flags, `auto`, measurements, fits,
//! benches and reports take the representations from that list.

mod explicit_fibres;
mod microflake;
mod packed;
mod plain;
pub(crate) mod plies;
mod surface;
mod table;
mod virtual_fibres;

pub use explicit_fibres::EXPLICIT_FIBRES;
pub use microflake::MICROFLAKE;
pub use packed::PACKED;
pub use plain::PLAIN;
pub use plies::PLIES;
pub use surface::SURFACE;
pub use table::TABLE;

use crate::error::Result;
use crate::fabric_file::Fabric;
use crate::loader::Loader;
use organza_scatter::FlakeFamily;
use organza_surface::ClothSurface;
use organza_transport::{AnyMedium, ExplicitFibres, Plies, Switch};
use organza_volume::{FibreFootprint, Octree};
use organza_weave::Material;
use serde::de::{Error as _, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::path::Path;
use std::sync::{Arc, LazyLock};

/// Every representation.
pub static REPRESENTATIONS: [&Representation; 7] = [
    &EXPLICIT_FIBRES,
    &PLIES,
    &PACKED,
    &PLAIN,
    &MICROFLAKE,
    &TABLE,
    &SURFACE,
];

/// A way to show a cloth.
pub struct Representation {
    /// Its name in files, flags and reports.
    pub name: &'static str,
    /// Its name in sentences.
    pub title: &'static str,
    /// What it is, in one line.
    pub about: &'static str,
    /// sRGB colour in plots.
    pub colour: [u8; 3],
    /// Keys of a cloth that belong to it and not to every representation.
    pub keys: &'static [&'static str],
    /// The trackers that can render a scene of nothing else, in the order in which
    /// `render` takes them.
    pub trackers: &'static [Tracker],
    /// Whether it can lie over a mesh.
    pub drapes: bool,
    /// Whether a fabric, with the files beside it, has what it needs, as far as that can be
    /// told without reading them.
    pub is_ready: fn(&Fabric, &Path, &Loader<'_>) -> bool,
    /// Refuses a fabric that lacks what it needs.
    pub check: fn(&Fabric, &Path, &Loader<'_>) -> Result<()>,
    /// How it is built.
    pub build: Build,
    /// The optics that a fit changes; `None` for what has no fibres.
    pub fitted: Option<&'static FittedOptics>,
}

/// How a representation is built from a fabric.
pub enum Build {
    /// From its fibres, without voxels.
    ExplicitFibres(fn(&Fabric, &Path, Option<u64>, &Loader<'_>) -> Result<ExplicitFibres>),
    /// From its plies, without voxels.
    Plies(fn(&Fabric, &Path, Option<u64>, &Loader<'_>) -> Result<Plies>),
    /// From an octree of its fibres.
    Voxels(VoxelBuild),
    /// As a surface.
    Surface(fn(&Fabric, &Path, &Loader<'_>) -> Result<ClothSurface>),
}

/// How a representation is built from an octree.
pub struct VoxelBuild {
    /// Where the octree holds the length of thick fibres.
    pub footprint: FibreFootprint,
    /// The finest level that suits it.
    pub finest_level: fn(&Octree, &[Material]) -> u8,
    /// One level as a medium; `None` when there is no such level.
    pub medium: fn(&VoxelSource<'_>) -> Result<Option<AnyMedium>>,
}

/// What a medium is made of.
pub struct VoxelSource<'a> {
    /// The fabric.
    pub fabric: &'a Fabric,
    /// Its file.
    pub path: &'a Path,
    /// Its voxels.
    pub octree: Arc<Octree>,
    /// Level of detail, 0 the finest.
    pub level: u8,
    /// The settings of the representation's own keys.
    pub settings: Settings,
    /// Limit on memory; what is free if none.
    pub max_memory_bytes: Option<u64>,
    /// Reports progress.
    pub loader: &'a Loader<'a>,
}

/// Values of the keys that belong to single representations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// `flake`: the family of micro-flakes.
    pub flake: FlakeFamily,
    /// `local_visibility`: direct light of the first event sees what stands in its
    /// way within two voxels, as counted from the fibres.
    pub local_visibility: bool,
    /// `first_events`, `while_weight`: when a path changes from explicit fibres to
    /// packed ones.
    pub packed_from: PackedFrom,
}

/// When a path changes from explicit fibres to packed ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PackedFrom {
    /// So many events are with explicit fibres.
    pub first_events: Option<u32>,
    /// Events are with explicit fibres while the path carries at least so much, a share of
    /// what it began with.
    pub while_weight: Option<f32>,
}

impl PackedFrom {
    /// In terms of the media; `None` where packed fibres are met from the camera on.
    pub(crate) fn switch(&self) -> Option<Switch> {
        let switch = Switch {
            first_events: self.first_events.unwrap_or(0),
            while_weight: self.while_weight.unwrap_or(f32::INFINITY),
        };
        (!switch.is_over(0, 1.0)).then_some(switch)
    }
}

/// The optics that a fit changes.
#[derive(Debug)]
pub struct FittedOptics {
    /// The key of the roughness, below `optics.YARN`.
    pub roughness: &'static str,
    /// Its range in a fit.
    pub range: [f64; 2],
    /// Where a fit starts.
    pub start: f64,
    /// The key of the colour and its value for the colour of a thick heap of fibres,
    /// linear, each channel 0 to 1.
    pub colour: fn([f64; 3]) -> (&'static str, String),
    /// Keys that state the same in other terms; a fit replaces them.
    pub replaced: &'static [&'static str],
}

/// How paths find what they meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tracker {
    /// The vector kernel, many paths at once: delta tracking in voxels, cells of explicit
    /// fibres.
    Kernel,
    /// The vector kernel, whose paths end where light was learned: `render.cache`.
    Cached,
    /// The general walk: delta tracking in voxels, cells of explicit fibres, and surfaces.
    Woodcock,
    /// The general walk with exact stepping through voxels.
    Regular,
}

impl Tracker {
    /// All of them.
    pub const ALL: [Tracker; 4] = [
        Tracker::Kernel,
        Tracker::Cached,
        Tracker::Woodcock,
        Tracker::Regular,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Tracker::Kernel => "kernel",
            Tracker::Cached => "cached",
            Tracker::Woodcock => "woodcock",
            Tracker::Regular => "regular",
        }
    }
}

impl Representation {
    /// The representation of a name.
    pub fn named(name: &str) -> Option<&'static Representation> {
        REPRESENTATIONS.into_iter().find(|r| r.name == name)
    }

    /// Its voxels, if it has any.
    pub fn voxels(&self) -> Option<&VoxelBuild> {
        match &self.build {
            Build::Voxels(voxels) => Some(voxels),
            Build::ExplicitFibres(_) | Build::Plies(_) | Build::Surface(_) => None,
        }
    }

    /// Whether a key of a cloth has a meaning for it.
    pub fn has_key(&self, key: &str) -> bool {
        self.keys.contains(&key)
    }
}

/// What `key` belongs to, as files name it.
pub(crate) fn owners(key: &str) -> String {
    let owners = REPRESENTATIONS.iter().filter(|r| r.has_key(key));
    let names: Vec<String> = owners.map(|r| format!("{:?}", r.name)).collect();
    format!("model = {}", names.join(" or "))
}

impl PartialEq for Representation {
    fn eq(&self, other: &Representation) -> bool {
        self.name == other.name
    }
}

impl Eq for Representation {}

impl fmt::Debug for Representation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl Serialize for Representation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
    }
}

impl<'de> Deserialize<'de> for &'static Representation {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;
        impl Visitor<'_> for Name {
            type Value = &'static Representation;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a representation")
            }
            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Self::Value, E> {
                Representation::named(name).ok_or_else(|| E::unknown_variant(name, &NAMES))
            }
        }
        deserializer.deserialize_str(Name)
    }
}

/// The names of all representations.
static NAMES: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| REPRESENTATIONS.iter().map(|r| r.name).collect());

/// The values of `model`.
static MODELS: LazyLock<Vec<&'static str>> = LazyLock::new(|| [&NAMES[..], &["auto"]].concat());

/// `model` of a cloth or of `[scattering]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelKey {
    /// A representation.
    Is(&'static Representation),
    /// What suits the camera and the lights, as measured by `organza bench`.
    Auto,
}

impl<'de> Deserialize<'de> for ModelKey {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<ModelKey, D::Error> {
        let name = String::deserialize(deserializer)?;
        match (name.as_str(), Representation::named(&name)) {
            (_, Some(representation)) => Ok(ModelKey::Is(representation)),
            ("auto", _) => Ok(ModelKey::Auto),
            // The name of the model rather than of how its fibres are packed.
            ("virtual-scattering", _) => Ok(ModelKey::Is(&PACKED)),
            _ => Err(D::Error::unknown_variant(&name, &MODELS)),
        }
    }
}

/// A representation with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShownAs {
    /// The representation.
    pub representation: &'static Representation,
    /// Values of its own keys.
    pub settings: Settings,
}

impl ShownAs {
    /// A representation with settings by default.
    pub fn usual(representation: &'static Representation) -> ShownAs {
        ShownAs {
            representation,
            settings: Settings::default(),
        }
    }
}

impl fmt::Display for ShownAs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.representation.name)?;
        if self.representation.has_key("flake") {
            write!(f, ", {}", self.settings.flake.name())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_survive_files() {
        for (i, one) in REPRESENTATIONS.iter().enumerate() {
            assert!(REPRESENTATIONS[..i].iter().all(|other| other != one));
            assert_eq!(Representation::named(one.name), Some(*one));
            assert!(!one.trackers.is_empty(), "{one:?}");
            let value = toml::Value::String(one.name.into());
            assert_eq!(value.clone().try_into(), Ok(ModelKey::Is(one)));
            assert_eq!(value.try_into::<&'static Representation>(), Ok(*one));
        }
        let wrong = toml::Value::String("packd".into()).try_into::<ModelKey>();
        let words = wrong.unwrap_err().to_string();
        assert!(words.starts_with("unknown variant `packd`, expected one of `fibres`, `plies`"));
    }
}
