//! TIFF pictures: linear `f32` colours, for programs that do not read OpenEXR; sRGB of 8 or 16 bits
//! is read, too.

use crate::format::{Format, Reader, WriteSeek};
use crate::picture::Rendered;
use crate::{PictureError, decoder};
use image::codecs::tiff::TiffEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageFormat};

const NAME: &str = "TIFF";

/// The record of the format.
pub const FORMAT: Format = Format {
    name: NAME,
    endings: &["tif", "tiff"],
    keeps: "linear radiance",
    starts: &[b"II*\0", b"MM\0*"],
    is_linear: true,
    keeps_sums: false,
    reader: Some(Reader {
        size: |bytes| decoder::size(NAME, bytes, ImageFormat::Tiff),
        shown_size: |bytes| decoder::size(NAME, bytes, ImageFormat::Tiff),
        decode: |bytes| decoder::decode(NAME, bytes, ImageFormat::Tiff),
        holds_radiance: |bytes| decoder::holds_floats(bytes, ImageFormat::Tiff),
    }),
    writer: Some(write),
};

fn write(rendered: &Rendered<'_>, out: &mut dyn WriteSeek) -> Result<(), PictureError> {
    let size = rendered.size();
    let pixels = rendered.colours().pixels;
    // The encoder takes samples in the order of bytes of this machine.
    let bytes: Vec<u8> = pixels
        .iter()
        .flat_map(|p| p.0.to_array().map(f32::to_ne_bytes))
        .flatten()
        .collect();
    TiffEncoder::new(out)
        .write_image(&bytes, size.x, size.y, ExtendedColorType::Rgb32F)
        .map_err(|e| PictureError::write(NAME, e))
}
