//! The header: everything but the arrays.
//!
//! Of a cloth of blocks the crossings along x and y and the finest voxels of a block along x, y
//! and z (u32 each) stand before the packing factors.
//!
//! It ends with the packing factors: the number of walks (u32; 0 where nothing was measured, and
//! then nothing follows), and for each level and material the factor and its standard error (f32)
//! for rays that leave the same yarn, then another yarn, then for rays from outside the cloth; a
//! factor of 0 stands for none. Where there are factors, the last of the four bytes before the
//! number of groups is 1: they were measured with outlines inside coarse voxels.

use super::SourceFile;
use super::blocks::word;
use crate::footprint::FibreFootprint;
use crate::lattice::{Lattice, MAX_LEVELS, bricks_across};
use crate::octree::Octree;
use crate::packing::{MeasuredPacking, PackingFactor};
use crate::record::{Brick, RadiusScale, StoredPopulation};
use glam::{DVec3, UVec2, UVec3};

/// Marks factors that were measured with outlines.
const WITH_OUTLINES: u8 = 1;

/// Materials are numbered with 16 bits.
const MAX_MATERIALS: u32 = 1 << 16;

/// Names of files, and how many bytes each has.
type FileTable = Vec<(String, u64)>;

/// The contents of the header.
pub struct Header {
    pub lattice: Lattice,
    pub quantum_mm: f64,
    pub radii: RadiusScale,
    pub materials: u32,
    /// Which voxels hold the length of thick fibres.
    pub footprint: FibreFootprint,
    pub group_count: u64,
    /// Bricks and populations of each level.
    pub counts: Vec<(u64, u64)>,
    /// Names and sizes of the files that the cloth was made from.
    pub files: FileTable,
    /// Measured packing factors.
    pub packing: Option<MeasuredPacking>,
    /// Crossings, and voxels of a block, of a cloth of blocks.
    pub blocks: Option<(UVec2, UVec3)>,
}

impl Header {
    /// Number of bytes that follow the header, unpacked.
    pub fn array_bytes(&self) -> u128 {
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
        let files = self.files.iter().map(|(_, size)| u128::from(*size));
        // The index, and the crossings at which blocks are found.
        let of_blocks = self.blocks.map_or(0, |(crossings, _)| {
            12 * u128::from(crossings.x) * u128::from(crossings.y)
        });
        of_blocks + levels.sum::<u128>() + files.sum::<u128>() + 8 * u128::from(self.group_count)
    }
}

/// Encodes the header.
pub fn encode(o: &Octree, files: &[SourceFile]) -> Vec<u8> {
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
    let footprint = match o.footprint {
        FibreFootprint::Covered => 0,
        FibreFootprint::Axis => 1,
    };
    let outlines = o.packing.as_ref().map_or(0, |_| WITH_OUTLINES);
    h.extend([l.levels, u8::from(l.repeats), footprint, outlines]);
    h.extend((o.groups.len() as u64).to_le_bytes());
    for level in &o.levels {
        h.extend((level.bricks.len() as u64).to_le_bytes());
        h.extend((level.records.len() as u64).to_le_bytes());
    }
    h.extend((files.len() as u32).to_le_bytes());
    for file in files {
        h.extend((file.name.len() as u32).to_le_bytes());
        h.extend(file.name.as_bytes());
        h.extend((file.bytes.len() as u64).to_le_bytes());
    }
    if let Some(blocks) = &o.blocks {
        let (crossings, block) = (blocks.crossings(), blocks.block_cells(0));
        for n in [crossings.x, crossings.y, block.x, block.y, block.z] {
            h.extend(n.to_le_bytes());
        }
    }
    encode_packing(o.packing.as_ref(), &mut h);
    h
}

fn encode_packing(packing: Option<&MeasuredPacking>, h: &mut Vec<u8>) {
    let Some(packing) = packing else {
        return h.extend(0u32.to_le_bytes());
    };
    h.extend(packing.walks.to_le_bytes());
    for material in packing.levels.iter().flatten() {
        for factor in material.factors() {
            let numbers = factor.map_or([0.0; 2], |f| [f.mean, f.standard_error]);
            for x in numbers {
                h.extend(x.to_le_bytes());
            }
        }
    }
}

/// The packing factors, which end the header.
fn decode_packing(
    rest: &[u8],
    levels: usize,
    materials: u32,
    with_outlines: bool,
) -> Option<Option<MeasuredPacking>> {
    let (walks, factors) = rest.split_at_checked(4)?;
    let walks = word(walks, 0);
    if walks == 0 {
        return factors.is_empty().then_some(None);
    }
    let materials = usize::try_from(materials).ok()?;
    if materials.checked_mul(24 * levels)? != factors.len() {
        return None;
    }
    let float = |at: usize| f32::from_bits(word(factors, at));
    let factor = |at: usize| {
        (float(at) != 0.0).then(|| PackingFactor {
            mean: float(at),
            standard_error: float(at + 4),
        })
    };
    let of_material = |at: usize| [0, 8, 16].map(|k| factor(at + k)).into();
    let of_level = |level: usize| {
        let places = (0..materials).map(|m| 24 * (level * materials + m));
        places.map(of_material).collect()
    };
    let packing = MeasuredPacking {
        walks,
        levels: (0..levels).map(of_level).collect(),
    };
    let is_sound = with_outlines && packing.fits(u8::try_from(levels).ok()?, materials);
    is_sound.then_some(Some(packing))
}

/// Decodes a header; `None` when its values are inconsistent.
pub fn decode(h: &[u8], has_blocks: bool) -> Option<Header> {
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
    let footprint = match h[82] {
        0 => FibreFootprint::Covered,
        1 => FibreFootprint::Axis,
        _ => return None,
    };
    let rest = h.get(FIXED + 16 * levels..)?;
    let (files, rest) = decode_files(rest)?;
    let (blocks, rest) = match has_blocks {
        true => {
            let (sizes, rest) = rest.split_at_checked(20)?;
            let n = |i: usize| word(sizes, 4 * i);
            let sizes = (UVec2::new(n(0), n(1)), UVec3::new(n(2), n(3), n(4)));
            (Some(sizes), rest)
        }
        false => (None, rest),
    };
    let materials = word(h, 76);
    let packing = decode_packing(rest, levels, materials, h[83] == WITH_OUTLINES)?;
    let sound = (1..=MAX_LEVELS).contains(&lattice.levels)
        && h[81] <= 1
        && materials <= MAX_MATERIALS
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
        materials,
        footprint,
        group_count: long(84),
        counts: (0..levels)
            .map(|k| (long(FIXED + 16 * k), long(FIXED + 16 * k + 8)))
            .collect(),
        files,
        packing,
        blocks,
    })
}

/// The table of files, and what follows it.
fn decode_files(mut rest: &[u8]) -> Option<(FileTable, &[u8])> {
    let mut take = |length: usize| {
        let (taken, left) = rest.split_at_checked(length)?;
        rest = left;
        Some(taken)
    };
    let count = word(take(4)?, 0) as usize;
    let mut files = Vec::new();
    for _ in 0..count {
        let length = word(take(4)?, 0) as usize;
        let name = std::str::from_utf8(take(length)?).ok()?.to_owned();
        let size = u64::from_le_bytes(take(8)?.try_into().ok()?);
        files.push((name, size));
    }
    Some((files, rest))
}
