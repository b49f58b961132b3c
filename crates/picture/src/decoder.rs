//! The `image` crate's decoders, for the formats that it reads.

use crate::{Picture, PictureError};
use glam::UVec2;
use image::{ImageFormat, ImageReader, Limits};
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

/// The values as they stand in the file, display values from 0 to 1.
pub(crate) fn decode(
    name: &'static str,
    bytes: &[u8],
    format: ImageFormat,
) -> Result<Picture, PictureError> {
    let decoded = reader(bytes, format).decode();
    let picture = decoded
        .map_err(|e| PictureError::broken(name, e))?
        .into_rgb32f();
    Ok(Picture {
        size: UVec2::new(picture.width(), picture.height()),
        pixels: picture.pixels().map(|p| Rgb::from(p.0)).collect(),
    })
}
