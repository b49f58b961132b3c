//! Renders without noise, by Open Image Denoise where it is installed.

use crate::error::input;
use crate::picture;
use anyhow::{Result, anyhow};
use organza_basis::Rgb;
use organza_denoise::{DenoiseError, Guides, Library, Settings, places};
use organza_film::Film;
use organza_picture::{Attributes, Rendered, exr};
use std::path::{Path, PathBuf};

/// Memory that a pixel takes beside its film: colours and guides as they are passed, guides
/// without noise, the result, and the channels of the file.
const BYTES_OF_PIXEL: u64 = 6 * 12 + 12 + 2 * 13 * 4;

/// The library, ready to be used.
pub struct Denoiser {
    library: Library,
    path: PathBuf,
    has_guides: bool,
}

impl Denoiser {
    /// Looks for the library in all places that it may be in.
    ///
    /// # Errors
    /// There is none that works; the message says how to get it.
    pub fn find(has_guides: bool) -> Result<Denoiser> {
        let mut reasons = String::new();
        for path in places(&|name| std::env::var_os(name)) {
            match Library::open(&path) {
                Ok(library) => {
                    return Ok(Denoiser {
                        library,
                        path,
                        has_guides,
                    });
                }
                // That the system has none is no news.
                Err(e) if path.is_absolute() || path.exists() => {
                    reasons += &format!("; {e}");
                }
                Err(_) => {}
            }
        }
        let named = std::env::var_os("ORGANZA_OIDN").filter(|value| !value.is_empty());
        let missing = match named {
            Some(value) => format!(
                "ORGANZA_OIDN names {}, where no Open Image Denoise is that can be used",
                Path::new(&value).display()
            ),
            None => "Open Image Denoise was not found".into(),
        };
        Err(input(format!(
            "{missing}; install it in an active Python environment (pip install pyoidn) or with \
             the system's packages, or set ORGANZA_OIDN to the library \
             (libOpenImageDenoise.so.2){reasons}"
        )))
    }

    /// What removes the noise, for files and messages.
    pub fn description(&self) -> String {
        let guides = if self.has_guides { "with" } else { "without" };
        format!(
            "Open Image Denoise {} {guides} guides",
            self.library.version()
        )
    }

    /// Where the library is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The colours of a film without noise.
    ///
    /// # Errors
    /// Too little memory, or what the library reports.
    fn colours(
        &self,
        film: &Film,
        threads: Option<u16>,
        max_memory_bytes: u64,
    ) -> Result<Vec<Rgb>> {
        let count = film.pixels().len() as u64;
        let needed = count.saturating_mul(BYTES_OF_PIXEL);
        let Some(left) = max_memory_bytes.checked_sub(needed) else {
            return Err(input(format!(
                "denoising {count} pixels needs {needed} bytes of memory, {max_memory_bytes} are \
                 allowed"
            )));
        };
        let noisy: Vec<[f32; 3]> = film.pixels().iter().map(|p| p.mean().into()).collect();
        let guides = self.has_guides.then(|| Guides::of_film(film));
        let settings = Settings {
            threads,
            max_memory_bytes: left,
        };
        let result = self
            .library
            .denoise(film.size(), &noisy, guides.as_ref(), &settings);
        let clean = result.map_err(|e: DenoiseError| anyhow!("{}: {e}", self.path.display()))?;
        Ok(clean.into_iter().map(Rgb::from).collect())
    }

    /// Writes a render without noise: an `.exr` keeps everything else of the render beside
    /// it, other formats get a second file, `NAME.noisy.ENDING`.
    ///
    /// # Errors
    /// Those of denoising, and of the files.
    pub fn write(
        &self,
        path: &Path,
        rendered: &Rendered<'_>,
        threads: Option<u16>,
        max_memory_bytes: u64,
    ) -> Result<Vec<PathBuf>> {
        let colours = self.colours(rendered.film, threads, max_memory_bytes)?;
        let mut attributes: Attributes = rendered.attributes.clone();
        attributes.set(exr::DENOISED, self.description());
        let rendered = Rendered {
            attributes: &attributes,
            ..*rendered
        };
        picture::write_denoised(path, &rendered, &colours)
    }
}
