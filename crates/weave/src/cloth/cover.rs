//! How wide the threads of a system are on average, and how much of the surface they cover.

use super::{Centreline, ThreadAtRest};
use glam::DVec2;

/// Places along threads at which widths are taken.
const SAMPLES: usize = 256;
/// Cells of the surface across a thread's share of it, and the most along an edge.
const CELLS_PER_THREAD: usize = 64;
const MAX_CELLS: usize = 2048;

impl ThreadAtRest {
    /// Factors on the width and height of the round section of its yarn at the share `s` of its
    /// length: pressed, and thicker or thinner than its mean.
    pub(super) fn size_at(&self, s: f64) -> DVec2 {
        let scale = self.spun.profile.as_ref().map_or(1.0, |p| p.mass(s).sqrt());
        scale * self.section.at(s)
    }

    /// Their mean over its length.
    pub(super) fn mean_size(&self) -> DVec2 {
        match self.spun.profile {
            None => self.section.mean(),
            Some(_) => (0..SAMPLES).map(|i| self.size_at(share(i))).sum::<DVec2>() / SAMPLES as f64,
        }
    }
}

fn share(i: usize) -> f64 {
    (i as f64 + 0.5) / SAMPLES as f64
}

/// Spans across the threads of one system, which repeats after `across_mm`, that they cover at
/// the share `along` of the cloth's edge: sorted, not joined.
fn spans_mm(threads: &[&ThreadAtRest], across_mm: f64, along: f64) -> Vec<(f64, f64)> {
    let mut spans = Vec::with_capacity(2 * threads.len());
    for thread in threads {
        let Centreline::Woven {
            curve,
            axis,
            origin,
            sway,
        } = &thread.line
        else {
            continue;
        };
        // A thread begins at its first knot.
        let s = along - curve.knots_mm[0] / curve.period_mm();
        let aside = sway.as_ref().map_or(0.0, |sway| sway.across_mm(s));
        // Across the warp is x, across the weft y.
        let middle = if axis.y > 0.5 { origin.x } else { origin.y } + aside;
        let half = (thread.spun.yarn.radius_mm() * thread.size_at(s).x).min(0.5 * across_mm);
        let start = (middle - half).rem_euclid(across_mm);
        let end = start + 2.0 * half;
        spans.push((start, end.min(across_mm)));
        if end > across_mm {
            spans.push((0.0, end - across_mm));
        }
    }
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    spans
}

/// Joins sorted spans that overlap.
fn joined(spans: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut joined: Vec<(f64, f64)> = Vec::with_capacity(spans.len());
    for (start, end) in spans {
        match joined.last_mut() {
            Some(last) if start <= last.1 => last.1 = last.1.max(end),
            _ => joined.push((start, end)),
        }
    }
    joined
}

/// Share of the surface that woven threads of one system cover, which repeats after `across_mm`:
/// the mean over their length of the union of their widths, where they lie. Threads of irregular
/// distance or width leave gaps that threads of the mean width at equal distances do not.
pub(super) fn cover_factor(threads: &[&ThreadAtRest], across_mm: f64) -> f64 {
    let at = |i: usize| joined(spans_mm(threads, across_mm, share(i)));
    let covered_mm: f64 = (0..SAMPLES).flat_map(at).map(|(a, b)| b - a).sum();
    (covered_mm / (SAMPLES as f64 * across_mm)).min(1.0)
}

/// Share of the surface that warp and weft leave free together, if it is less or more than what
/// follows from the cover of each: threads are wide where they cross, and narrow between. `None`
/// where all threads are straight and of constant width.
pub(super) fn openness(
    warp: &[&ThreadAtRest],
    weft: &[&ThreadAtRest],
    size_mm: DVec2,
) -> Option<f64> {
    let is_even = |t: &&ThreadAtRest| {
        let sways = matches!(&t.line, Centreline::Woven { sway: Some(_), .. });
        t.spun.profile.is_none() && t.section.is_even() && !sways
    };
    if warp.iter().chain(weft).all(is_even) {
        return None;
    }
    // Several cells to a thread.
    let cells = |threads: usize| (CELLS_PER_THREAD * threads).clamp(SAMPLES, MAX_CELLS);
    let [columns, rows] = [warp, weft].map(|threads| cells(threads.len()));
    let mut is_free = vec![true; columns * rows];
    let mut cover =
        |threads: &[&ThreadAtRest], across: f64, lines: usize, cells: usize, step: [usize; 2]| {
            for line in 0..lines {
                let s = (line as f64 + 0.5) / lines as f64;
                for (start, end) in spans_mm(threads, across, s) {
                    let cell = |mm: f64| ((mm / across * cells as f64).round() as usize).min(cells);
                    for k in cell(start)..cell(end) {
                        is_free[line * step[0] + k * step[1]] = false;
                    }
                }
            }
        };
    cover(warp, size_mm.x, rows, columns, [columns, 1]);
    cover(weft, size_mm.y, columns, rows, [1, columns]);
    let free = is_free.iter().filter(|free| **free).count();
    Some(free as f64 / is_free.len() as f64)
}
