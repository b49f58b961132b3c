//! `.ovox`: the whole octree, every level included.
//!
//! Little-endian. `OVOX` CR LF SUB LF; version (u32); length of the header
//! (u32), the header, its CRC-32. Then the octree's arrays one after another
//! (yarn and material table; for each level the table of bricks, bricks,
//! populations), each cut into blocks of at most 1 MiB: stored length, raw
//! length, CRC-32 of the stored bytes (u32 each) and, packed as one LZ4 block, the
//! raw bytes with the bytes of equal place in their record brought together
//! (version 1: a zlib stream instead). Blocks are packed and unpacked in
//! parallel. Nothing follows the last.

use super::{Format, Part, Source, Volume, box_of};
use crate::Error;
use crate::lattice::{Lattice, MAX_LEVELS, bricks_across};
use crate::octree::{Group, Level, Octree};
use crate::record::{Brick, RadiusScale, StoredPopulation};
use bytemuck::Pod;
use flate2::{Crc, read::ZlibDecoder};
use glam::{DVec3, UVec3};
use lz4_flex::block::{compress, decompress_into};
use organza_basis::Budget;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::io::{Read, Write};

/// The record of the format.
pub static FORMAT: Format = Format {
    ending: "ovox",
    magic: &MAGIC,
    noun: "an octree (.ovox)",
    keeps: "the whole octree: every level, every population",
    options: &[],
    describe: |source, budget| Ok(describe(&open(source, budget)?)),
    read: |source, budget| open(source, budget).map(Volume::Octree),
    write: |voxels| {
        Ok(vec![Part {
            infix: None,
            write: Box::new(|out| write(voxels.octree, out)),
        }])
    },
};

const ENDING: &str = ".ovox";
const MAGIC: [u8; 8] = *b"OVOX\r\n\x1a\n";
/// The version that this program writes, and the newest that it reads.
pub const VERSION: u32 = 2;
const BLOCK: usize = 1 << 20;

/// Writes an octree.
///
/// # Errors
/// When writing fails.
pub fn write(octree: &Octree, out: &mut dyn Write) -> Result<(), Error> {
    let header = encode_header(octree);
    out.write_all(&MAGIC)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&(header.len() as u32).to_le_bytes())?;
    out.write_all(&header)?;
    out.write_all(&crc(&header).to_le_bytes())?;
    let groups: Vec<[u32; 2]> = octree
        .groups
        .iter()
        .map(|g| [g.yarn, u32::from(g.material)])
        .collect();
    write_array(&groups, out)?;
    for l in &octree.levels {
        write_array(&l.brick_of, out)?;
        write_array(&l.bricks, out)?;
        write_array(&l.records, out)?;
    }
    Ok(())
}

/// Reads an octree.
///
/// # Errors
/// For files of another kind or a newer version, truncated or altered ones,
/// ones that hold more than the budget has room for, and ones whose octree is not
/// well formed.
pub fn read(input: &mut dyn Read, budget: &mut Budget) -> Result<Octree, Error> {
    let mut start = [0u8; 16];
    read_exactly(input, &mut start, "header")?;
    if start[..8] != MAGIC {
        return Err(wrong("its first bytes are wrong"));
    }
    let version = word(&start, 8);
    if !(1..=VERSION).contains(&version) {
        return Err(wrong(format!(
            "version {version}; this program reads versions 1 to {VERSION}"
        )));
    }
    let mut header = vec![0u8; word(&start, 12).min(4096) as usize];
    read_exactly(input, &mut header, "header")?;
    let mut sum = [0u8; 4];
    read_exactly(input, &mut sum, "header")?;
    if crc(&header) != word(&sum, 0) {
        return Err(wrong("its header was altered (checksum)"));
    }
    let h = decode_header(&header).ok_or_else(|| wrong("its header is inconsistent"))?;
    let needed = u64::try_from(h.array_bytes()).unwrap_or(u64::MAX);
    budget.take(needed, "voxels")?;
    let groups: Vec<[u32; 2]> = read_array(input, version, h.group_count)?;
    let groups = groups.iter().map(|&[yarn, material]| Group {
        yarn,
        material: material as u16,
    });
    let groups = groups.collect();
    let mut levels = Vec::new();
    for level in 0..h.lattice.levels {
        let grid = bricks_across(h.lattice.dims_at(level));
        let (bricks, records) = h.counts[usize::from(level)];
        levels.push(Level {
            grid,
            brick_of: read_array(input, version, grid.as_u64vec3().element_product())?,
            bricks: read_array(input, version, bricks)?,
            records: read_array(input, version, records)?,
            density_per_quantum: h.lattice.density_of(h.quantum_mm, level),
        });
    }
    if input.read(&mut [0])? != 0 {
        return Err(wrong("it continues after its last block"));
    }
    let octree = Octree::assemble(
        h.lattice,
        levels,
        groups,
        h.radii,
        h.quantum_mm,
        h.materials,
    );
    octree.check().map_err(wrong)?;
    Ok(octree)
}

fn open(source: &Source<'_>, budget: &mut Budget) -> Result<Octree, Error> {
    source.read(budget, |bytes, budget| read(&mut &bytes[..], budget))
}

/// Sizes, and what the levels hold.
fn describe(octree: &Octree) -> Value {
    let levels: Vec<Value> = (0..octree.level_count())
        .map(|l| {
            json!({
                "voxel_um": (octree.voxel_mm(l) * 1e3).to_array(),
                "dims": octree.dims(l).to_array(),
                "occupied": octree.occupied_cells(l),
                "fibre_length_mm": octree.fibre_length_mm(l),
                "memory_bytes": octree.level_memory_bytes(l),
            })
        })
        .collect();
    let (mut least, mut most) = (f32::INFINITY, 0.0f32);
    octree.for_each_occupied(0, |cell| {
        let sigma = octree.broadside_per_mm(0, cell);
        least = least.min(sigma);
        most = most.max(sigma);
    });
    json!({
        "kind": "octree",
        "box": box_of(&octree.bounds_mm()),
        "repeats": octree.repeats(),
        "materials": octree.material_count(),
        "extinction_per_mm": if most > 0.0 { json!([least, most]) } else { json!([0.0, 0.0]) },
        "memory_bytes": octree.memory_bytes(),
        "levels": levels,
    })
}

/// The contents of the header.
struct Header {
    lattice: Lattice,
    quantum_mm: f64,
    radii: RadiusScale,
    materials: u32,
    group_count: u64,
    /// Bricks and populations of each level.
    counts: Vec<(u64, u64)>,
}

impl Header {
    fn array_bytes(&self) -> u128 {
        let levels = self
            .counts
            .iter()
            .zip(0..)
            .map(|(&(bricks, records), level)| {
                let table = bricks_across(self.lattice.dims_at(level)).as_u64vec3();
                4 * u128::from(table.x) * u128::from(table.y) * u128::from(table.z)
                    + size_of::<Brick>() as u128 * u128::from(bricks)
                    + size_of::<StoredPopulation>() as u128 * u128::from(records)
            });
        levels.sum::<u128>() + 8 * u128::from(self.group_count)
    }
}

fn encode_header(o: &Octree) -> Vec<u8> {
    let l = &o.lattice;
    let mut h = Vec::new();
    for x in l.min_mm.to_array().into_iter().chain(l.voxel_mm.to_array()) {
        h.extend(x.to_le_bytes());
    }
    h.extend(o.quantum_mm.to_le_bytes());
    for n in l.dims.to_array() {
        h.extend(n.to_le_bytes());
    }
    h.extend(o.radii.min_mm.to_le_bytes());
    h.extend(o.radii.step_mm.to_le_bytes());
    h.extend(o.material_count.to_le_bytes());
    h.extend([l.levels, u8::from(l.repeats), 0, 0]);
    h.extend((o.groups.len() as u64).to_le_bytes());
    for level in &o.levels {
        h.extend((level.bricks.len() as u64).to_le_bytes());
        h.extend((level.records.len() as u64).to_le_bytes());
    }
    h
}

fn decode_header(h: &[u8]) -> Option<Header> {
    const FIXED: usize = 56 + 12 + 8 + 4 + 4 + 8;
    if h.len() < FIXED {
        return None;
    }
    let long = |at: usize| {
        let mut b = [0u8; 8];
        b.copy_from_slice(&h[at..at + 8]);
        u64::from_le_bytes(b)
    };
    let double = |at: usize| f64::from_bits(long(at));
    let triple = |at: usize| DVec3::new(double(at), double(at + 8), double(at + 16));
    let float = |at: usize| f32::from_bits(word(h, at));
    let lattice = Lattice {
        min_mm: triple(0),
        voxel_mm: triple(24),
        dims: UVec3::new(word(h, 56), word(h, 60), word(h, 64)),
        levels: h[80],
        repeats: h[81] == 1,
    };
    let levels = usize::from(lattice.levels);
    let quantum_mm = double(48);
    let radii = RadiusScale {
        min_mm: float(68),
        step_mm: float(72),
    };
    let sound = (1..=MAX_LEVELS).contains(&lattice.levels)
        && h.len() == FIXED + 16 * levels
        && h[81] <= 1
        && lattice.is_sound()
        && quantum_mm.is_finite()
        && quantum_mm > 0.0
        && radii.min_mm >= 0.0
        && radii.step_mm >= 0.0
        && (radii.min_mm + 4096.0 * radii.step_mm).is_finite();
    sound.then(|| Header {
        lattice,
        quantum_mm,
        radii,
        materials: word(h, 76),
        group_count: long(84),
        counts: (0..levels)
            .map(|k| (long(FIXED + 16 * k), long(FIXED + 16 * k + 8)))
            .collect(),
    })
}

fn write_array<T: Pod + Send + Sync>(array: &[T], out: &mut dyn Write) -> Result<(), Error> {
    let per_block = BLOCK / size_of::<T>();
    // A few blocks at a time: memory stays small and threads busy.
    for part in array.chunks(per_block * 4 * rayon::current_num_threads()) {
        let packed: Vec<Vec<u8>> = part
            .par_chunks(per_block)
            .map(|block| {
                let raw: &[u8] = bytemuck::cast_slice(block);
                let stored = compress(&planes_from_records(raw, size_of::<T>()));
                let mut bytes = Vec::with_capacity(12 + stored.len());
                for n in [stored.len() as u32, raw.len() as u32, crc(&stored)] {
                    bytes.extend(n.to_le_bytes());
                }
                bytes.extend(stored);
                bytes
            })
            .collect();
        for block in packed {
            out.write_all(&block)?;
        }
    }
    Ok(())
}

fn read_array<T: Pod + Send + Sync>(
    input: &mut dyn Read,
    version: u32,
    count: u64,
) -> Result<Vec<T>, Error> {
    let mut array: Vec<T> = Vec::new();
    while (array.len() as u64) < count {
        // Read as many blocks as threads like, unpack them together.
        let mut packed = Vec::new();
        let mut coming = array.len() as u64;
        while coming < count && packed.len() < 4 * rayon::current_num_threads() {
            let mut head = [0u8; 12];
            read_exactly(input, &mut head, "blocks")?;
            let (stored, raw) = (word(&head, 0) as usize, word(&head, 4) as usize);
            if stored > 2 * BLOCK || raw > BLOCK || raw == 0 || !raw.is_multiple_of(size_of::<T>())
            {
                return Err(wrong("a block has an impossible size"));
            }
            let mut bytes = vec![0u8; stored];
            read_exactly(input, &mut bytes, "blocks")?;
            coming += (raw / size_of::<T>()) as u64;
            packed.push((bytes, raw, word(&head, 8)));
        }
        if coming > count {
            return Err(wrong("its blocks hold more than its header says"));
        }
        let unpacked: Vec<Option<Vec<T>>> = packed
            .par_iter()
            .map(|(bytes, raw, sum)| {
                if crc(bytes) != *sum {
                    return None;
                }
                let planes = unpack(version, bytes, *raw)?;
                let mut records = vec![T::zeroed(); raw / size_of::<T>()];
                let bytes = bytemuck::cast_slice_mut(&mut records);
                records_from_planes(&planes, size_of::<T>(), bytes);
                Some(records)
            })
            .collect();
        for block in unpacked {
            array.extend(block.ok_or_else(|| wrong("a block was altered (checksum)"))?);
        }
    }
    Ok(array)
}

/// The raw bytes of a block, if their number is the one declared.
fn unpack(version: u32, stored: &[u8], raw: usize) -> Option<Vec<u8>> {
    if version == 1 {
        let mut bytes = Vec::with_capacity(raw);
        let mut zlib = ZlibDecoder::new(stored).take(raw as u64 + 1);
        zlib.read_to_end(&mut bytes).ok()?;
        return (bytes.len() == raw).then_some(bytes);
    }
    let mut bytes = vec![0u8; raw];
    let length = decompress_into(stored, &mut bytes).ok()?;
    (length == raw).then_some(bytes)
}

/// Brings the first bytes of all records together, then the second, and so on:
/// they are alike and pack better.
fn planes_from_records(records: &[u8], size: usize) -> Vec<u8> {
    let count = records.len() / size;
    let mut planes = vec![0u8; records.len()];
    for (k, plane) in planes.chunks_exact_mut(count.max(1)).enumerate() {
        for (i, byte) in plane.iter_mut().enumerate() {
            *byte = records[i * size + k];
        }
    }
    planes
}

fn records_from_planes(planes: &[u8], size: usize, records: &mut [u8]) {
    let count = planes.len() / size;
    for (i, record) in records.chunks_exact_mut(size).enumerate() {
        for (k, byte) in record.iter_mut().enumerate() {
            *byte = planes[k * count + i];
        }
    }
}

fn crc(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}

fn word(bytes: &[u8], at: usize) -> u32 {
    let mut b = [0u8; 4];
    b.copy_from_slice(&bytes[at..at + 4]);
    u32::from_le_bytes(b)
}

fn wrong(problem: impl Into<String>) -> Error {
    Error::format(ENDING, problem)
}

fn read_exactly(input: &mut dyn Read, into: &mut [u8], what: &str) -> Result<(), Error> {
    input.read_exact(into).map_err(|e| match e.kind() {
        std::io::ErrorKind::UnexpectedEof => wrong(format!("it is cut off within its {what}")),
        _ => Error::Io(e),
    })
}
