//! Picture files by their paths; the formats themselves are `organza-picture`'s.

use crate::context::Context;
use crate::error::of_file;
use crate::output;
use anyhow::Result;
use glam::UVec2;
use organza_basis::Rgb;
use organza_film::Film;
use organza_picture::exr::{self, StoredRender};
use organza_picture::{
    Attributes, Display, Exposure, Format, Picture, PictureError, PngBits, Rendered, WhiteBalance,
    WriteSeek, format_of_ending, png,
};
use organza_scene::read;
use std::path::{Path, PathBuf};

/// The format that a render is written in, by the ending of its name.
///
/// # Errors
/// An ending of no format that renders can be written in.
pub fn format(path: &Path) -> Result<&'static Format> {
    format_that(path, |f| f.writer.is_some())
}

/// The same for formats that keep the sums from which parts are merged.
///
/// # Errors
/// Another ending.
pub fn format_of_parts(path: &Path) -> Result<&'static Format> {
    format_that(path, |f| f.writer.is_some() && f.keeps_sums)
}

fn format_that(path: &Path, is_meant: fn(&Format) -> bool) -> Result<&'static Format> {
    let ending = path.extension().and_then(|e| e.to_str());
    let format = ending.and_then(format_of_ending);
    format.filter(|f| is_meant(f)).ok_or_else(|| {
        of_file(
            path,
            format!(
                "expected a name that ends in {}",
                Format::list_endings(is_meant)
            ),
        )
    })
}

/// Whether a name is that of a format for linear values.
pub fn is_linear(path: &Path) -> bool {
    format_that(path, |_| true).is_ok_and(|f| f.is_linear)
}

/// The settings with the numbers that a picture gets where they say `auto`, which are noted.
/// Linear formats, which ignore the settings, leave them as they are.
pub fn resolved(path: &Path, film: &Film, display: Display, context: &Context) -> Display {
    if !display.is_auto() || is_linear(path) {
        return display;
    }
    let attributes = Attributes::default();
    let rendered = Rendered::new(film, display, &attributes);
    let resolved = display.resolve(&rendered.colours());
    if let (Exposure::Auto, number) = (display.exposure, resolved.exposure) {
        let same = format!("--exposure {number} gives the same");
        context.note(format!("exposure      auto: {number} stops ({same})"));
    }
    if let (WhiteBalance::Auto, white) = (display.white_balance, resolved.white_balance) {
        let same = format!("--white-balance {white} gives the same");
        context.note(format!("white balance auto: {white} ({same})"));
    }
    resolved
}

/// Writes a render in the format of the path's ending.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, rendered: &Rendered<'_>) -> Result<()> {
    let Some(writer) = format(path)?.writer else {
        return Err(of_file(
            path,
            "no picture of a render is written in this format",
        ));
    };
    write_with(path, |out| writer(rendered, out))
}

/// The formats that a denoised picture can be written in.
fn is_for_denoised(format: &Format) -> bool {
    format.writer.is_some() && (format.keeps_sums || format.endings == png::FORMAT.endings)
}

/// The files that [`write_denoised`] writes.
///
/// # Errors
/// An ending of another format.
pub fn files_of_denoised(path: &Path) -> Result<Vec<PathBuf>> {
    let format = format_that(path, is_for_denoised)?;
    let noisy = || path.with_extension(format!("noisy.{}", format.endings[0]));
    let mut files = vec![path.to_owned()];
    files.extend((!format.keeps_sums).then(noisy));
    Ok(files)
}

/// Writes a render with denoised colours, as many as pixels. Formats that keep sums keep the
/// noisy colours beside them; others get a second file for these. Returns the files.
///
/// # Errors
/// The ending is another one, or a file cannot be written.
pub fn write_denoised(
    path: &Path,
    rendered: &Rendered<'_>,
    colours: &[Rgb],
) -> Result<Vec<PathBuf>> {
    let files = files_of_denoised(path)?;
    let [clean, noisy] = &files[..] else {
        write_with(path, |out| exr::write_denoised(rendered, colours, out))?;
        return Ok(files);
    };
    let picture = Picture::new(rendered.size(), colours.to_vec());
    // Both are shown alike, so that they can be compared.
    let display = rendered.display.resolve(&rendered.colours());
    let write = |picture: Picture| -> output::WriteFile<'_> {
        let display = &display;
        Box::new(move |mut out| Ok(png::write_colours(&picture, display, &mut out)?))
    };
    output::write_files(vec![
        (clean.clone(), write(picture)),
        (noisy.clone(), write(rendered.colours())),
    ])
}

/// Writes colours alone, in rows from the top, as a linear EXR.
///
/// # Errors
/// The file cannot be written.
pub fn write_plain(path: &Path, size: UVec2, pixels: &[Rgb]) -> Result<()> {
    let picture = Picture::new(size, pixels.to_vec());
    write_with(path, |out| exr::write_colours(&picture, out))
}

/// Writes linear display values in rows from the top as PNG.
///
/// # Errors
/// The file cannot be written.
pub fn write_shown_png(path: &Path, size: UVec2, pixels: &[[f32; 3]], bits: PngBits) -> Result<()> {
    write_with(path, |out| {
        png::write_shown(size, pixels.iter().copied(), bits, out)
    })
}

/// Writes 8-bit RGB rows as PNG.
///
/// # Errors
/// The file cannot be written.
pub fn write_rgb_png(path: &Path, width: u32, height: u32, rgb: &[u8]) -> Result<()> {
    write_with(path, |out| {
        png::write_rgb8(UVec2::new(width, height), rgb, out)
    })
}

fn write_with(
    path: &Path,
    write: impl FnOnce(&mut dyn WriteSeek) -> Result<(), PictureError>,
) -> Result<()> {
    output::write_file(path, |mut out| Ok(write(&mut out)?))
}

/// What `organza render` wrote to an EXR file.
///
/// # Errors
/// The file cannot be read, is no EXR, or was not written by this program; the
/// film would take more than `max_memory_bytes`.
pub fn read_exr(path: &Path, max_memory_bytes: u64) -> Result<StoredRender> {
    let bytes = read::bytes(path)?;
    exr::read_render(&bytes, max_memory_bytes).map_err(|e| of_file(path, e))
}
