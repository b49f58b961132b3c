//! `kind = "directional"`: parallel light, as from the sun.

use crate::catalogue::{LightError, LightKind, LoadPicture, brightness};
use crate::light::{KernelLight, Light, LightSample, LightSearch, LightSource};
use crate::mitsuba::{self, MitsubaLight};
use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use serde::Deserialize;

/// The `[[light]]` table of parallel light.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirectionalTable {
    /// Direction in which the light travels; any length.
    pub direction: [f32; 3],
    /// Irradiance on a plane perpendicular to the direction, linear RGB.
    pub irradiance: [f32; 3],
}

impl LightKind for DirectionalTable {
    fn example() -> &'static str {
        "direction = [-0.5, -0.3, -0.8]\nirradiance = [1.0, 1.0, 1.0]"
    }

    fn build(&self, _: &LoadPicture<'_>) -> Result<Light, LightError> {
        let why = "expected a finite vector that is not zero";
        Ok(Light::from(DirectionalLight {
            direction: Vec3::from_array(self.direction)
                .try_normalize()
                .ok_or_else(|| LightError::of("direction", why))?,
            irradiance: brightness(self.irradiance, "irradiance")?,
        }))
    }

    fn sides(&self, _: f64) -> [bool; 2] {
        [self.direction[2] < 0.0, self.direction[2] > 0.0]
    }
}

/// Parallel light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalLight {
    /// Unit direction in which the light travels.
    pub direction: Vec3,
    /// Irradiance on a plane perpendicular to the direction.
    pub irradiance: Rgb,
}

impl DirectionalLight {
    /// Light that travels along a unit direction.
    pub const fn new(direction: Vec3, irradiance: Rgb) -> DirectionalLight {
        DirectionalLight {
            direction,
            irradiance,
        }
    }
}

impl LightSource for DirectionalLight {
    fn radiance_toward(&self, _: Vec3) -> Rgb {
        Rgb::BLACK
    }

    fn search(&self) -> LightSearch {
        LightSearch::ShadowRays
    }

    fn sample_toward(&self, _: Vec3, _: &mut PathRng) -> Option<LightSample> {
        Some(LightSample {
            w_in: -self.direction,
            irradiance: self.irradiance,
            pdf: f32::INFINITY,
        })
    }

    fn pdf_toward(&self, _: Vec3, _: Vec3) -> f32 {
        f32::INFINITY
    }

    fn for_kernel(&self) -> KernelLight<'_> {
        KernelLight::Parallel {
            direction: self.direction,
            irradiance: self.irradiance,
        }
    }

    fn for_mitsuba(&self, _: usize) -> Result<MitsubaLight, String> {
        Ok(MitsubaLight::of_xml(format!(
            r#"    <emitter type="directional">
        <vector name="direction" value="{}"/>
        <rgb name="irradiance" value="{}"/>
    </emitter>
"#,
            mitsuba::vector(self.direction),
            mitsuba::colour(self.irradiance)
        )))
    }
}
