//! The `image` crate's decoders, for the formats that it reads.

use crate::{Picture, PictureError};
use glam::UVec2;
use image::{DynamicImage, ImageFormat, ImageReader, Limits};
use organza_basis::Rgb;
use std::io::Cursor;

fn reader(bytes: &[u8], format: ImageFormat) -> ImageReader<Cursor<&[u8]>> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    // The stated size was checked against the allowed memory.
    reader.limits(Limits::no_limits());
    reader
}

/// The size that a file's header states.
pub(crate) fn size(
    name: &'static str,
    bytes: &[u8],
    format: ImageFormat,
) -> Result<UVec2, PictureError> {
    let size = reader(bytes, format).into_dimensions();
    let (width, height) = size.map_err(|e| PictureError::broken(name, e))?;
    Ok(UVec2::new(width, height))
}

/// The values as they stand in the file; those of integers as display values from
/// 0 to 1.
pub(crate) fn decode(
    name: &'static str,
    bytes: &[u8],
    format: ImageFormat,
) -> Result<Picture, PictureError> {
    let decoded = reader(bytes, format).decode();
    Ok(picture(decoded.map_err(|e| PictureError::broken(name, e))?))
}

/// The same of formats that hold radiance as floats, or else display values, which
/// are refused.
pub(crate) fn decode_floats(
    name: &'static str,
    bytes: &[u8],
    format: ImageFormat,
) -> Result<Picture, PictureError> {
    let decoded = reader(bytes, format).decode();
    let decoded = decoded.map_err(|e| PictureError::broken(name, e))?;
    match decoded {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => Ok(picture(decoded)),
        other => Err(PictureError::broken(
            name,
            format!(
                "it holds {:?} values; expected 32-bit floats in red, green and blue",
                other.color()
            ),
        )),
    }
}

fn picture(decoded: DynamicImage) -> Picture {
    let decoded = decoded.into_rgb32f();
    Picture {
        size: UVec2::new(decoded.width(), decoded.height()),
        pixels: decoded.pixels().map(|p| Rgb::from(p.0)).collect(),
    }
}
