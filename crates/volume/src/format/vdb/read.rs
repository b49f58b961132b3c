//! Reading .vdb files, versions 222 to 224 of the format.

use super::cursor::Cursor;
use super::write::EXTENT;
use super::{Cells, Cube, Data, EDGES, ENDING, Grid, Leaf, Value, blosc};
use crate::Error;
use flate2::read::ZlibDecoder;
use glam::{DAffine3, DMat3, DVec3, IVec3};
use organza_basis::{Budget, OverBudget};
use std::io::Read;

const ZIP: u32 = 1;
const ACTIVE_MASK: u32 = 2;
const BLOSC: u32 = 4;

/// The grids of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct File {
    /// Grids that could be read.
    pub grids: Vec<Grid>,
    /// Names of those that could not, each with the reason: a type, map or
    /// packing that is not supported.
    pub unread: Vec<(String, String)>,
}

/// Reads all grids of a file. Cells that are not active read as background.
///
/// # Errors For files of another kind or version, damaged files, and files that hold more than
/// the budget allows.
pub fn read(bytes: &[u8], budget: &mut Budget) -> Result<File, Error> {
    let mut cur = Cursor { bytes, at: 0 };
    if cur.take(8)? != b" BDV\0\0\0\0" {
        return Err(wrong("its first bytes are wrong").into());
    }
    let version = cur.u32()?;
    if !(222..=224).contains(&version) {
        return Err(wrong(format!(
            "version {version}; versions 222 to 224 can be read"
        ))
        .into());
    }
    cur.take(8)?;
    if cur.take(1)? != [1] {
        return Err(wrong("it was streamed: it has no table of places").into());
    }
    cur.take(36)?;
    read_metadata(&mut cur)?;
    let count = cur.u32()?;
    let mut file = File::default();
    for _ in 0..count {
        let (name, grid) = read_grid(&mut cur, budget)?;
        match grid {
            Ok(grid) => file.grids.push(grid),
            Err(Problem::Unknown(reason)) => file.unread.push((name, reason)),
            Err(Problem::Damage(reason)) => {
                return Err(Error::format(ENDING, format!("grid \"{name}\": {reason}")));
            }
            Err(Problem::Budget(over)) => return Err(over.into()),
        }
    }
    Ok(file)
}

/// Why a grid cannot be read.
pub(super) enum Problem {
    /// It is valid, but of a kind that is not supported.
    Unknown(String),
    /// The file is damaged.
    Damage(String),
    /// It holds more than the budget allows.
    Budget(OverBudget),
}

impl From<OverBudget> for Problem {
    fn from(over: OverBudget) -> Problem {
        Problem::Budget(over)
    }
}

impl From<Problem> for Error {
    fn from(p: Problem) -> Error {
        match p {
            Problem::Unknown(problem) | Problem::Damage(problem) => Error::format(ENDING, problem),
            Problem::Budget(over) => over.into(),
        }
    }
}

/// Reads one grid and its name, and goes to the place where the next begins. Places only
/// increase, so that no two grids share bytes.
fn read_grid(
    cur: &mut Cursor,
    budget: &mut Budget,
) -> Result<(String, Result<Grid, Problem>), Problem> {
    let full_name = cur.text()?;
    let name = name_of(&full_name).to_string();
    let kind = cur.text()?;
    let parent = cur.text()?;
    let (grid_at, blocks_at, end_at) = (cur.place()?, cur.place()?, cur.place()?);
    if !(cur.at <= grid_at && grid_at <= blocks_at && blocks_at <= end_at) {
        return Err(wrong(format!(
            "grid \"{name}\": its places {grid_at}, {blocks_at}, {end_at} do not follow {}",
            cur.at
        )));
    }
    budget.take_items::<Grid>(1, "grids")?;
    let grid = if parent.is_empty() {
        cur.at = grid_at;
        read_body(cur, &full_name, &kind, blocks_at, budget)
    } else {
        Err(Problem::Unknown(
            "it shares the tree of another grid".into(),
        ))
    };
    cur.at = end_at;
    Ok((name, grid))
}

/// Copies of a name differ by a control character and a number.
fn name_of(full_name: &str) -> &str {
    full_name.split('\u{1e}').next().unwrap_or_default()
}

fn read_body(
    cur: &mut Cursor,
    full_name: &str,
    kind: &str,
    blocks_at: usize,
    budget: &mut Budget,
) -> Result<Grid, Problem> {
    let (plain, half) = match kind.strip_suffix("_HalfFloat") {
        Some(plain) => (plain, true),
        None => (kind, false),
    };
    let compression = cur.u32()?;
    if compression > (ZIP | ACTIVE_MASK | BLOSC) {
        return Err(wrong(format!("packing {compression} is not known")));
    }
    let extent = read_metadata(cur)?;
    let mm_from_cell = read_map(cur)?;
    let mut tree = TreeReader {
        cur,
        compression,
        half,
        blocks_at,
        budget,
        unknown_packing: false,
    };
    let data = match plain {
        "Tree_float_5_4_3" => Data::Float(tree.read()?),
        "Tree_vec3s_5_4_3" => Data::Vec3(tree.read()?),
        "Tree_int32_5_4_3" => Data::Int(tree.read()?),
        other => {
            return Err(Problem::Unknown(format!(
                "it is of type {other}; float, vec3s and int32 trees of shape 5_4_3 can be read"
            )));
        }
    };
    if tree.unknown_packing {
        return Err(Problem::Unknown(
            "it is packed with Blosc in a way that cannot be read (other than LZ4 or zlib): \
             write it with zip or without compression"
                .into(),
        ));
    }
    let name = name_of(full_name).to_string();
    Ok(Grid {
        name,
        mm_from_cell,
        extent,
        half,
        data,
    })
}

/// A map from cells to millimetres.
fn read_map(cur: &mut Cursor) -> Result<DAffine3, Problem> {
    let name = cur.text()?;
    let map = match &name[..] {
        "UniformScaleMap" | "ScaleMap" => {
            let scale = cur.triple()?;
            cur.take(4 * 24)?;
            DAffine3::from_scale(scale)
        }
        "UniformScaleTranslateMap" | "ScaleTranslateMap" => {
            let (translation, scale) = (cur.triple()?, cur.triple()?);
            cur.take(4 * 24)?;
            DAffine3 {
                matrix3: DMat3::from_diagonal(scale),
                translation,
            }
        }
        "TranslationMap" => DAffine3::from_translation(cur.triple()?),
        "AffineMap" => {
            let mut rows = [DVec3::ZERO; 4];
            for row in &mut rows {
                *row = cur.triple()?;
                cur.f64()?;
            }
            DAffine3 {
                matrix3: DMat3::from_cols(rows[0], rows[1], rows[2]),
                translation: rows[3],
            }
        }
        other => return Err(Problem::Unknown(format!("its map {other} is not known"))),
    };
    if !map.is_finite() || map.matrix3.determinant() == 0.0 {
        return Err(wrong("its map cannot be inverted"));
    }
    Ok(map)
}

struct TreeReader<'a, 'b> {
    cur: &'a mut Cursor<'b>,
    compression: u32,
    half: bool,
    blocks_at: usize,
    budget: &'a mut Budget,
    /// Set when a Blosc frame could not be unpacked: values are not to be used.
    unknown_packing: bool,
}

impl TreeReader<'_, '_> {
    fn read<T: Value>(&mut self) -> Result<Cells<T>, Problem> {
        if self.cur.u32()? != 1 {
            return Err(wrong("more than one buffer of values"));
        }
        let mut cells = Cells::new(T::get(self.cur.take(T::WIDTH)?));
        let (tiles, children) = (self.cur.u32()?, self.cur.u32()?);
        for _ in 0..tiles {
            let origin = self.cur.cell(4096)?;
            let value = T::get(self.cur.take(T::WIDTH)?);
            if self.cur.take(1)? != [0] {
                self.budget.take_items::<Cube<T>>(1, "cubes")?;
                cells.cubes.push(Cube {
                    origin,
                    edge: 4096,
                    value,
                });
            }
        }
        for _ in 0..children {
            let origin = self.cur.cell(4096)?;
            self.inner(origin, 2, &mut cells)?;
        }
        self.cur.at = self.blocks_at;
        let background = cells.background;
        for leaf in &mut cells.leaves {
            let mut mask = [0u64; 8];
            for m in &mut mask {
                *m = self.cur.u64()?;
            }
            let bits: Vec<u8> = mask.iter().flat_map(|m| m.to_le_bytes()).collect();
            leaf.mask = mask;
            leaf.values = self.values(512, &bits, background)?;
            // Values that other programs keep in inactive cells are ignored.
            for (i, value) in leaf.values.iter_mut().enumerate() {
                if !is_set(&bits, i) {
                    *value = background;
                }
            }
        }
        Ok(cells)
    }

    /// A node below the root and everything below it, without the values of leaves.
    fn inner<T: Value>(
        &mut self,
        origin: IVec3,
        level: usize,
        cells: &mut Cells<T>,
    ) -> Result<(), Problem> {
        let across = if level == 2 { 32 } else { 16 };
        let slots = (across * across * across) as usize;
        let children = self.cur.take(slots / 8)?;
        let active = self.cur.take(slots / 8)?;
        let values: Vec<T> = self.values(slots, active, cells.background)?;
        let edge = EDGES[level - 1];
        let place = |i: usize| {
            let i = i as i32;
            origin + IVec3::new(i / (across * across), i / across % across, i % across) * edge
        };
        for (i, &value) in values.iter().enumerate() {
            if is_set(active, i) && !is_set(children, i) {
                self.budget.take_items::<Cube<T>>(1, "cubes")?;
                cells.cubes.push(Cube {
                    origin: place(i),
                    edge,
                    value,
                });
            }
        }
        for i in (0..slots).filter(|&i| is_set(children, i)) {
            if level == 2 {
                self.inner(place(i), 1, cells)?;
            } else {
                self.cur.take(64)?;
                self.budget.take_items::<(Leaf<T>, [T; 512])>(1, "leaves")?;
                cells.leaves.push(Leaf {
                    origin: place(i),
                    mask: [0; 8],
                    values: Vec::new(),
                });
            }
        }
        Ok(())
    }

    /// A record of values: one for each slot.
    fn values<T: Value>(
        &mut self,
        slots: usize,
        active: &[u8],
        background: T,
    ) -> Result<Vec<T>, Problem> {
        let flag = self.cur.take(1)?[0];
        let mut one = || Ok::<T, Problem>(T::get(self.cur.take(T::WIDTH)?));
        let (off, on) = match flag {
            0 | 6 => (background, background),
            1 => (background.negative(), background.negative()),
            2 => one().map(|v| (v, v))?,
            3 => (background.negative(), background),
            4 => (one()?, background),
            5 => (one()?, one()?),
            other => return Err(wrong(format!("a record of values has the flag {other}"))),
        };
        let chosen = if (3..=5).contains(&flag) {
            Some(self.cur.take(slots / 8)?)
        } else {
            None
        };
        let all = flag == 6 || self.compression & ACTIVE_MASK == 0;
        let stored = if all {
            slots
        } else {
            (0..slots).filter(|&i| is_set(active, i)).count()
        };
        let half = self.half && T::HALF_WIDTH.is_some();
        let width = if half { T::WIDTH / 2 } else { T::WIDTH };
        let raw = self.payload(stored * width, half)?;
        let mut packed = raw.chunks_exact(width);
        let values = (0..slots).map(|i| {
            if all || is_set(active, i) {
                let bytes = packed.next().unwrap_or(&[0; 12]);
                if half {
                    T::get_half(bytes)
                } else {
                    T::get(bytes)
                }
            } else if chosen.is_some_and(|c| is_set(c, i)) {
                on
            } else {
                off
            }
        });
        Ok(values.collect())
    }

    fn payload(&mut self, length: usize, half: bool) -> Result<Vec<u8>, Problem> {
        if self.compression & (ZIP | BLOSC) == 0 {
            return Ok(self.cur.take(length)?.to_vec());
        }
        if half && length == 0 {
            return Ok(Vec::new());
        }
        let packed = self.cur.u64()? as i64;
        if packed <= 0 {
            if packed.unsigned_abs() != length as u64 {
                return Err(wrong(format!(
                    "{} bytes of values where {length} belong",
                    packed.unsigned_abs()
                )));
            }
            return Ok(self.cur.take(length)?.to_vec());
        }
        let packed = usize::try_from(packed).unwrap_or(usize::MAX);
        let bytes = self.cur.take(packed)?;
        if self.compression & BLOSC != 0 {
            // The frame's own header must claim what the tree needs.
            let claim = |at: usize| {
                let word = bytes.get(at..at + 4).and_then(|b| b.try_into().ok());
                word.map(u32::from_le_bytes)
            };
            if claim(4) != Some(length as u32) || claim(12) != Some(packed as u32) {
                return Err(wrong("a Blosc frame has the wrong size"));
            }
            return Ok(blosc::unpack(bytes, length).unwrap_or_else(|| {
                self.unknown_packing = true;
                vec![0; length]
            }));
        }
        let mut raw = Vec::with_capacity(length);
        let read = ZlibDecoder::new(bytes)
            .take(length as u64 + 1)
            .read_to_end(&mut raw);
        if read.is_err() || raw.len() != length {
            return Err(wrong("a record of values cannot be unpacked"));
        }
        Ok(raw)
    }
}

fn is_set(bits: &[u8], i: usize) -> bool {
    bits[i / 8] >> (i % 8) & 1 == 1
}

/// Skips metadata; returns the extent, where the file has it.
fn read_metadata(cur: &mut Cursor) -> Result<Option<(IVec3, IVec3)>, Problem> {
    let mut extent = [None; 2];
    for _ in 0..cur.u32()? {
        let (name, kind) = (cur.text()?, cur.text()?);
        let length = cur.u32()? as usize;
        let mut value = Cursor {
            bytes: cur.take(length)?,
            at: 0,
        };
        if let Some(k) = EXTENT.iter().position(|n| *n == name && kind == "vec3i") {
            extent[k] = Some(value.cell(1)?);
        }
    }
    Ok(extent[0].zip(extent[1]))
}

/// Damage.
pub(super) fn wrong(problem: impl Into<String>) -> Problem {
    Problem::Damage(problem.into())
}
