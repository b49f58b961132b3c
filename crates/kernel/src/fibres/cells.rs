//! Fibres sorted into the cells of a periodic grid.
//!
//! A ray that leaves a fibre meets the next one after a few radii, so that a walk
//! from cell to cell is cheaper than a descent through a hierarchy. Pieces are
//! copied into every cell that they reach, in blocks of sixteen, with their
//! places relative to the cell's centre: everything a ray needs lies side by
//! side, and single precision is enough wherever the cloth is.

use super::block::{BLOCK, Block, MAX_PIECES};
use super::copies::{Copies, Ends};
use super::grid::Grid;
use super::hull::HullBlock;
use super::reached::for_each_cell;
use super::strands::Strands;
use crate::cpu::prefetch;
use glam::DVec3;
use rayon::prelude::*;

/// Width of a cell in radii of the fibres' mean. The time of a path is flat between 6
/// and 7.5 for cotton and silk, and longer by 3 to 24 % at 4.
const CELL_RADII: f64 = 6.0;

/// How far intervals of neighbouring cells overlap, in the least edge of a cell.
pub const LEAD: f32 = 1.0 / 512.0;

/// How far a hit may lie beyond the plane that cuts a piece: both pieces own it.
const SLACK: f32 = 1e-6;

/// Pieces of fibre placed by one task.
const BATCH: usize = 16_384;

/// Cells filled by one task.
const CELLS_PER_TASK: usize = 4096;

/// What stands in a cell.
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
    /// Half the edges of a cell, mm, and the least edge.
    pub half_mm: [f32; 3],
    pub min_edge_mm: f32,
    /// How far the intervals of neighbouring cells overlap, mm.
    pub lead_mm: f32,
    /// How far a hit may lie beyond a plane that cuts a piece, mm.
    pub slack_mm: f32,
    pub heads: Vec<Head>,
    pub blocks: Vec<Block>,
    pub hulls: Vec<HullBlock>,
}

/// Why fibres cannot be sorted into cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfit {
    /// There are too many pieces, or too many in one cell.
    TooMany,
    /// The cells need so many bytes, more than allowed.
    Memory(u64),
}

/// A piece in a cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reached {
    pub piece: u32,
    /// Periods by which the piece is moved to get there.
    pub shift: [i16; 2],
}

impl Cells {
    /// Sorts all pieces into the cells of the box `bounds_mm` (in the world, as
    /// the strands' `origin_mm`). `max_bytes` bounds what the cells take at the peak.
    ///
    /// # Errors
    /// See [`Unfit`].
    pub fn new(
        strands: Strands<'_>,
        origin_mm: DVec3,
        bounds_mm: (DVec3, DVec3),
        repeats: bool,
        max_bytes: u64,
    ) -> Result<Cells, Unfit> {
        let count = strands.joints.len();
        if count as u64 > MAX_PIECES {
            return Err(Unfit::TooMany);
        }
        let pieces: Vec<u32> = strands.pieces().collect();
        let sum: f64 = pieces.iter().map(|&k| radius_mm(strands, k)).sum();
        let mean = sum / pieces.len().max(1) as f64;
        let grid = Grid::new(bounds_mm, CELL_RADII * mean, pieces.len(), repeats);
        let copies = Copies::new(strands, &grid, origin_mm);
        let batches: Vec<Vec<(u32, Reached)>> = pieces
            .par_chunks(BATCH)
            .map(|pieces| {
                let mut found = Vec::with_capacity(8 * pieces.len());
                for &piece in pieces {
                    for_each_cell(&grid, &copies.ends(piece), &mut |cell, shift| {
                        found.push((cell, Reached { piece, shift }));
                    });
                }
                found
            })
            .collect();
        let reached: u64 = batches.iter().map(|b| b.len() as u64).sum();
        let least = reached * (size_of::<(u32, Reached)>() + size_of::<Reached>()) as u64
            + (grid.count() * (size_of::<Head>() + 4)) as u64;
        let copied = reached * size_of::<Block>() as u64 / BLOCK as u64;
        if least + copied > max_bytes {
            return Err(Unfit::Memory(least + copied));
        }
        if reached > u64::from(u32::MAX) {
            return Err(Unfit::TooMany);
        }
        let (first, sorted) = sort(grid.count(), batches);
        let heads = heads(&copies, &first, &sorted).ok_or(Unfit::TooMany)?;
        let ends = heads.last().map_or((0, 0), |h| {
            (
                h.blocks as usize + usize::from(h.block_count),
                h.hulls as usize + usize::from(h.hull_count),
            )
        });
        let bytes = least + (ends.0 * size_of::<Block>() + ends.1 * size_of::<HullBlock>()) as u64;
        if bytes > max_bytes {
            return Err(Unfit::Memory(bytes));
        }
        let mut blocks = vec![Block::empty(); ends.0];
        let mut hulls = vec![HullBlock::empty(); ends.1];
        let tasks = tasks(&heads, &mut blocks, &mut hulls);
        tasks.into_par_iter().for_each(|(cell, blocks, hulls)| {
            let cells = cell..(cell + CELLS_PER_TASK).min(heads.len());
            fill(&copies, cells, (&first, &sorted), blocks, hulls);
        });
        let min_edge_mm = grid.cell_mm().min_element() as f32;
        Ok(Cells {
            half_mm: (0.5 * grid.cell_mm()).as_vec3().to_array(),
            min_edge_mm,
            lead_mm: LEAD * min_edge_mm,
            slack_mm: SLACK * min_edge_mm,
            grid,
            heads,
            blocks,
            hulls,
        })
    }

    /// Asks for what stands in a cell, whose head has been asked for.
    #[inline(always)]
    pub fn prefetch(&self, index: usize) {
        let Some(head) = self.heads.get(index) else {
            return;
        };
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
            + self.blocks.len() * size_of::<Block>()
            + self.hulls.len() * size_of::<HullBlock>()) as u64
    }
}

fn radius_mm(strands: Strands<'_>, piece: u32) -> f64 {
    let [a, b] = [piece, piece + 1].map(|i| strands.joints[i as usize].radius_mm);
    f64::from(a.max(b))
}

/// Pieces in the order of cells, and where each cell's begin. Within a cell they
/// keep the order of the batches.
fn sort(cells: usize, batches: Vec<Vec<(u32, Reached)>>) -> (Vec<u32>, Vec<Reached>) {
    let mut next = vec![0u32; cells + 1];
    for (cell, _) in batches.iter().flatten() {
        next[*cell as usize + 1] += 1;
    }
    for i in 0..cells {
        next[i + 1] += next[i];
    }
    let count = next[cells] as usize;
    let mut sorted = vec![Reached::default(); count];
    for (cell, reached) in batches.into_iter().flatten() {
        let slot = &mut next[cell as usize];
        sorted[*slot as usize] = reached;
        *slot += 1;
    }
    // Every start has become the next cell's.
    next.pop();
    next.insert(0, 0);
    (next, sorted)
}

/// Where the blocks of every cell begin; `None` when a cell holds too many.
fn heads(copies: &Copies<'_>, first: &[u32], sorted: &[Reached]) -> Option<Vec<Head>> {
    let (mut blocks, mut hulls) = (0u32, 0u32);
    first
        .windows(2)
        .map(|w| {
            let own = &sorted[w[0] as usize..w[1] as usize];
            let plain = own.iter().filter(|r| copies.is_plain(r.piece)).count();
            let head = Head {
                blocks,
                hulls,
                block_count: u16::try_from(plain.div_ceil(BLOCK)).ok()?,
                hull_count: u16::try_from((own.len() - plain).div_ceil(BLOCK)).ok()?,
            };
            blocks = blocks.checked_add(u32::from(head.block_count))?;
            hulls = hulls.checked_add(u32::from(head.hull_count))?;
            Some(head)
        })
        .collect()
}

type Task<'a> = (usize, &'a mut [Block], &'a mut [HullBlock]);

/// Runs of cells with the blocks that are theirs.
fn tasks<'a>(
    heads: &[Head],
    mut blocks: &'a mut [Block],
    mut hulls: &'a mut [HullBlock],
) -> Vec<Task<'a>> {
    let mut tasks = Vec::new();
    for (i, run) in heads.chunks(CELLS_PER_TASK).enumerate() {
        let of_blocks: usize = run.iter().map(|h| usize::from(h.block_count)).sum();
        let of_hulls: usize = run.iter().map(|h| usize::from(h.hull_count)).sum();
        let (own_blocks, rest) = blocks.split_at_mut(of_blocks);
        blocks = rest;
        let (own_hulls, rest) = hulls.split_at_mut(of_hulls);
        hulls = rest;
        tasks.push((i * CELLS_PER_TASK, own_blocks, own_hulls));
    }
    tasks
}

/// Copies the pieces of some cells into their blocks.
fn fill(
    copies: &Copies<'_>,
    cells: std::ops::Range<usize>,
    (first, sorted): (&[u32], &[Reached]),
    blocks: &mut [Block],
    hulls: &mut [HullBlock],
) {
    let (mut block, mut hull) = (0, 0);
    for cell in cells {
        let own = &sorted[first[cell] as usize..first[cell + 1] as usize];
        let (mut plain, mut others) = (0, 0);
        for reached in own {
            let ends: Ends = copies.ends_in(reached, cell);
            if ends.is_plain {
                ends.write_block(&mut blocks[block + plain / BLOCK], plain % BLOCK);
                plain += 1;
            } else {
                ends.write_hull(&mut hulls[hull + others / BLOCK], others % BLOCK);
                others += 1;
            }
        }
        block += plain.div_ceil(BLOCK);
        hull += others.div_ceil(BLOCK);
    }
}
