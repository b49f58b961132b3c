//! Pictures of all directions, from files.

use crate::loader::Loader;
use crate::memory::free_memory_bytes;
use crate::read;
use glam::UVec2;
use image::{ImageFormat, ImageReader, Limits};
use organza_basis::Rgb;
use std::io::Cursor;
use std::path::Path;

/// Size and pixels, in rows from the top, of an OpenEXR or Radiance file.
/// Negative values, which resampling leaves behind, count as zero.
///
/// # Errors
/// Names the file and what about it is not supported.
pub fn decode(path: &Path, loader: &Loader<'_>) -> Result<(UVec2, Vec<Rgb>), String> {
    let fail = |why: &str| format!("{}: {why}", path.display());
    let bytes = loader
        .bytes_or_why(path)
        .map_err(|e| fail(&read::io_words(&e)))?;
    let format = match bytes.as_slice() {
        [0x76, 0x2f, 0x31, 0x01, ..] => ImageFormat::OpenExr,
        [b'#', b'?', ..] => ImageFormat::Hdr,
        _ => {
            return Err(fail(
                "expected an OpenEXR (.exr) or Radiance (.hdr) picture",
            ));
        }
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    // Decoding holds the picture twice.
    limits.max_alloc = Some(free_memory_bytes() / 4);
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| fail(&e.to_string()))?;
    let picture = picture.into_rgb32f();
    let size = UVec2::new(picture.width(), picture.height());
    let pixels = picture
        .pixels()
        .map(|p| Rgb::from(p.0.map(|x| if x < 0.0 { 0.0 } else { x })));
    Ok((size, pixels.collect()))
}
