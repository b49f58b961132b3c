//! `[camera]`: its table, and one file for each kind.
//!
//! A new kind is a file here with a [`CameraKind`] and a line in [`CAMERA_KINDS`];
//! keys of its own are fields of [`CameraTable`], which names in one message all the
//! keys there are.

mod orthographic;
mod perspective;
mod thin_lens;

use glam::{DVec3, UVec2};
use organza_transport::{Camera, CameraPose, PixelFilter, Projection};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;

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
    pub keys: &'static [&'static str],
    /// Its projection; the error is `key: why`.
    pub projection: fn(&CameraTable) -> Result<Projection, String>,
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
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraTable {
    /// Its projection.
    #[serde(default = "usual", deserialize_with = "kind")]
    pub kind: &'static CameraKind,
    /// Where it stands.
    pub origin_mm: [f64; 3],
    /// The point in the middle of the picture.
    pub target_mm: [f64; 3],
    /// The direction that is up in the picture.
    #[serde(default = "up")]
    pub up: [f64; 3],
    /// Orthographic: width of the picture on the film plane.
    pub width_mm: Option<f64>,
    /// Perspective and thin lens: horizontal angle of view.
    pub fov_deg: Option<f64>,
    /// Thin lens: its diameter; or `f_number`.
    pub aperture_mm: Option<f64>,
    /// Thin lens: focal length over diameter, the former from `fov_deg`,
    /// `focus_mm` and `sensor_width_mm`.
    pub f_number: Option<f64>,
    /// Thin lens: distance in focus along the axis; that of the target if none.
    pub focus_mm: Option<f64>,
    /// With `f_number`: width of the sensor, 36 if none.
    pub sensor_width_mm: Option<f64>,
    /// Pixels, width and height.
    #[serde(default = "resolution")]
    pub resolution: [u32; 2],
    /// How samples spread over pixels.
    #[serde(default)]
    pub filter: FilterName,
}

fn usual() -> &'static CameraKind {
    CAMERA_KINDS[0]
}

fn kind<'de, D: Deserializer<'de>>(deserializer: D) -> Result<&'static CameraKind, D::Error> {
    let name = String::deserialize(deserializer)?;
    let found = CAMERA_KINDS.into_iter().find(|k| k.name == name);
    found.ok_or_else(|| {
        let names = CAMERA_KINDS.map(|k| format!("`{}`", k.name)).join(", ");
        D::Error::custom(format!("unknown variant `{name}`, expected one of {names}"))
    })
}

/// A camera that is one table: a list of tables is no camera.
pub(crate) fn one_table<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<CameraTable>, D::Error> {
    struct OneTable;
    impl<'de> Visitor<'de> for OneTable {
        type Value = CameraTable;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("one table in single brackets")
        }
        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<CameraTable, A::Error> {
            CameraTable::deserialize(MapAccessDeserializer::new(map))
        }
    }
    deserializer.deserialize_map(OneTable).map(Some)
}

fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn resolution() -> [u32; 2] {
    [512, 512]
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

/// The largest length of a camera, mm: rays start in `f64`, whose steps are there
/// 1.2e-4 mm wide, a fiftieth of a fibre.
const MAX_MM: f64 = 1e12;

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
        let given = [
            ("width_mm", self.width_mm.is_some()),
            ("fov_deg", self.fov_deg.is_some()),
            ("aperture_mm", self.aperture_mm.is_some()),
            ("f_number", self.f_number.is_some()),
            ("focus_mm", self.focus_mm.is_some()),
            ("sensor_width_mm", self.sensor_width_mm.is_some()),
        ];
        let is_foreign = |k: &&(&str, bool)| k.1 && !self.kind.keys.contains(&k.0);
        let Some((key, _)) = given.iter().find(is_foreign) else {
            return Ok(());
        };
        let owners = CAMERA_KINDS.iter().filter(|k| k.keys.contains(key));
        let owners: Vec<String> = owners.map(|k| format!("{:?}", k.name)).collect();
        Err(format!("{key} belongs to kind = {}", owners.join(" or ")))
    }

    fn check_lengths(&self) -> Result<(), String> {
        let greatest = |v: [f64; 3]| Some(v.into_iter().map(f64::abs).fold(0.0, f64::max));
        for (key, length) in [
            ("origin_mm", greatest(self.origin_mm)),
            ("target_mm", greatest(self.target_mm)),
            ("width_mm", self.width_mm),
            ("aperture_mm", self.aperture_mm),
            ("focus_mm", self.focus_mm),
            ("sensor_width_mm", self.sensor_width_mm),
            ("f_number", self.f_number),
        ] {
            if let Some(found) = length.filter(|l| l.is_finite() && *l > MAX_MM) {
                return Err(format!(
                    "{key}: expected at most {MAX_MM:e}, found {found:e}"
                ));
            }
        }
        Ok(())
    }

    /// The horizontal angle of view of the kinds that have one.
    fn fov_rad(&self) -> Result<f64, String> {
        Ok(self.fov_deg.ok_or("fov_deg is missing")?.to_radians())
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
