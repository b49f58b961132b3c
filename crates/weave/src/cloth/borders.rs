//! The borders of blocks, where yarns pass from one crossing to the next.

use super::{Centreline, Cloth};
use crate::path::Hermite;
use crate::relax::Relaxed;
use crate::synthesis::Synthesis;
use std::collections::{BTreeSet, HashMap};

/// How well yarns go on across the borders of blocks, over all borders of a design.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct BorderGaps {
    /// Borders between two crossings that a yarn passes.
    pub borders: usize,
    /// Root mean square and greatest distance of the two ends of a yarn at a border, mm.
    pub position_rms_mm: f64,
    /// See `position_rms_mm`.
    pub position_max_mm: f64,
    /// The same of the angle between the tangents, radians.
    pub tangent_rms_rad: f64,
    /// See `tangent_rms_rad`.
    pub tangent_max_rad: f64,
}

impl Cloth {
    /// The gaps of yarns at the borders of the blocks of a design that is made from this
    /// exemplar.
    pub fn border_gaps(&self, synthesis: &Synthesis) -> BorderGaps {
        let (ends, picks) = (synthesis.design.ends(), synthesis.design.picks());
        let exemplar_ends = synthesis.exemplar.ends();
        let curve = |thread: usize| match &self.threads[thread].line {
            Centreline::Woven { curve, .. } => Some(curve),
            _ => None,
        };
        let place = |e: usize, p: usize| {
            let number = synthesis.index[p % picks * ends + e % ends];
            synthesis.blocks[number as usize].place
        };
        let at = |place: [usize; 2], is_warp: bool, is_after: bool| {
            let volume = synthesis.volume_height(place, is_warp, is_after);
            volume.or_else(|| {
                let [end, pick] = place;
                let (thread, at) = if is_warp {
                    (end, pick)
                } else {
                    (exemplar_ends + pick, end)
                };
                let curve = curve(thread)?;
                Some(if is_after {
                    after(curve, at)
                } else {
                    before(curve, at)
                })
            })
        };
        let mut gaps = BorderGaps::default();
        let mut add = |before: Option<(f64, f64)>, after: Option<(f64, f64)>| {
            let (Some(a), Some(b)) = (before, after) else {
                return;
            };
            let position = (a.0 - b.0).abs();
            let angle = (a.1.atan() - b.1.atan()).abs();
            gaps.borders += 1;
            gaps.position_rms_mm += position * position;
            gaps.tangent_rms_rad += angle * angle;
            gaps.position_max_mm = gaps.position_max_mm.max(position);
            gaps.tangent_max_rad = gaps.tangent_max_rad.max(angle);
        };
        for p in 0..picks {
            for e in 0..ends {
                let (own, above, right) = (place(e, p), place(e, p + 1), place(e + 1, p));
                add(at(own, true, true), at(above, true, false));
                add(at(own, false, true), at(right, false, false));
            }
        }
        let count = gaps.borders.max(1) as f64;
        gaps.position_rms_mm = (gaps.position_rms_mm / count).sqrt();
        gaps.tangent_rms_rad = (gaps.tangent_rms_rad / count).sqrt();
        gaps
    }
}

/// The knot halfway to the crossing after `i`.
fn knot_after(i: usize) -> usize {
    2 * i + 1
}

/// The knot halfway to the crossing before `i`.
fn knot_before(curve: &Hermite, i: usize) -> usize {
    let knots = curve.height_mm.len();
    (2 * i + knots - 1) % knots
}

fn after(curve: &Hermite, i: usize) -> (f64, f64) {
    let k = knot_after(i);
    (curve.height_mm[k], curve.slope[k])
}

fn before(curve: &Hermite, i: usize) -> (f64, f64) {
    let k = knot_before(curve, i);
    (curve.height_mm[k], curve.slope[k])
}

/// Gives yarns the same height and slope at all borders of blocks around which the interlacing
/// is the same: the means, of volumes alone if any have such a border. Volumes stay as they are.
pub(super) fn join_at_borders(synthesis: &Synthesis, relaxed: &mut Relaxed) {
    let draft = &synthesis.exemplar;
    let (ends, picks) = (draft.ends(), draft.picks());
    let radius = synthesis.radius;
    // The crossings that the windows on both sides of a border share.
    let shared = |end: usize, pick: usize, along_warp: bool| -> u32 {
        let (width, height) = if along_warp {
            (2 * radius + 1, 2 * radius)
        } else {
            (2 * radius, 2 * radius + 1)
        };
        let first_end = end + ends * radius - radius + usize::from(!along_warp);
        let first_pick = pick + picks * radius - radius + usize::from(along_warp);
        let mut bits = 0;
        for p in 0..height {
            for e in 0..width {
                bits = bits << 1 | u32::from(draft.warp_up(first_end + e, first_pick + p));
            }
        }
        bits
    };
    // Thread, knot and kind of every border of a block that is in use.
    let mut borders: Vec<(bool, usize, usize, u32)> = Vec::new();
    let mut fixed: HashMap<(bool, u32), (f64, f64, f64)> = HashMap::new();
    for block in &synthesis.blocks {
        let [end, pick] = block.place;
        let (below, left) = ((pick + picks - 1) % picks, (end + ends - 1) % ends);
        let own = [
            (true, end, knot_after(pick), shared(end, pick, true)),
            (true, end, knot_after(below), shared(end, below, true)),
            (false, pick, knot_after(end), shared(end, pick, false)),
            (false, pick, knot_after(left), shared(left, pick, false)),
        ];
        for (border, is_after) in own.into_iter().zip([true, false, true, false]) {
            match synthesis.volume_height(block.place, border.0, is_after) {
                None => borders.push(border),
                Some((height_mm, slope)) => {
                    let sum = fixed.entry((border.0, border.3)).or_default();
                    sum.0 += height_mm;
                    sum.1 += slope;
                    sum.2 += 1.0;
                }
            }
        }
    }
    borders.sort_unstable();
    borders.dedup();
    let mut sums: HashMap<(bool, u32), (f64, f64, f64)> = HashMap::new();
    for &(is_warp, thread, knot, kind) in &borders {
        let system = if is_warp {
            &relaxed.warp
        } else {
            &relaxed.weft
        };
        let curve = &system[thread];
        let sum = sums.entry((is_warp, kind)).or_default();
        sum.0 += curve.height_mm[knot];
        sum.1 += curve.slope[knot];
        sum.2 += 1.0;
    }
    let before = (relaxed.warp.clone(), relaxed.weft.clone());
    for (is_warp, thread, knot, kind) in borders {
        let (height, slope, count) = fixed
            .get(&(is_warp, kind))
            .copied()
            .unwrap_or(sums[&(is_warp, kind)]);
        let system = if is_warp {
            &mut relaxed.warp
        } else {
            &mut relaxed.weft
        };
        let curve = &mut system[thread];
        curve.height_mm[knot] = height / count;
        curve.slope[knot] = slope / count;
    }
    let places: BTreeSet<[usize; 2]> = synthesis.blocks.iter().map(|b| b.place).collect();
    for [end, pick] in places {
        if synthesis.volume_at([end, pick]).is_some() {
            continue;
        }
        let warp = follow(&mut relaxed.warp[end], &before.0[end], pick);
        let weft = follow(&mut relaxed.weft[pick], &before.1[pick], end);
        // The threads of a crossing keep the distance at which they rest on each other.
        let shift_mm = 0.5 * (warp + weft);
        relaxed.warp[end].height_mm[2 * pick] += shift_mm;
        relaxed.weft[pick].height_mm[2 * end] += shift_mm;
    }
}

/// Turns a yarn at crossing `i` as the cubic does that moves its borders from where they were,
/// and returns how far that cubic moves the crossing, mm. A yarn whose borders alone moved
/// would have a bump at every crossing.
fn follow(curve: &mut Hermite, before: &Hermite, i: usize) -> f64 {
    let (low, high) = (knot_before(curve, i), knot_after(i));
    let moved = |k: usize| {
        (
            curve.height_mm[k] - before.height_mm[k],
            curve.slope[k] - before.slope[k],
        )
    };
    let ((h0, s0), (h1, s1)) = (moved(low), moved(high));
    let length_mm = curve.interval(low).0 + curve.interval(2 * i).0;
    curve.slope[2 * i] += 1.5 * (h1 - h0) / length_mm - 0.25 * (s0 + s1);
    0.5 * (h0 + h1) + 0.125 * length_mm * (s0 - s1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_follow_their_borders_on_a_cubic() {
        let knots_mm: Vec<f64> = (0..=8).map(|k| 0.25 * f64::from(k)).collect();
        let before = Hermite {
            knots_mm: knots_mm.into(),
            height_mm: vec![0.1, 0.0, -0.1, 0.0, 0.1, 0.0, -0.1, 0.0],
            slope: vec![0.0, -0.6, 0.0, 0.6, 0.0, -0.6, 0.0, 0.6],
        };
        // The crossing at 0.5 mm lies between borders at 0.25 and 0.75 mm.
        let cubic = |y: f64| 0.02 - 0.05 * y + 0.11 * y * y - 0.3 * y * y * y;
        let slope = |y: f64| -0.05 + 0.22 * y - 0.9 * y * y;
        let mut curve = before.clone();
        for (k, y) in [(1, 0.25), (3, 0.75)] {
            curve.height_mm[k] += cubic(y);
            curve.slope[k] += slope(y);
        }
        let moved_mm = follow(&mut curve, &before, 1);
        assert!(
            (moved_mm - cubic(0.5)).abs() < 4.0 * f64::EPSILON,
            "{moved_mm}"
        );
        assert!((curve.slope[2] - before.slope[2] - slope(0.5)).abs() < 4.0 * f64::EPSILON);
        // The first crossing, whose border lies behind the end of the period.
        let mut curve = before.clone();
        curve.height_mm[1] += 0.01;
        curve.height_mm[7] += 0.01;
        let moved_mm = follow(&mut curve, &before, 0);
        assert!((moved_mm - 0.01).abs() < 4.0 * f64::EPSILON, "{moved_mm}");
    }
}
