//! Pictures of all directions, from files.

use crate::loader::Loader;
use crate::memory::free_memory_bytes;
use crate::read;
use glam::UVec2;
use organza_basis::Rgb;
use organza_picture::{Format, PictureError};
use std::path::Path;

/// Size and pixels, in rows from the top, of a picture in a linear format.
/// Negative values, which resampling leaves behind, count as zero.
///
/// # Errors
/// Names the file and what about it is not supported, or how much memory its
/// size would take.
pub fn decode(path: &Path, loader: &Loader<'_>) -> Result<(UVec2, Vec<Rgb>), String> {
    let fail = |why: &str| format!("{}: {why}", path.display());
    let bytes = loader
        .bytes_or_why(path)
        .map_err(|e| fail(&read::io_words(&e)))?;
    let expected = || {
        let formats = Format::list(|f| f.is_linear && f.reader.is_some());
        fail(&format!("expected an {formats} picture"))
    };
    let is_linear = organza_picture::format_of_bytes(&bytes).is_some_and(|f| f.is_linear);
    if !is_linear {
        return Err(expected());
    }
    let decoded = organza_picture::decode(&bytes, free_memory_bytes());
    let (picture, _) = decoded.map_err(|e| match e {
        PictureError::Unknown(_) => expected(),
        e => fail(&e.to_string()),
    })?;
    let positive = |p: Rgb| Rgb::from(p.0.to_array().map(|x| if x < 0.0 { 0.0 } else { x }));
    let pixels = picture.pixels.into_iter().map(positive);
    Ok((picture.size, pixels.collect()))
}
