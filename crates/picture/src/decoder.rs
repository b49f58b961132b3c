//! The `image` crate's decoders, for the formats that it reads.

use crate::{Picture, PictureError};
use glam::UVec2;
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use organza_basis::Rgb;
use std::io::Cursor;

fn reader(bytes: &[u8], format: ImageFormat) -> ImageReader<Cursor<&[u8]>> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    // The stated size was checked against the allowed memory.
    reader.limits(Limits::no_limits());
    reader
}

/// The size that a file's header states, as the picture is to be shown.
pub(crate) fn size(
    name: &'static str,
    bytes: &[u8],
    format: ImageFormat,
) -> Result<UVec2, PictureError> {
    let broken = |e| PictureError::broken(name, e);
    let mut decoder = reader(bytes, format).into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let stated = UVec2::new(width, height);
    Ok(match orientation(&mut decoder) {
        Orientation::Rotate90
        | Orientation::Rotate270
        | Orientation::Rotate90FlipH
        | Orientation::Rotate270FlipH => UVec2::new(stated.y, stated.x),
        _ => stated,
    })
}

/// How a camera was held, by the file's Exif data; upright where that says nothing.
fn orientation(decoder: &mut impl ImageDecoder) -> Orientation {
    decoder.orientation().unwrap_or(Orientation::NoTransforms)
}

/// Whether a file holds floats, and not the whole numbers of display values.
pub(crate) fn holds_floats(bytes: &[u8], format: ImageFormat) -> bool {
    let decoder = reader(bytes, format).into_decoder();
    decoder.is_ok_and(|d| matches!(d.color_type(), ColorType::Rgb32F | ColorType::Rgba32F))
}

/// Linear values: floats as they stand in the file, whole numbers as sRGB.
pub(crate) fn decode(
    name: &'static str,
    bytes: &[u8],
    format: ImageFormat,
) -> Result<Picture, PictureError> {
    let broken = |e| PictureError::broken(name, e);
    let mut decoder = reader(bytes, format).into_decoder().map_err(broken)?;
    let orientation = orientation(&mut decoder);
    let mut decoded = DynamicImage::from_decoder(decoder).map_err(broken)?;
    decoded.apply_orientation(orientation);
    let is_linear = matches!(
        decoded,
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_)
    );
    let decoded = decoded.into_rgb32f();
    let linear = |values: [f32; 3]| match is_linear {
        true => values,
        false => values.map(Rgb::linear_from_srgb),
    };
    Ok(Picture {
        size: UVec2::new(decoded.width(), decoded.height()),
        pixels: decoded.pixels().map(|p| Rgb::from(linear(p.0))).collect(),
    })
}
