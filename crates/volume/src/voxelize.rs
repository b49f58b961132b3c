//! Builds an octree from a stream of curve segments.
//!
//! Batches of segments are sorted into blocks of voxels; then each block is filled, quantised
//! and built up independently, all levels at once. Sums are taken in the order of batches,
//! whichever thread computes them.

use crate::block::BlockSums;
use crate::cluster::GatheredPopulation;
use crate::fold::fold;
use crate::footprint::FibreFootprint;
use crate::lattice::{Lattice, brick_at, bricks_across};
use crate::octree::build::{Assembly, Scales, build_block};
use crate::parts::Parts;
use crate::route::{RoutePiece, Routed, route};
use crate::{Error, Octree};
use organza_basis::{SegmentSource, Stopped, Watch};
use rayon::prelude::*;
use std::sync::Mutex;

/// How to voxelize.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelizeOptions {
    /// Edge of the finest voxels. Along x and y of a tile that repeats it is fitted to the
    /// period: it usually changes by up to a tenth, and by more where few voxels make a period
    /// or `levels` is given.
    pub voxel_mm: f32,
    /// Number of levels, 1 to 8; if none, as many as fit, at most six.
    pub levels: Option<u8>,
    /// Treatment of thick fibres.
    pub footprint: FibreFootprint,
    /// Maximum memory; a larger need is an error. No limit if none.
    pub max_memory_bytes: Option<u64>,
}

impl Default for VoxelizeOptions {
    fn default() -> VoxelizeOptions {
        VoxelizeOptions {
            voxel_mm: 0.01,
            levels: None,
            footprint: FibreFootprint::default(),
            max_memory_bytes: None,
        }
    }
}

/// Maximum number of pieces that are kept: 280 MB. When there are more, all blocks process
/// theirs and keep sums instead.
const MAX_WAITING: usize = 4_000_000;

/// Batches that a thread is given at a time, unless they are large: all that are in work
/// then have about [`MAX_WAITING`] pieces, or each thread has one.
const BATCHES: usize = 4;
/// Blocks that a thread is given at a time.
const BLOCKS: usize = 16;

/// Voxelizes all segments of a source: [`VoxelizePlan::new`] and [`VoxelizePlan::run`].
///
/// # Errors
/// As those.
pub fn voxelize(
    source: &dyn SegmentSource,
    options: &VoxelizeOptions,
    progress: Watch<'_, f32>,
) -> Result<Octree, Error> {
    let lattice = Lattice::new(&source.tile(), options.voxel_mm, options.levels)?;
    if options.max_memory_bytes.is_some() {
        return VoxelizePlan::new(source, options)?.run(progress);
    }
    run(source, (&lattice, None), options, progress)
}

/// A voxelization that has not begun.
pub struct VoxelizePlan<'a> {
    source: &'a dyn SegmentSource,
    options: VoxelizeOptions,
    lattice: Lattice,
    parts: Option<Parts>,
    memory_bytes: u64,
}

impl<'a> VoxelizePlan<'a> {
    /// Estimates the memory from a sample of the batches of the source (a sixteenth of them, at
    /// most eight).
    ///
    /// # Errors For an invalid voxel edge or tile, when more memory is needed than allowed, and
    /// as [`VoxelizePlan::run`] for the segments of the sample.
    pub fn new(
        source: &'a dyn SegmentSource,
        options: &VoxelizeOptions,
    ) -> Result<VoxelizePlan<'a>, Error> {
        let lattice = Lattice::new(&source.tile(), options.voxel_mm, options.levels)?;
        VoxelizePlan::on(lattice, source, None, options)
    }

    /// The same for a tile of equal parts, each of which is to be whole voxels of every level.
    /// Voxels outside the needed parts are incomplete or empty.
    ///
    /// # Errors
    /// As [`VoxelizePlan::new`].
    pub fn of_parts(
        source: &'a dyn SegmentSource,
        parts: Parts,
        options: &VoxelizeOptions,
    ) -> Result<VoxelizePlan<'a>, Error> {
        let (tile, count) = (source.tile(), parts.count());
        let lattice = Lattice::of_parts(&tile, count, options.voxel_mm, options.levels)?;
        VoxelizePlan::on(lattice, source, Some(parts), options)
    }

    fn on(
        lattice: Lattice,
        source: &'a dyn SegmentSource,
        parts: Option<Parts>,
        options: &VoxelizeOptions,
    ) -> Result<VoxelizePlan<'a>, Error> {
        let mut plan = VoxelizePlan {
            source,
            options: *options,
            lattice,
            parts,
            memory_bytes: table_bytes(&lattice),
        };
        plan.check(options.max_memory_bytes.unwrap_or(u64::MAX))?;
        plan.memory_bytes += sampled_bytes(source, plan.space(), options)?;
        plan.check(options.max_memory_bytes.unwrap_or(u64::MAX))?;
        Ok(plan)
    }

    /// Levels that the octree will have.
    pub fn level_count(&self) -> u8 {
        self.lattice.levels
    }

    /// Estimated peak memory, bytes.
    pub fn memory_bytes(&self) -> u64 {
        self.memory_bytes
    }

    fn space(&self) -> Space<'_> {
        (&self.lattice, self.parts.as_ref())
    }

    fn check(&self, allowed: u64) -> Result<(), Error> {
        let needed = self.memory_bytes;
        if needed > allowed {
            return Err(Error::Memory { needed, allowed });
        }
        Ok(())
    }

    /// Voxelizes all segments of the source.
    ///
    /// Segments are clipped to voxels exactly, so that the sum of density times volume is the
    /// input length (within 1e-5, the quantisation of lengths). The result is the same bit for
    /// bit on any number of threads. `progress` is called with the share of the work done, in
    /// `[0, 1]`.
    ///
    /// # Errors
    /// For segments that are not finite or lie outside a tile that does not
    /// repeat; [`Error::Stopped`] if `progress` broke.
    pub fn run(&self, progress: Watch<'_, f32>) -> Result<Octree, Error> {
        run(self.source, self.space(), &self.options, progress)
    }
}

/// The voxels, and the parts of the tile that are needed; all of them if none are given.
type Space<'a> = (&'a Lattice, Option<&'a Parts>);

fn run(
    source: &dyn SegmentSource,
    space: Space<'_>,
    options: &VoxelizeOptions,
    progress: Watch<'_, f32>,
) -> Result<Octree, Error> {
    let mut tile = Tiled::new(space.0, options.footprint);
    let max_bytes = options.max_memory_bytes.unwrap_or(u64::MAX);
    let threads = rayon::current_num_threads();
    let count = source.batch_count();
    // What is in work at a time has no effect on the result.
    let (mut done, mut at_a_time) = (0, threads);
    while done < count {
        let routed: Vec<Routed> = (done..count.min(done + at_a_time))
            .into_par_iter()
            .map(|batch| route(source, batch, space, options.footprint, max_bytes))
            .collect::<Result<_, Error>>()?;
        done += routed.len();
        let largest = routed.iter().map(|r| r.pieces.len()).max().unwrap_or(0);
        at_a_time = (MAX_WAITING / largest.max(1)).clamp(threads, BATCHES * threads);
        for r in routed {
            // Independent of the number of threads, which would otherwise change sums.
            if tile.waiting > 0 && tile.waiting + r.pieces.len() > MAX_WAITING {
                tile.take_in();
            }
            tile.add(r);
        }
        Stopped::check(progress(0.4 * done as f32 / count as f32))?;
    }
    let mut octree = tile.build(source.material_count(), progress)?;
    octree.footprint = options.footprint;
    Stopped::check(progress(1.0))?;
    Ok(octree)
}

/// All blocks of a tile.
struct Tiled<'a> {
    lattice: &'a Lattice,
    footprint: FibreFootprint,
    blocks: Vec<BlockRuns>,
    routed: Vec<Routed>,
    /// Pieces in `routed`.
    waiting: usize,
    groups: Vec<u64>,
    radii_mm: [f32; 2],
    idle: Mutex<Vec<BlockSums>>,
}

#[derive(Default)]
struct BlockRuns {
    /// Batch among `routed` and its run for this block.
    runs: Vec<(u32, u32)>,
    /// The sums that were taken before.
    kept: Vec<GatheredPopulation>,
    max_length_mm: f64,
}

impl<'a> Tiled<'a> {
    fn new(lattice: &'a Lattice, footprint: FibreFootprint) -> Tiled<'a> {
        let count = lattice.blocks_across().element_product();
        Tiled {
            lattice,
            footprint,
            blocks: (0..count).map(|_| BlockRuns::default()).collect(),
            routed: Vec::new(),
            waiting: 0,
            groups: Vec::new(),
            radii_mm: [f32::INFINITY, 0.0],
            idle: Mutex::new(Vec::new()),
        }
    }

    fn add(&mut self, r: Routed) {
        let batch = self.routed.len() as u32;
        for (i, run) in r.runs.iter().enumerate() {
            let block = &mut self.blocks[run.block as usize];
            block.runs.push((batch, i as u32));
            block.max_length_mm += run.max_length_mm;
        }
        self.waiting += r.pieces.len();
        self.groups.extend(&r.groups);
        if self.groups.len() > 1 << 21 {
            self.groups.sort_unstable();
            self.groups.dedup();
        }
        self.radii_mm = [
            self.radii_mm[0].min(r.radii_mm[0]),
            self.radii_mm[1].max(r.radii_mm[1]),
        ];
        self.routed.push(r);
    }

    /// The waiting pieces of a block together with the sums that it kept.
    fn filled(&self, index: u32, block: &mut BlockRuns) -> Vec<GatheredPopulation> {
        let mut pieces: Vec<(u64, &RoutePiece)> = Vec::new();
        for &(batch, run) in &block.runs {
            let r = &self.routed[batch as usize];
            let run = &r.runs[run as usize];
            let ids = &r.ids[run.start as usize..run.end as usize];
            pieces.extend(ids.iter().map(|&id| {
                let p = &r.pieces[id as usize];
                (r.groups[p.group as usize], p)
            }));
        }
        block.runs = Vec::new();
        let kept = std::mem::take(&mut block.kept);
        if pieces.is_empty() {
            return kept;
        }
        let spare = self.idle.lock().ok().and_then(|mut l| l.pop());
        let mut sums = spare.unwrap_or_else(BlockSums::new);
        let at = brick_at(index, self.lattice.blocks_across());
        let new = sums.fill(self.lattice, self.footprint, at, &mut pieces);
        if let Ok(mut l) = self.idle.lock() {
            l.push(sums);
        }
        fold(kept, new)
    }

    /// Every block processes the pieces that wait for it.
    fn take_in(&mut self) {
        let mut blocks = std::mem::take(&mut self.blocks);
        blocks
            .par_iter_mut()
            .enumerate()
            .filter(|(_, b)| !b.runs.is_empty())
            .for_each(|(i, b)| b.kept = self.filled(i as u32, b));
        self.blocks = blocks;
        self.routed.clear();
        self.waiting = 0;
    }

    fn scales(&mut self) -> Result<Scales, Error> {
        let mut groups = std::mem::take(&mut self.groups);
        groups.sort_unstable();
        groups.dedup();
        let lengths = self.blocks.iter().map(|b| b.max_length_mm);
        Scales::new(self.lattice, lengths, self.radii_mm, groups)
    }

    fn build(mut self, material_count: usize, progress: Watch<'_, f32>) -> Result<Octree, Error> {
        let scales = self.scales()?;
        let mut blocks: Vec<(u32, BlockRuns)> = std::mem::take(&mut self.blocks)
            .into_iter()
            .enumerate()
            .filter(|(_, b)| !(b.runs.is_empty() && b.kept.is_empty()))
            .map(|(i, b)| (i as u32, b))
            .collect();
        let mut assembly = Assembly::new(self.lattice, &scales);
        let count = blocks.len();
        let mut done = 0;
        for part in blocks.chunks_mut(BLOCKS * rayon::current_num_threads()) {
            let built: Vec<_> = part
                .par_iter_mut()
                .map(|(i, b)| build_block(self.lattice, &scales, *i, self.filled(*i, b)))
                .collect();
            for b in built {
                assembly.add(b)?;
            }
            done += part.len();
            Stopped::check(progress(0.4 + 0.6 * done as f32 / count as f32))?;
        }
        assembly.finish(material_count)
    }
}

/// Bytes of the tables of bricks and of blocks, whose size depends on the box alone.
fn table_bytes(lattice: &Lattice) -> u64 {
    let bricks = |level| {
        bricks_across(lattice.dims_at(level))
            .as_u64vec3()
            .element_product()
    };
    let blocks = lattice.blocks_across().as_u64vec3().element_product();
    let levels: u64 = (0..lattice.levels).map(bricks).sum();
    4 * levels + size_of::<BlockRuns>() as u64 * blocks
}

/// Bytes of everything else, under the assumption that no two batches share a voxel.
fn sampled_bytes(
    source: &dyn SegmentSource,
    space: Space<'_>,
    options: &VoxelizeOptions,
) -> Result<u64, Error> {
    let lattice = space.0;
    let batches = source.batch_count();
    let sample = batches.div_ceil(16).min(8);
    let max_bytes = options.max_memory_bytes.unwrap_or(u64::MAX);
    let (mut waiting, mut pieces, mut sums, mut octree) = (0, 0, 0, 0);
    let mut largest = 0;
    for i in 0..sample {
        // The middle of each equal part of the batches.
        let batch = (2 * i + 1) * batches / (2 * sample);
        let routed = route(source, batch, space, options.footprint, max_bytes)?;
        waiting += routed.bytes();
        largest = largest.max(routed.bytes());
        pieces += routed.pieces.len();
        let mut tile = Tiled::new(lattice, options.footprint);
        tile.add(routed);
        let scales = tile.scales()?;
        let mut blocks = std::mem::take(&mut tile.blocks);
        let parts: Vec<(u64, u64)> = blocks
            .par_iter_mut()
            .enumerate()
            .filter(|(_, b)| !b.runs.is_empty())
            .map(|(i, b)| {
                let populations = tile.filled(i as u32, b);
                let kept = size_of_val(&populations[..]) as u64;
                (
                    kept,
                    build_block(lattice, &scales, i as u32, populations).bytes(),
                )
            })
            .collect();
        sums += parts.iter().map(|p| p.0).sum::<u64>();
        octree += parts.iter().map(|p| p.1).sum::<u64>();
    }
    let scale = batches as f64 / sample.max(1) as f64;
    let all = |bytes: u64| (bytes as f64 * scale) as u64;
    let threads = rayon::current_num_threads() as u64;
    // Either all pieces wait to the end, or the earlier ones are kept as sums while some wait and
    // others are in work; a batch that is larger than all that may wait waits alone.
    let before = if pieces as f64 * scale <= MAX_WAITING as f64 {
        all(waiting)
    } else {
        let most = largest.max(80 * MAX_WAITING as u64);
        all(sums) + most + most.max(threads * largest)
    };
    Ok(before + all(octree) + threads * (BlockSums::BYTES + (8 << 20)))
}
