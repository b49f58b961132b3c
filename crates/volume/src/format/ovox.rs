//! `.ovox`: the whole octree, every level included.
//!
//! Little-endian. `OVOX` CR LF SUB LF; version (u32); length of the header (u32), the header,
//! its CRC-32. Then the octree's arrays one after another (yarn and material table; for each
//! level the table of bricks, bricks, populations; of a cloth of blocks, which is version 5, the
//! block of each crossing as u32, x fastest) and the files that the cloth was made from, each cut
//! into blocks of at most 1 MiB: stored length, raw length, CRC-32 of the stored bytes (u32 each)
//! and one LZ4 block of the raw bytes, regrouped so that bytes of equal position in their records
//! are adjacent. Blocks are packed and unpacked in parallel. Nothing follows the last block.

mod blocks;
mod header;

use super::{Format, Part, Source, Volume, WriteOption, box_of};
use crate::Error;
use crate::block_layout::BlockLayout;
use crate::footprint::FibreFootprint;
use crate::lattice::bricks_across;
use crate::octree::{Group, Octree, OctreeLevel};
use crate::packing::{MaterialPacking, PackingFactor};
use blocks::{crc, read_array, read_exactly, word, write_array, wrong};
use organza_basis::Budget;
use serde_json::{Value, json};
use std::io::{Read, Write};

/// The record of the format.
pub static FORMAT: Format = Format {
    ending: "ovox",
    magic: &MAGIC,
    noun: "an octree (.ovox)",
    keeps: "the whole octree: every level, every population",
    options: &[WriteOption::Footprint],
    describe: |source, budget| Ok(describe(&open(source, budget)?)),
    read: |source, budget| open(source, budget).map(Volume::Octree),
    write_memory_bytes: |_, _| 0, // block by block
    write: |voxels| {
        Ok(vec![Part {
            infix: None,
            write: Box::new(|out| write(voxels.octree, voxels.files, out)),
        }])
    },
};

const ENDING: &str = ".ovox";
const MAGIC: [u8; 8] = *b"OVOX\r\n\x1a\n";
/// The version of a volume.
const VERSION: u32 = 4;
/// The version of a cloth of blocks.
const VERSION_WITH_BLOCKS: u32 = 5;
const BLOCK: usize = 1 << 20;
/// Maximum size of a header, bytes; names of files make up most of it.
const MAX_HEADER: u32 = 1 << 20;

/// Name of the first file of a scanned volume, instead of a fabric: how it was scanned, and its
/// materials.
pub const SCAN_FILE: &str = "scan.toml";

/// A file that a cloth was made from. With these files a scene shows the volume exactly as it
/// shows the cloth. The first is the fabric file, with all its overrides; then come those that
/// it names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// Its name in the fabric file.
    pub name: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// What a file holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// The octree.
    pub octree: Octree,
    /// The files that its cloth was made from; empty where they were not kept.
    pub files: Vec<SourceFile>,
}

/// Writes an octree and the files that its cloth was made from.
///
/// # Errors
/// When writing fails, or names of files fill more than a MiB.
pub fn write(octree: &Octree, files: &[SourceFile], out: &mut dyn Write) -> Result<(), Error> {
    let header = header::encode(octree, files);
    if header.len() > MAX_HEADER as usize {
        return Err(wrong("the names of its files are too long"));
    }
    out.write_all(&MAGIC)?;
    let version = match octree.blocks() {
        Some(_) => VERSION_WITH_BLOCKS,
        None => VERSION,
    };
    out.write_all(&version.to_le_bytes())?;
    out.write_all(&(header.len() as u32).to_le_bytes())?;
    out.write_all(&header)?;
    out.write_all(&crc(&header).to_le_bytes())?;
    let groups = octree.groups.iter();
    let groups = groups.map(|g| [g.yarn, u32::from(g.material)]);
    let groups: Vec<[u32; 2]> = groups.collect();
    write_array(&groups, out)?;
    for l in &octree.levels {
        write_array(&l.brick_of, out)?;
        write_array(&l.bricks, out)?;
        write_array(&l.records, out)?;
    }
    if let Some(blocks) = octree.blocks() {
        write_array(blocks.index(), out)?;
    }
    for file in files {
        write_array(&file.bytes, out)?;
    }
    Ok(())
}

/// Reads an octree.
///
/// # Errors For files of another kind or a newer version, truncated or altered files, files
/// that hold more than the budget allows, and files whose octree is not well formed.
pub fn read(input: &mut dyn Read, budget: &mut Budget) -> Result<Stored, Error> {
    let mut start = [0u8; 16];
    read_exactly(input, &mut start, "header")?;
    if start[..8] != MAGIC {
        return Err(wrong("its first bytes are wrong"));
    }
    let version = word(&start, 8);
    if ![VERSION, VERSION_WITH_BLOCKS].contains(&version) {
        return Err(wrong(format!(
            "version {version}; this program reads versions {VERSION} and {VERSION_WITH_BLOCKS}"
        )));
    }
    let mut header = vec![0u8; word(&start, 12).min(MAX_HEADER) as usize];
    read_exactly(input, &mut header, "header")?;
    let mut sum = [0u8; 4];
    read_exactly(input, &mut sum, "header")?;
    if crc(&header) != word(&sum, 0) {
        return Err(wrong("its header was altered (checksum)"));
    }
    let has_blocks = version == VERSION_WITH_BLOCKS;
    let h =
        header::decode(&header, has_blocks).ok_or_else(|| wrong("its header is inconsistent"))?;
    let needed = u64::try_from(h.array_bytes()).unwrap_or(u64::MAX);
    budget.take(needed, "voxels")?;
    let groups: Vec<[u32; 2]> = read_array(input, h.group_count)?;
    let groups = groups.iter().map(|&[yarn, material]| {
        let material = u16::try_from(material).map_err(|_| {
            wrong(format!(
                "a yarn has the material {material}; expected a number below {}",
                h.materials
            ))
        })?;
        Ok(Group { yarn, material })
    });
    let groups = groups.collect::<Result<_, Error>>()?;
    let mut levels = Vec::new();
    for level in 0..h.lattice.levels {
        let grid = bricks_across(h.lattice.dims_at(level));
        let (bricks, records) = h.counts[usize::from(level)];
        levels.push(OctreeLevel {
            grid,
            brick_of: read_array(input, grid.as_u64vec3().element_product())?,
            bricks: read_array(input, bricks)?,
            records: read_array(input, records)?,
            density_per_quantum: h.lattice.density_of(h.quantum_mm, level),
        });
    }
    let blocks = match h.blocks {
        Some((crossings, block)) => {
            let count = u64::from(crossings.x) * u64::from(crossings.y);
            let index = read_array(input, count)?;
            Some(BlockLayout::new(crossings, block, index).map_err(wrong)?)
        }
        None => None,
    };
    let mut files = Vec::new();
    for (name, size) in h.files {
        let bytes = read_array(input, size)?;
        files.push(SourceFile { name, bytes });
    }
    if input.read(&mut [0])? != 0 {
        return Err(wrong("it continues after its last block"));
    }
    let mut octree = Octree::assemble(
        h.lattice,
        levels,
        groups,
        h.radii,
        h.quantum_mm,
        h.materials,
    );
    octree.footprint = h.footprint;
    octree.packing = h.packing;
    octree.check().map_err(wrong)?;
    if let Some(blocks) = blocks {
        let whole = octree.with_blocks(blocks);
        octree = whole.ok_or_else(|| wrong("its blocks do not fit its voxels"))?;
    }
    Ok(Stored { octree, files })
}

fn open(source: &Source<'_>, budget: &mut Budget) -> Result<Stored, Error> {
    source.read(budget, |bytes, budget| read(&mut &bytes[..], budget))
}

/// Sizes, and what the levels hold.
fn describe(stored: &Stored) -> Value {
    let octree = &stored.octree;
    let levels: Vec<Value> = (0..octree.level_count())
        .map(|l| {
            let mut about = json!({
                "voxel_um": (octree.voxel_mm(l) * 1e3).to_array(),
                "dims": octree.dims(l).to_array(),
                "occupied": octree.occupied_cells(l),
                "fibre_length_mm": octree.fibre_length_mm(l),
                "memory_bytes": octree.level_memory_bytes(l),
            });
            if let Some(packing) = octree.packing() {
                about["packing"] = describe_packing(&packing.levels[usize::from(l)]);
            }
            about
        })
        .collect();
    let (mut least, mut most) = (f32::INFINITY, 0.0f32);
    octree.for_each_stored(0, |cell| {
        let sigma = octree.broadside_per_mm(0, cell);
        least = least.min(sigma);
        most = most.max(sigma);
    });
    let mut about = json!({
        "kind": "octree",
        "box": box_of(&octree.bounds_mm()),
        "repeats": octree.repeats(),
        "materials": octree.material_count(),
        "footprint": match octree.footprint() {
            FibreFootprint::Covered => "covered",
            FibreFootprint::Axis => "axis",
        },
        "packing": match octree.packing() {
            Some(packing) => json!({ "source": "measured", "walks": packing.walks }),
            None => json!({ "source": "derived" }),
        },
        "files": stored.files.iter().map(|f| &f.name).collect::<Vec<_>>(),
        "extinction_per_mm": if most > 0.0 { json!([least, most]) } else { json!([0.0, 0.0]) },
        "memory_bytes": octree.memory_bytes(),
        "levels": levels,
    });
    let scan = stored.files.first().filter(|f| f.name == SCAN_FILE);
    if let Some(scan) = scan {
        about["kind"] = json!("scan");
        about["scan"] = json!(String::from_utf8_lossy(&scan.bytes));
    }
    if let Some(blocks) = octree.blocks() {
        about["blocks"] = json!({
            "crossings": blocks.crossings().to_array(),
            "count": blocks.count(),
            "block_voxels": blocks.block_cells(0).to_array(),
            "effective_voxels": octree.dims(0).as_u64vec3().element_product(),
        });
    }
    about
}

/// The packing factors of a level, material by material.
fn describe_packing(materials: &[MaterialPacking]) -> Value {
    let factor = |f: Option<PackingFactor>| match f {
        Some(f) => json!({ "factor": f.mean, "standard_error": f.standard_error }),
        None => json!("derived"),
    };
    let one = |m: &MaterialPacking| {
        json!({
            "own_yarn": factor(m.own_yarn),
            "other_yarn": factor(m.other_yarn),
            "outside": factor(m.outside),
        })
    };
    materials.iter().map(one).collect()
}
