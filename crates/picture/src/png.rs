//! PNG pictures: sRGB of 8 or 16 bits, tone-mapped when a render is written.

use crate::format::{Format, Reader, WriteSeek};
use crate::picture::{Picture, Rendered};
use crate::{Display, PictureError, PngBits, decoder};
use glam::UVec2;
use image::ImageFormat;
use organza_basis::Rgb;
use png::BitDepth;

const NAME: &str = "PNG";

/// The record of the format.
pub const FORMAT: Format = Format {
    name: NAME,
    endings: &["png"],
    keeps: "display values, tone-mapped",
    starts: &[b"\x89PNG"],
    is_linear: false,
    keeps_sums: false,
    reader: Some(Reader {
        size: |bytes| decoder::size(NAME, bytes, ImageFormat::Png),
        shown_size: |bytes| decoder::size(NAME, bytes, ImageFormat::Png),
        decode: |bytes| decoder::decode(NAME, bytes, ImageFormat::Png),
        holds_radiance: |_| false,
    }),
    writer: Some(write),
};

fn write(rendered: &Rendered<'_>, out: &mut dyn WriteSeek) -> Result<(), PictureError> {
    write_colours(&rendered.colours(), &rendered.display, out)
}

/// Writes linear colours as a display shows them.
///
/// # Errors
/// The sink fails.
pub fn write_colours(
    picture: &Picture,
    display: &Display,
    out: &mut dyn WriteSeek,
) -> Result<(), PictureError> {
    write_shown(picture.size, display.apply(picture), display.png_bits, out)
}

/// Writes linear display values, which are clamped to 0 to 1, in rows from the top.
///
/// # Errors
/// The sink fails.
pub fn write_shown(
    size: UVec2,
    pixels: impl Iterator<Item = [f32; 3]>,
    bits: PngBits,
    out: &mut dyn WriteSeek,
) -> Result<(), PictureError> {
    let shown = pixels.flatten();
    match bits {
        PngBits::Eight => {
            let bytes: Vec<u8> = shown.map(Rgb::srgb8).collect();
            write_rgb8(size, &bytes, out)
        }
        PngBits::Sixteen => {
            let bytes: Vec<u8> = shown.flat_map(|v| srgb16(v).to_be_bytes()).collect();
            encode(size, BitDepth::Sixteen, &bytes, out)
        }
    }
}

/// Writes 8-bit sRGB, three bytes a pixel in rows from the top.
///
/// # Errors
/// The sink fails.
pub fn write_rgb8(size: UVec2, rgb: &[u8], out: &mut dyn WriteSeek) -> Result<(), PictureError> {
    encode(size, BitDepth::Eight, rgb, out)
}

/// `gAMA` of sRGB, in units of 1/100000 [PNG2025].
const SRGB_GAMMA: u32 = 45_455;
/// `cHRM` of sRGB: x and y of white, red, green and blue [PNG2025].
const SRGB_CHROMATICITIES: [(f32, f32); 4] =
    [(0.3127, 0.3290), (0.64, 0.33), (0.30, 0.60), (0.15, 0.06)];

/// Encodes RGB with the colour space stated: the chunk `sRGB`, and `gAMA` and `cHRM` for
/// programs that do not know that one [PNG2025].
fn encode(
    size: UVec2,
    depth: BitDepth,
    bytes: &[u8],
    out: &mut dyn WriteSeek,
) -> Result<(), PictureError> {
    let mut encoder = png::Encoder::new(out, size.x, size.y);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(depth);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_source_gamma(png::ScaledFloat::from_scaled(SRGB_GAMMA));
    let [white, red, green, blue] = SRGB_CHROMATICITIES;
    encoder.set_source_chromaticities(png::SourceChromaticities::new(white, red, green, blue));
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(bytes)?;
        writer.finish()
    });
    written.map_err(|e| PictureError::write(NAME, e))
}

/// One 16-bit sRGB channel (IEC 61966-2-1) of a linear value, rounded.
fn srgb16(linear: f32) -> u16 {
    let x = f64::from(linear).clamp(0.0, 1.0);
    let y = if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    };
    (y * 65_535.0 + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Exposure, ToneMapping};
    use std::io::Cursor;

    fn ramp() -> Picture {
        let value = |i: u32| Rgb::new(i as f32 / 1023.0, 0.5, 1.5 * i as f32 / 1023.0);
        Picture::new(UVec2::new(64, 16), (0..1024).map(value).collect())
    }

    fn written(picture: &Picture, display: &Display) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        write_colours(picture, display, &mut out).unwrap();
        out.into_inner()
    }

    #[test]
    fn sixteen_bits_hold_the_values_256_times_as_finely() {
        let picture = ramp();
        let errors = [PngBits::Eight, PngBits::Sixteen].map(|png_bits| {
            let display = Display {
                png_bits,
                ..Display::default()
            };
            let read = crate::decode(&written(&picture, &display), 1 << 20)
                .unwrap()
                .0;
            assert_eq!(read.size, picture.size);
            let shown: Vec<[f32; 3]> = display.apply(&picture).collect();
            let pairs = read.pixels.iter().zip(shown);
            let error = pairs.map(|(r, s)| (r.0 - glam::Vec3::from(s)).abs().max_element());
            error.fold(0.0, f32::max)
        });
        // Half a step of the steepest part, 2.4 / 1.055 of the encoded range.
        assert!(errors[1] < 1.2 / 65_535.0 + 3e-7, "{errors:?}");
        assert!(
            errors[0] > 100.0 / 65_535.0 && errors[0] < 1.2 / 255.0,
            "{errors:?}"
        );
    }

    #[test]
    fn files_state_their_colour_space_and_depth() {
        for (png_bits, depth) in [
            (PngBits::Eight, BitDepth::Eight),
            (PngBits::Sixteen, BitDepth::Sixteen),
        ] {
            let display = Display {
                png_bits,
                exposure: Exposure::Auto,
                tone_mapping: ToneMapping::Agx,
                ..Display::default()
            };
            let bytes = written(&ramp(), &display);
            let reader = png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
            let info = reader.info();
            assert_eq!(
                (info.bit_depth, info.color_type),
                (depth, png::ColorType::Rgb)
            );
            assert_eq!(info.srgb, Some(png::SrgbRenderingIntent::Perceptual));
            for chunk in [b"sRGB", b"gAMA", b"cHRM"] {
                assert!(bytes.windows(4).any(|w| w == chunk), "{chunk:?}");
            }
        }
    }

    #[test]
    fn sixteen_bits_round_to_the_eight() {
        for i in 0..=4096 {
            let linear = i as f32 / 4096.0;
            let eight = f64::from(srgb16(linear)) / 257.0;
            let apart = (eight - f64::from(Rgb::srgb8(linear))).abs();
            assert!(apart <= 0.503, "{linear}: {apart}");
        }
        assert_eq!(
            [srgb16(-1.0), srgb16(0.0), srgb16(1.0), srgb16(9.0)],
            [0, 0, 65_535, 65_535]
        );
        assert_eq!(srgb16(f32::NAN), 0);
    }
}
