//! Fibres of tests.

use organza_basis::Rgb;
use organza_scatter::{
    DielectricFibre, DielectricParameters, Fibre, FittedFibre, FittedParameters,
};

/// A dielectric fibre of index of refraction 1.55. The absorption is per fibre radius, the
/// blurs are standard deviations in radians.
///
/// # Panics
/// When a parameter is out of its range.
pub fn dielectric_fibre(absorption_radii: Rgb, longitudinal_rad: f32, azimuthal_rad: f32) -> Fibre {
    let parameters = DielectricParameters {
        ior: 1.55,
        absorption_radii,
        longitudinal_rad,
        azimuthal_rad,
    };
    Fibre::from(DielectricFibre::new(parameters).expect("parameters are in range"))
}

/// A fitted fibre, by the name of its preset.
///
/// # Panics
/// When there is no such preset.
pub fn fitted_fibre(preset: &str) -> Fibre {
    let parameters = FittedParameters::preset(preset).expect("the preset exists");
    Fibre::from(FittedFibre::new(parameters).expect("presets are in range"))
}
