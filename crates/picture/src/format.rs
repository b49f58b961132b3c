//! The record of a picture format.

use crate::{FORMATS, Picture, PictureError, Rendered};
use glam::UVec2;
use std::io::{Seek, Write};

/// What encoders need of a file.
pub trait WriteSeek: Write + Seek {}
impl<T: Write + Seek + ?Sized> WriteSeek for T {}

/// How a format is read.
#[derive(Clone, Copy, Debug)]
pub struct Reader {
    /// The largest size that the file states, from its header alone: what memory is taken for.
    pub size: fn(&[u8]) -> Result<UVec2, PictureError>,
    /// The size of the picture, from the header alone.
    pub shown_size: fn(&[u8]) -> Result<UVec2, PictureError>,
    /// The pixels, in linear values.
    pub decode: fn(&[u8]) -> Result<Picture, PictureError>,
    /// Whether a file holds radiance of any size, and not display values from 0 to 1.
    pub holds_radiance: fn(&[u8]) -> bool,
}

/// How a render is written.
pub type Writer = fn(&Rendered<'_>, &mut dyn WriteSeek) -> Result<(), PictureError>;

/// One format of picture files.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// Name, for messages.
    pub name: &'static str,
    /// Endings of file names, in lower case and without the dot; the first one
    /// is the usual one.
    pub endings: &'static [&'static str],
    /// What a written file keeps of a render, for help texts.
    pub keeps: &'static str,
    /// What a file may begin with.
    pub starts: &'static [&'static [u8]],
    /// Whether values are linear radiance of any size, and not display values
    /// from 0 to 1.
    pub is_linear: bool,
    /// Whether a render's exact sums are kept, so that parts can be merged.
    pub keeps_sums: bool,
    /// How it is read, if it can be.
    pub reader: Option<Reader>,
    /// How a render is written, if it can be.
    pub writer: Option<Writer>,
}

/// Memory that decoding takes for a pixel: four channels of 32 bits as decoded,
/// three as `f32`, and those of the [`Picture`].
const BYTES_OF_PIXEL: u64 = 16 + 12 + 12;

/// The format of a file name's ending (without the dot, in any case).
pub fn format_of_ending(ending: &str) -> Option<&'static Format> {
    let ending = ending.to_ascii_lowercase();
    FORMATS
        .iter()
        .copied()
        .find(|f| f.endings.contains(&ending.as_str()))
}

/// The format that bytes begin like.
pub fn format_of_bytes(bytes: &[u8]) -> Option<&'static Format> {
    FORMATS
        .iter()
        .copied()
        .find(|f| f.starts.iter().any(|start| bytes.starts_with(start)))
}

/// Reads a picture of any format that can be read, in linear values.
///
/// # Errors
/// Another kind of file, a broken one, or one whose stated size takes more than
/// `max_memory_bytes`.
pub fn decode(
    bytes: &[u8],
    max_memory_bytes: u64,
) -> Result<(Picture, &'static Format), PictureError> {
    let format = format_of_bytes(bytes);
    let (Some(format), Some(reader)) = (format, format.and_then(|f| f.reader)) else {
        return Err(PictureError::Unknown(Format::list(|f| f.reader.is_some())));
    };
    check_memory((reader.size)(bytes)?, BYTES_OF_PIXEL, max_memory_bytes)?;
    Ok(((reader.decode)(bytes)?, format))
}

/// The size of the picture that [`decode`] would read, from the header alone.
///
/// # Errors
/// Another kind of file, or a broken header.
pub fn stated_size(bytes: &[u8]) -> Result<UVec2, PictureError> {
    match format_of_bytes(bytes).and_then(|f| f.reader) {
        Some(reader) => (reader.shown_size)(bytes),
        None => Err(PictureError::Unknown(Format::list(|f| f.reader.is_some()))),
    }
}

/// Refuses a picture whose pixels take more memory than allowed.
pub(crate) fn check_memory(
    size: UVec2,
    bytes_of_pixel: u64,
    allowed: u64,
) -> Result<(), PictureError> {
    let pixels = u64::from(size.x) * u64::from(size.y);
    let needed = pixels.saturating_mul(bytes_of_pixel);
    if needed > allowed {
        return Err(PictureError::Memory {
            width: size.x,
            height: size.y,
            needed,
            allowed,
        });
    }
    Ok(())
}

impl Format {
    /// The formats that `is_meant`, as "OpenEXR (.exr) or PNG (.png)".
    pub fn list(is_meant: impl Fn(&Format) -> bool) -> String {
        let named = |f: &&Format| format!("{} (.{})", f.name, f.endings[0]);
        joined(FORMATS.iter().copied().filter(|f| is_meant(f)), named)
    }

    /// The endings of the formats that `is_meant`, as ".exr or .png".
    pub fn list_endings(is_meant: impl Fn(&Format) -> bool) -> String {
        let named = |f: &&Format| format!(".{}", f.endings[0]);
        joined(FORMATS.iter().copied().filter(|f| is_meant(f)), named)
    }
}

/// "a, b or c".
fn joined<T>(items: impl Iterator<Item = T>, named: impl Fn(&T) -> String) -> String {
    let mut names: Vec<String> = items.map(|item| named(&item)).collect();
    match names.pop() {
        Some(last) if names.is_empty() => last,
        Some(last) => format!("{} or {last}", names.join(", ")),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::Rgb;
    use organza_film::{Film, Pixel};
    use std::io::Cursor;

    /// A film without samples, which every writer takes.
    fn film(size: UVec2) -> Film {
        let mut film = Film::new(size);
        film.pixels_mut().fill(Pixel::default());
        film
    }

    #[test]
    fn names_and_first_bytes_belong_to_one_format_each() {
        for (i, a) in FORMATS.iter().enumerate() {
            assert!(!a.endings.is_empty() && !a.starts.is_empty(), "{}", a.name);
            for b in &FORMATS[i + 1..] {
                for ending in a.endings {
                    assert!(!b.endings.contains(ending), "{} and {}", a.name, b.name);
                }
                for start in a.starts {
                    let clash = b
                        .starts
                        .iter()
                        .any(|s| s.starts_with(start) || start.starts_with(s));
                    assert!(!clash, "{} and {}", a.name, b.name);
                }
            }
        }
    }

    #[test]
    fn what_a_format_writes_is_known_by_its_first_bytes_and_read_again() {
        for format in FORMATS {
            let Some(write) = format.writer else { continue };
            let size = UVec2::new(5, 3);
            let (film, attributes) = (film(size), crate::Attributes::default());
            let rendered = Rendered::new(&film, crate::Display::default(), &attributes);
            let mut out = Cursor::new(Vec::new());
            write(&rendered, &mut out).unwrap();
            let bytes = out.into_inner();
            let known = format_of_bytes(&bytes).map(|f| f.name);
            assert_eq!(known, Some(format.name));
            if format.reader.is_some() {
                let (picture, _) = decode(&bytes, 1 << 20).unwrap();
                assert_eq!(picture.size, size, "{}", format.name);
                assert_eq!(picture.pixels, vec![Rgb::BLACK; 15], "{}", format.name);
            }
        }
    }

    #[test]
    fn a_picture_is_refused_by_its_stated_size_before_it_is_decoded() {
        // Known bad: with enough memory allowed, the same file is read.
        let picture = Picture::new(UVec2::new(300, 200), vec![Rgb::BLACK; 300 * 200]);
        let mut out = Cursor::new(Vec::new());
        crate::exr::write_colours(&picture, &mut out).unwrap();
        let bytes = out.into_inner();
        let needed = 300 * 200 * BYTES_OF_PIXEL;
        assert!(bytes.len() < 20_000, "small: {}", bytes.len());
        assert!(decode(&bytes, needed).is_ok());
        let refused = decode(&bytes, needed - 1).unwrap_err().to_string();
        assert!(
            refused.starts_with("has 300 x 200 pixels, which take "),
            "{refused}"
        );
        let unknown = decode(b"[camera]", 1 << 20).unwrap_err().to_string();
        assert!(unknown.starts_with("is no picture"), "{unknown}");
    }
}
