//! `.bsdf`: a table in a file.
//!
//! Little-endian. `OFAR` CR LF SUB LF; version (u32); length of the description (u32) and the
//! description, JSON in UTF-8; number of rings (u32) and for each its polar angle in radians
//! (f32) and its nodes (u32); the share of light straight through for each node of the front
//! (f32); for each channel the natural logarithms of the values of the bytes 1 and 255 (f32
//! each); for each node of front and back a factor for each channel (f32); for each pair of
//! nodes `(a, b)` with `b <= a`, in the order of `a`, then `b`, a byte for each channel; the
//! SHA-256 of all bytes before it. Nothing follows.

use super::rings::{MAX_NODES, MAX_RINGS, Rings};
use super::{FarTable, NoTable, TableParts};
use sha2::{Digest, Sha256};

const MAGIC: [u8; 8] = *b"OFAR\r\n\x1a\n";
/// The version that this program writes and reads.
const VERSION: u32 = 1;
/// The longest description, bytes.
const MAX_ABOUT: usize = 1 << 16;
/// Length of the checksum.
const SUM: usize = 32;
/// No table is longer, bytes.
pub const MAX_FILE_BYTES: u64 = {
    let nodes = 2 * MAX_NODES as u64;
    (1 << 17) + MAX_RINGS as u64 * 8 + nodes * 14 + nodes * (nodes + 1) / 2 * 3
};

/// What is wrong with a file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableFileError {
    /// It is no such file.
    #[error("is not a table of organza: its first bytes are wrong")]
    Magic,
    /// A version that this program does not know.
    #[error("is a table of version {0}; this program reads version {VERSION}")]
    Version(u32),
    /// It ends too early, or goes on too long.
    #[error("has a wrong length: {0}")]
    Length(&'static str),
    /// It was altered.
    #[error("is damaged: its checksum does not match")]
    Checksum,
    /// The description is not JSON.
    #[error("has a description that is not JSON: {0}")]
    About(String),
    /// Rings that are none.
    #[error("has rings of nodes that are none")]
    Rings,
    /// Numbers that are no table.
    #[error("is no table: {0}")]
    Table(#[from] NoTable),
}

/// Whether bytes begin as a table.
pub fn is_table(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// The bytes of a table with a description.
///
/// # Errors
/// A description that is too long.
pub fn write_table(
    parts: &TableParts,
    about: &serde_json::Value,
) -> Result<Vec<u8>, TableFileError> {
    let about = about.to_string();
    if about.len() > MAX_ABOUT {
        return Err(TableFileError::Length("its description is too long"));
    }
    let mut bytes = Vec::with_capacity(3 * parts.codes.len() + (1 << 16));
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((about.len() as u32).to_le_bytes());
    bytes.extend(about.as_bytes());
    let rings = parts.rings.list();
    bytes.extend((rings.len() as u32).to_le_bytes());
    for (theta, count) in rings {
        bytes.extend(theta.to_le_bytes());
        bytes.extend(count.to_le_bytes());
    }
    let numbers = parts.gaps.iter();
    let numbers = numbers
        .chain(parts.range.iter().flatten())
        .chain(parts.factors.iter().flatten());
    bytes.extend(numbers.flat_map(|x| x.to_le_bytes()));
    bytes.extend(parts.codes.iter().flatten());
    Ok(sealed(bytes))
}

/// The content of a file with its checksum.
pub fn sealed(mut content: Vec<u8>) -> Vec<u8> {
    let sum = Sha256::digest(&content);
    content.extend(sum);
    content
}

/// A table and its description.
///
/// # Errors
/// Says what is wrong with the bytes.
pub fn read_table(bytes: &[u8]) -> Result<(FarTable, serde_json::Value), TableFileError> {
    if !is_table(bytes) {
        return Err(TableFileError::Magic);
    }
    let whole = bytes;
    let mut rest = Reader(whole.get(MAGIC.len()..).unwrap_or_default());
    let version = rest.word()?;
    if version != VERSION {
        return Err(TableFileError::Version(version));
    }
    let length = rest.word()? as usize;
    if length > MAX_ABOUT {
        return Err(TableFileError::Length("its description is too long"));
    }
    let about = rest.take(length)?;
    let count = rest.word()? as usize;
    if count > MAX_RINGS {
        return Err(TableFileError::Rings);
    }
    let mut rings = Vec::with_capacity(count);
    for _ in 0..count {
        rings.push((rest.number()?, rest.word()?));
    }
    let rings = Rings::new(&rings).ok_or(TableFileError::Rings)?;
    let n = rings.sphere();
    let pairs = n * (n + 1) / 2;
    let expected = 4 * (rings.hemisphere() + 6 + 3 * n) + 3 * pairs + SUM;
    if rest.0.len() != expected {
        let what = match rest.0.len() < expected {
            true => "it was cut off",
            false => "something follows the table",
        };
        return Err(TableFileError::Length(what));
    }
    let (content, sum) = whole.split_at(whole.len() - SUM);
    if Sha256::digest(content)[..] != *sum {
        return Err(TableFileError::Checksum);
    }
    let about = serde_json::from_slice(about).map_err(|e| TableFileError::About(e.to_string()))?;
    let mut list = |count: usize| -> Result<Vec<f32>, TableFileError> {
        (0..count).map(|_| rest.number()).collect()
    };
    let gaps = list(rings.hemisphere())?;
    let limits = list(6)?;
    let factors = list(3 * n)?;
    let codes = rest.take(3 * pairs)?;
    let table = FarTable::new(TableParts {
        rings,
        gaps,
        range: std::array::from_fn(|c| [limits[2 * c], limits[2 * c + 1]]),
        factors: factors
            .chunks_exact(3)
            .map(|f| [f[0], f[1], f[2]])
            .collect(),
        codes: codes.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    })?;
    Ok((table, about))
}

/// The bytes that are not yet read.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], TableFileError> {
        let (taken, rest) = self
            .0
            .split_at_checked(count)
            .ok_or(TableFileError::Length("it was cut off"))?;
        self.0 = rest;
        Ok(taken)
    }

    fn four(&mut self) -> Result<[u8; 4], TableFileError> {
        let mut four = [0; 4];
        four.copy_from_slice(self.take(4)?);
        Ok(four)
    }

    fn word(&mut self) -> Result<u32, TableFileError> {
        self.four().map(u32::from_le_bytes)
    }

    fn number(&mut self) -> Result<f32, TableFileError> {
        self.four().map(f32::from_le_bytes)
    }
}
