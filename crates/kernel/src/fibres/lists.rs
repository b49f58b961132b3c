//! Cells that hold numbers of pieces: a fraction of the memory of copies, and the same hits
//! bit for bit.
//!
//! A piece is stored once, in double precision. A cell's blocks are put together from it
//! when a ray looks into the cell, by the operations that make copies. Those begin with
//! the places of the piece's ends in the frame of the cell, so in a few cells they round
//! otherwise than those of the stored piece: such cells keep copies.

use super::block::{BLOCK, PieceBlock, PieceCode};
use super::cells::{Head, Reached};
use super::copies::{Copies, Ends, Frame};
use super::hull::HullBlock;
use glam::{DVec3, IVec3, Vec3};
use rayon::prelude::*;

/// In place of where the hulls of a cell begin: the cell has copies.
const COPIED: u32 = u32::MAX;

/// A piece as all cells share it; see [`Ends`].
#[derive(Clone, Copy, Debug, Default)]
pub struct ListedPiece {
    axis: [f64; 3],
    length: f64,
    mitre: [f64; 2],
    /// First end, from what the strands are counted from, mm.
    position: [f32; 3],
    /// At both ends, mm; negative where a plane cuts the end.
    radius: [f32; 2],
    code: u32,
}

impl ListedPiece {
    /// From its first end and what it is there.
    pub fn new(position: Vec3, ends: &Ends) -> ListedPiece {
        let signed = |radius: f64, cut: bool| if cut { -radius } else { radius } as f32;
        ListedPiece {
            axis: ends.axis.to_array(),
            length: ends.length,
            mitre: ends.mitre,
            position: position.to_array(),
            radius: [
                signed(ends.radius_a, ends.cut[0]),
                signed(ends.radius_b, ends.cut[1]),
            ],
            code: ends.code.0,
        }
    }

    /// The piece, moved.
    fn ends(&self, by: DVec3) -> Ends {
        let a = Vec3::from_array(self.position).as_dvec3() + by;
        let axis = DVec3::from_array(self.axis);
        let [radius_a, radius_b] = self.radius.map(|r| f64::from(r.abs()));
        Ends {
            a,
            b: a + self.length * axis,
            radius_a,
            radius_b,
            axis,
            length: self.length,
            mitre: self.mitre,
            cut: self.radius.map(|r| r < 0.0),
            is_plain: false,
            code: PieceCode(self.code),
        }
    }
}

/// The numbers of the pieces of all cells.
pub struct Lists {
    /// Pieces in the order of cells; of each cell first the plain ones.
    entries: Vec<Reached>,
    /// By number.
    pieces: Vec<ListedPiece>,
    frame: Frame,
    /// Cells with copies, in order, and where these are.
    copied: Vec<(u32, Head)>,
}

/// What a ray finds in a cell.
pub enum InCell<'a> {
    /// Copies of its pieces.
    Copied(Head),
    /// Their numbers: plain pieces and others.
    Listed(&'a [Reached], &'a [Reached]),
}

impl Lists {
    /// Lists from pieces in the order of cells, `first` being where the plain and the
    /// other pieces of every cell begin. Gives the heads of the cells, too, with one more
    /// at the end, and the copies of those that need them.
    pub fn new(
        copies: &Copies<'_>,
        first: &[u32],
        entries: Vec<Reached>,
        mut heads: Vec<Head>,
    ) -> (Lists, Vec<Head>, Vec<PieceBlock>, Vec<HullBlock>) {
        let mut lists = Lists {
            pieces: copies.all(),
            frame: copies.frame(),
            entries,
            copied: Vec::new(),
        };
        for (cell, head) in heads.iter_mut().enumerate() {
            (head.blocks, head.hulls) = (first[2 * cell], first[2 * cell + 1]);
        }
        let end = lists.entries.len() as u32;
        heads.push(Head {
            blocks: end,
            hulls: end,
            ..Head::default()
        });
        let (mut blocks, mut hulls) = (Vec::new(), Vec::new());
        let unlike: Vec<u32> = (0..heads.len() as u32 - 1)
            .into_par_iter()
            .filter(|&cell| !lists.is_exact(copies, &heads, cell as usize))
            .collect();
        for cell in unlike {
            let InCell::Listed(plain, others) = lists.find(&heads, cell as usize) else {
                continue;
            };
            let head = Head {
                blocks: blocks.len() as u32,
                hulls: hulls.len() as u32,
                ..heads[cell as usize]
            };
            let at = lists.frame.cell_at(cell as usize);
            blocks.extend(plain.chunks(BLOCK).map(|c| copies.block(c, at)));
            hulls.extend(others.chunks(BLOCK).map(|c| copies.hulls(c, at)));
            lists.copied.push((cell, head));
        }
        for &(cell, _) in &lists.copied {
            heads[cell as usize].hulls = COPIED;
        }
        (lists, heads, blocks, hulls)
    }

    /// Bytes of the lists of some entries, of pieces between so many joints.
    pub fn bytes(entries: u64, joints: usize) -> u64 {
        entries * size_of::<Reached>() as u64 + (joints * size_of::<ListedPiece>()) as u64
    }

    /// A cell's place in the grid.
    #[cfg(feature = "gpu")]
    pub fn cell_at(&self, cell: usize) -> IVec3 {
        self.frame.cell_at(cell)
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let copied = self.copied.len() * size_of::<(u32, Head)>();
        Lists::bytes(self.entries.len() as u64, self.pieces.len()) + copied as u64
    }

    /// What a cell holds.
    #[inline(always)]
    pub fn find(&self, heads: &[Head], cell: usize) -> InCell<'_> {
        let (head, next) = (&heads[cell], &heads[cell + 1]);
        if head.hulls == COPIED {
            return InCell::Copied(self.copied_head(cell as u32));
        }
        let [a, b, c] = [head.blocks, head.hulls, next.blocks].map(|i| i as usize);
        InCell::Listed(&self.entries[a..b], &self.entries[b..c])
    }

    #[inline(never)]
    fn copied_head(&self, cell: u32) -> Head {
        let found = self.copied.binary_search_by_key(&cell, |c| c.0);
        found.map_or(Head::default(), |i| self.copied[i].1)
    }

    /// Asks for the numbers of a cell.
    #[inline(always)]
    pub fn prefetch(&self, head: &Head) {
        organza_lanes::prefetch(&self.entries, head.blocks as usize);
        organza_lanes::prefetch(&self.entries, head.blocks as usize + 8);
    }

    /// Up to sixteen plain pieces in the frame of a cell: what [`Ends::write_block`]
    /// gives, in loops that become vectors.
    #[inline(always)]
    pub fn block(&self, entries: &[Reached], cell: IVec3) -> PieceBlock {
        let mut block = PieceBlock::empty();
        let (mut at, mut axis) = ([[0.0f64; BLOCK]; 3], [[0.0f64; BLOCK]; 3]);
        let (mut length, mut mitre) = ([0.0f64; BLOCK], [[0.0f64; BLOCK]; 2]);
        let here = self.frame.offset_in_cell(cell, [0; 2]);
        for (i, entry) in entries.iter().enumerate().take(BLOCK) {
            let piece = &self.pieces[entry.piece() as usize];
            let by = match entry.shift() {
                [0, 0] => here,
                shift => self.frame.offset_in_cell(cell, shift),
            };
            at[0][i] = f64::from(piece.position[0]) + by.x;
            at[1][i] = f64::from(piece.position[1]) + by.y;
            at[2][i] = f64::from(piece.position[2]) + by.z;
            for (lanes, axis) in axis.iter_mut().zip(piece.axis) {
                lanes[i] = axis;
            }
            length[i] = piece.length;
            (mitre[0][i], mitre[1][i]) = (piece.mitre[0], piece.mitre[1]);
            let radius = f64::from(piece.radius[0]);
            block.radius_squared[i] = (radius * radius) as f32;
            block.piece[i] = piece.code;
        }
        for i in 0..BLOCK {
            let back = -(at[0][i] * axis[0][i] + at[1][i] * axis[1][i] + at[2][i] * axis[2][i]);
            for k in 0..3 {
                block.foot[k][i] = (at[k][i] + back * axis[k][i]) as f32;
                block.axis[k][i] = axis[k][i] as f32;
            }
            block.low[i] = (-back - mitre[0][i]) as f32;
            block.high[i] = (-back + length[i] + mitre[1][i]) as f32;
        }
        block
    }

    /// Up to sixteen other pieces in the frame of a cell.
    #[inline(never)]
    pub fn hulls(&self, entries: &[Reached], cell: IVec3) -> HullBlock {
        let mut hulls = HullBlock::empty();
        for (i, entry) in entries.iter().enumerate().take(BLOCK) {
            let by = self.frame.offset_in_cell(cell, entry.shift());
            let ends = self.pieces[entry.piece() as usize].ends(by);
            ends.write_hull(&mut hulls, i);
        }
        hulls
    }

    /// Whether lists give the bits of copies in a cell.
    fn is_exact(&self, copies: &Copies<'_>, heads: &[Head], cell: usize) -> bool {
        let InCell::Listed(plain, others) = self.find(heads, cell) else {
            return true;
        };
        let at = self.frame.cell_at(cell);
        plain
            .chunks(BLOCK)
            .all(|c| self.block(c, at) == copies.block(c, at))
            && others
                .chunks(BLOCK)
                .all(|c| self.hulls(c, at) == copies.hulls(c, at))
    }
}
