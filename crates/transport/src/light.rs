//! Lights.

use glam::Vec3;
use organza_basis::Rgb;

/// Which half of the sphere an environment fills, as seen from the cloth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hemisphere {
    /// Everywhere.
    #[default]
    All,
    /// Where the cloth's face looks: directions with z >= 0.
    Front,
    /// Behind the cloth, like the lamp of a light table: z < 0.
    Back,
}

/// A source of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Parallel light.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a plane perpendicular to the direction.
        irradiance: Rgb,
    },
    /// Light from infinity, the same from every direction of a hemisphere or
    /// of the sphere.
    Environment {
        /// Radiance.
        radiance: Rgb,
        /// Where it comes from.
        hemisphere: Hemisphere,
    },
}

impl Light {
    /// Radiance of an escaped ray that travels away from the scene along
    /// `direction`. Parallel light has no width and is never met.
    pub fn radiance_toward(&self, direction: Vec3) -> Rgb {
        match *self {
            Light::Directional { .. } => Rgb::BLACK,
            Light::Environment {
                radiance,
                hemisphere,
            } => {
                let lit = match hemisphere {
                    Hemisphere::All => true,
                    Hemisphere::Front => direction.z >= 0.0,
                    Hemisphere::Back => direction.z < 0.0,
                };
                if lit { radiance } else { Rgb::BLACK }
            }
        }
    }
}
