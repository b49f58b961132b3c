//! Checkpoints: the state of a render, from which it resumes.
//!
//! A checkpoint is a [`Journal`] that is replaced as a whole: a [`Header`] as JSON, then a record
//! for each row of pixels with their words, little-endian; then the same of direct light, where that
//! is kept.

use crate::error::of_file;
use crate::identity::{Difference, EngineKind, Identity, crop_edges};
use crate::journal::{Journal, Work};
use crate::keys::listed;
use crate::{output, version};
use anyhow::{Context, Result};
use organza_transport::{Crop, Film, Pixel, Rendering, Stats};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::path::Path;

/// The header says what the samples are of, so that a difference can be named.
const WORK: Work<'static> = Work {
    command: "render",
    key: "",
};

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

/// The record of a row of pixels.
fn row_bytes(pixels: &[Pixel]) -> Vec<u8> {
    let words = pixels.iter().flat_map(Pixel::to_words);
    words.flat_map(u32::to_le_bytes).collect()
}

/// Sets a row from its record; `false` when that is of another number of pixels.
fn set_row(row: &mut [Pixel], bytes: &[u8]) -> bool {
    for (pixel, bytes) in row.iter_mut().zip(bytes.chunks_exact(PIXEL_BYTES)) {
        let (words, _) = bytes.as_chunks::<4>();
        *pixel = Pixel::from_words(&std::array::from_fn(|i| u32::from_le_bytes(words[i])));
    }
    bytes.len() == row.len() * PIXEL_BYTES
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
    let films = std::iter::once(rendering.film()).chain(rendering.direct());
    let rows = films.flat_map(|film| film.pixels().chunks(film.size().x as usize));
    let records = std::iter::once(header).chain(rows.map(row_bytes));
    output::write_file(path, |out| {
        Journal::write(out, &WORK, records).context("saving the checkpoint failed")
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
    let fail = |why: &str| of_file(path, why);
    let damaged = || fail("is damaged: its checksums do not match");
    let mut journal = Journal::<Vec<u8>>::read_only(path, &WORK)?;
    let header = Header::read(path, &mut journal)?;
    if let Some(difference) = header.identity.difference(identity) {
        return Err(fail(&describe_difference(
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
        .map_err(|_| fail("is damaged: it holds other counts"))?;
    let size = rendering.film().size();
    let mut direct = rendering.direct().map(|_| Film::new(size));
    let films = if direct.is_some() { 2 } else { 1 };
    if journal.count() != 1 + films * size.y as usize {
        return Err(fail("is cut short; it cannot be resumed"));
    }
    let mut film = Film::new(size);
    let films = std::iter::once(&mut film).chain(&mut direct);
    let rows = films.flat_map(|film| film.pixels_mut().chunks_mut(size.x as usize));
    for (number, row) in (1..).zip(rows) {
        let bytes = journal.read(number)?.ok_or_else(damaged)?;
        if !set_row(row, &bytes) {
            return Err(damaged());
        }
    }
    identity.engines = header.identity.engines;
    rendering
        .resume(
            (film, direct),
            Stats::from_words(&stats),
            header.samples.end,
        )
        .map_err(|e| fail(&e.to_string()))
}

/// Why a checkpoint is of another picture.
fn describe_difference(
    difference: &Difference,
    of_file: &Identity,
    here: &Identity,
    why_walk: Option<&str>,
) -> String {
    match difference {
        Difference::Code => format!(
            "is a checkpoint of organza {}; this is organza {}",
            of_file.code, here.code
        ),
        Difference::Seed => format!(
            "is a checkpoint of seed {}; this render has seed {}",
            of_file.seed, here.seed
        ),
        Difference::Crop => format!(
            "is a checkpoint of the pixels {}; this render is of {}",
            listed(&of_file.crop),
            listed(&here.crop)
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
    let header = Header::read(path, &mut Journal::read_only(path, &WORK)?)?;
    let here = Identity {
        code: version::code(),
        seed,
        crop: crop_edges(crop),
        ..header.identity.clone()
    };
    if let Some(difference) = header.identity.difference(&here) {
        let words = describe_difference(&difference, &header.identity, &here, None);
        return Err(of_file(path, words));
    }
    header.check_samples(path, samples)
}

impl Header {
    fn read(path: &Path, journal: &mut Journal<Vec<u8>>) -> Result<Header> {
        let header = journal.read(0)?;
        let header = header.and_then(|bytes| serde_json::from_slice(&bytes).ok());
        header.ok_or_else(|| of_file(path, "is cut short or damaged: its header cannot be read"))
    }

    fn check_samples(&self, path: &Path, wanted: &Range<u64>) -> Result<()> {
        let Range { start, end } = self.samples;
        if start == wanted.start && end <= wanted.end {
            return Ok(());
        }
        Err(of_file(
            path,
            format!(
                "is a checkpoint of the samples {start}..{end}; this render is of {}..{}",
                wanted.start, wanted.end
            ),
        ))
    }
}
