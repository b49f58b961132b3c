//! What a ray meets among the pieces of its cell.

use super::block::{BLOCK, PieceBlock, PieceCode, RayLanes, entries, nearest};
use super::cell_ray::{CellHit, CellRay};
use super::cells::{Cells, Head};
use super::hull::{HullBlock, hull_entries};
use super::joint_table::JointTable;
use super::lists::{InCell, Lists};
use glam::{IVec2, IVec3, Vec3};
use organza_lanes::Floats;

impl CellRay {
    /// The nearest entry, or any, among copies of pieces.
    #[inline(always)]
    pub(super) fn search_copies<F: Floats>(
        &self,
        cells: &Cells,
        joints: &JointTable,
        head: Head,
        ray: RayLanes<F>,
        any: bool,
    ) -> Option<CellHit> {
        let mut nearest = Nearest { ray, best: None };
        let first = head.blocks as usize;
        for block in &cells.blocks[first..first + usize::from(head.block_count)] {
            self.search_block(cells, joints, block, &mut nearest, any);
            if any && nearest.best.is_some() {
                return self.found(joints, &nearest);
            }
        }
        let first = head.hulls as usize;
        for hull in &cells.hulls[first..first + usize::from(head.hull_count)] {
            self.search_hull(cells, joints, hull, &mut nearest, any);
        }
        self.found(joints, &nearest)
    }

    /// The nearest entry, or any, among pieces whose numbers the ray's cell holds.
    #[inline(always)]
    pub(super) fn search_lists<F: Floats>(
        &self,
        cells: &Cells,
        lists: &Lists,
        joints: &JointTable,
        ray: RayLanes<F>,
        any: bool,
    ) -> Option<CellHit> {
        let cell = IVec3::from_array(self.cell);
        let (plain, others) = match lists.find(&cells.heads, cells.grid.index(cell)) {
            InCell::Copied(head) => return self.search_copies(cells, joints, head, ray, any),
            InCell::Listed(plain, others) => (plain, others),
        };
        let mut nearest = Nearest { ray, best: None };
        for entries in plain.chunks(BLOCK) {
            let block = lists.block(entries, cell);
            self.search_block(cells, joints, &block, &mut nearest, any);
            if any && nearest.best.is_some() {
                return self.found(joints, &nearest);
            }
        }
        for entries in others.chunks(BLOCK) {
            let hull = lists.hulls(entries, cell);
            self.search_hull(cells, joints, &hull, &mut nearest, any);
        }
        self.found(joints, &nearest)
    }

    /// Keeps the nearest entry among the pieces of a block, or any.
    #[inline(always)]
    fn search_block<F: Floats>(
        &self,
        cells: &Cells,
        joints: &JointTable,
        block: &PieceBlock,
        so_far: &mut Nearest<F>,
        any: bool,
    ) {
        for part in (0..BLOCK).step_by(F::LANES) {
            let found = entries(block, part, &so_far.ray);
            let kept = nearest::<F>(found.met, found.distance, |lane, t| {
                let i = part + lane;
                PieceCode(block.piece[i]).margin() == 0.0
                    || self.is_kept(cells, joints, &OnePiece::of_block(block, i), t)
            });
            if let Some((lane, t)) = kept {
                so_far.keep(OnePiece::of_block(block, part + lane), t);
                if any {
                    return;
                }
            }
        }
    }

    /// Keeps the nearest entry among the pieces of a block of hulls, or any.
    #[inline(always)]
    fn search_hull<F: Floats>(
        &self,
        cells: &Cells,
        joints: &JointTable,
        hull: &HullBlock,
        so_far: &mut Nearest<F>,
        any: bool,
    ) {
        for part in (0..BLOCK).step_by(F::LANES) {
            let found = hull_entries(hull, part, &so_far.ray);
            let kept = nearest::<F>(found.met, found.distance, |lane, t| {
                let i = part + lane;
                self.is_kept(cells, joints, &OnePiece::of_hull(hull, i), t)
            });
            if let Some((lane, t)) = kept {
                so_far.keep(OnePiece::of_hull(hull, part + lane), t);
                if any {
                    return;
                }
            }
        }
    }

    #[inline(always)]
    fn found<F: Floats>(&self, joints: &JointTable, nearest: &Nearest<F>) -> Option<CellHit> {
        let (piece, t) = nearest.best?;
        Some(self.hit(joints, &piece, t))
    }

    /// Whether a hit lies between the planes that cut a piece.
    #[inline(always)]
    fn is_kept(&self, cells: &Cells, joints: &JointTable, piece: &OnePiece, t: f32) -> bool {
        let margin = piece.code.margin();
        if margin == 0.0 {
            return true;
        }
        let (out, along) = self.relative(piece, t);
        let margin = margin * cells.min_edge_mm;
        if along - piece.low > margin && piece.high - along > margin {
            return true;
        }
        is_between_planes(joints, piece, out, along, cells.slack_mm)
    }

    /// From the axis to a place of the ray, and how far along the axis.
    #[inline(always)]
    fn relative(&self, piece: &OnePiece, t: f32) -> (Vec3, f32) {
        let at = Vec3::from_array(self.at) + t * self.direction();
        let from = at - piece.foot;
        let along = from.dot(piece.axis);
        (from - along * piece.axis, along)
    }

    #[inline]
    fn hit(&self, joints: &JointTable, piece: &OnePiece, t: f32) -> CellHit {
        let (out, along) = self.relative(piece, t);
        // Where the side of the piece would begin; no look-up for most.
        let (nearest, low) = match piece.ends {
            Some((start, end)) => {
                let mitre = joints.mitres_mm(piece.code.piece())[0];
                (along.clamp(start, end), start - mitre)
            }
            None => (along, piece.low),
        };
        CellHit {
            piece: piece.code.piece(),
            distance_mm: self.gone_mm + t,
            axis_at_mm: piece.foot + nearest * piece.axis,
            out_mm: out + (along - nearest) * piece.axis,
            along_mm: nearest - low,
            cell: IVec3::from_array(self.cell),
            period: IVec2::from_array(self.period),
        }
    }
}

/// Whether a place near an end of a piece, so far from the axis and along it, lies between
/// the planes that cut the piece. Few hits are: kept out of the way of the others.
#[inline(never)]
fn is_between_planes(
    joints: &JointTable,
    piece: &OnePiece,
    out: Vec3,
    along: f32,
    slack_mm: f32,
) -> bool {
    let (first, last) = joints.planes(piece.code.piece());
    let from_start = out + (along - piece.start_of(joints)) * piece.axis;
    let from_end = out + (along - piece.end_of(joints)) * piece.axis;
    first.is_none_or(|n| from_start.dot(n) >= -slack_mm)
        && last.is_none_or(|n| from_end.dot(n) <= slack_mm)
}

/// The nearest entry so far, and the ray up to it.
struct Nearest<F: Floats> {
    ray: RayLanes<F>,
    best: Option<(OnePiece, f32)>,
}

impl<F: Floats> Nearest<F> {
    #[inline(always)]
    fn keep(&mut self, piece: OnePiece, t: f32) {
        // Of equals the first one found counts, whatever the lanes.
        self.ray.most = F::splat(t.next_down());
        self.best = Some((piece, t));
    }
}

/// One piece of a block.
#[derive(Clone, Copy)]
struct OnePiece {
    foot: Vec3,
    axis: Vec3,
    low: f32,
    high: f32,
    /// Where the axis begins and ends, of a piece with round ends.
    ends: Option<(f32, f32)>,
    code: PieceCode,
}

impl OnePiece {
    #[inline(always)]
    fn of_block(block: &PieceBlock, i: usize) -> OnePiece {
        OnePiece {
            foot: Vec3::from_array([0, 1, 2].map(|k| block.foot[k][i])),
            axis: Vec3::from_array([0, 1, 2].map(|k| block.axis[k][i])),
            low: block.low[i],
            high: block.high[i],
            ends: None,
            code: PieceCode(block.piece[i]),
        }
    }

    #[inline(always)]
    fn of_hull(hull: &HullBlock, i: usize) -> OnePiece {
        OnePiece {
            foot: Vec3::from_array([0, 1, 2].map(|k| hull.foot[k][i])),
            axis: Vec3::from_array([0, 1, 2].map(|k| hull.axis[k][i])),
            low: hull.low[i],
            high: hull.high[i],
            ends: Some((hull.start[i], hull.end[i])),
            code: PieceCode(hull.piece[i]),
        }
    }

    /// Where the first joint lies along the axis.
    #[inline(always)]
    fn start_of(&self, joints: &JointTable) -> f32 {
        match self.ends {
            Some((start, _)) => start,
            None => self.low + joints.mitres_mm(self.code.piece())[0],
        }
    }

    #[inline(always)]
    fn end_of(&self, joints: &JointTable) -> f32 {
        match self.ends {
            Some((_, end)) => end,
            None => self.high - joints.mitres_mm(self.code.piece())[1],
        }
    }
}
