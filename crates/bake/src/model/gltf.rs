//! The material of glTF 2.0 [Khronos2021] with its extensions [Khronos2024].

use super::{
    BOTH_SIDES, EVEN_OPACITY, SPOTS, Sheen, Surface, Target, WIDE_FORWARD, below, half_vector,
    round,
};
use crate::albedo::Albedos;
use crate::lobe::{f0_of_index, ggx, schlick};
use glam::Vec3;

/// The record of the model.
pub const GLTF: Target = Target {
    name: "glTF 2.0",
    file: "material.glb",
    transmits: true,
    is_anisotropic: true,
    sheen: Some(Sheen::InvertedSquare),
    has_specular_map: true,
    has_specular_weight: true,
    limits: &[
        BOTH_SIDES,
        EVEN_OPACITY,
        WIDE_FORWARD,
        "There is no height map: the relief is in the normals alone, without parallax or shadows.",
        SPOTS,
    ],
    bsdf,
};

/// Widths along the rough direction and across it: the rough one grows to one.
pub fn widths(roughness: f32, strength: f32) -> (f32, f32) {
    let (alpha, _) = round(roughness);
    (alpha + (1.0 - alpha) * strength * strength, alpha)
}

/// A layer of sheen over microfacets over diffuse reflection and transmission. Layers are
/// weighted so that light and eye may be exchanged, as the extension of sheen allows.
fn bsdf(s: &Surface, albedos: &Albedos, w_in: Vec3, w_out: Vec3) -> Vec3 {
    let (mirrored, h) = half_vector(w_in, w_out);
    let f = schlick(f0_of_index(s.ior) * s.specular, s.specular, w_out.dot(h));
    let reflects = w_in.z > 0.0;
    let facets = ggx(widths(s.roughness, s.anisotropy), mirrored, w_out);
    let mut value = (1.0 - f) * below(s, reflects, facets, s.base);
    if reflects {
        value += f * facets;
    }
    let strength = s.sheen.max_element();
    if strength <= 0.0 {
        return value;
    }
    let (sheen, roughness) = (Sheen::InvertedSquare, s.sheen_roughness);
    let taken = [mirrored.z, w_out.z].map(|cos| sheen.albedo(albedos, cos, roughness));
    value *= 1.0 - strength * taken[0].max(taken[1]);
    if reflects {
        value += s.sheen * sheen.value(roughness, w_in, w_out);
    }
    value
}
