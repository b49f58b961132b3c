//! UsdPreviewSurface [Pixar2024], metallic workflow.

use super::{BOTH_SIDES, EVEN_OPACITY, Surface, Target, half_vector, round};
use crate::albedo::Albedos;
use crate::lobe::{f0_of_index, ggx, schlick};
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;

/// The record of the model.
pub const USD_PREVIEW: Target = Target {
    name: "USD Preview Surface",
    file: "material.usda",
    transmits: false,
    is_anisotropic: false,
    sheen: None,
    has_specular_map: false,
    has_specular_weight: false,
    limits: &[
        "There is no transmission by scattering: cloth lit from behind is dark but for its gaps.",
        "Highlights are isotropic: the direction of the fibres does not show.",
        "There is no sheen: edges do not brighten but by the Fresnel factor.",
        "The strength of highlights cannot vary: it follows from one index of refraction.",
        BOTH_SIDES,
        EVEN_OPACITY,
    ],
    bsdf,
};

/// Isotropic microfacets over diffuse reflection, which gets what they do not reflect.
fn bsdf(s: &Surface, _: &Albedos, w_in: Vec3, w_out: Vec3) -> Vec3 {
    if w_in.z <= 0.0 {
        return Vec3::ZERO;
    }
    let (_, h) = half_vector(w_in, w_out);
    let f = schlick(f0_of_index(s.ior), 1.0, w_out.dot(h));
    (1.0 - f) * FRAC_1_PI * s.base + f * ggx(round(s.roughness), w_in, w_out)
}
