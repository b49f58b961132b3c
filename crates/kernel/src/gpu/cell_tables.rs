//! The pieces of fibre in cells, one after the other, without the empty places of blocks.

use super::tables::Tables;
use crate::fibres::block::{BLOCK, Block};
use crate::fibres::cells::Cells;
use crate::fibres::hull::HullBlock;
use crate::fibres::lists::{Found, Lists};
use crate::refusal::Refusal;
use rayon::prelude::*;

/// Words of a cell's head, of a plain piece and of a hull: see `cells.wgsl`.
const HEAD_WORDS: usize = 4;
const PIECE_WORDS: usize = 12;
const HULL_WORDS: usize = 16;
/// Cells that one task lays out.
const CELLS_PER_PART: usize = 16_384;

/// The first words of the tables of a body's cells.
pub struct CellTables {
    pub heads: u32,
    pub pieces: u32,
    pub hulls: u32,
}

impl CellTables {
    /// Bytes of the tables, at most.
    pub fn bytes(cells: &Cells) -> u64 {
        let listed = cells.lists.as_ref().map_or(0, Lists::entry_count);
        let pieces = (cells.blocks.len() * BLOCK + listed) * PIECE_WORDS;
        let hulls = cells.hulls.len() * BLOCK * HULL_WORDS;
        4 * (cells.heads.len() * HEAD_WORDS + pieces + hulls) as u64
    }

    /// Lays the cells of a body out.
    ///
    /// # Errors
    /// More pieces in a cell than its head can count.
    pub fn add(cells: &Cells, tables: &mut Tables<'_>) -> Result<CellTables, Refusal> {
        let count = cells.grid.count();
        let parts: Vec<Part> = (0..count.div_ceil(CELLS_PER_PART))
            .into_par_iter()
            .map(|i| {
                let mut part = Part::default();
                for cell in i * CELLS_PER_PART..((i + 1) * CELLS_PER_PART).min(count) {
                    part.add_cell(cells, cell);
                }
                part
            })
            .collect();
        let mut heads = Vec::with_capacity(HEAD_WORDS * count);
        let (mut first, mut first_hull) = (0u32, 0u32);
        for [pieces, hulls] in parts.iter().flat_map(|part| &part.counts) {
            if pieces.max(hulls) > &0xffff {
                return Err(Refusal::TooManyPieces);
            }
            heads.extend([first, first_hull, pieces | hulls << 16, 0]);
            first += pieces;
            first_hull += hulls;
        }
        let (pieces, hulls): (Vec<_>, Vec<_>) =
            parts.into_iter().map(|p| (p.pieces, p.hulls)).unzip();
        Ok(CellTables {
            heads: tables.add(heads),
            pieces: tables.add_parts(pieces),
            hulls: tables.add_parts(hulls),
        })
    }
}

/// Some cells.
#[derive(Default)]
struct Part {
    /// Of each cell its plain pieces and its hulls.
    counts: Vec<[u32; 2]>,
    pieces: Vec<u32>,
    hulls: Vec<u32>,
}

impl Part {
    fn add_cell(&mut self, cells: &Cells, cell: usize) {
        let before = [self.pieces.len(), self.hulls.len()];
        let found = match &cells.lists {
            None => Found::Copied(cells.heads[cell]),
            Some(lists) => lists.find(&cells.heads, cell),
        };
        match (found, &cells.lists) {
            (Found::Listed(plain, others), Some(lists)) => {
                let at = lists.cell_at(cell);
                for entries in plain.chunks(BLOCK) {
                    self.add_block(&lists.block(entries, at));
                }
                for entries in others.chunks(BLOCK) {
                    self.add_hulls(&lists.hulls(entries, at));
                }
            }
            (Found::Copied(head), _) => {
                let (first, hull) = (head.blocks as usize, head.hulls as usize);
                for block in &cells.blocks[first..first + usize::from(head.block_count)] {
                    self.add_block(block);
                }
                for block in &cells.hulls[hull..hull + usize::from(head.hull_count)] {
                    self.add_hulls(block);
                }
            }
            (Found::Listed(..), None) => {}
        }
        self.counts.push([
            ((self.pieces.len() - before[0]) / PIECE_WORDS) as u32,
            ((self.hulls.len() - before[1]) / HULL_WORDS) as u32,
        ]);
    }

    fn add_block(&mut self, block: &Block) {
        for i in 0..BLOCK {
            // Whatever nothing can meet has a negative square of its radius.
            if block.radius_squared[i] < 0.0 {
                continue;
            }
            let [fx, fy, fz] = block.foot.map(|x| x[i]);
            let [ax, ay, az] = block.axis.map(|x| x[i]);
            let [square, low, high] = [block.radius_squared[i], block.low[i], block.high[i]];
            let numbers = [fx, fy, fz, square, ax, ay, az, low, high];
            self.pieces.extend(numbers.map(f32::to_bits));
            self.pieces.extend([block.piece[i], 0, 0]);
        }
    }

    fn add_hulls(&mut self, hull: &HullBlock) {
        for i in 0..BLOCK {
            let squares = [hull.start_squared[i], hull.end_squared[i]];
            let has_side = hull.low[i] < hull.high[i];
            if !has_side && squares.iter().all(|&square| square < 0.0) {
                continue;
            }
            let [fx, fy, fz] = hull.foot.map(|x| x[i]);
            let [ax, ay, az] = hull.axis.map(|x| x[i]);
            let line = [fx, fy, fz, hull.start[i], ax, ay, az, hull.end[i]];
            let side = [hull.narrowing[i], hull.wide[i], hull.low[i], hull.high[i]];
            let numbers = line.into_iter().chain(squares).chain(side);
            self.hulls.extend(numbers.map(f32::to_bits));
            self.hulls.extend([hull.piece[i], 0]);
        }
    }
}
