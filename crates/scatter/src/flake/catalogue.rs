//! The families of micro-flakes that a fabric or scene file can name.
//!
//! A family is one file with a [`FlakeRecord`] and one line in the list at the end
//! of this file.

use super::{
    FlakeMixtures, FlakeScattering, gaussian, gaussian_diffuse, sggx_diffuse, sggx_specular,
    sggx_transmitting, sine_power,
};
use crate::FlakeOptics;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::sync::Arc;

/// The description of a family of micro-flakes.
pub(super) struct FlakeRecord {
    /// Its name in the key `flake`.
    pub name: &'static str,
    /// What it is, in one line.
    pub about: &'static str,
    /// How populations scatter, given the optics of each material: all that the general walk
    /// and the kernel need.
    pub scattering: fn(&[FlakeOptics]) -> Arc<dyn FlakeScattering>,
}

/// A family of micro-flakes; mirrors of the SGGX distribution by default.
#[derive(Clone, Copy)]
pub struct FlakeFamily(&'static FlakeRecord);

impl FlakeFamily {
    /// Mirrors of the SGGX distribution, the one family whose mixtures other renderers take.
    pub const SGGX_SPECULAR: FlakeFamily = FlakeFamily(&sggx_specular::FAMILY);

    /// Pieces of the surface of clear fibres, which need the fibres of the materials:
    /// [`TransmittingFlakes`](super::TransmittingFlakes).
    pub const SGGX_TRANSMITTING: FlakeFamily = FlakeFamily(&sggx_transmitting::FAMILY);

    /// All families.
    pub fn all() -> impl Iterator<Item = FlakeFamily> {
        FAMILIES.iter().map(FlakeFamily)
    }

    /// The family of a name in files.
    pub fn named(name: &str) -> Option<FlakeFamily> {
        FlakeFamily::all().find(|family| family.name() == name)
    }

    /// Its name in files.
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// What it is, in one line.
    pub fn about(self) -> &'static str {
        self.0.about
    }

    /// How populations scatter, given the optics of each material.
    pub fn scattering(self, optics: &[FlakeOptics]) -> Arc<dyn FlakeScattering> {
        (self.0.scattering)(optics)
    }

    /// The same of the mixtures of a cloth.
    pub fn of_materials(self, optics: Vec<FlakeOptics>) -> FlakeMixtures {
        let scattering = self.scattering(&optics);
        FlakeMixtures::new(optics, scattering)
    }
}

impl Default for FlakeFamily {
    fn default() -> FlakeFamily {
        FlakeFamily::SGGX_SPECULAR
    }
}

impl PartialEq for FlakeFamily {
    fn eq(&self, other: &FlakeFamily) -> bool {
        self.name() == other.name()
    }
}

impl Eq for FlakeFamily {}

impl fmt::Debug for FlakeFamily {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl<'de> Deserialize<'de> for FlakeFamily {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<FlakeFamily, D::Error> {
        let name = String::deserialize(deserializer)?;
        FlakeFamily::named(&name)
            .ok_or_else(|| serde::de::Error::unknown_variant(&name, FLAKE_FAMILIES))
    }
}

impl Serialize for FlakeFamily {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

macro_rules! flake_families {
    ($($file:ident,)*) => {
        static FAMILIES: &[FlakeRecord] = &[$($file::FAMILY,)*];

        /// The names of all families.
        pub const FLAKE_FAMILIES: &[&str] = &[$($file::FAMILY.name,)*];
    };
}

flake_families! {
    sggx_specular,
    sggx_diffuse,
    gaussian,
    gaussian_diffuse,
    sine_power,
    sggx_transmitting,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Lobe;
    use glam::Vec3;
    use organza_basis::{FibrePopulation, Mixture, Moments, PathRng, Rgb, warp};

    fn mixture() -> Mixture {
        let mut mixture = Mixture::EMPTY;
        for (axis, material) in [(Vec3::X, 0), (Vec3::new(0.0, 0.6, 0.8), 1)] {
            mixture.push(FibrePopulation {
                length_density_per_mm2: 40.0 + 30.0 * f32::from(material),
                axis,
                spread_rad: 0.3,
                radius_mm: 0.01,
                material,
                ..Default::default()
            });
        }
        mixture
    }

    fn mixtures(family: FlakeFamily) -> FlakeMixtures {
        let optics = |albedo| FlakeOptics::new(Rgb::splat(albedo), 0.2);
        family.of_materials(vec![optics(0.9), optics(0.5)])
    }

    /// Every family, also one that is added: what is drawn toward the light is a
    /// phase function of the albedo, and extinction times it is symmetric.
    #[test]
    fn every_family_keeps_energy_and_is_reciprocal() {
        let mixture = mixture();
        for family in FlakeFamily::all() {
            let flakes = mixtures(family);
            let mut rng = PathRng::from_seed(21);
            let (a, b) = (Vec3::new(0.48, 0.6, 0.64), Vec3::new(-0.8, 0.36, 0.48));
            let (mut phase, mut weight) = (Moments::default(), Moments::default());
            let (mut lopsided, mut twin) = (Moments::default(), Moments::default());
            let n = 60_000;
            for _ in 0..n {
                let w_in = warp::uniform_sphere(rng.unit2());
                let flake = flakes.draw_flake(&mixture, a, &mut rng);
                let (value, pdf) = flakes.eval(&mixture, flake.as_ref(), a, w_in);
                assert!(value.max_component() <= 0.9001 * pdf + 1e-6, "{family:?}");
                phase.add(f64::from(pdf / warp::UNIFORM_SPHERE_PDF));
                if let Some(s) = flakes.sample(&mixture, flake.as_ref(), a, &mut rng) {
                    weight.add(f64::from(s.weight.0.x));
                    let (value, pdf) = flakes.eval(&mixture, flake.as_ref(), a, s.w_in);
                    let off = (value.0.x - s.weight.0.x * s.pdf).abs();
                    assert!(off <= 4.0 * f32::EPSILON * value.0.x, "{family:?}, seed 21");
                    let off = (pdf / s.pdf - 1.0).abs();
                    assert!(off <= 4.0 * f32::EPSILON, "{family:?}, seed 21");
                }
                let there = f64::from(
                    flakes.sigma_t_per_mm(&mixture, a) * {
                        let flake = flakes.draw_flake(&mixture, a, &mut rng);
                        flakes.eval(&mixture, flake.as_ref(), a, b).0.0.x
                    },
                );
                let back = f64::from(
                    flakes.sigma_t_per_mm(&mixture, b) * {
                        let flake = flakes.draw_flake(&mixture, b, &mut rng);
                        flakes.eval(&mixture, flake.as_ref(), b, a).0.0.x
                    },
                );
                let scale = f64::from(mixture.broadside_per_mm());
                lopsided.add((there - back) / scale);
                twin.add((1.1 * there - back) / scale);
            }
            let z = (phase.mean - 1.0) / phase.standard_error();
            assert!(z.abs() < 4.5, "{family:?}, seed 21: {}", phase.mean);
            assert!(weight.mean > 0.5 && weight.mean < 0.9, "{family:?}");
            let off = lopsided.mean.abs();
            let most = 4.5 * lopsided.standard_error() + 1e-6;
            assert!(off <= most, "{family:?}, seed 21: {off}");
            // A tenth more in one direction is found.
            let off = twin.mean.abs();
            let least = 4.5 * twin.standard_error() + 1e-6;
            assert!(off > least, "{family:?}, seed 21: {off}");
        }
    }

    #[test]
    fn families_are_found_by_unique_names() {
        for (i, name) in FLAKE_FAMILIES.iter().enumerate() {
            assert!(!FLAKE_FAMILIES[i + 1..].contains(name), "{name}");
            let family = FlakeFamily::named(name).unwrap();
            assert_eq!(family.name(), *name);
            assert!(!family.about().is_empty());
        }
        assert_eq!(FlakeFamily::named("sggx"), None);
        assert_eq!(FlakeFamily::default().name(), "sggx-specular");
    }

    #[test]
    fn a_flake_that_was_drawn_is_a_lobe() {
        let flakes = mixtures(FlakeFamily::named("sggx-diffuse").unwrap());
        let mut rng = PathRng::from_seed(22);
        let flake = flakes.draw_flake(&mixture(), Vec3::Z, &mut rng).unwrap();
        assert!(flake.normal.z > 0.0 && flake.pdf(Vec3::Z, flake.normal) > 0.3);
    }
}
