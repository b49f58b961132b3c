//! `kind = "environment"`: light from infinity, the same from every direction or
//! a picture of all directions.

use crate::catalogue::{
    LightError, LightKind, LoadPicture, MAX_BRIGHTNESS, brightness, too_bright,
};
use crate::image_environment::{ImageEnvironment, ImageLight};
use crate::light::{KernelLight, Light, LightSample, LightSearch, LightSource};
use crate::mitsuba::{self, MitsubaLight};
use glam::{Quat, UVec2, Vec3};
use organza_basis::{PathRng, Rgb};
use serde::Deserialize;
use std::sync::Arc;

/// Which half of the sphere an environment fills, as seen from the cloth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hemisphere {
    /// Everywhere.
    #[default]
    All,
    /// Where the cloth's face looks: directions with z >= 0.
    Front,
    /// Behind the cloth, like the lamp of a light table: z < 0.
    Back,
}

impl Hemisphere {
    /// Whether light comes from a direction of sight.
    fn holds(self, direction: Vec3) -> bool {
        match self {
            Hemisphere::All => true,
            Hemisphere::Front => direction.z >= 0.0,
            Hemisphere::Back => direction.z < 0.0,
        }
    }
}

/// The `[[light]]` table of an environment: one radiance, or a picture.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EnvironmentTable {
    /// Radiance from every direction, linear RGB.
    pub radiance: Option<[f32; 3]>,
    /// With `radiance`: where it comes from.
    pub hemisphere: Option<Hemisphere>,
    /// An equirectangular picture (.exr, .hdr).
    pub file: Option<String>,
    /// Radiance per value of the picture, 1 if none.
    pub scale: Option<f32>,
    /// Where the top of the picture is, z if none.
    pub up: Option<[f32; 3]>,
    /// Turns the picture about `up`, counter-clockwise seen from there. At 0
    /// its middle is seen toward +y, or toward -z where `up` is y.
    pub rotation_deg: Option<f32>,
}

impl LightKind for EnvironmentTable {
    fn example() -> &'static str {
        "radiance = [0.3, 0.3, 0.3]"
    }

    fn build(&self, load: &LoadPicture<'_>) -> Result<Light, LightError> {
        let of_file = [
            ("scale", self.scale.is_some()),
            ("up", self.up.is_some()),
            ("rotation_deg", self.rotation_deg.is_some()),
        ];
        let wrong = |why: &str| Err(LightError::Keys(why.into()));
        match (self.radiance, &self.file) {
            (Some(radiance), None) => {
                if let Some((key, _)) = of_file.iter().find(|(_, given)| *given) {
                    return wrong(&format!("{key} belongs to an environment with a file"));
                }
                Ok(Light::from(EnvironmentLight::new(
                    brightness(radiance, "radiance")?,
                    self.hemisphere.unwrap_or_default(),
                )))
            }
            (None, Some(name)) if self.hemisphere.is_none() => Ok(Light::from(ImageLight {
                image: Arc::new(self.image(name, load)?),
                search: LightSearch::Both,
            })),
            (None, Some(_)) => wrong("hemisphere belongs to an environment with a radiance"),
            _ => wrong("an environment takes either radiance or file"),
        }
    }

    fn sides(&self, _: f64) -> [bool; 2] {
        let hemisphere = self.hemisphere.unwrap_or_default();
        [
            hemisphere != Hemisphere::Back,
            hemisphere != Hemisphere::Front,
        ]
    }

    fn file(&self) -> Option<&str> {
        self.file.as_deref()
    }
}

impl EnvironmentTable {
    fn image(&self, name: &str, load: &LoadPicture<'_>) -> Result<ImageEnvironment, LightError> {
        let scale = self.scale.unwrap_or(1.0);
        if !(scale >= 0.0 && scale.is_finite()) {
            let why = format!("expected a finite number of at least 0, found {scale}");
            return Err(LightError::of("scale", why));
        }
        let rotation = self.rotation_deg.unwrap_or(0.0).to_radians();
        let up = self
            .up
            .map_or(Some(Vec3::Z), |v| Vec3::from_array(v).try_normalize());
        let (Some(up), true) = (up, rotation.is_finite()) else {
            let why = "expected finite numbers, and an up that is not zero";
            return Err(LightError::of("up, rotation_deg", why));
        };
        let ahead = if up.y.abs() > 0.999 {
            Vec3::NEG_Z
        } else {
            Vec3::Y
        };
        let centre = Quat::from_axis_angle(up, rotation) * ahead.reject_from_normalized(up);
        let mut picture = load(name).map_err(|why| LightError::of("file", why))?;
        for p in &mut picture.pixels {
            *p *= scale;
            // What is not a number is refused with its place below.
            if p.max_component().is_finite() && p.max_component() > MAX_BRIGHTNESS {
                let why = format!("{}: {}", picture.name, too_bright(p.max_component()));
                return Err(LightError::of("file", why));
            }
        }
        ImageEnvironment::new(picture.size, picture.pixels, up, centre)
            .map_err(|e| LightError::of("file", format!("{}: {e}", picture.name)))
    }
}

/// Light from infinity, the same from every direction of a hemisphere or of the
/// sphere. The walk alone finds it: a shadow ray in a random direction would be
/// the worse estimate of light from everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentLight {
    /// Radiance.
    pub radiance: Rgb,
    /// Where it comes from.
    pub hemisphere: Hemisphere,
}

impl EnvironmentLight {
    /// A radiance from a half of the sphere, or from all of it.
    pub const fn new(radiance: Rgb, hemisphere: Hemisphere) -> EnvironmentLight {
        EnvironmentLight {
            radiance,
            hemisphere,
        }
    }
}

impl LightSource for EnvironmentLight {
    fn radiance_toward(&self, direction: Vec3) -> Rgb {
        if self.hemisphere.holds(direction) {
            self.radiance
        } else {
            Rgb::BLACK
        }
    }

    fn search(&self) -> LightSearch {
        LightSearch::Walk
    }

    fn sample_toward(&self, _: Vec3, _: &mut PathRng) -> Option<LightSample> {
        None
    }

    fn pdf_toward(&self, _: Vec3, _: Vec3) -> f32 {
        0.0
    }

    fn for_kernel(&self) -> KernelLight<'_> {
        KernelLight::Sky {
            radiance: self.radiance,
            hemisphere: self.hemisphere,
        }
    }

    fn for_mitsuba(&self, index: usize) -> Result<MitsubaLight, String> {
        if self.hemisphere == Hemisphere::All {
            let mut constant = MitsubaLight::of_xml(format!(
                r#"    <emitter type="constant">
        <rgb name="radiance" value="{}"/>
    </emitter>
"#,
                mitsuba::colour(self.radiance)
            ));
            constant.is_environment = true;
            return Ok(constant);
        }
        let size = UVec2::new(4, 1024);
        let upper = self.hemisphere == Hemisphere::Front;
        let rows = (0..size.y).flat_map(|y| {
            let lit = (y < size.y / 2) == upper;
            [if lit { self.radiance } else { Rgb::BLACK }; 4]
        });
        let image = ImageEnvironment::new(size, rows.collect(), Vec3::Z, Vec3::Y)
            .map_err(|e| format!("light[{index}]: {e}"))?;
        let mut half = image.for_mitsuba(index);
        half.notes.push(format!(
            "light[{index}]: half an environment is written as a picture whose edge is \
             0.2 degrees wide"
        ));
        Ok(half)
    }
}
