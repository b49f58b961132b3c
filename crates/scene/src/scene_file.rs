//! The scene file, as written in TOML.

use crate::camera::CameraTable;
use crate::error::{InputError, Result};
use crate::file_kind::Wanted;
use crate::loader::Loader;
use crate::object::ObjectTable;
use crate::read;
pub use organza_light::LightTable;
use organza_picture::{Display, Exposure, PngBits, ToneMapping, WhiteBalance};
use organza_transport::{CacheMode, CachePlan, Integrator};
use serde::Deserialize;
use std::path::Path;

/// Whether a file is a scene and no fabric: whichever top-level keys it has.
///
/// # Errors
/// Says what a file is that can be neither.
pub fn is_scene(path: &Path) -> Result<bool> {
    is_scene_text(path, &read::text_of(path, Wanted::Either)?)
}

/// The same of a file's text.
///
/// # Errors
/// As [`is_scene`].
pub fn is_scene_text(path: &Path, text: &str) -> Result<bool> {
    Wanted::Either.check(path, text)?;
    let table = toml::from_str::<toml::Table>(text);
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
    /// The camera, which pictures need and measurements do not.
    pub camera: Option<CameraTable>,
    /// Lights, at least one if the picture is not to be black.
    #[serde(default)]
    pub light: Vec<LightTable>,
    /// Objects.
    #[serde(default)]
    pub object: Vec<ObjectTable>,
}

impl SceneFile {
    /// The camera.
    ///
    /// # Errors
    /// There is none; names the file.
    pub fn camera(&self, path: &Path) -> Result<&CameraTable> {
        self.camera
            .as_ref()
            .ok_or_else(|| InputError::of_file(path, "`camera` is missing"))
    }
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
    /// Exposure of pictures that are not linear.
    pub exposure: Exposure,
    /// Their compression of bright colours.
    pub tone_mapping: ToneMapping,
    /// The light that is white in them.
    pub white_balance: WhiteBalance,
    /// Bits of a channel in PNG files.
    pub png_bits: PngBits,
    /// The most a channel of a sample may be; no limit if none.
    pub clamp: Option<f32>,
    /// Whether paths end in a cache of radiance; chosen by the picture if none.
    pub cache: Option<CacheName>,
    /// How much the cache learns, in multiples of the usual.
    pub cache_learning: f64,
    /// More is learned where the error of the cache in blocks of 16 x 16 pixels is surely
    /// above this fraction of the picture's mean; never if none.
    pub cache_error: Option<f64>,
    /// Memory of the cache while it is learned, MiB.
    pub cache_mib: u32,
    /// Whether direct light is kept beside the picture.
    pub direct: bool,
}

/// `render.cache`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CacheName {
    /// Every path is walked to its end.
    Off,
    /// Paths end at their second fibre.
    SecondFibre,
    /// At their first fibre where samples can share its light, elsewhere at the second.
    FirstFibre,
}

impl Default for RenderTable {
    fn default() -> RenderTable {
        RenderTable {
            integrator: IntegratorName::Woodcock,
            spp: 64,
            max_bounces: None,
            seed: 0,
            exposure: Exposure::default(),
            tone_mapping: ToneMapping::default(),
            white_balance: WhiteBalance::default(),
            png_bits: PngBits::default(),
            clamp: None,
            cache: None,
            cache_learning: 1.0,
            cache_error: None,
            cache_mib: (CachePlan::BYTES >> 20) as u32,
            direct: false,
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
        if !(0.01..=1000.0).contains(&self.cache_learning) {
            let found = self.cache_learning;
            return Err(format!(
                "cache_learning: expected 0.01 to 1000, found {found}"
            ));
        }
        if let Some(found) = self.cache_error.filter(|e| !(1e-4..=1.0).contains(e)) {
            return Err(format!("cache_error: expected 0.0001 to 1, found {found}"));
        }
        if !(1..=4096).contains(&self.cache_mib) {
            let found = self.cache_mib;
            return Err(format!("cache_mib: expected 1 to 4096, found {found}"));
        }
        if self.direct && self.cache == Some(CacheName::FirstFibre) {
            return Err(
                "direct: samples that share the light of their first fibres do not know \
                 which of it is direct; expected cache = \"second-fibre\" or \"off\""
                    .into(),
            );
        }
        self.display().check()
    }

    /// What a picture of that size learns of its fibres before its first sample: nothing if
    /// the cache is off, or if the file leaves the choice and the picture is small.
    pub fn cache_plan(&self, resolution: [u32; 2]) -> Option<CachePlan> {
        let pixels = resolution.iter().map(|n| u64::from(*n)).product();
        let mode = match self.cache {
            Some(CacheName::Off) => return None,
            None if pixels < Self::LEAST_CACHED_PIXELS => return None,
            Some(CacheName::FirstFibre) => CacheMode::FirstFibre,
            None if self.spp <= Self::MOST_SHARED_SAMPLES && !self.direct => CacheMode::FirstFibre,
            Some(CacheName::SecondFibre) | None => CacheMode::SecondFibre,
        };
        Some(CachePlan {
            bytes: u64::from(self.cache_mib) << 20,
            block_error: self.cache_error.unwrap_or(f64::INFINITY),
            ..CachePlan::of_picture(mode, pixels, self.cache_learning)
        })
    }

    /// Smaller pictures take less time than their cache.
    const LEAST_CACHED_PIXELS: u64 = 256 * 256;
    /// With more samples a picture has less noise than what samples share.
    const MOST_SHARED_SAMPLES: u32 = 64;

    /// How pictures that are not linear are shown.
    pub fn display(&self) -> Display {
        Display {
            exposure: self.exposure,
            tone_mapping: self.tone_mapping,
            white_balance: self.white_balance,
            png_bits: self.png_bits,
        }
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
