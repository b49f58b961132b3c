//! `.bsdf`: a table in a file.
//!
//! Little-endian. `OFAR` CR LF SUB LF; version (u32); length of the description (u32) and the
//! description, JSON in UTF-8; number of rings (u32) and for each its polar angle in radians
//! (f32) and its nodes (u32); the share of light straight through for each node of the front
//! (f32); for each channel the natural logarithms of the values of the bytes 1 and 255 (f32
//! each); for each node of front and back a factor for each channel (f32); for each pair of
//! nodes `(a, b)` with `b <= a`, in the order of `a`, then `b`, a byte for each channel; the number
//! of textures, 0 or 1 (u32), and the texture; the SHA-256 of all bytes before it. Nothing follows.
//!
//! The texture: its rings as those above; texels along weft and warp (u32 each); the corner of a
//! period and the period, x and y in mm (f32 each); heights of the planes of its texels for
//! directions of the face and of the back, mm (f32 each); the number of images (u32); for each
//! texel and node of the front the share straight through in 255ths (u8); for each texel and
//! image its value in 32767ths (i16); for each image and node of the eye a scale (f32); for each
//! image, node of the eye and node of the light, and each channel, a value in 127ths of the scale
//! (i8).

use super::layout::{MAX_TEXELS, TextureLayout};
use super::rings::{MAX_NODES, MAX_RINGS, Rings};
use super::texture::{MAX_RANK, Texture, TextureParts};
use super::{FarTable, NoTable, TableParts};
use glam::{UVec2, Vec2};
use sha2::{Digest, Sha256};

const MAGIC: [u8; 8] = *b"OFAR\r\n\x1a\n";
/// The version of the format.
const VERSION: u32 = 2;
/// Most nodes of a texture's hemisphere.
const MAX_TEXTURE_NODES: usize = 128;
/// The longest description, bytes.
const MAX_ABOUT: usize = 1 << 16;
/// Length of the checksum.
const SUM: usize = 32;
/// No table is longer, bytes.
pub const MAX_FILE_BYTES: u64 = {
    let nodes = 2 * MAX_NODES as u64;
    let coarse = 2 * MAX_TEXTURE_NODES as u64;
    let (texels, rank) = (MAX_TEXELS as u64, MAX_RANK as u64);
    let texture = texels * (coarse / 2 + 2 * rank) + rank * coarse * (4 + 3 * coarse);
    (1 << 17) + MAX_RINGS as u64 * 16 + nodes * 14 + nodes * (nodes + 1) / 2 * 3 + texture
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
    texture: Option<&TextureParts>,
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
    write_rings(&mut bytes, &parts.rings);
    let numbers = parts.gaps.iter();
    let numbers = numbers
        .chain(parts.range.iter().flatten())
        .chain(parts.factors.iter().flatten());
    bytes.extend(numbers.flat_map(|x| x.to_le_bytes()));
    bytes.extend(parts.codes.iter().flatten());
    bytes.extend(u32::from(texture.is_some()).to_le_bytes());
    if let Some(texture) = texture {
        write_texture(&mut bytes, texture);
    }
    Ok(sealed(bytes))
}

fn write_rings(bytes: &mut Vec<u8>, rings: &Rings) {
    let rings = rings.list();
    bytes.extend((rings.len() as u32).to_le_bytes());
    for (theta, count) in rings {
        bytes.extend(theta.to_le_bytes());
        bytes.extend(count.to_le_bytes());
    }
}

fn write_texture(bytes: &mut Vec<u8>, texture: &TextureParts) {
    write_rings(bytes, &texture.eye);
    write_rings(bytes, &texture.light);
    let layout = &texture.layout;
    let words = [layout.size.x, layout.size.y];
    bytes.extend(words.iter().flat_map(|x| x.to_le_bytes()));
    let [origin, period] = [layout.origin_mm, layout.period_mm].map(|v| v.to_array());
    let numbers = origin.iter().chain(&period).chain(&layout.heights_mm);
    bytes.extend(numbers.flat_map(|x| x.to_le_bytes()));
    let rank = texture.scales.len() / texture.eye.sphere().max(1);
    bytes.extend((rank as u32).to_le_bytes());
    bytes.extend(&texture.gaps);
    bytes.extend(texture.images.iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend(texture.scales.iter().flat_map(|x| x.to_le_bytes()));
    let functions = texture.functions.iter().flatten();
    bytes.extend(functions.map(|x| x.cast_unsigned()));
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
    let rings = rest.rings(MAX_NODES)?;
    let n = rings.sphere();
    let pairs = n * (n + 1) / 2;
    let matrix = 4 * (rings.hemisphere() + 6 + 3 * n) + 3 * pairs;
    let after = rest.0.get(matrix..).ok_or(CUT_OFF)?;
    let (texture, expected) = read_texture(&mut Reader(after))?;
    if after.len() != expected {
        return Err(match after.len() < expected {
            true => CUT_OFF,
            false => TableFileError::Length("something follows the table"),
        });
    }
    let (content, sum) = whole.split_at(whole.len() - SUM);
    if Sha256::digest(content)[..] != *sum {
        return Err(TableFileError::Checksum);
    }
    let about = serde_json::from_slice(about).map_err(|e| TableFileError::About(e.to_string()))?;
    let gaps = rest.list(rings.hemisphere())?;
    let limits = rest.list(6)?;
    let factors = rest.list(3 * n)?;
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
    let texture = texture.as_ref().map(Texture::new).transpose()?;
    Ok((table.with_texture(texture), about))
}

/// The texture, if there is one, and the length of this part of the file with the checksum.
fn read_texture(rest: &mut Reader<'_>) -> Result<(Option<TextureParts>, usize), TableFileError> {
    let whole = rest.0.len();
    match rest.word()? {
        0 => return Ok((None, 4 + SUM)),
        1 => {}
        _ => return Err(TableFileError::Length("it has several textures")),
    }
    let eye = rest.rings(MAX_TEXTURE_NODES)?;
    let light = rest.rings(MAX_TEXTURE_NODES)?;
    let size = UVec2::new(rest.word()?, rest.word()?);
    let numbers = rest.list(6)?;
    let rank = rest.word()? as usize;
    let layout = TextureLayout {
        size,
        origin_mm: Vec2::new(numbers[0], numbers[1]),
        period_mm: Vec2::new(numbers[2], numbers[3]),
        heights_mm: [numbers[4], numbers[5]],
    };
    if !layout.is_sound() || rank > MAX_RANK {
        return Err(NoTable::Number("the grid of its texture").into());
    }
    let (texels, n, m) = (layout.texels(), eye.sphere(), light.sphere());
    let gaps = rest.take(texels * eye.hemisphere())?.to_vec();
    let images = rest.take(2 * texels * rank)?.chunks_exact(2);
    let images = images.map(|b| i16::from_le_bytes([b[0], b[1]])).collect();
    let scales = rest.list(rank * n)?;
    let functions = rest.take(3 * rank * n * m)?.chunks_exact(3);
    let functions = functions
        .map(|b| [b[0], b[1], b[2]].map(u8::cast_signed))
        .collect();
    let texture = TextureParts {
        eye,
        light,
        layout,
        gaps,
        images,
        scales,
        functions,
    };
    Ok((Some(texture), whole - rest.0.len() + SUM))
}

/// The error of a file that ends too early.
const CUT_OFF: TableFileError = TableFileError::Length("it was cut off");

/// The bytes that are not yet read.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], TableFileError> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(CUT_OFF)?;
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

    fn list(&mut self, count: usize) -> Result<Vec<f32>, TableFileError> {
        (0..count).map(|_| self.number()).collect()
    }

    /// Rings with at most so many nodes on a hemisphere.
    fn rings(&mut self, most: usize) -> Result<Rings, TableFileError> {
        let count = self.word()? as usize;
        if count > MAX_RINGS {
            return Err(TableFileError::Rings);
        }
        let mut rings = Vec::with_capacity(count);
        for _ in 0..count {
            rings.push((self.number()?, self.word()?));
        }
        let rings = Rings::new(&rings).filter(|r| r.hemisphere() <= most);
        rings.ok_or(TableFileError::Rings)
    }
}
