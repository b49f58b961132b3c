//! Pieces of fibre on their way into cells.

use super::block::{BLOCK, PieceBlock, PieceCode};
use super::cells::{Placed, Reached};
use super::grid::Grid;
use super::hull::HullBlock;
use super::lists::ListedPiece;
use super::strands::{Joint, Strands};
use glam::{DVec3, IVec3};
use rayon::prelude::*;

/// Mitres that reach farther than this share of a piece's radius would be spikes.
const MAX_MITRE_RADII: f64 = 4.0;

/// The strands, seen from a grid.
pub struct Copies<'a> {
    strands: Strands<'a>,
    frame: Frame,
    first_piece: u32,
}

/// Where strands lie in a grid.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    dims: IVec3,
    cell_mm: DVec3,
    /// From the grid's least corner to what the strands are counted from.
    offset_mm: DVec3,
}

impl Frame {
    /// A cell's place in the grid.
    pub fn cell_at(&self, cell: usize) -> IVec3 {
        let dims = self.dims.as_usizevec3();
        IVec3::new(
            (cell % dims.x) as i32,
            (cell / dims.x % dims.y) as i32,
            (cell / (dims.x * dims.y)) as i32,
        )
    }

    /// From the centre of a cell to what strands moved by some periods are counted from.
    #[inline(always)]
    pub fn offset_in_cell(&self, at: IVec3, [x, y]: [i16; 2]) -> DVec3 {
        let beyond = IVec3::new(i32::from(x), i32::from(y), 0) * self.dims;
        let centre = ((at - beyond).as_dvec3() + 0.5) * self.cell_mm;
        self.offset_mm - centre
    }
}

/// A piece in double precision, in the frame of a cell or of the grid.
#[derive(Clone, Copy, Debug)]
pub struct Ends {
    pub a: DVec3,
    pub b: DVec3,
    pub radius_a: f64,
    pub radius_b: f64,
    /// Unit direction from `a` to `b`; any for a piece without length.
    pub axis: DVec3,
    pub length: f64,
    /// How far the side goes on beyond each end to reach the plane that cuts it.
    pub mitre: [f64; 2],
    /// Whether a plane cuts each end.
    pub cut: [bool; 2],
    /// One radius, and both ends cut.
    pub is_plain: bool,
    pub code: PieceCode,
}

/// How far a side of some radius goes on beyond a joint whose plane has a normal
/// that makes an angle with the axis.
pub fn mitre_mm(normal: DVec3, axis: DVec3, radius_mm: f64) -> f64 {
    let cosine = normal.dot(axis).abs();
    let sine = normal.cross(axis).length();
    (radius_mm * sine / cosine.max(1e-9)).min(MAX_MITRE_RADII * radius_mm)
}

impl<'a> Copies<'a> {
    pub fn new(strands: Strands<'a>, grid: &Grid, placed: &Placed) -> Copies<'a> {
        Copies {
            strands,
            frame: Frame {
                dims: grid.dims,
                cell_mm: grid.cell_mm(),
                offset_mm: placed.origin_mm - grid.corner_mm(),
            },
            first_piece: placed.first_piece,
        }
    }

    /// Where the strands lie.
    pub fn frame(&self) -> Frame {
        self.frame
    }

    fn joints(&self, piece: u32) -> [&'a Joint; 2] {
        [piece, piece + 1].map(|i| &self.strands.joints[i as usize])
    }

    /// Joints of the strands.
    pub fn joint_count(&self) -> usize {
        self.strands.joints.len()
    }

    /// Whether a piece begins at a joint, which has its number.
    pub fn begins_piece(&self, joint: u32) -> bool {
        self.strands.begins_piece(joint as usize)
    }

    /// Whether a piece is a cylinder cut at both ends.
    pub fn is_plain(&self, piece: u32) -> bool {
        let [a, b] = self.joints(piece);
        a.radius_mm == b.radius_mm && a.cut && b.cut && a.position != b.position
    }

    /// A piece in the frame of the grid's least corner.
    pub fn ends(&self, piece: u32) -> Ends {
        self.place(piece, self.frame.offset_mm)
    }

    /// A piece in the frame of the centre of a cell that it reaches.
    pub fn ends_in(&self, reached: &Reached, cell: IVec3) -> Ends {
        self.place(
            reached.piece(),
            self.frame.offset_in_cell(cell, reached.shift()),
        )
    }

    /// Up to sixteen plain pieces in the frame of a cell.
    pub fn block(&self, pieces: &[Reached], cell: IVec3) -> PieceBlock {
        let mut block = PieceBlock::empty();
        for (i, reached) in pieces.iter().enumerate().take(BLOCK) {
            self.ends_in(reached, cell).write_block(&mut block, i);
        }
        block
    }

    /// Up to sixteen other pieces in the frame of a cell.
    pub fn hulls(&self, pieces: &[Reached], cell: IVec3) -> HullBlock {
        let mut hulls = HullBlock::empty();
        for (i, reached) in pieces.iter().enumerate().take(BLOCK) {
            self.ends_in(reached, cell).write_hull(&mut hulls, i);
        }
        hulls
    }

    /// Every piece by its number, in the frame of the grid; nothing where a joint begins
    /// none.
    pub fn all(&self) -> Vec<ListedPiece> {
        let mut all = vec![ListedPiece::default(); self.strands.joints.len()];
        all.par_iter_mut().enumerate().for_each(|(k, piece)| {
            if self.strands.begins_piece(k) {
                let ends = self.ends(k as u32);
                *piece = ListedPiece::new(self.strands.joints[k].position, &ends);
            }
        });
        all
    }

    fn place(&self, piece: u32, by: DVec3) -> Ends {
        let [a, b] = self.joints(piece);
        let [pa, pb] = [a, b].map(|j| j.position.as_dvec3() + by);
        let along = pb - pa;
        let length = along.length();
        let axis = along.try_normalize().unwrap_or(DVec3::X);
        let mitre = [a, b].map(|j| match j.cut {
            true => mitre_mm(j.tangent.as_dvec3(), axis, f64::from(j.radius_mm)),
            false => 0.0,
        });
        let reach = mitre[0].max(mitre[1]) / self.frame.cell_mm.min_element();
        Ends {
            a: pa,
            b: pb,
            radius_a: f64::from(a.radius_mm),
            radius_b: f64::from(b.radius_mm),
            axis,
            length,
            mitre,
            cut: [a.cut, b.cut],
            is_plain: self.is_plain(piece),
            code: PieceCode::new(self.first_piece + piece, reach as f32),
        }
    }
}

impl Ends {
    /// The greater radius.
    pub fn radius(&self) -> f64 {
        self.radius_a.max(self.radius_b)
    }

    fn foot(&self) -> (DVec3, f64) {
        let back = -self.a.dot(self.axis);
        (self.a + back * self.axis, -back)
    }

    /// Into one place of a block, in the frame of its cell.
    pub fn write_block(&self, block: &mut PieceBlock, i: usize) {
        let (foot, start) = self.foot();
        for k in 0..3 {
            block.foot[k][i] = foot[k] as f32;
            block.axis[k][i] = self.axis[k] as f32;
        }
        block.radius_squared[i] = (self.radius_a * self.radius_a) as f32;
        block.low[i] = (start - self.mitre[0]) as f32;
        block.high[i] = (start + self.length + self.mitre[1]) as f32;
        block.piece[i] = self.code.0;
    }

    /// Into one place of a block of hulls.
    pub fn write_hull(&self, hull: &mut HullBlock, i: usize) {
        let (foot, start) = self.foot();
        for k in 0..3 {
            hull.foot[k][i] = foot[k] as f32;
            hull.axis[k][i] = self.axis[k] as f32;
        }
        let end = start + self.length;
        let squares = [self.radius_a, self.radius_b].map(|r| (r * r) as f32);
        (hull.start[i], hull.end[i]) = (start as f32, end as f32);
        [hull.start_squared[i], hull.end_squared[i]] = squares;
        hull.piece[i] = self.code.0;
        let narrowing = self.radius_a - self.radius_b;
        if self.length <= narrowing.abs() {
            // One sphere holds the other, and there is no side.
            if narrowing > 0.0 {
                HullBlock::no_sphere(&mut hull.end_squared[i]);
            } else {
                HullBlock::no_sphere(&mut hull.start_squared[i]);
            }
            (hull.low[i], hull.high[i]) = (f32::MAX, f32::MIN);
            return;
        }
        let sine = narrowing / self.length;
        hull.narrowing[i] = sine as f32;
        hull.wide[i] = (self.radius_a + sine * start) as f32;
        hull.low[i] = (start + sine * self.radius_a) as f32;
        hull.high[i] = (end + sine * self.radius_b) as f32;
        if self.cut[0] {
            HullBlock::no_sphere(&mut hull.start_squared[i]);
            hull.low[i] = (start - self.mitre[0]) as f32;
        }
        if self.cut[1] {
            HullBlock::no_sphere(&mut hull.end_squared[i]);
            hull.high[i] = (end + self.mitre[1]) as f32;
        }
    }
}
