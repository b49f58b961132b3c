//! Checkpoints: the state of a render, from which it resumes.
//!
//! Little-endian: [`MAGIC`], version, then the header's `u64` words (seed;
//! crop left, top, right, bottom; first and next sample; the counts of
//! [`Stats`]), the scene's digest, every pixel's words row by row, and last
//! the SHA-256 of all before.

use crate::error::input;
use crate::identity::{Identity, crop_words};
use crate::output;
use anyhow::{Context, Result};
use glam::UVec2;
use organza_scene::read;
use organza_transport::{Crop, Film, Pixel, Rendering, Stats};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{Read, Write};
use std::ops::Range;
use std::path::Path;

const MAGIC: &[u8; 8] = b"organzaR";
const VERSION: u32 = 2;
const HEADER_WORDS: usize = 7 + Stats::WORDS;
const DIGEST_BYTES: usize = 32;
const PREFIX_BYTES: usize = MAGIC.len() + 4;
const HEADER_BYTES: usize = PREFIX_BYTES + 8 * HEADER_WORDS + DIGEST_BYTES;
const PIXEL_BYTES: usize = 4 * Pixel::WORDS;

/// Writes through to a file and digests on the way.
struct Digesting<W> {
    out: W,
    digest: Sha256,
}

impl<W: Write> Digesting<W> {
    fn put(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.digest.update(bytes);
        self.out.write_all(bytes)
    }
}

/// Saves a render; the file's former content stays until the new one is
/// complete.
///
/// # Errors
/// The file cannot be written.
pub fn save(path: &Path, identity: &Identity, rendering: &Rendering<'_>) -> Result<()> {
    let Crop { min, max } = identity.crop;
    let taken = rendering.taken();
    let mut header = vec![
        identity.seed,
        u64::from(min.x),
        u64::from(min.y),
        u64::from(max.x),
        u64::from(max.y),
        taken.start,
        taken.end,
    ];
    header.extend(rendering.stats().to_words());
    output::write_file(path, |out| {
        let mut out = Digesting {
            out,
            digest: Sha256::new(),
        };
        let mut write = || -> std::io::Result<()> {
            out.put(MAGIC)?;
            out.put(&VERSION.to_le_bytes())?;
            for word in &header {
                out.put(&word.to_le_bytes())?;
            }
            out.put(&identity.scene)?;
            for pixel in rendering.film().pixels() {
                let mut bytes = [0; PIXEL_BYTES];
                for (slot, word) in bytes.chunks_exact_mut(4).zip(pixel.to_words()) {
                    slot.copy_from_slice(&word.to_le_bytes());
                }
                out.put(&bytes)?;
            }
            let digest = out.digest.clone().finalize();
            out.out.write_all(&digest)
        };
        write().context("saving the checkpoint failed")
    })
}

/// Resumes from a checkpoint of the same picture.
///
/// # Errors
/// A file that is no checkpoint, is not whole, or is of another picture.
pub fn resume<'a>(
    path: &Path,
    identity: &Identity,
    rendering: Rendering<'a>,
) -> Result<Rendering<'a>> {
    let fail = |why: String| input(format!("{}: {why}", path.display()));
    let size = rendering.film().size();
    let pixels = size.x as usize * size.y as usize;
    let whole = HEADER_BYTES + pixels * PIXEL_BYTES + DIGEST_BYTES;
    // No more than belongs to it, whatever the file is.
    let bytes = start(path, whole as u64 + 1)?;
    let header = Header::parse(path, &bytes)?;
    if header.scene != identity.scene {
        return Err(fail(
            "is a checkpoint of another scene, of changed input files or of another version of organza"
                .into(),
        ));
    }
    header.check_picture(path, identity.seed, identity.crop)?;
    if bytes.len() < whole {
        return Err(fail(format!(
            "is cut short after {} of {whole} bytes; it cannot be resumed",
            bytes.len()
        )));
    }
    let (content, digest) = bytes.split_at(whole - DIGEST_BYTES);
    if Sha256::digest(content)[..] != *digest {
        return Err(fail("is damaged: its checksum does not match".into()));
    }
    let wanted = rendering.taken().start..rendering.taken().start + rendering.left();
    header.check_samples(path, &wanted)?;
    let mut film = Film::new(size);
    let rest = bytes.get(HEADER_BYTES..).unwrap_or_default();
    for (pixel, bytes) in film
        .pixels_mut()
        .iter_mut()
        .zip(rest.chunks_exact(PIXEL_BYTES))
    {
        *pixel = Pixel::from_words(&std::array::from_fn(|i| u32_at(bytes, 4 * i)));
    }
    let next = header.samples.end;
    rendering
        .resume(film, header.stats, next)
        .map_err(|e| fail(e.to_string()))
}

/// Refuses a checkpoint of another picture before that one's scene is built: all
/// but its digest is known by then.
///
/// # Errors
/// As [`resume`].
pub fn check(path: &Path, seed: u64, crop: Crop, samples: &Range<u64>) -> Result<()> {
    let header = Header::parse(path, &start(path, HEADER_BYTES as u64)?)?;
    header.check_picture(path, seed, crop)?;
    header.check_samples(path, samples)
}

/// The first bytes of a file.
fn start(path: &Path, count: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|f| f.take(count).read_to_end(&mut bytes))
        .map_err(|e| input(format!("{}: {}", path.display(), read::io_words(&e))))?;
    Ok(bytes)
}

/// What stands before the pixels.
struct Header {
    seed: u64,
    crop: Crop,
    samples: Range<u64>,
    stats: Stats,
    scene: [u8; DIGEST_BYTES],
}

impl Header {
    fn parse(path: &Path, bytes: &[u8]) -> Result<Header> {
        let fail = |why: String| input(format!("{}: {why}", path.display()));
        if !bytes.starts_with(&MAGIC[..bytes.len().min(MAGIC.len())]) || bytes.is_empty() {
            return Err(fail("is not a checkpoint of organza".into()));
        }
        if bytes.len() < HEADER_BYTES {
            return Err(fail(format!(
                "is cut short after {} bytes; it cannot be resumed",
                bytes.len()
            )));
        }
        let header = bytes.split_at(HEADER_BYTES).0;
        let version = u32_at(header, MAGIC.len());
        if version != VERSION {
            return Err(fail(format!(
                "is a checkpoint of format {version}; this program reads {VERSION}"
            )));
        }
        let words: [u64; HEADER_WORDS] = std::array::from_fn(|i| {
            let at = PREFIX_BYTES + 8 * i;
            u64::from(u32_at(header, at)) | (u64::from(u32_at(header, at + 4)) << 32)
        });
        let [seed, x0, y0, x1, y1, first, next, ..] = words;
        let scene = header.get(HEADER_BYTES - DIGEST_BYTES..);
        let scene = scene.and_then(|b| b.try_into().ok()).unwrap_or_default();
        Ok(Header {
            seed,
            crop: Crop {
                min: UVec2::new(x0 as u32, y0 as u32),
                max: UVec2::new(x1 as u32, y1 as u32),
            },
            samples: first..next,
            stats: Stats::from_words(&std::array::from_fn(|i| words[7 + i])),
            scene,
        })
    }

    fn check_picture(&self, path: &Path, seed: u64, crop: Crop) -> Result<()> {
        let fail = |why: String| Err(input(format!("{}: {why}", path.display())));
        if self.seed != seed {
            let own = self.seed;
            return fail(format!(
                "is a checkpoint of seed {own}; this render has seed {seed}"
            ));
        }
        if self.crop != crop {
            return fail(format!(
                "is a checkpoint of the pixels {}; this render is of {}",
                crop_words(self.crop),
                crop_words(crop)
            ));
        }
        Ok(())
    }

    fn check_samples(&self, path: &Path, wanted: &Range<u64>) -> Result<()> {
        let Range { start, end } = self.samples;
        if start == wanted.start && end <= wanted.end {
            return Ok(());
        }
        Err(input(format!(
            "{}: is a checkpoint of the samples {start}..{end}; this render is of {}..{}",
            path.display(),
            wanted.start,
            wanted.end
        )))
    }
}

/// Four bytes as a number; zero beyond the end.
fn u32_at(bytes: &[u8], at: usize) -> u32 {
    let four = bytes.get(at..at + 4).and_then(|b| b.try_into().ok());
    u32::from_le_bytes(four.unwrap_or_default())
}
