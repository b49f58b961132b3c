//! The scene file, as written in TOML.

use crate::error::Result;
use crate::file_kind::Wanted;
use crate::loader::Loader;
use crate::optics::OpticsFile;
use crate::read;
use crate::representation::ModelKey;
use crate::scattering::{EventName, ScatteringTable};
use crate::volume_object::VolumeTable;
use organza_light::LightTable;
use organza_scatter::FlakeFamily;
use organza_transport::Integrator;
use serde::Deserialize;
use std::path::Path;

/// Whether a file is a scene and no fabric: whichever top-level keys it has.
///
/// # Errors
/// Says what a file is that can be neither.
pub fn is_scene(path: &Path) -> Result<bool> {
    let text = read::text_of(path, Wanted::Either)?;
    Wanted::Either.check(path, &text)?;
    let table = toml::from_str::<toml::Table>(&text);
    Ok(table.is_ok_and(|t| t.contains_key("camera") || t.contains_key("object")))
}

/// Reads a scene file, with `key.path=value` overrides.
///
/// # Errors
/// Says what a file of another kind is, and as [`read::toml_changed`].
pub fn load(path: &Path, overrides: &[String], loader: &Loader<'_>) -> Result<SceneFile> {
    loader.toml_of(path, overrides, Wanted::Scene)
}

/// A whole scene file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// How to trace.
    #[serde(default)]
    pub render: RenderTable,
    /// The camera.
    pub camera: CameraTable,
    /// Lights, at least one if the picture is not to be black.
    #[serde(default)]
    pub light: Vec<LightTable>,
    /// Objects.
    #[serde(default)]
    pub object: Vec<ObjectTable>,
}

/// `[render]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RenderTable {
    /// How paths find their way.
    pub integrator: IntegratorName,
    /// Samples of a pixel.
    pub spp: u32,
    /// Scattering events of a path at most; no limit if none.
    pub max_bounces: Option<u32>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Stops of exposure for pictures that are not linear.
    pub exposure: f32,
    /// The most a channel of a sample may be; no limit if none.
    pub clamp: Option<f32>,
}

impl Default for RenderTable {
    fn default() -> RenderTable {
        RenderTable {
            integrator: IntegratorName::Woodcock,
            spp: 64,
            max_bounces: None,
            seed: 0,
            exposure: 0.0,
            clamp: None,
        }
    }
}

impl RenderTable {
    /// Checks the numbers.
    ///
    /// # Errors
    /// `key: what was expected`.
    pub fn check(&self) -> Result<(), String> {
        if self.spp == 0 {
            return Err("spp: expected at least 1, found 0".into());
        }
        if let Some(clamp) = self.clamp.filter(|c| !(*c > 0.0 && c.is_finite())) {
            return Err(format!("clamp: expected a positive number, found {clamp}"));
        }
        if !self.exposure.is_finite() {
            let found = self.exposure;
            return Err(format!("exposure: expected a finite number, found {found}"));
        }
        Ok(())
    }
}

/// `integrator`
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum IntegratorName {
    /// Delta tracking.
    Woodcock,
    /// Steps from voxel to voxel; exact.
    Regular,
    /// Every cloth as explicit fibres, whatever its `model`.
    Fibres,
}

impl From<IntegratorName> for Integrator {
    fn from(name: IntegratorName) -> Integrator {
        match name {
            // Fibres are met, not tracked.
            IntegratorName::Woodcock | IntegratorName::Fibres => Integrator::Woodcock,
            IntegratorName::Regular => Integrator::Regular,
        }
    }
}

/// `[camera]`
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraTable {
    /// Its projection.
    #[serde(default)]
    pub kind: CameraKind,
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

fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn resolution() -> [u32; 2] {
    [512, 512]
}

/// `kind` of a camera.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum CameraKind {
    /// Parallel rays.
    #[default]
    Orthographic,
    /// A pinhole.
    Perspective,
    /// A lens that focuses at one distance.
    ThinLens,
}

impl CameraKind {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            CameraKind::Orthographic => "orthographic",
            CameraKind::Perspective => "perspective",
            CameraKind::ThinLens => "thin-lens",
        }
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

/// `[[object]]`
#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ObjectTable {
    /// Grids of matter.
    Grid(GridTable),
    /// A cloth.
    Cloth(ClothTable),
    /// An opaque plane.
    Plane(PlaneTable),
    /// A volume file.
    Volume(Box<VolumeTable>),
}

/// An opaque, endless plane.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneTable {
    /// A point of it.
    pub position_mm: [f32; 3],
    /// The side that shines, +z if none.
    pub normal: Option<[f32; 3]>,
    /// Share of light scattered, evenly to all directions; 0 if none.
    pub reflectance: Option<[f32; 3]>,
    /// Light sent out on the side of the normal; 0 if none.
    pub radiance: Option<[f32; 3]>,
}

/// A medium from Mitsuba `.vol` grids.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridTable {
    /// File of the extinction, one channel, 1/mm.
    pub extinction: String,
    /// File of the matrices, six channels: xx yy zz xy xz yz.
    pub sggx: String,
    /// Single-scattering albedo.
    pub albedo: AlbedoValue,
    /// Between the samples of the grids.
    #[serde(default)]
    pub interpolation: InterpolationName,
    /// Whether it repeats without end in x and y.
    #[serde(default)]
    pub repeat_xy: bool,
    /// Where a repeated grid is: x and y of two corners; without end if none.
    pub extent_mm: Option<[f32; 4]>,
}

/// A colour, or the file of a three-channel grid.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "expected three numbers from 0 to 1, or the name of a 3-channel .vol file"
)]
pub enum AlbedoValue {
    /// One colour everywhere.
    Colour([f32; 3]),
    /// A file of three channels.
    File(String),
}

/// `interpolation` of a grid.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum InterpolationName {
    /// Constant in a cell.
    #[default]
    Nearest,
    /// Linear between the centres of cells.
    Trilinear,
}

/// A cloth: a fabric, laid where the scene says.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClothTable {
    /// A fabric file.
    pub fabric: String,
    /// How it is shown; as the fabric's `[scattering]` states if none.
    pub model: Option<ModelKey>,
    /// Micro-flakes: their family.
    pub flake: Option<FlakeFamily>,
    /// Old key of `model = "virtual-scattering"`.
    pub event: Option<EventName>,
    /// Virtual scattering: direct light of the first event sees what stands in
    /// its way within two voxels as tables counted from the fibres tell.
    #[serde(default)]
    pub local_visibility: bool,
    /// How fibres scatter, before what the fabric says of it.
    #[serde(default)]
    pub optics: OpticsFile,
    /// Level of detail.
    #[serde(default)]
    pub lod: Lod,
    /// With model = "auto": error of a pixel, a share of the picture's mean, that
    /// is tolerated.
    pub tolerance: Option<f64>,
    /// A mesh with texture coordinates to lay the cloth over.
    pub mesh: Option<String>,
    /// With `mesh`: length of its units; 1000 for glTF and else 1, if none.
    pub mm_per_unit: Option<f32>,
    /// With `mesh`: cloth to a unit of texture coordinate.
    pub mm_per_uv: Option<f32>,
    /// Overrides the fabric's own voxel size.
    pub voxel_um: Option<f32>,
    /// Overrides the fabric's own seed.
    pub seed: Option<u64>,
    /// Where the cloth is: x and y of two corners; without end if none.
    pub extent_mm: Option<[f32; 4]>,
}

impl ClothTable {
    /// Its keys of a [`ScatteringTable`].
    pub fn scattering(&self) -> ScatteringTable {
        ScatteringTable {
            model: self.model,
            flake: self.flake,
            event: self.event,
        }
    }
}

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
