//! The material models of other programs, each with its published formula.
//!
//! A model is one file with a [`Target`]; [`TARGETS`] lists them. The parameters of all models
//! have the same meaning: they say how the maps of a tile become the inputs of the model.

mod gltf;
mod openpbr;
mod standard_surface;
mod usd_preview;

pub use gltf::GLTF;
pub use openpbr::{OPENPBR, widths as openpbr_widths};
pub use standard_surface::STANDARD_SURFACE;
pub use usd_preview::USD_PREVIEW;

use crate::albedo::Albedos;
use crate::lobe::{MIN_COSINE, f0_of_index, fuzz, fuzz_albedo, sheen};
use crate::texel::Texel;
use glam::Vec3;
use organza_measure::Pair;
use organza_measure::fit::Bound;
use std::f32::consts::FRAC_1_PI;

/// All models, in the order of reports.
pub const TARGETS: [&Target; 4] = [&GLTF, &OPENPBR, &STANDARD_SURFACE, &USD_PREVIEW];

// What several models cannot show.
const BOTH_SIDES: &str =
    "One material serves both sides: the back has the colour and highlights of the face.";
const EVEN_OPACITY: &str = "Opacity does not depend on direction: straight-through light does not fall towards grazing angles.";
const WIDE_FORWARD: &str = "Light that keeps its direction is spread as much as the highlight.";
const SPOTS: &str =
    "The highlight of a microfacet is a spot, that of a fibre a cone about its axis.";

/// One material model.
pub struct Target {
    /// Its name.
    pub name: &'static str,
    /// The file that holds it.
    pub file: &'static str,
    /// Whether light passes, spread evenly and through rough microfacets, which keep its direction.
    pub transmits: bool,
    /// Whether its highlights may be anisotropic.
    pub is_anisotropic: bool,
    /// Its layer of sheen.
    pub sheen: Option<Sheen>,
    /// Whether the strength of its highlights may vary from texel to texel.
    pub has_specular_map: bool,
    /// Whether the strength of its highlights is a parameter beside the index of refraction. That
    /// one then is at least 1.5, below which programs in real time blur transmitted light less.
    pub has_specular_weight: bool,
    /// What it cannot show, a sentence each.
    pub limits: &'static [&'static str],
    /// The BSDF, 1/sr, of a surface in its own frame: x is the rough direction, the eye has
    /// positive z, the light any z but zero.
    pub bsdf: fn(&Surface, &Albedos, w_in: Vec3, w_out: Vec3) -> Vec3,
}

impl std::fmt::Debug for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Target").field("name", &self.name).finish()
    }
}

/// The lobe of a layer of sheen, by its roughness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sheen {
    /// That of [Estevez2017], whose width is the roughness.
    Inverted,
    /// The same; the width is the square of the roughness.
    InvertedSquare,
    /// That of [Zeltner2022].
    Fuzz,
}

impl Sheen {
    /// Roughnesses that are tried.
    fn range(self) -> (f64, f64) {
        match self {
            Sheen::Inverted => (0.2, 0.8),
            Sheen::InvertedSquare => (0.2, 1.0),
            Sheen::Fuzz => (0.1, 1.0),
        }
    }

    /// The share of light that it reflects towards an eye of this cosine.
    fn albedo(self, albedos: &Albedos, cos: f32, roughness: f32) -> f32 {
        match self {
            Sheen::Inverted => albedos.sheen(cos, roughness),
            Sheen::InvertedSquare => albedos.sheen(cos, roughness * roughness),
            Sheen::Fuzz => fuzz_albedo(cos, roughness),
        }
    }

    /// The BSDF, 1/sr, of light and eye on the side of the normal.
    fn value(self, roughness: f32, w_in: Vec3, w_out: Vec3) -> f32 {
        let cos_half = || (w_in + w_out).normalize_or_zero().z;
        match self {
            Sheen::Inverted => sheen(roughness, cos_half(), w_in.z, w_out.z),
            Sheen::InvertedSquare => sheen(roughness * roughness, cos_half(), w_in.z, w_out.z),
            Sheen::Fuzz => fuzz(roughness, w_in, w_out),
        }
    }
}

/// How the maps become the inputs of a model.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Parameters {
    /// Factor of the colour of diffuse reflection, per channel.
    pub reflectance: [f64; 3],
    /// Factor of the transmitted share of light, whose colour is the measured one.
    pub transmittance: f64,
    /// Factor of the same share, for light that passes through rough microfacets.
    pub forward: f64,
    /// Roughness where fibres are parallel.
    pub roughness: f64,
    /// Growth of the roughness where the directions of fibres are mixed: 1 doubles it.
    pub roughening: f64,
    /// Anisotropy where fibres are parallel.
    pub anisotropy: f64,
    /// Index of refraction.
    pub ior: f64,
    /// Weight of the highlights.
    pub specular: f64,
    /// Weight of the sheen.
    pub sheen: f64,
    /// Roughness of the sheen.
    pub sheen_roughness: f64,
    /// Factor of the slopes of the relief.
    pub relief: f64,
}

fn vector(v: [f64; 3]) -> Vec3 {
    Vec3::new(v[0] as f32, v[1] as f32, v[2] as f32)
}

/// Inputs of a model at one texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Colour of diffuse reflection, 0 to 1.
    pub base: Vec3,
    /// Share of the diffuse light that is transmitted.
    pub transmission: f32,
    /// Colour of diffuse transmission, 0 to 1.
    pub transmission_colour: Vec3,
    /// Share of the light below the highlights that passes through rough microfacets.
    pub forward: f32,
    /// Roughness, as the model reads it.
    pub roughness: f32,
    /// Anisotropy, as the model reads it.
    pub anisotropy: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Weight of the highlights.
    pub specular: f32,
    /// Colour of the sheen, weight included.
    pub sheen: Vec3,
    /// Roughness of the sheen.
    pub sheen_roughness: f32,
}

/// Least roughness that is used.
pub const MIN_ROUGHNESS: f32 = 0.045;

impl Target {
    /// Ranges of the free parameters of this model; `roughening` is one of them where none is
    /// given.
    pub fn bounds(&self, roughening: Option<f64>) -> Vec<Bound> {
        let bound = |name: &str, low: f64, high: f64, start: f64| Bound {
            name: name.to_owned(),
            low,
            high,
            start,
        };
        let mut list = Vec::new();
        for channel in ["red", "green", "blue"] {
            list.push(bound(&format!("reflectance_{channel}"), 0.0, 1.5, 0.9));
        }
        list.push(bound("roughness", 0.1, 1.0, 0.5));
        if self.has_specular_weight {
            list.push(bound("ior", 1.5, 2.6, 1.5));
            list.push(bound("specular", 0.0, 1.0, 0.5));
        } else {
            list.push(bound("ior", 1.05, 2.6, 1.5));
        }
        list.push(bound("relief", 0.0, 1.0, 0.4));
        if self.transmits {
            list.push(bound("transmittance", 0.0, 2.5, 0.7));
            list.push(bound("forward", 0.0, 5.0, 0.3));
        }
        if self.is_anisotropic {
            list.push(bound("anisotropy", 0.0, 0.98, 0.4));
        }
        if let Some(sheen) = self.sheen {
            let (low, high) = sheen.range();
            list.push(bound("sheen", 0.0, 1.0, 0.2));
            list.push(bound("sheen_roughness", low, high, 0.5));
        }
        if roughening.is_none() {
            list.push(bound("roughening", 0.0, 1.0, 0.2));
        }
        list
    }

    /// The parameters at a place within [`Target::bounds`]; those that the model has not are
    /// zero.
    pub fn parameters(&self, values: &[f64], roughening: Option<f64>) -> Parameters {
        let mut values = values.iter().copied();
        let mut next = || values.next().unwrap_or(0.0);
        let reflectance = [next(), next(), next()];
        let (roughness, ior) = (next(), next());
        let specular = if self.has_specular_weight {
            next()
        } else {
            1.0
        };
        let relief = next();
        let (transmittance, forward) = match self.transmits {
            true => (next(), next()),
            false => (0.0, 0.0),
        };
        let anisotropy = if self.is_anisotropic { next() } else { 0.0 };
        let (sheen, sheen_roughness) = match self.sheen {
            Some(_) => (next(), next()),
            None => (0.0, 0.5),
        };
        let roughening = roughening.unwrap_or_else(next);
        Parameters {
            reflectance,
            transmittance,
            forward,
            roughness,
            roughening,
            anisotropy,
            ior,
            specular,
            sheen,
            sheen_roughness,
            relief,
        }
    }

    /// The inputs of the model at a texel.
    pub fn surface(&self, p: &Parameters, texel: &Texel) -> Surface {
        let mixed = p.roughening as f32 * (1.0 - texel.order);
        Surface {
            base: (vector(p.reflectance) * texel.base()).min(Vec3::ONE),
            transmission: (p.transmittance as f32 * texel.transmission()).min(1.0),
            forward: (p.forward as f32 * texel.transmission()).min(1.0),
            transmission_colour: texel.transmission_hue(),
            roughness: (p.roughness as f32 * (1.0 + mixed)).clamp(MIN_ROUGHNESS, 1.0),
            anisotropy: p.anisotropy as f32 * texel.order,
            ior: p.ior as f32,
            specular: p.specular as f32
                * if self.has_specular_map {
                    texel.gloss
                } else {
                    1.0
                },
            sheen: p.sheen as f32 * texel.hue(),
            sheen_roughness: p.sheen_roughness as f32,
        }
    }

    /// The BSDF of one texel as a part of the cloth, 1/sr: coverage and the tilt of its normal
    /// count. Light and eye must be on the same side of the texel's plane as they are of the
    /// cloth's, or it is dark.
    pub fn texel_bsdf(
        &self,
        surface: &Surface,
        texel: &Texel,
        relief: f32,
        albedos: &Albedos,
        (w_in, w_out): (Vec3, Vec3),
    ) -> Vec3 {
        let frame = texel.frame(relief);
        let (mut i, mut o) = (frame.local(w_in), frame.local(w_out));
        if w_out.z < 0.0 {
            // Seen from behind, the normal faces the eye.
            (i, o) = (Vec3::new(i.x, -i.y, -i.z), Vec3::new(o.x, -o.y, -o.z));
        }
        let reflects = (w_in.z > 0.0) == (w_out.z > 0.0);
        if (i.z > 0.0) != reflects {
            return Vec3::ZERO;
        }
        o.z = o.z.max(1e-3);
        let value = (self.bsdf)(surface, albedos, i, o);
        value * (texel.coverage * i.z.abs() / w_in.z.abs().max(MIN_COSINE))
    }

    /// The share of light from a bright sky that a surface reflects towards an eye of this
    /// cosine: its directional albedo, with the table of round lobes.
    pub fn albedo(&self, s: &Surface, albedos: &Albedos, cos: f32) -> Vec3 {
        let f0 = f0_of_index(s.ior);
        let (alpha, _) = round(s.roughness);
        let facets = s.specular * albedos.facets(cos, alpha, f0, (50.0 * f0).min(1.0));
        let diffuse = (1.0 - s.forward) * (1.0 - s.transmission) * s.base;
        let sheen = self
            .sheen
            .map_or(0.0, |sheen| sheen.albedo(albedos, cos, s.sheen_roughness));
        let below = (1.0 - facets) * diffuse + Vec3::splat(facets);
        (1.0 - s.sheen.max_element() * sheen) * below + s.sheen * sheen
    }

    /// The mean BSDF of a textured patch, 1/sr, over texels and their inputs.
    pub fn patch_bsdf(
        &self,
        texels: &[(Texel, Surface)],
        relief: f32,
        albedos: &Albedos,
        pair: &Pair,
    ) -> [f64; 3] {
        let directions = (pair.incident.direction(), pair.exitant.direction());
        let mut sum = [0.0f64; 3];
        for (texel, surface) in texels {
            let value = self.texel_bsdf(surface, texel, relief, albedos, directions);
            for (s, v) in sum.iter_mut().zip(value.to_array()) {
                *s += f64::from(v);
            }
        }
        sum.map(|s| s / texels.len().max(1) as f64)
    }
}

/// The half vector of a pair, the light mirrored to the side of the eye.
fn half_vector(w_in: Vec3, w_out: Vec3) -> (Vec3, Vec3) {
    let mirrored = Vec3::new(w_in.x, w_in.y, w_in.z.abs());
    (mirrored, (mirrored + w_out).normalize_or_zero())
}

/// What reaches the eye of the light that a highlight leaves: diffuse light of the own side or the other
/// one, and from the other side `facets` of a colour, rough microfacets seen in a mirror.
fn below(s: &Surface, reflects: bool, facets: f32, colour: Vec3) -> Vec3 {
    let (diffuse, forward) = match reflects {
        true => ((1.0 - s.transmission) * s.base, Vec3::ZERO),
        false => (s.transmission * s.transmission_colour, facets * colour),
    };
    (1.0 - s.forward) * FRAC_1_PI * diffuse + s.forward * forward
}

/// Widths for an isotropic lobe.
fn round(roughness: f32) -> (f32, f32) {
    let alpha = (roughness * roughness).max(2e-3);
    (alpha, alpha)
}

#[cfg(test)]
mod tests;
