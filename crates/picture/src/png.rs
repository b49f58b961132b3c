//! PNG pictures: 8-bit sRGB, tone-mapped when a render is written.

use crate::PictureError;
use crate::decoder;
use crate::format::{Format, Reader, WriteSeek};
use crate::picture::{Picture, Rendered};
use glam::UVec2;
use image::{ExtendedColorType, ImageEncoder, ImageFormat};
use organza_basis::Rgb;

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
        decode,
    }),
    writer: Some(write),
};

/// Linear values of the file's sRGB.
fn decode(bytes: &[u8]) -> Result<Picture, PictureError> {
    let mut picture = decoder::decode(NAME, bytes, ImageFormat::Png)?;
    for pixel in &mut picture.pixels {
        *pixel = Rgb::from(pixel.0.to_array().map(Rgb::linear_from_srgb));
    }
    Ok(picture)
}

fn write(rendered: &Rendered<'_>, out: &mut dyn WriteSeek) -> Result<(), PictureError> {
    write_colours(&rendered.colours(), rendered.exposure_stops, out)
}

/// Writes linear colours, brightened by so many stops and tone-mapped.
///
/// # Errors
/// The sink fails.
pub fn write_colours(
    picture: &Picture,
    exposure_stops: f32,
    out: &mut dyn WriteSeek,
) -> Result<(), PictureError> {
    let gain = exposure_stops.exp2();
    let pixels = picture.pixels.iter();
    let bytes: Vec<u8> = pixels
        .flat_map(|&p| tone_map(p * gain).map(Rgb::srgb8))
        .collect();
    write_rgb8(picture.size, &bytes, out)
}

/// Writes 8-bit sRGB, three bytes a pixel in rows from the top.
///
/// # Errors
/// The sink fails.
pub fn write_rgb8(size: UVec2, rgb: &[u8], out: &mut dyn WriteSeek) -> Result<(), PictureError> {
    image::codecs::png::PngEncoder::new(out)
        .write_image(rgb, size.x, size.y, ExtendedColorType::Rgb8)
        .map_err(|e| PictureError::write(NAME, e))
}

/// Highlights above this value are compressed; all below keep theirs.
const SHOULDER: f32 = 0.8;

/// Linear below the shoulder, then bent so that any brightness stays below
/// one; all channels are scaled alike, which keeps the hue.
fn tone_map(c: Rgb) -> [f32; 3] {
    let y = c.max_component();
    if y <= SHOULDER {
        return c.into();
    }
    let over = (y - SHOULDER) / (1.0 - SHOULDER);
    let bent = SHOULDER + (1.0 - SHOULDER) * over / (1.0 + over);
    (c * (bent / y)).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tone_mapping_keeps_the_dark_and_bounds_the_bright() {
        assert_eq!(tone_map(Rgb::new(0.1, 0.5, 0.8)), [0.1, 0.5, 0.8]);
        let mut last = 0.8;
        for i in 1..200 {
            let [r, g, _] = tone_map(Rgb::new(0.8 + i as f32, 0.4 + 0.5 * i as f32, 0.0));
            assert!(r > last && r < 1.0, "monotone and below one");
            assert!((g / r - 0.5).abs() < 1e-5, "hue kept");
            last = r;
        }
    }
}
