//! Builds all levels of the octree from gathered populations.

use super::{EMPTY, Group, Octree, OctreeLevel, broadside};
use crate::Error;
use crate::block::sort_by_voxel;
use crate::cluster::{GatheredPopulation, KeepApart, Merger};
use crate::lattice::{
    BLOCK, LEVELS_IN_BLOCK, Lattice, bit_of, brick_at, brick_index, bricks_across, cell_in_block,
    cell_of_bit, octant, voxel_in_block,
};
use crate::record::{Brick, MAX_GROUPS, RadiusScale, StoredPopulation, encode_direction};
use glam::UVec3;
use organza_basis::MAX_POPULATIONS;
use rayon::prelude::*;
use std::collections::HashMap;

/// Extinction-weighted variance of `t t^T`, as a share, up to which two populations of a voxel
/// are stored as one: two equal populations at less than 18 degrees, which one lobe of 9
/// degrees spread represents. Coarser cells are few and mix more: there the limit is 8 degrees.
const FINEST_TOLERANCE: f32 = 0.05;
const COARSE_TOLERANCE: f32 = 0.01;

/// The populations of one brick under construction, sorted by voxel.
type BuildBrick = (u32, Vec<GatheredPopulation>);

/// The properties of the whole tile that quantisation needs.
pub(crate) struct Scales {
    quantum_mm: f64,
    radii: RadiusScale,
    groups: Vec<u64>,
}

impl Scales {
    /// For the greatest lengths that may lie in each block, the least and
    /// greatest radius, and all groups in order.
    pub fn new(
        lattice: &Lattice,
        max_lengths_mm: impl Iterator<Item = f64>,
        radii_mm: [f32; 2],
        groups: Vec<u64>,
    ) -> Result<Scales, Error> {
        if groups.len() > MAX_GROUPS {
            return Err(Error::Options(format!(
                "{} pairs of yarn and material; at most {MAX_GROUPS} fit an octree",
                groups.len()
            )));
        }
        // Sums over the coarsest cells where those are larger than blocks.
        let shift = (u32::from(lattice.levels) - 1).saturating_sub(BLOCK.ilog2());
        let mut sums: HashMap<UVec3, f64> = HashMap::new();
        for (block, length) in max_lengths_mm.enumerate() {
            if length > 0.0 {
                let cell = brick_at(block as u32, lattice.blocks_across()) >> shift;
                *sums.entry(cell).or_default() += length;
            }
        }
        let fullest = sums.values().fold(0.0f64, |a, &b| a.max(b));
        // Rounding up in every voxel must not carry the sum past 32 bits.
        let quantum_mm = if fullest > 0.0 {
            (fullest / 4.0e9).log2().ceil().exp2()
        } else {
            1.0
        };
        let [least, most] = radii_mm;
        Ok(Scales {
            quantum_mm,
            radii: RadiusScale::new(if most > 0.0 { least } else { 0.0 }, most),
            groups,
        })
    }

    fn record(&self, l: &GatheredPopulation) -> StoredPopulation {
        let (axis, sin_sq) = l.axis_and_sin_sq();
        let group = self.groups.binary_search(&l.group()).unwrap_or(0) as u32;
        StoredPopulation {
            length: (l.length_mm / self.quantum_mm) as u32,
            direction: encode_direction(axis, sin_sq),
            population: self.radii.encode(group, l.radius_mm()),
        }
    }
}

/// Bricks of one level with their populations, in the order they were made.
#[derive(Default)]
struct Part {
    /// Where each brick belongs in the table of its level.
    places: Vec<u32>,
    bricks: Vec<Brick>,
    records: Vec<StoredPopulation>,
}

impl Part {
    /// Quantises the populations of a brick; returns its records.
    fn push(
        &mut self,
        place: u32,
        populations: &[GatheredPopulation],
        scales: &Scales,
    ) -> (&mut Brick, &[StoredPopulation]) {
        let mut header = Brick {
            first: self.records.len() as u32,
            ..Brick::default()
        };
        for l in populations {
            let bit = 1u64 << l.bit();
            // At most four per voxel, so a mask is always free.
            if let Some(mask) = header.masks.iter_mut().find(|m| **m & bit == 0) {
                *mask |= bit;
            }
        }
        let start = self.records.len();
        self.records
            .extend(populations.iter().map(|l| scales.record(l)));
        self.places.push(place);
        self.bricks.push(header);
        let last = self.bricks.len() - 1;
        (&mut self.bricks[last], &self.records[start..])
    }
}

/// The levels of one block, and the populations of the last.
pub(crate) struct BuiltBlock {
    levels: Vec<Part>,
    top: Option<BuildBrick>,
}

impl BuiltBlock {
    /// Bytes that it will take in the octree, including the levels above.
    pub fn bytes(&self) -> u64 {
        let bytes = |p: &Part| size_of_val(&p.bricks[..]) + size_of_val(&p.records[..]);
        let above = self.levels.last().map_or(0, bytes);
        (self.levels.iter().map(bytes).sum::<usize>() + above) as u64
    }
}

/// Quantises and builds up one block from its finest voxels' populations,
/// sorted by voxel.
pub(crate) fn build_block(
    lattice: &Lattice,
    scales: &Scales,
    block: u32,
    populations: Vec<GatheredPopulation>,
) -> BuiltBlock {
    let corner = brick_at(block, lattice.blocks_across());
    let mut merger = Merger::default();
    let mut populations = reduce(&mut merger, populations, KeepApart::Yarns);
    // The rounding error of each number is carried to the next, so that a sum over voxels is
    // off by at most half a quantum instead of an error that grows with the root of their
    // number.
    let mut carry = 0.0;
    for l in populations.iter_mut() {
        let exact = l.length_mm / scales.quantum_mm + carry;
        let quanta = exact.round().max(0.0);
        carry = exact - quanta;
        l.rescale(quanta * scales.quantum_mm);
    }
    populations.retain(|l| l.length_mm > 0.0);

    let mut built = BuiltBlock {
        levels: Vec::new(),
        top: None,
    };
    if populations.is_empty() {
        return built;
    }
    let bricks_in_block = UVec3::splat(BLOCK / 4);
    let mut below = [0.0f32; (BLOCK * BLOCK * BLOCK / 64) as usize];
    for level in 0..lattice.levels.min(LEVELS_IN_BLOCK) {
        if level > 0 {
            for l in populations.iter_mut() {
                let cell = cell_in_block(l.voxel()) >> 1u32;
                *l = l.moved_to(voxel_in_block(cell));
            }
            sort_by_voxel(&mut populations);
            populations = reduce(&mut merger, populations, KeepApart::Materials);
        }
        let grid = bricks_across(lattice.dims_at(level));
        let low = corner * (bricks_in_block >> u32::from(level));
        let density_per_quantum = lattice.density_of(scales.quantum_mm, level);
        let finer = std::mem::replace(&mut below, [0.0; _]);
        let mut part = Part::default();
        for brick in populations.chunk_by(|a, b| a.voxel() >> 6 == b.voxel() >> 6) {
            let number = brick[0].voxel() >> 6;
            let at = brick_at(number, bricks_in_block);
            let (header, records) = part.push(brick_index(low + at, grid), brick, scales);
            header.majorant_per_mm = if level == 0 {
                finest_majorant(header, records, density_per_quantum, &scales.radii)
            } else {
                let child = |i| brick_index((at << 1u32) + octant(i), bricks_in_block);
                (0..8).fold(0.0, |m, i| finer[child(i) as usize].max(m))
            };
            below[number as usize] = header.majorant_per_mm;
        }
        built.levels.push(part);
    }
    if lattice.levels > LEVELS_IN_BLOCK {
        // One brick is left, at the place of the block in the grid of blocks.
        built.top = Some((block, populations));
    }
    built
}

/// Merges the populations of each voxel; they are sorted by voxel.
fn reduce(
    merger: &mut Merger,
    all: Vec<GatheredPopulation>,
    apart: KeepApart,
) -> Vec<GatheredPopulation> {
    let tolerance = match apart {
        KeepApart::Yarns => FINEST_TOLERANCE,
        KeepApart::Materials => COARSE_TOLERANCE,
    };
    let mut populations = Vec::with_capacity(all.len());
    let mut voxel = Vec::new();
    for part in all.chunk_by(|a, b| a.voxel() == b.voxel()) {
        if let [only] = part {
            populations.push(*only);
            continue;
        }
        voxel.extend_from_slice(part);
        merger.merge_to(&mut voxel, MAX_POPULATIONS, tolerance, apart);
        // Largest first, so that a reader who wants only one takes the first.
        voxel.sort_by(|a, b| b.radius_length_mm2.total_cmp(&a.radius_length_mm2));
        populations.append(&mut voxel);
    }
    populations
}

fn finest_majorant(
    brick: &Brick,
    records: &[StoredPopulation],
    density_per_quantum: f32,
    radii: &RadiusScale,
) -> f32 {
    let first = brick.first as usize;
    let mut left = brick.masks[0];
    let mut most = 0.0f32;
    while left != 0 {
        let r = brick.records_of(left.trailing_zeros());
        left &= left - 1;
        let own = &records[r.start - first..r.end - first];
        most = most.max(broadside(own, density_per_quantum, radii));
    }
    // A sum in another order must not exceed it.
    most * (1.0 + 1e-6)
}

/// An octree under construction.
pub(crate) struct Assembly<'a> {
    lattice: &'a Lattice,
    scales: &'a Scales,
    levels: Vec<OctreeLevel>,
    /// Populations of the last level that blocks build.
    tops: Vec<BuildBrick>,
}

impl<'a> Assembly<'a> {
    pub fn new(lattice: &'a Lattice, scales: &'a Scales) -> Assembly<'a> {
        let level = |level| {
            let grid = bricks_across(lattice.dims_at(level));
            OctreeLevel {
                grid,
                brick_of: vec![EMPTY; grid.element_product() as usize],
                bricks: Vec::new(),
                records: Vec::new(),
                density_per_quantum: lattice.density_of(scales.quantum_mm, level),
            }
        };
        Assembly {
            lattice,
            scales,
            levels: (0..lattice.levels).map(level).collect(),
            tops: Vec::new(),
        }
    }

    /// Adds the next block: bricks lie in memory in the order of blocks.
    pub fn add(&mut self, block: BuiltBlock) -> Result<(), Error> {
        for (level, part) in self.levels.iter_mut().zip(block.levels) {
            append(level, part)?;
        }
        self.tops.extend(block.top);
        Ok(())
    }

    /// Builds the levels above the blocks.
    pub fn finish(mut self, material_count: usize) -> Result<Octree, Error> {
        let mut bricks = std::mem::take(&mut self.tops);
        for level in usize::from(LEVELS_IN_BLOCK)..self.levels.len() {
            let (finer, coarser) = self.levels.split_at_mut(level);
            let finer = &finer[level - 1];
            bricks = coarsen(&bricks, finer, coarser[0].grid);
            let mut part = Part::default();
            for (place, populations) in &bricks {
                let (header, _) = part.push(*place, populations, self.scales);
                let below = children(brick_at(*place, coarser[0].grid), finer);
                header.majorant_per_mm = below
                    .iter()
                    .flatten()
                    .fold(0.0, |m, &c| finer.bricks[c as usize].majorant_per_mm.max(m));
            }
            append(&mut coarser[0], part)?;
        }
        for l in &mut self.levels {
            l.bricks.shrink_to_fit();
            l.records.shrink_to_fit();
        }
        let groups = self.scales.groups.iter().map(|&g| Group {
            yarn: (g >> 16) as u32,
            material: g as u16,
        });
        Ok(Octree::assemble(
            *self.lattice,
            self.levels,
            groups.collect(),
            self.scales.radii,
            self.scales.quantum_mm,
            material_count as u32,
        ))
    }
}

fn append(level: &mut OctreeLevel, mut part: Part) -> Result<(), Error> {
    let first = level.records.len();
    if u32::try_from(first + part.records.len()).is_err() {
        return Err(Error::Options(
            "more than 4294967295 populations in one level: use larger voxels".into(),
        ));
    }
    for (place, brick) in part.places.iter().zip(&mut part.bricks) {
        brick.first += first as u32;
        level.brick_of[*place as usize] = level.bricks.len() as u32;
        level.bricks.push(*brick);
    }
    level.records.append(&mut part.records);
    Ok(())
}

/// Indices of the eight bricks below a brick, x fastest.
fn children(brick: UVec3, finer: &OctreeLevel) -> [Option<u32>; 8] {
    std::array::from_fn(|i| {
        let c = (brick << 1u32) + octant(i as u32);
        if c.cmpge(finer.grid).any() {
            return None;
        }
        let at = finer.brick_of[brick_index(c, finer.grid) as usize];
        (at != EMPTY).then_some(at)
    })
}

/// The next coarser level: the populations of eight voxels are joined and merged from their
/// full tensors, not from their stored values.
fn coarsen(bricks: &[BuildBrick], finer: &OctreeLevel, grid: UVec3) -> Vec<BuildBrick> {
    let mut parents: Vec<u32> = bricks
        .iter()
        .map(|(brick, _)| brick_index(brick_at(*brick, finer.grid) >> 1u32, grid))
        .collect();
    parents.sort_unstable();
    parents.dedup();
    parents
        .into_par_iter()
        .map(|parent| {
            let mut populations = Vec::new();
            let below = children(brick_at(parent, grid), finer);
            for (i, child) in below.into_iter().enumerate() {
                let Some(child) = child else { continue };
                let low = octant(i as u32) << 1u32;
                populations.extend(bricks[child as usize].1.iter().map(|l| {
                    let cell = low + (cell_of_bit(l.bit()) >> 1u32);
                    l.moved_to(bit_of(cell))
                }));
            }
            populations.sort_by_key(GatheredPopulation::bit);
            let merged = reduce(&mut Merger::default(), populations, KeepApart::Materials);
            (parent, merged)
        })
        .collect()
}
