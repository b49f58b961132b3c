//! Shear of woven cloth, estimated from the bending of its threads.

use super::bending::HINDRANCE;
use crate::draft::{Draft, interlacings};
use glam::DVec2;

/// Threads of one system, as beams that the other one holds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beams {
    /// Flexural rigidity of one thread as free fibres, N mm2.
    pub free_n_mm2: f64,
    /// Distance to the next one, mm.
    pub spacing_mm: f64,
    /// Mean length from one interlacing to the next, mm.
    pub held_mm: f64,
}

impl Beams {
    /// Angle by which they bend for each N/mm of shear force per width, rad mm/N.
    ///
    /// A cut across the threads leaves each the force of its spacing; where a piece of thread is held
    /// at both ends, its middle has no bending moment, so that its halves are cantilevers under that
    /// force, which bend by F (l / 2)^3 / 3 B each: the angle is F l^2 / 12 B.
    fn compliance_mm_per_n(&self) -> f64 {
        let bent_n_mm2 = HINDRANCE * self.free_n_mm2;
        self.spacing_mm * self.held_mm * self.held_mm / (12.0 * bent_n_mm2)
    }
}

/// Shear rigidity of cloth of two such systems, N/m: their angles add up. In plain weave, where
/// threads are held at every crossing, this is the straight-yarn case of `[LeafSheta1984]`.
pub(super) fn rigidity_n_m(warp: Beams, weft: Beams) -> f64 {
    1e3 / (warp.compliance_mm_per_n() + weft.compliance_mm_per_n())
}

/// Mean length of ends and of picks between interlacings, mm, in a tile of that size; `None` where
/// threads of a system interlace with none. Floats count as long beams, though threads under them
/// hold them a little.
pub(super) fn held_mm(draft: &Draft, size_mm: DVec2) -> Option<[f64; 2]> {
    let (ends, picks) = (draft.ends(), draft.picks());
    let of_end = |e| interlacings(&(0..picks).map(|p| draft.warp_up(e, p)).collect::<Vec<_>>());
    let of_pick = |p| interlacings(&(0..ends).map(|e| draft.warp_up(e, p)).collect::<Vec<_>>());
    let of_ends: usize = (0..ends).map(of_end).sum();
    let of_picks: usize = (0..picks).map(of_pick).sum();
    let held = |length_mm: f64, threads: usize, held: usize| {
        (held > 0).then(|| length_mm * threads as f64 / held as f64)
    };
    Some([
        held(size_mm.y, ends, of_ends)?,
        held(size_mm.x, picks, of_picks)?,
    ])
}
