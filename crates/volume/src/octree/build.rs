//! From gathered populations to all levels of the octree.

use super::{EMPTY, Group, Level, Octree, broadside};
use crate::Error;
use crate::cluster::{Apart, Lump, merge_to};
use crate::lattice::{Lattice, bit_of, brick_at, brick_index, bricks_across, cell_of_bit, octant};
use crate::record::{Brick, MAX_GROUPS, RadiusScale, Record, encode_direction};
use glam::UVec3;
use organza_basis::MAX_COMPONENTS;
use rayon::prelude::*;
use std::collections::HashMap;

/// Extinction-weighted variance of `t t^T`, as a share, up to which two
/// populations of a voxel are stored as one: two equal ones at less than 18
/// degrees, which one lobe of 9 degrees spread stands for. Coarser cells are
/// few and mix more: there it is 8 degrees.
const FINEST_TOLERANCE: f32 = 0.05;
const COARSE_TOLERANCE: f32 = 0.01;

/// The populations of one brick under construction, sorted by voxel.
pub(crate) type BuildBrick = (u32, Vec<Lump>);

/// What quantisation needs to know of the whole tile.
struct Scales {
    quantum_mm: f64,
    radii: RadiusScale,
    groups: Vec<u64>,
}

impl Octree {
    /// Builds all levels from the finest voxels' populations, given brick by
    /// brick in rising order.
    pub(crate) fn build(
        lattice: Lattice,
        material_count: usize,
        mut bricks: Vec<BuildBrick>,
    ) -> Result<Octree, Error> {
        bricks
            .par_iter_mut()
            .for_each(|(_, lumps)| reduce(lumps, Apart::Yarns));
        let scales = Scales::new(&lattice, &bricks)?;
        // What is left of each number after rounding goes to the next, so that
        // a sum over voxels is off by half a quantum and not by its root.
        bricks.par_iter_mut().for_each(|(_, lumps)| {
            let mut carry = 0.0;
            for l in lumps.iter_mut() {
                let exact = l.length_mm / scales.quantum_mm + carry;
                let quanta = exact.round().max(0.0);
                carry = exact - quanta;
                l.rescale(quanta * scales.quantum_mm);
            }
            lumps.retain(|l| l.length_mm > 0.0);
        });
        bricks.retain(|b| !b.1.is_empty());

        let mut levels: Vec<Level> = Vec::new();
        for level in 0..lattice.levels {
            if let Some(finer) = levels.last() {
                bricks = coarsen(&bricks, finer, bricks_across(lattice.dims_at(level)));
            }
            let stored = store(&lattice, level, &bricks, &scales, levels.last())?;
            levels.push(stored);
        }
        let groups = scales.groups.iter().map(|&g| Group {
            yarn: (g >> 16) as u32,
            material: g as u16,
        });
        Ok(Octree::assemble(
            lattice,
            levels,
            groups.collect(),
            scales.radii,
            scales.quantum_mm,
            material_count as u32,
        ))
    }
}

/// Merges the populations of each voxel of a brick, which are sorted by voxel.
fn reduce(lumps: &mut Vec<Lump>, apart: Apart) {
    let all = std::mem::take(lumps);
    lumps.reserve_exact(all.len());
    let mut voxel = Vec::new();
    for part in all.chunk_by(|a, b| a.bit() == b.bit()) {
        if let [only] = part {
            lumps.push(*only);
            continue;
        }
        voxel.extend_from_slice(part);
        let tolerance = match apart {
            Apart::Yarns => FINEST_TOLERANCE,
            Apart::Materials => COARSE_TOLERANCE,
        };
        merge_to(&mut voxel, MAX_COMPONENTS, tolerance, apart);
        // Largest first: a reader who wants only one takes the first.
        voxel.sort_by(|a, b| b.radius_length_mm2.total_cmp(&a.radius_length_mm2));
        lumps.append(&mut voxel);
    }
}

impl Scales {
    fn new(lattice: &Lattice, bricks: &[BuildBrick]) -> Result<Scales, Error> {
        // Sums over the coarsest cells, or over whole bricks where those are
        // larger: an upper bound is enough.
        let shift = u32::from(lattice.levels.saturating_sub(3));
        let grid = bricks_across(lattice.dims);
        let mut sums: HashMap<UVec3, f64> = HashMap::new();
        let (mut least, mut most) = (f32::INFINITY, 0.0f32);
        let mut groups = Vec::new();
        for (brick, lumps) in bricks {
            let cell = brick_at(*brick, grid) >> shift;
            *sums.entry(cell).or_default() += lumps.iter().map(|l| l.length_mm).sum::<f64>();
            for l in lumps {
                let r = l.radius_mm();
                (least, most) = (least.min(r), most.max(r));
                if groups.last() != Some(&l.group()) {
                    groups.push(l.group());
                }
            }
            if groups.len() > 4 * MAX_GROUPS {
                groups.sort_unstable();
                groups.dedup();
            }
        }
        groups.sort_unstable();
        groups.dedup();
        if groups.len() > MAX_GROUPS {
            return Err(Error::Options(format!(
                "{} pairs of yarn and material; at most {MAX_GROUPS} fit an octree",
                groups.len()
            )));
        }
        let fullest = sums.values().fold(0.0f64, |a, &b| a.max(b));
        // Rounding up in every voxel must not carry the sum past 32 bits.
        let quantum_mm = if fullest > 0.0 {
            (fullest / 4.0e9).log2().ceil().exp2()
        } else {
            1.0
        };
        Ok(Scales {
            quantum_mm,
            radii: RadiusScale::new(if most > 0.0 { least } else { 0.0 }, most),
            groups,
        })
    }

    fn record(&self, l: &Lump) -> Record {
        let (axis, sin_sq) = l.axis_and_sin_sq();
        let group = self.groups.binary_search(&l.group()).unwrap_or(0) as u32;
        Record {
            length: (l.length_mm / self.quantum_mm) as u32,
            direction: encode_direction(axis, sin_sq),
            population: self.radii.encode(group, l.radius_mm()),
        }
    }
}

/// Quantises a level.
fn store(
    lattice: &Lattice,
    level: u8,
    bricks: &[BuildBrick],
    scales: &Scales,
    finer: Option<&Level>,
) -> Result<Level, Error> {
    let grid = bricks_across(lattice.dims_at(level));
    let density_per_quantum = lattice.density_of(scales.quantum_mm, level);
    let mut brick_of = vec![EMPTY; grid.element_product() as usize];
    let mut headers = Vec::with_capacity(bricks.len());
    let mut count = 0usize;
    for (i, (brick, lumps)) in bricks.iter().enumerate() {
        brick_of[*brick as usize] = i as u32;
        let mut header = Brick {
            first: u32::try_from(count).map_err(|_| too_many())?,
            ..Brick::default()
        };
        for l in lumps {
            let bit = 1u64 << l.bit();
            // At most four per voxel, so a mask is always free.
            if let Some(mask) = header.masks.iter_mut().find(|m| **m & bit == 0) {
                *mask |= bit;
            }
        }
        count += lumps.len();
        headers.push(header);
    }
    u32::try_from(count).map_err(|_| too_many())?;
    let mut records = vec![Record::default(); count];
    let mut parts = Vec::with_capacity(bricks.len());
    let mut rest = &mut records[..];
    for (_, lumps) in bricks {
        let (part, tail) = rest.split_at_mut(lumps.len());
        parts.push(part);
        rest = tail;
    }
    parts
        .into_par_iter()
        .zip(bricks)
        .for_each(|(part, (_, lumps))| {
            for (r, l) in part.iter_mut().zip(lumps) {
                *r = scales.record(l);
            }
        });
    let mut stored = Level {
        grid,
        brick_of,
        bricks: headers,
        records,
        density_per_quantum,
    };
    let majorants: Vec<f32> = bricks
        .par_iter()
        .enumerate()
        .map(|(i, (brick, _))| match finer {
            None => finest_majorant(&stored, i, &scales.radii),
            Some(finer) => {
                let below = children(brick_at(*brick, grid), finer);
                below
                    .iter()
                    .flatten()
                    .fold(0.0, |m, &c| finer.bricks[c as usize].majorant_per_mm.max(m))
            }
        })
        .collect();
    for (b, m) in stored.bricks.iter_mut().zip(majorants) {
        b.majorant_per_mm = m;
    }
    Ok(stored)
}

fn too_many() -> Error {
    Error::Options("more than 4294967295 populations in one level: take larger voxels".into())
}

fn finest_majorant(level: &Level, brick: usize, radii: &RadiusScale) -> f32 {
    let b = &level.bricks[brick];
    let most = (0..64)
        .map(|bit| {
            broadside(
                &level.records[b.records_of(bit)],
                level.density_per_quantum,
                radii,
            )
        })
        .fold(0.0f32, f32::max);
    // Whoever sums in another order must not exceed it.
    most * (1.0 + 1e-6)
}

/// Indices of the eight bricks below a brick, x fastest.
fn children(brick: UVec3, finer: &Level) -> [Option<u32>; 8] {
    std::array::from_fn(|i| {
        let c = (brick << 1u32) + octant(i as u32);
        if c.cmpge(finer.grid).any() {
            return None;
        }
        let at = finer.brick_of[brick_index(c, finer.grid) as usize];
        (at != EMPTY).then_some(at)
    })
}

/// The next coarser level: eight voxels' populations brought together and
/// merged from their full tensors, not from what was stored of them.
fn coarsen(bricks: &[BuildBrick], finer: &Level, grid: UVec3) -> Vec<BuildBrick> {
    let mut parents: Vec<u32> = bricks
        .iter()
        .map(|(brick, _)| brick_index(brick_at(*brick, finer.grid) >> 1u32, grid))
        .collect();
    parents.sort_unstable();
    parents.dedup();
    parents
        .into_par_iter()
        .map(|parent| {
            let mut lumps = Vec::new();
            let below = children(brick_at(parent, grid), finer);
            for (i, child) in below.into_iter().enumerate() {
                let Some(child) = child else { continue };
                let low = octant(i as u32) << 1u32;
                lumps.extend(bricks[child as usize].1.iter().map(|l| {
                    let cell = low + (cell_of_bit(l.bit()) >> 1u32);
                    l.moved_to(bit_of(cell))
                }));
            }
            lumps.sort_by_key(Lump::bit);
            reduce(&mut lumps, Apart::Materials);
            (parent, lumps)
        })
        .collect()
}
