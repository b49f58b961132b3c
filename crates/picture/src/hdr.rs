//! Radiance pictures (`.hdr`): linear, with a shared exponent; read only.

use crate::decoder;
use crate::format::{Format, Reader};
use image::ImageFormat;

const NAME: &str = "Radiance";

/// The record of the format.
pub const FORMAT: Format = Format {
    name: NAME,
    endings: &["hdr"],
    keeps: "linear radiance",
    starts: &[b"#?"],
    is_linear: true,
    keeps_sums: false,
    reader: Some(Reader {
        size: |bytes| decoder::size(NAME, bytes, ImageFormat::Hdr),
        shown_size: |bytes| decoder::size(NAME, bytes, ImageFormat::Hdr),
        decode: |bytes| decoder::decode(NAME, bytes, ImageFormat::Hdr),
        holds_radiance: |_| true,
    }),
    writer: None,
};
