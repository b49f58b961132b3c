//! Pictures of all directions, from files.

use crate::error::{InputError, Result};
use crate::loader::Loader;
use crate::memory::free_memory_bytes;
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
pub fn decode(
    path: &Path,
    max_memory_bytes: Option<u64>,
    loader: &Loader<'_>,
) -> Result<(UVec2, Vec<Rgb>)> {
    let fail = |why: &str| InputError::of_file(path, why);
    let bytes = loader.bytes(path)?;
    let expected = || {
        let formats = Format::list(|f| f.is_linear && f.reader.is_some());
        fail(&format!("expected an {formats} picture"))
    };
    let allowed = max_memory_bytes.unwrap_or_else(free_memory_bytes);
    let reader = organza_picture::format_of_bytes(&bytes).and_then(|f| f.reader);
    if !reader.is_some_and(|reader| (reader.holds_radiance)(&bytes)) {
        return Err(expected());
    }
    let decoded = organza_picture::decode(&bytes, allowed);
    let (picture, _) = decoded.map_err(|e| match e {
        PictureError::Unknown(_) => expected(),
        e => fail(&e.to_string()),
    })?;
    let positive = |p: Rgb| Rgb::from(p.0.to_array().map(|x| if x < 0.0 { 0.0 } else { x }));
    let pixels = picture.pixels.into_iter().map(positive);
    Ok((picture.size, pixels.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_picture::{Picture, exr};

    #[test]
    fn a_sky_that_takes_more_memory_than_allowed_is_refused_by_its_header() {
        let size = UVec2::new(300, 200);
        let picture = Picture {
            size,
            pixels: vec![Rgb::splat(-1.0); 300 * 200],
        };
        let mut out = std::io::Cursor::new(Vec::new());
        exr::write_colours(&picture, &mut out).unwrap();
        let name = format!("organza-environment-{}.exr", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, out.get_ref()).unwrap();
        let decode = |allowed| decode(&path, Some(allowed), &Loader::new());
        let refused = decode(1 << 20).unwrap_err().to_string();
        // The known-bad twin: with more memory it is read, without negative values.
        let read = decode(1 << 24);
        std::fs::remove_file(&path).unwrap();
        assert!(refused.contains("has 300 x 200 pixels"), "{refused}");
        assert_eq!(read.unwrap(), (size, vec![Rgb::BLACK; 300 * 200]));
    }
}
