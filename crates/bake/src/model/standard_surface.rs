//! Autodesk Standard Surface [Georgiev2019], thin-walled.

use super::{
    BOTH_SIDES, EVEN_OPACITY, SPOTS, Sheen, Surface, Target, WIDE_FORWARD, below, half_vector,
};
use crate::albedo::Albedos;
use crate::lobe::{dielectric, f0_of_index, ggx};
use glam::Vec3;

/// The record of the model.
pub const STANDARD_SURFACE: Target = Target {
    name: "standard_surface",
    file: "material.mtlx",
    transmits: true,
    is_anisotropic: true,
    sheen: Some(Sheen::Inverted),
    has_specular_map: true,
    has_specular_weight: false,
    limits: &[BOTH_SIDES, EVEN_OPACITY, WIDE_FORWARD, SPOTS],
    bsdf,
};

/// Widths along the rough direction and across it, whose product keeps.
fn widths(roughness: f32, anisotropy: f32) -> (f32, f32) {
    let alpha = (roughness * roughness).max(2e-3);
    let aspect = (1.0 - anisotropy.clamp(0.0, 0.98)).sqrt();
    ((alpha / aspect).min(1.0), alpha * aspect)
}

fn bsdf(s: &Surface, albedos: &Albedos, w_in: Vec3, w_out: Vec3) -> Vec3 {
    let lobe = (widths(s.roughness, s.anisotropy), s.ior, s.specular);
    layered(s, albedos, lobe, Sheen::Inverted, (w_in, w_out))
}

/// Sheen over microfacets of a dielectric over diffuse light, and light that passes through rough
/// microfacets. Each layer leaves to those
/// below it what it does not reflect from the direction of the eye, which does not let light
/// and eye be exchanged. `lobe`: widths, index and weight of the microfacets.
pub(super) fn layered(
    s: &Surface,
    albedos: &Albedos,
    (alpha, eta, weight): ((f32, f32), f32, f32),
    sheen: Sheen,
    (w_in, w_out): (Vec3, Vec3),
) -> Vec3 {
    let (mirrored, h) = half_vector(w_in, w_out);
    let reflects = w_in.z > 0.0;
    let mean_alpha = (alpha.0 * alpha.1).sqrt();
    // An index near one reflects little at grazing angles, too [Lagarde2014].
    let f0 = f0_of_index(eta);
    let taken = weight * albedos.facets(w_out.z, mean_alpha, f0, (50.0 * f0).min(1.0));
    let facets = ggx(alpha, mirrored, w_out);
    let mut value = (1.0 - taken) * below(s, reflects, facets, s.transmission_colour);
    if reflects {
        value += weight * dielectric(eta, w_out.dot(h)) * facets;
    }
    let strength = s.sheen.max_element();
    if strength <= 0.0 {
        return value;
    }
    value *= 1.0 - strength * sheen.albedo(albedos, w_out.z, s.sheen_roughness);
    if reflects {
        value += s.sheen * sheen.value(s.sheen_roughness, w_in, w_out);
    }
    value
}
