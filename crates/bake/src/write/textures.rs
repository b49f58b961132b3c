//! The textures of a tile, as PNG files.

use super::WriteError;
use crate::maps::Maps;
use crate::model::{OPENPBR, Parameters, Surface};
use crate::texel::Texel;
use glam::{UVec2, Vec3};
use organza_basis::Rgb;
use png::{BitDepth, ColorType};
use std::f32::consts::{FRAC_PI_4, PI};

/// The folder of the textures, beside the materials that name them; each colourway has one in it.
pub const FOLDER: &str = "textures";

/// One texture file.
#[derive(Clone, Debug)]
pub struct TextureFile {
    /// Its name in the folder of textures.
    pub name: &'static str,
    /// What its values mean.
    pub meaning: &'static str,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

const GREY8: (ColorType, BitDepth) = (ColorType::Grayscale, BitDepth::Eight);
const GREY16: (ColorType, BitDepth) = (ColorType::Grayscale, BitDepth::Sixteen);
const RGB8: (ColorType, BitDepth) = (ColorType::Rgb, BitDepth::Eight);
const RGBA8: (ColorType, BitDepth) = (ColorType::Rgba, BitDepth::Eight);

/// One 8-bit value of a share.
fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

fn colour(value: Vec3) -> [u8; 3] {
    value.to_array().map(Rgb::srgb8)
}

/// A normal as a normal map holds it, green along y.
fn normal(value: Vec3) -> [u8; 3] {
    (0.5 * value + Vec3::splat(0.5)).to_array().map(byte)
}

/// What the values of a PNG are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Values {
    /// Colours, encoded as sRGB: the file says so by the chunk `sRGB`, and by `gAMA` for
    /// programs that do not know that one [PNG2025].
    Colours,
    /// Numbers in proportion to what they mean. The file states no colour space: a program
    /// that obeys one would change the numbers. The material that names the file says how
    /// to read it.
    Numbers,
    /// Either, inside a glTF file, whose materials fix the meaning: readers must ignore what
    /// images state about colour [glTF2021], so they state nothing.
    OfGltf,
}

/// `gAMA` of sRGB, in units of 1/100000 [PNG2025].
const SRGB_GAMMA: u32 = 45_455;

/// Encodes channels of 8 bits, or of 16 bits with the high byte first, in rows from the top.
///
/// # Errors
/// Pixels that do not fill the size, or no memory for the file.
fn png(
    size: UVec2,
    pixels: &[u8],
    (kind, depth): (ColorType, BitDepth),
    values: Values,
) -> Result<Vec<u8>, WriteError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size.x, size.y);
    encoder.set_color(kind);
    encoder.set_depth(depth);
    if values == Values::Colours {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        encoder.set_source_gamma(png::ScaledFloat::from_scaled(SRGB_GAMMA));
    }
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(pixels)?;
        writer.finish()
    });
    written.map_err(|e| WriteError::Encoding(e.to_string()))?;
    Ok(bytes)
}

/// The textures that materials beside them name: what was measured, which the materials
/// multiply by constants. Only the roughness is that of a material, OpenPBR. `relief`: factor
/// of the slopes of the second normal map, for programs that cannot scale one.
///
/// # Errors
/// See [`png`].
pub fn texture_files(
    maps: &Maps,
    parameters: &Parameters,
    relief: f64,
) -> Result<Vec<TextureFile>, WriteError> {
    let surfaces: Vec<Surface> = maps
        .texels
        .iter()
        .map(|t| OPENPBR.surface(parameters, t))
        .collect();
    let grey = |value: &dyn Fn(&Texel, &Surface) -> f32| {
        let pairs = maps.texels.iter().zip(&surfaces);
        let bytes: Vec<u8> = pairs.map(|(t, s)| byte(value(t, s))).collect();
        png(maps.size, &bytes, GREY8, Values::Numbers)
    };
    let rgb = |values: Values, value: &dyn Fn(&Texel, &Surface) -> [u8; 3]| {
        let pairs = maps.texels.iter().zip(&surfaces);
        let bytes: Vec<u8> = pairs.flat_map(|(t, s)| value(t, s)).collect();
        png(maps.size, &bytes, RGB8, values)
    };
    let (low, high) = maps.height_range_mm();
    let height: Vec<u8> = maps
        .height_mm
        .iter()
        .flat_map(|h| (((h - low) / (high - low) * 65535.0 + 0.5) as u16).to_be_bytes())
        .collect();
    let file = |name, meaning, bytes| TextureFile {
        name,
        meaning,
        bytes,
    };
    Ok(vec![
        file(
            "base_color.png",
            "measured colour, sRGB: light reflected from a bright sky, without what is transmitted",
            rgb(Values::Colours, &|t, _| colour(t.base()))?,
        ),
        file(
            "opacity.png",
            "share of the texel that fibres cover, seen along the normal",
            grey(&|t, _| t.coverage)?,
        ),
        file(
            "normal.png",
            "normal of the threads, (n + 1) / 2, green along the warp, whole relief",
            rgb(Values::Numbers, &|t, _| normal(t.normal(1.0)))?,
        ),
        file(
            "normal_preview.png",
            "the same with the relief of the USD material",
            rgb(Values::Numbers, &|t, _| normal(t.normal(relief as f32)))?,
        ),
        file(
            "height.png",
            "height of the threads between height_mm of bake.json, 16 bits",
            png(maps.size, &height, GREY16, Values::Numbers)?,
        ),
        file(
            "roughness.png",
            "roughness of the OpenPBR material",
            grey(&|_, s| s.roughness)?,
        ),
        file(
            "anisotropy.png",
            "how parallel the visible fibres are: the anisotropy before its factor",
            grey(&|t, _| t.order)?,
        ),
        file(
            "anisotropy_rotation.png",
            "angle from the weft of the direction across the fibres, in which the highlight is \
             wide: 180 degrees times the value, less 45",
            grey(&|t, _| (t.across_rad + FRAC_PI_4) / PI)?,
        ),
        file(
            "sheen.png",
            "colour of the sheen without its weight, sRGB",
            rgb(Values::Colours, &|t, _| colour(t.hue()))?,
        ),
        file(
            "diffuse_transmission.png",
            "measured share of light that is transmitted by scattering",
            grey(&|t, _| t.transmission())?,
        ),
        file(
            "diffuse_transmission_color.png",
            "colour of the transmitted light, sRGB, its strongest channel one",
            rgb(Values::Colours, &|t, _| colour(t.transmission_hue()))?,
        ),
        file(
            "specular.png",
            "weight of the highlight: light reflected by one fibre",
            grey(&|_, s| s.specular)?,
        ),
    ])
}

/// A texture inside a glTF file: its pixels, or their value where all are the same.
#[derive(Clone, Debug)]
pub enum GltfTexture {
    /// Red, green, blue and alpha of all texels.
    Constant([u8; 4]),
    /// A PNG.
    Picture(Vec<u8>),
}

/// The textures that a glTF material holds: several maps share the channels of one. Base colour
/// and normal are pictures in any case, since importers look for them.
///
/// # Errors
/// See [`png`].
pub fn gltf_textures(
    maps: &Maps,
    surfaces: &[Surface],
) -> Result<Vec<(&'static str, GltfTexture)>, WriteError> {
    let picture = |pixels: &[[u8; 4]], has_alpha: bool| {
        let (kind, channels) = if has_alpha { (RGBA8, 4) } else { (RGB8, 3) };
        let bytes: Vec<u8> = pixels
            .iter()
            .flat_map(|p| &p[..channels])
            .copied()
            .collect();
        png(maps.size, &bytes, kind, Values::OfGltf).map(GltfTexture::Picture)
    };
    let pixels = |value: &dyn Fn(&Texel, &Surface) -> [u8; 4]| -> Vec<[u8; 4]> {
        let pairs = maps.texels.iter().zip(surfaces);
        pairs.map(|(t, s)| value(t, s)).collect()
    };
    let texture = |has_alpha: bool, value: &dyn Fn(&Texel, &Surface) -> [u8; 4]| {
        let pixels = pixels(value);
        match pixels.first() {
            Some(first) if pixels.iter().all(|p| p == first) => Ok(GltfTexture::Constant(*first)),
            _ => picture(&pixels, has_alpha),
        }
    };
    let with_alpha = |c: [u8; 3], a: f32| [c[0], c[1], c[2], byte(a)];
    let opaque = |c: [u8; 3]| with_alpha(c, 1.0);
    let base = pixels(&|t, s| with_alpha(colour(s.base), t.coverage));
    let normals = pixels(&|t, _| opaque(normal(t.normal(1.0))));
    Ok(vec![
        ("base_color", picture(&base, true)?),
        ("normal", picture(&normals, false)?),
        (
            "roughness",
            texture(false, &|_, s| {
                opaque([byte(s.forward), byte(s.roughness), 0])
            })?,
        ),
        (
            "anisotropy",
            texture(false, &|t, s| {
                let (sin, cos) = t.across_rad.sin_cos();
                opaque([0.5 + 0.5 * cos, 0.5 + 0.5 * sin, s.anisotropy].map(byte))
            })?,
        ),
        ("sheen", texture(false, &|t, _| opaque(colour(t.hue())))?),
        (
            "diffuse_transmission",
            texture(true, &|_, s| {
                with_alpha(colour(s.transmission_colour), s.transmission)
            })?,
        ),
        (
            "specular",
            texture(true, &|t, _| with_alpha([255; 3], t.gloss))?,
        ),
    ])
}
