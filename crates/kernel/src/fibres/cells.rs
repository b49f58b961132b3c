//! Fibres sorted into the cells of a periodic grid.
//!
//! A ray that leaves a fibre meets the next one after a few radii, so that a walk
//! from cell to cell is cheaper than a descent through a hierarchy. Pieces are
//! copied into every cell that they reach, in blocks of sixteen, with their
//! places relative to the cell's centre: everything a ray needs lies side by
//! side, and single precision is enough wherever the cloth is. Where memory does not
//! suffice for copies, cells hold [lists](super::lists) of numbers instead.

use super::block::{BLOCK, MAX_PIECES, PieceBlock};
use super::copies::Copies;
use super::grid::Grid;
use super::hull::HullBlock;
use super::lists::Lists;
use super::reached::for_each_cell;
use super::strands::Strands;
use glam::DVec3;
use organza_lanes::prefetch;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Width of a cell in radii of the fibres' mean. The time of a path is flat between 6
/// and 7.5 for cotton and silk, and longer by 3 to 24 % at 4.
const CELL_RADII: f64 = 6.0;

/// How far intervals of neighbouring cells overlap, in the least edge of a cell.
pub const LEAD: f32 = 1.0 / 512.0;

/// How far a hit may lie beyond the plane that cuts a piece: both pieces own it.
const SLACK: f32 = 1e-6;

/// Pieces of fibre placed by one task.
const BATCH: usize = 16_384;

/// Cells sorted by one task.
const CELLS_PER_TASK: usize = 4096;

/// What stands in a cell. Where cells hold lists, there is one head more than cells, and
/// `blocks` and `hulls` are the first of its numbers in the lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Head {
    /// The first of its blocks of each kind.
    pub blocks: u32,
    pub hulls: u32,
    /// Their numbers.
    pub block_count: u16,
    pub hull_count: u16,
}

/// All cells.
pub struct Cells {
    pub grid: Grid,
    /// Mean radius of the pieces, mm.
    pub mean_radius_mm: f64,
    /// Half the edges of a cell, mm, and the least edge.
    pub half_mm: [f32; 3],
    pub min_edge_mm: f32,
    /// How far the intervals of neighbouring cells overlap, mm.
    pub lead_mm: f32,
    /// How far a hit may lie beyond a plane that cuts a piece, mm.
    pub slack_mm: f32,
    pub heads: Vec<Head>,
    pub blocks: Vec<PieceBlock>,
    pub hulls: Vec<HullBlock>,
    /// In place of most copies, where these take too much memory.
    pub lists: Option<Lists>,
}

/// Where strands lie, and how their pieces are numbered.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// What joints are counted from, in the world.
    pub origin_mm: DVec3,
    /// The box that is divided into cells, in the world.
    pub bounds_mm: (DVec3, DVec3),
    /// Whether it repeats in x and y.
    pub repeats: bool,
    /// Number of the first piece in the table of joints.
    pub first_piece: u32,
}

/// Why fibres cannot be sorted into cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfit {
    /// There are too many pieces, or too many in one cell.
    TooMany,
    /// Even lists of numbers need so many bytes, more than allowed.
    Memory(u64),
}

/// A piece in a cell, and the periods by which it is moved to get there, in one word: the order
/// of pieces in a cell is that of these words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reached(u64);

impl Reached {
    /// A piece that is moved by so many periods.
    fn new(piece: u32, shift: [i16; 2]) -> Reached {
        // Copies of one piece come in the order in which cells are found along it: those that are
        // moved farthest forwards first.
        let [x, y] = shift.map(|n| u64::from(n as u16 ^ 0x7fff));
        Reached(u64::from(piece) << 32 | x << 16 | y)
    }

    /// The number of the piece.
    #[inline(always)]
    pub fn piece(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// Periods by which it is moved.
    #[inline(always)]
    pub fn shift(self) -> [i16; 2] {
        [self.0 >> 16, self.0].map(|word| (word as u16 ^ 0x7fff) as i16)
    }
}

impl Cells {
    /// Sorts all pieces into cells. `max_bytes` bounds what these take at the peak.
    ///
    /// # Errors
    /// See [`Unfit`].
    pub fn new(strands: Strands<'_>, placed: &Placed, max_bytes: u64) -> Result<Cells, Unfit> {
        let count = strands.joints.len();
        if count as u64 + u64::from(placed.first_piece) > MAX_PIECES {
            return Err(Unfit::TooMany);
        }
        let (mut sum, mut pieces) = (0.0, 0);
        for piece in strands.pieces() {
            sum += radius_mm(strands, piece);
            pieces += 1;
        }
        let mean = sum / pieces.max(1) as f64;
        let edge_mm = CELL_RADII * mean;
        let grid = Grid::new(placed.bounds_mm, edge_mm, pieces, placed.repeats);
        let copies = Copies::new(strands, &grid, placed);
        let counting = 2 * grid.count() as u64 * size_of::<[AtomicU32; 2]>() as u64;
        if counting > max_bytes {
            return Err(Unfit::Memory(counting));
        }
        let first = starts(&copies, &grid).ok_or(Unfit::TooMany)?;
        let heads = heads(&first).ok_or(Unfit::TooMany)?;
        let reached = u64::from(first[first.len() - 1]);
        let ends = heads.last().map_or((0, 0), |h| {
            (
                h.blocks as usize + usize::from(h.block_count),
                h.hulls as usize + usize::from(h.hull_count),
            )
        });
        let sorting = reached * size_of::<Reached>() as u64
            + counting
            + (heads.len() * size_of::<Head>()) as u64;
        let copied = (ends.0 * size_of::<PieceBlock>() + ends.1 * size_of::<HullBlock>()) as u64;
        let is_listed = sorting + copied > max_bytes;
        let listed = sorting + Lists::bytes(0, count);
        if is_listed && listed > max_bytes {
            return Err(Unfit::Memory(listed));
        }
        let sorted = sort(&copies, &grid, &first);
        let min_edge_mm = grid.cell_mm().min_element() as f32;
        let mut cells = Cells {
            half_mm: (0.5 * grid.cell_mm()).as_vec3().to_array(),
            min_edge_mm,
            lead_mm: LEAD * min_edge_mm,
            slack_mm: SLACK * min_edge_mm,
            grid,
            mean_radius_mm: mean,
            heads: Vec::new(),
            blocks: Vec::new(),
            hulls: Vec::new(),
            lists: None,
        };
        if is_listed {
            let (lists, heads, blocks, hulls) = Lists::new(&copies, &first, sorted, heads);
            (cells.heads, cells.blocks, cells.hulls) = (heads, blocks, hulls);
            cells.lists = Some(lists);
            return Ok(cells);
        }
        // Each is written once: to write so much memory takes longer than to compute what stands in it.
        let filled = |of: fn(&Head) -> u32, kind: usize, i: usize| {
            let cell = heads.partition_point(|head| of(head) as usize <= i) - 1;
            let [from, to] = [0, 1].map(|k| first[2 * cell + kind + k] as usize);
            let from = from + (i - of(&heads[cell]) as usize) * BLOCK;
            (
                &sorted[from..to.min(from + BLOCK)],
                copies.frame().cell_at(cell),
            )
        };
        let blocks = many(ends.0, |i| {
            let (pieces, at) = filled(|head| head.blocks, 0, i);
            copies.block(pieces, at)
        });
        let hulls = many(ends.1, |i| {
            let (pieces, at) = filled(|head| head.hulls, 1, i);
            copies.hulls(pieces, at)
        });
        (cells.heads, cells.blocks, cells.hulls) = (heads, blocks, hulls);
        Ok(cells)
    }

    /// Asks for what stands in a cell, whose head has been asked for.
    #[inline(always)]
    pub fn prefetch(&self, index: usize) {
        let Some(head) = self.heads.get(index) else {
            return;
        };
        if let Some(lists) = &self.lists {
            return lists.prefetch(head);
        }
        for block in 0..usize::from(head.block_count).min(2) {
            prefetch(&self.blocks, head.blocks as usize + block);
        }
        if head.hull_count > 0 {
            prefetch(&self.hulls, head.hulls as usize);
        }
    }

    /// Asks for the head of a cell.
    #[inline(always)]
    pub fn prefetch_head(&self, index: usize) {
        prefetch(&self.heads, index);
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        (self.heads.len() * size_of::<Head>()
            + self.blocks.len() * size_of::<PieceBlock>()
            + self.hulls.len() * size_of::<HullBlock>()) as u64
            + self.lists.as_ref().map_or(0, Lists::memory_bytes)
    }
}

fn radius_mm(strands: Strands<'_>, piece: u32) -> f64 {
    let [a, b] = [piece, piece + 1].map(|i| strands.joints[i as usize].radius_mm);
    f64::from(a.max(b))
}

/// So many, made by all threads.
fn many<T: Send>(count: usize, one: impl Fn(usize) -> T + Send + Sync) -> Vec<T> {
    let all = (0..count).into_par_iter().with_min_len(BATCH);
    all.map(one).collect()
}

/// Calls `found` with every cell that a piece reaches, twice its index, and one more for a piece
/// that is not plain; all threads do.
fn for_each_reached(copies: &Copies<'_>, grid: &Grid, found: impl Fn(usize, Reached) + Sync) {
    let joints = copies.joint_count();
    let batches = (0..joints.div_ceil(BATCH)).into_par_iter();
    batches.for_each(|batch| {
        for joint in batch * BATCH..((batch + 1) * BATCH).min(joints) {
            let piece = joint as u32;
            if !copies.begins_piece(piece) {
                continue;
            }
            let kind = usize::from(!copies.is_plain(piece));
            for_each_cell(grid, &copies.ends(piece), &mut |cell, shift| {
                found(2 * cell as usize + kind, Reached::new(piece, shift));
            });
        }
    });
}

/// Where the plain pieces and then the others of every cell begin in the order of cells,
/// and where the last ends; `None` when there are too many.
fn starts(copies: &Copies<'_>, grid: &Grid) -> Option<Vec<u32>> {
    let counts = many(2 * grid.count() + 1, |_| AtomicU32::default());
    for_each_reached(copies, grid, |kind, _| {
        counts[kind].fetch_add(1, Ordering::Relaxed);
    });
    let mut sum = 0u32;
    let mut starts: Vec<u32> = counts.into_iter().map(AtomicU32::into_inner).collect();
    for count in &mut starts {
        let start = sum;
        sum = sum.checked_add(*count)?;
        *count = start;
    }
    Some(starts)
}

/// Pieces in the order of cells. Within a cell the plain ones come first, and either keep
/// the order of their numbers.
fn sort(copies: &Copies<'_>, grid: &Grid, first: &[u32]) -> Vec<Reached> {
    let next: Vec<AtomicU32> = first.par_iter().map(|&i| AtomicU32::new(i)).collect();
    let slots = many(first[first.len() - 1] as usize, |_| AtomicU64::default());
    for_each_reached(copies, grid, |kind, reached| {
        let slot = next[kind].fetch_add(1, Ordering::Relaxed);
        slots[slot as usize].store(reached.0, Ordering::Relaxed);
    });
    drop(next);
    // The same room.
    let words = slots.into_iter().map(AtomicU64::into_inner);
    let mut sorted: Vec<Reached> = words.map(Reached).collect();
    // Threads came to a cell in any order.
    let (mut rest, mut tasks) = (&mut sorted[..], Vec::new());
    for from in (0..first.len() - 1).step_by(2 * CELLS_PER_TASK) {
        let to = (from + 2 * CELLS_PER_TASK).min(first.len() - 1);
        let (own, others) = rest.split_at_mut((first[to] - first[from]) as usize);
        rest = others;
        tasks.push((&first[from..=to], own));
    }
    tasks.into_par_iter().for_each(|(first, own)| {
        for kind in first.windows(2) {
            let [from, to] = [kind[0], kind[1]].map(|i| (i - first[0]) as usize);
            own[from..to].sort_unstable();
        }
    });
    sorted
}

/// Where the blocks of every cell begin; `None` when a cell holds too many.
fn heads(first: &[u32]) -> Option<Vec<Head>> {
    let (mut blocks, mut hulls) = (0u32, 0u32);
    (0..first.len() / 2)
        .map(|cell| {
            let [a, b, c] = [0, 1, 2].map(|i| first[2 * cell + i] as usize);
            let head = Head {
                blocks,
                hulls,
                block_count: u16::try_from((b - a).div_ceil(BLOCK)).ok()?,
                hull_count: u16::try_from((c - b).div_ceil(BLOCK)).ok()?,
            };
            blocks = blocks.checked_add(u32::from(head.block_count))?;
            hulls = hulls.checked_add(u32::from(head.hull_count))?;
            Some(head)
        })
        .collect()
}
