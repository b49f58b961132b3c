//! The pieces of fibre in cells, one after the other, without the empty places of blocks.

use super::tables::{Made, Tables};
use crate::fibres::block::{BLOCK, PieceBlock};
use crate::fibres::cells::Cells;
use crate::fibres::hull::HullBlock;
use crate::fibres::lists::InCell;
use crate::refusal::Refusal;
use rayon::prelude::*;
use std::ops::Range;

/// Words of a cell's head, of a plain piece, of its end and of a hull: see `cells.wgsl`.
const HEAD_WORDS: usize = 4;
const PIECE_WORDS: usize = 8;
const END_WORDS: usize = 2;
const HULL_WORDS: usize = 16;
/// Cells whose pieces are laid out at once.
const CELLS_PER_PART: usize = 16_384;

/// The first words of the tables of a body's cells, among large ones.
pub struct CellTables {
    pub heads: u32,
    pub pieces: u32,
    pub ends: u32,
    pub hulls: u32,
}

impl CellTables {
    /// Lays the cells of a body out.
    ///
    /// # Errors
    /// More pieces in a cell than its head can count.
    pub fn add<'a>(cells: &'a Cells, tables: &mut Tables<'a>) -> Result<CellTables, Refusal> {
        let all = 0..cells.grid.count();
        let counts: Vec<[u32; 2]> = all.into_par_iter().map(|i| counts(cells, i)).collect();
        let mut heads = Vec::with_capacity(HEAD_WORDS * counts.len());
        let (mut first, mut first_hull) = (0u32, 0u32);
        for [pieces, hulls] in &counts {
            if pieces.max(hulls) > &0xffff {
                return Err(Refusal::TooManyPieces);
            }
            heads.extend([first, first_hull, pieces | hulls << 16, 0]);
            first = first.checked_add(*pieces).ok_or(Refusal::TooManyPieces)?;
            first_hull += hulls;
        }
        let mut add = |kind: usize, words: usize, of_cell: fn(&Cells, usize, &mut Vec<u32>)| {
            let parts = counts
                .chunks(CELLS_PER_PART)
                .enumerate()
                .map(|(i, counts)| {
                    let from = i * CELLS_PER_PART;
                    let range = from..from + counts.len();
                    let pieces: u32 = counts.iter().map(|count| count[kind]).sum();
                    part(cells, range, words * pieces as usize, of_cell)
                });
            tables.add_large_made(parts)
        };
        Ok(CellTables {
            pieces: add(0, PIECE_WORDS, add_pieces),
            ends: add(0, END_WORDS, add_ends),
            hulls: add(1, HULL_WORDS, add_hulls),
            heads: tables.add_large(heads),
        })
    }
}

/// What some cells have in a table of so many words.
fn part<'a>(
    cells: &'a Cells,
    range: Range<usize>,
    count: usize,
    of_cell: fn(&Cells, usize, &mut Vec<u32>),
) -> Made<'a> {
    let make = move || {
        let mut words = Vec::with_capacity(count);
        for cell in range.clone() {
            of_cell(cells, cell, &mut words);
        }
        words
    };
    Made {
        count,
        make: Box::new(make),
    }
}

/// Plain pieces and hulls of a cell.
fn counts(cells: &Cells, cell: usize) -> [u32; 2] {
    let mut counts = [0; 2];
    for_each_piece(cells, cell, |_, _| counts[0] += 1);
    for_each_hull(cells, cell, |_, _| counts[1] += 1);
    counts
}

fn add_pieces(cells: &Cells, cell: usize, words: &mut Vec<u32>) {
    for_each_piece(cells, cell, |block, i| {
        let [fx, fy, fz] = block.foot.map(|x| x[i]);
        let [ax, ay, az] = block.axis.map(|x| x[i]);
        let numbers = [
            fx,
            fy,
            fz,
            block.radius_squared[i],
            ax,
            ay,
            az,
            block.low[i],
        ];
        words.extend(numbers.map(f32::to_bits));
    });
}

fn add_ends(cells: &Cells, cell: usize, words: &mut Vec<u32>) {
    for_each_piece(cells, cell, |block, i| {
        words.extend([block.high[i].to_bits(), block.piece[i]]);
    });
}

fn add_hulls(cells: &Cells, cell: usize, words: &mut Vec<u32>) {
    for_each_hull(cells, cell, |hull, i| {
        let [fx, fy, fz] = hull.foot.map(|x| x[i]);
        let [ax, ay, az] = hull.axis.map(|x| x[i]);
        let line = [fx, fy, fz, hull.start[i], ax, ay, az, hull.end[i]];
        let squares = [hull.start_squared[i], hull.end_squared[i]];
        let side = [hull.narrowing[i], hull.wide[i], hull.low[i], hull.high[i]];
        let numbers = line.into_iter().chain(squares).chain(side);
        words.extend(numbers.map(f32::to_bits));
        words.extend([hull.piece[i], 0]);
    });
}

fn found(cells: &Cells, cell: usize) -> InCell<'_> {
    match &cells.lists {
        None => InCell::Copied(cells.heads[cell]),
        Some(lists) => lists.find(&cells.heads, cell),
    }
}

/// Calls `each` with the blocks of a cell's plain pieces and their places there.
fn for_each_piece(cells: &Cells, cell: usize, mut each: impl FnMut(&PieceBlock, usize)) {
    // Whatever nothing can meet has a negative square of its radius.
    let mut of_block = |block: &PieceBlock| {
        let places = (0..BLOCK).filter(|&i| block.radius_squared[i] >= 0.0);
        places.for_each(|i| each(block, i));
    };
    match (found(cells, cell), &cells.lists) {
        (InCell::Copied(head), _) => {
            let blocks = &cells.blocks[head.blocks as usize..][..usize::from(head.block_count)];
            blocks.iter().for_each(of_block);
        }
        (InCell::Listed(plain, _), Some(lists)) => {
            for entries in plain.chunks(BLOCK) {
                of_block(&lists.block(entries, lists.cell_at(cell)));
            }
        }
        (InCell::Listed(..), None) => {}
    }
}

/// The same of hulls, which may have a side or a ball.
fn for_each_hull(cells: &Cells, cell: usize, mut each: impl FnMut(&HullBlock, usize)) {
    let mut of_block = |hull: &HullBlock| {
        let balls = |i| hull.start_squared[i] >= 0.0 || hull.end_squared[i] >= 0.0;
        let places = (0..BLOCK).filter(|&i| hull.low[i] < hull.high[i] || balls(i));
        places.for_each(|i| each(hull, i));
    };
    match (found(cells, cell), &cells.lists) {
        (InCell::Copied(head), _) => {
            let hulls = &cells.hulls[head.hulls as usize..][..usize::from(head.hull_count)];
            hulls.iter().for_each(of_block);
        }
        (InCell::Listed(_, others), Some(lists)) => {
            for entries in others.chunks(BLOCK) {
                of_block(&lists.hulls(entries, lists.cell_at(cell)));
            }
        }
        (InCell::Listed(..), None) => {}
    }
}
