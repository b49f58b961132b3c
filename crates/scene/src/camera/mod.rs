//! `[camera]`: its table, and one file for each kind.
//!
//! A new kind is a file here with a [`CameraKind`], which lists the keys of its own, and a
//! line in [`CAMERA_KINDS`].

mod orthographic;
mod own_keys;
mod perspective;
mod thin_lens;

pub use own_keys::{CameraKey, OwnKeys};

use glam::{DVec3, UVec2};
use organza_transport::{Camera, CameraPose, PixelFilter, Projection};
use own_keys::MAX_MM;
use serde::de::{DeserializeSeed, Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::sync::LazyLock;

/// Every kind, the usual one first.
pub static CAMERA_KINDS: [&CameraKind; 3] = [
    &orthographic::ORTHOGRAPHIC,
    &perspective::PERSPECTIVE,
    &thin_lens::THIN_LENS,
];

/// A kind of camera.
pub struct CameraKind {
    /// Its name in files.
    pub name: &'static str,
    /// The keys that belong to it and not to every camera.
    pub keys: &'static [CameraKey],
    /// Its projection; the error is `key: why`.
    pub projection: fn(&CameraTable) -> Result<Projection, String>,
}

impl CameraKind {
    fn has_key(&self, name: &str) -> bool {
        self.keys.iter().any(|key| key.name == name)
    }
}

impl PartialEq for CameraKind {
    fn eq(&self, other: &CameraKind) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for CameraKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// `[camera]`
#[derive(Clone, Debug)]
pub struct CameraTable {
    /// Its projection.
    pub kind: &'static CameraKind,
    /// Where it stands.
    pub origin_mm: [f64; 3],
    /// The point in the middle of the picture.
    pub target_mm: [f64; 3],
    /// The direction that is up in the picture.
    pub up: [f64; 3],
    /// Pixels, width and height.
    pub resolution: [u32; 2],
    /// How samples spread over pixels.
    pub filter: FilterName,
    /// The keys of its kind.
    pub own: OwnKeys,
}

/// The keys that every kind has, in the order of messages: those of the kinds stand
/// between `up` and `resolution`.
const BEFORE: [&str; 4] = ["kind", "origin_mm", "target_mm", "up"];
const AFTER: [&str; 2] = ["resolution", "filter"];

/// The keys of all kinds, each once.
static OWN_KEYS: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
    let mut keys = Vec::new();
    for key in CAMERA_KINDS.iter().flat_map(|kind| kind.keys) {
        if !keys.contains(&key.name) {
            keys.push(key.name);
        }
    }
    keys
});

/// Every key of `[camera]`.
static KEYS: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| [&BEFORE[..], &OWN_KEYS[..], &AFTER[..]].concat());

/// The names of all kinds.
static KIND_NAMES: LazyLock<Vec<&'static str>> =
    LazyLock::new(|| CAMERA_KINDS.iter().map(|kind| kind.name).collect());

impl<'de> Deserialize<'de> for CameraTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<CameraTable, D::Error> {
        struct OneTable;
        impl<'de> Visitor<'de> for OneTable {
            type Value = CameraTable;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("one table in single brackets")
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CameraTable, A::Error> {
                read(map)
            }
        }
        deserializer.deserialize_map(OneTable)
    }
}

fn read<'de, A: MapAccess<'de>>(mut map: A) -> Result<CameraTable, A::Error> {
    let (mut origin_mm, mut target_mm) = (None, None);
    let mut table = CameraTable {
        kind: CAMERA_KINDS[0],
        origin_mm: [0.0; 3],
        target_mm: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        resolution: [512, 512],
        filter: FilterName::default(),
        own: OwnKeys::default(),
    };
    while let Some(key) = map.next_key_seed(KnownKey)? {
        match key {
            "kind" => table.kind = map.next_value::<KindName>()?.0,
            "origin_mm" => origin_mm = Some(map.next_value()?),
            "target_mm" => target_mm = Some(map.next_value()?),
            "up" => table.up = map.next_value()?,
            "resolution" => table.resolution = map.next_value()?,
            "filter" => table.filter = map.next_value()?,
            own => table.own.set(own, map.next_value()?),
        }
    }
    table.origin_mm = origin_mm.ok_or_else(|| A::Error::missing_field("origin_mm"))?;
    table.target_mm = target_mm.ok_or_else(|| A::Error::missing_field("target_mm"))?;
    Ok(table)
}

/// Reads one of [`KEYS`].
struct KnownKey;

impl<'de> DeserializeSeed<'de> for KnownKey {
    type Value = &'static str;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<&'static str, D::Error> {
        let name = String::deserialize(deserializer)?;
        let found = KEYS.iter().find(|key| **key == name);
        found
            .copied()
            .ok_or_else(|| D::Error::unknown_field(&name, &KEYS))
    }
}

/// The value of `kind`.
struct KindName(&'static CameraKind);

impl<'de> Deserialize<'de> for KindName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<KindName, D::Error> {
        let name = String::deserialize(deserializer)?;
        let found = CAMERA_KINDS.into_iter().find(|k| k.name == name);
        found
            .map(KindName)
            .ok_or_else(|| D::Error::unknown_variant(&name, &KIND_NAMES))
    }
}

/// `filter` of a camera.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum FilterName {
    /// Constant over the pixel.
    #[default]
    Box,
    /// Falls linearly to the neighbouring pixels' centres.
    Tent,
    /// A Gaussian of half a pixel.
    Gaussian,
}

impl From<FilterName> for PixelFilter {
    fn from(name: FilterName) -> PixelFilter {
        match name {
            FilterName::Box => PixelFilter::Box,
            FilterName::Tent => PixelFilter::Tent,
            FilterName::Gaussian => PixelFilter::Gaussian,
        }
    }
}

/// Pixels along an edge of a picture at most.
const MAX_PIXELS: u32 = 65_536;

impl CameraTable {
    /// The camera.
    ///
    /// # Errors
    /// `key: why`.
    pub fn build(&self) -> Result<Camera, String> {
        self.check_keys()?;
        self.check_lengths()?;
        let projection = (self.kind.projection)(self)?;
        let pose = CameraPose {
            origin_mm: DVec3::from_array(self.origin_mm),
            target_mm: DVec3::from_array(self.target_mm),
            up: DVec3::from_array(self.up),
        };
        if !(pose.origin_mm.is_finite() && pose.target_mm.is_finite() && pose.up.is_finite()) {
            return Err("origin_mm, target_mm and up must be finite".into());
        }
        let resolution = UVec2::from_array(self.resolution);
        if resolution.max_element() > MAX_PIXELS {
            let [x, y] = self.resolution;
            return Err(format!(
                "resolution: at most {MAX_PIXELS} pixels along an edge, found {x} x {y}"
            ));
        }
        Camera::new(projection, pose, resolution, self.filter.into()).map_err(|e| e.to_string())
    }

    /// Refuses keys that belong to other kinds.
    fn check_keys(&self) -> Result<(), String> {
        let mut given = OWN_KEYS.iter().filter(|key| self.own.get(key).is_some());
        let Some(key) = given.find(|key| !self.kind.has_key(key)) else {
            return Ok(());
        };
        let owners = CAMERA_KINDS.iter().filter(|kind| kind.has_key(key));
        let owners: Vec<String> = owners.map(|kind| format!("{:?}", kind.name)).collect();
        Err(format!("{key} belongs to kind = {}", owners.join(" or ")))
    }

    fn check_lengths(&self) -> Result<(), String> {
        let greatest = |v: [f64; 3]| v.into_iter().map(f64::abs).fold(0.0, f64::max);
        let places = [
            ("origin_mm", greatest(self.origin_mm), MAX_MM),
            ("target_mm", greatest(self.target_mm), MAX_MM),
        ];
        let own = self.kind.keys.iter();
        let own = own.filter_map(|key| Some((key.name, self.own.get(key.name)?, key.max)));
        for (key, found, max) in places.into_iter().chain(own) {
            if found.is_finite() && found > max {
                return Err(format!("{key}: expected at most {max:e}, found {found:e}"));
            }
        }
        Ok(())
    }
}

/// The camera of what is measured and not seen. Its pixels have no width, so that
/// everything is shown at its finest.
///
/// # Errors
/// None: its numbers are valid, which a test checks.
pub fn of_a_goniometer() -> Result<Camera, String> {
    let pose = CameraPose {
        origin_mm: DVec3::Z,
        target_mm: DVec3::ZERO,
        up: DVec3::Y,
    };
    let projection = Projection::Orthographic { width_mm: 1e-9 };
    Camera::new(projection, pose, UVec2::ONE, PixelFilter::Box).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(more: &str) -> CameraTable {
        let common = "origin_mm = [0.0, 0.0, 5.0]\ntarget_mm = [0.0, 0.0, 0.0]\n";
        toml::from_str(&format!("{common}{more}")).unwrap()
    }

    #[test]
    fn every_kind_is_built_and_refuses_keys_of_others() {
        for (keys, kind) in [
            ("width_mm = 1.0", "orthographic"),
            ("kind = 'perspective'\nfov_deg = 30.0", "perspective"),
            (
                "kind = 'thin-lens'\nfov_deg = 30.0\nf_number = 2.8",
                "thin-lens",
            ),
        ] {
            let table = table(keys);
            assert_eq!(table.kind.name, kind);
            assert!(table.build().is_ok(), "{keys}");
        }
        let wrong = table("width_mm = 1.0\nfov_deg = 30.0").build().unwrap_err();
        let words = "fov_deg belongs to kind = \"perspective\" or \"thin-lens\"";
        assert_eq!(wrong, words);
        let huge = table("width_mm = 1e308").build().unwrap_err();
        assert!(
            huge.starts_with("width_mm: expected at most 1e12"),
            "{huge}"
        );
        assert!(of_a_goniometer().is_ok());
    }
}
