//! Checkpoints: the state of a render, from which it resumes.
//!
//! [`MAGIC`]; the version, a little-endian `u32`; the length of the header, the
//! same; the [`Header`] as JSON; every pixel's words row by row, little-endian;
//! and last the SHA-256 of all before.

use crate::error::input;
use crate::identity::{Difference, EngineKind, Identity, VERSION, crop_edges};
use crate::output;
use anyhow::{Context, Result};
use organza_transport::{Crop, Film, Pixel, Rendering, Stats};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{Read, Write};
use std::ops::Range;
use std::path::Path;

const MAGIC: &[u8; 8] = b"organzaR";
const FORMAT: u32 = 3;
/// Longest header that is read, bytes; a scene may name a hundred thousand files.
const MAX_HEADER: usize = 16 << 20;
const DIGEST_BYTES: usize = 32;
const PREFIX_BYTES: usize = MAGIC.len() + 8;
const PIXEL_BYTES: usize = 4 * Pixel::WORDS;

/// What stands before the pixels.
#[derive(Serialize, Deserialize)]
struct Header {
    identity: Identity,
    /// The first sample of every pixel, and the one after the last.
    samples: Range<u64>,
    /// [`Stats::to_words`].
    stats: Vec<u64>,
}

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
    let header = serde_json::to_vec(&Header {
        identity: Identity {
            engines: identity.all_engines(rendering),
            ..identity.clone()
        },
        samples: rendering.taken(),
        stats: rendering.stats().to_words().to_vec(),
    })?;
    let length = u32::try_from(header.len())?;
    output::write_file(path, |out| {
        let mut out = Digesting {
            out,
            digest: Sha256::new(),
        };
        let mut write = || -> std::io::Result<()> {
            out.put(MAGIC)?;
            out.put(&FORMAT.to_le_bytes())?;
            out.put(&length.to_le_bytes())?;
            out.put(&header)?;
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

/// Resumes from a checkpoint of the same picture, whose engines are noted in `identity`.
/// `why_walk` is why the kernel does not take the paths of this render, if it does not.
///
/// # Errors
/// A file that is no checkpoint, is not whole, or is of another picture.
pub fn resume<'a>(
    path: &Path,
    identity: &mut Identity,
    why_walk: Option<&str>,
    rendering: Rendering<'a>,
) -> Result<Rendering<'a>> {
    let fail = |why: String| input(format!("{}: {why}", path.display()));
    let size = rendering.film().size();
    let pixels = size.x as usize * size.y as usize;
    // No more than belongs to it, whatever the file is.
    let most = PREFIX_BYTES + MAX_HEADER + pixels * PIXEL_BYTES + DIGEST_BYTES + 1;
    let bytes = start(path, most as u64)?;
    let (header, header_bytes) = Header::parse(path, &bytes)?;
    let whole = PREFIX_BYTES + header_bytes + pixels * PIXEL_BYTES + DIGEST_BYTES;
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
    if let Some(difference) = header.identity.difference(identity) {
        return Err(fail(describe_difference(
            &difference,
            &header.identity,
            identity,
            why_walk,
        )));
    }
    let wanted = rendering.taken().start..rendering.taken().start + rendering.left();
    header.check_samples(path, &wanted)?;
    let stats: [u64; Stats::WORDS] = header
        .stats
        .try_into()
        .map_err(|_| fail("is damaged: it holds other counts".into()))?;
    let mut film = Film::new(size);
    let rest = bytes.get(PREFIX_BYTES + header_bytes..).unwrap_or_default();
    for (pixel, bytes) in film
        .pixels_mut()
        .iter_mut()
        .zip(rest.chunks_exact(PIXEL_BYTES))
    {
        *pixel = Pixel::from_words(&std::array::from_fn(|i| u32_at(bytes, 4 * i)));
    }
    let next = header.samples.end;
    identity.engines = header.identity.engines;
    rendering
        .resume(film, Stats::from_words(&stats), next)
        .map_err(|e| fail(e.to_string()))
}

/// Why a checkpoint is of another picture.
fn describe_difference(
    difference: &Difference,
    of_file: &Identity,
    here: &Identity,
    why_walk: Option<&str>,
) -> String {
    let crop = |[x0, y0, x1, y1]: [u32; 4]| format!("{x0},{y0},{x1},{y1}");
    match difference {
        Difference::Version => format!(
            "is a checkpoint of organza {}; this is organza {}",
            of_file.version, here.version
        ),
        Difference::Seed => format!(
            "is a checkpoint of seed {}; this render has seed {}",
            of_file.seed, here.seed
        ),
        Difference::Crop => format!(
            "is a checkpoint of the pixels {}; this render is of {}",
            crop(of_file.crop),
            crop(here.crop)
        ),
        Difference::Engine => {
            let remedy = match (here.engine, why_walk) {
                (EngineKind::Walk, Some(why)) => format!(", for {why}"),
                (EngineKind::Walk, None) => "; leave out --engine walk".to_owned(),
                (EngineKind::Kernel, _) => "; continue with --engine walk".to_owned(),
            };
            format!(
                "is a checkpoint of {}; this render is of {}{remedy}",
                of_file.engine.description(),
                here.engine.description()
            )
        }
        Difference::Input(name) => {
            format!("is a checkpoint of another content of {name}, which the scene names")
        }
        Difference::Scene => "is a checkpoint of another scene".to_owned(),
    }
}

/// Refuses a checkpoint of another picture before that one's scene is built: all
/// but the scene and its engine is known by then.
///
/// # Errors
/// As [`resume`].
pub fn check(path: &Path, seed: u64, crop: Crop, samples: &Range<u64>) -> Result<()> {
    let (header, _) = Header::parse(path, &start(path, (PREFIX_BYTES + MAX_HEADER) as u64)?)?;
    let here = Identity {
        version: VERSION.into(),
        seed,
        crop: crop_edges(crop),
        ..header.identity.clone()
    };
    if let Some(difference) = header.identity.difference(&here) {
        let words = describe_difference(&difference, &header.identity, &here, None);
        return Err(input(format!("{}: {words}", path.display())));
    }
    header.check_samples(path, samples)
}

/// The first bytes of a file.
fn start(path: &Path, count: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|f| f.take(count).read_to_end(&mut bytes))
        .map_err(|e| {
            input(format!(
                "{}: {}",
                path.display(),
                organza_scene::read::io_message(&e)
            ))
        })?;
    Ok(bytes)
}

impl Header {
    /// The header of a file, and its length.
    fn parse(path: &Path, bytes: &[u8]) -> Result<(Header, usize)> {
        let fail = |why: String| Err(input(format!("{}: {why}", path.display())));
        if !bytes.starts_with(&MAGIC[..bytes.len().min(MAGIC.len())]) || bytes.is_empty() {
            return fail("is not a checkpoint of organza".into());
        }
        let cut = || {
            fail(format!(
                "is cut short after {} bytes; it cannot be resumed",
                bytes.len()
            ))
        };
        if bytes.len() < PREFIX_BYTES {
            return cut();
        }
        let format = u32_at(bytes, MAGIC.len());
        if format != FORMAT {
            return fail(format!(
                "is a checkpoint of format {format}; this program reads {FORMAT}"
            ));
        }
        let length = u32_at(bytes, MAGIC.len() + 4) as usize;
        if length > MAX_HEADER {
            return fail("is damaged: its header is too long".into());
        }
        let Some(header) = bytes.get(PREFIX_BYTES..PREFIX_BYTES + length) else {
            return cut();
        };
        match serde_json::from_slice(header) {
            Ok(header) => Ok((header, length)),
            Err(e) => fail(format!("is damaged: its header cannot be read: {e}")),
        }
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
