//! OpenPBR surface [OpenPBR2024], thin-walled.

use super::standard_surface::layered;
use super::{BOTH_SIDES, EVEN_OPACITY, SPOTS, Sheen, Surface, Target, WIDE_FORWARD};
use crate::albedo::Albedos;
use crate::lobe::{f0_of_index, index_of_f0};
use glam::Vec3;

/// The record of the model.
pub const OPENPBR: Target = Target {
    name: "OpenPBR",
    file: "material.mtlx",
    transmits: true,
    is_anisotropic: true,
    sheen: Some(Sheen::Fuzz),
    has_specular_map: true,
    has_specular_weight: false,
    limits: &[BOTH_SIDES, EVEN_OPACITY, WIDE_FORWARD, SPOTS],
    bsdf,
};

/// Widths along the rough direction and across it, which keep the mean of their squares.
pub fn widths(roughness: f32, anisotropy: f32) -> (f32, f32) {
    let alpha = (roughness * roughness).max(2e-3);
    let narrow = 1.0 - anisotropy.clamp(0.0, 0.99);
    let wide = alpha * (2.0 / (1.0 + narrow * narrow)).sqrt();
    (wide, wide * narrow)
}

/// Fuzz over a dielectric interface over diffuse reflection and, by thin-walled subsurface
/// scattering that is wholly forward, transmission. The weight of highlights acts on the
/// index.
fn bsdf(s: &Surface, albedos: &Albedos, w_in: Vec3, w_out: Vec3) -> Vec3 {
    let eta = index_of_f0(s.specular * f0_of_index(s.ior));
    let lobe = (widths(s.roughness, s.anisotropy), eta, 1.0);
    layered(s, albedos, lobe, Sheen::Fuzz, (w_in, w_out))
}
