//! Threads of a weave that do not lie straight: they wander sideways along their length.
//!
//! All threads follow one smooth displacement of the cloth in its plane, so that crossings stay
//! crossings: where an end is displaced sideways, the picks that cross it are displaced along
//! themselves by as much.

use crate::spec::ThreadWanderSpec;
use crate::spline::periodic_spline;
use organza_basis::PathRng;

/// The fewest turning points along a thread, and the most.
const MIN_KNOTS: f64 = 4.0;
const MAX_KNOTS: f64 = 4096.0;
/// Root mean square of the spline between independent knots of deviation one.
const SPLINE_RMS: f64 = 0.9;
/// Normal deviates are clamped to this magnitude.
const MAX_DEVIATIONS: f64 = 2.0;
/// Largest root mean square of the displacement, as a share of the spacing: threads then keep
/// their order.
pub(crate) const MAX_SHARE: f64 = 0.15;
/// Rounds in which threads that would lie in each other give way.
const ROUNDS: usize = 8;

/// The displacement of one thread in the plane of the cloth.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sway {
    /// Sideways, towards larger x for ends and larger y for picks, at equal distances along the
    /// period, millimetres. Empty for none.
    across_mm: Vec<f64>,
    /// Along the thread at its crossings, millimetres. Empty for none.
    along_mm: Vec<f64>,
}

impl Sway {
    /// Sideways displacement at a share of the period.
    pub fn across_mm(&self, s: f64) -> f64 {
        if self.across_mm.is_empty() {
            return 0.0;
        }
        periodic_spline(&self.across_mm, s)
    }

    /// Displacement along the thread at the share `t` of the way from crossing `j` to the next.
    pub fn along_mm(&self, j: usize, t: f64) -> f64 {
        let n = self.along_mm.len();
        if n == 0 {
            return 0.0;
        }
        let (a, b) = (self.along_mm[j % n], self.along_mm[(j + 1) % n]);
        a + (b - a) * t * t * (3.0 - 2.0 * t)
    }
}

/// One system of threads whose displacement is drawn.
pub(crate) struct Lane {
    /// Middle of each thread across the system, and the period there.
    pub position_mm: Vec<f64>,
    pub period_mm: f64,
    /// Width of each thread.
    pub width_mm: Vec<f64>,
    pub wander: Option<ThreadWanderSpec>,
    /// Family of the random numbers.
    pub family: u64,
}

impl Lane {
    /// Sideways displacements of all threads along `length_mm`, each at the same knots. Threads
    /// move no nearer to each other than they are or than they touch.
    fn across_mm(&self, length_mm: f64, seed: u64) -> Vec<Vec<f64>> {
        let Some(wander) = self.wander else {
            return vec![Vec::new(); self.position_mm.len()];
        };
        let knots = (length_mm / wander.length_mm).round();
        let knots = knots.clamp(MIN_KNOTS, MAX_KNOTS) as usize;
        let size_mm = 1e-3 * wander.amplitude_um / SPLINE_RMS;
        let threads = self.position_mm.len();
        let mut all: Vec<Vec<f64>> = (0..threads)
            .map(|i| {
                let mut rng = PathRng::new(seed, i as u64, self.family);
                let deviate = |_| f64::from(rng.normal2().x).clamp(-MAX_DEVIATIONS, MAX_DEVIATIONS);
                (0..knots).map(deviate).map(|d| size_mm * d).collect()
            })
            .collect();
        if threads < 2 {
            return all;
        }
        (0..knots).for_each(|k| self.keep_apart(&mut all, k));
        all
    }

    /// Moves threads apart at knot `k` that would lie nearer to each other than they may.
    fn keep_apart(&self, all: &mut [Vec<f64>], k: usize) {
        let threads = all.len();
        for i in (0..ROUNDS).flat_map(|_| 0..threads) {
            let next = (i + 1) % threads;
            let gap_mm = (self.position_mm[next] - self.position_mm[i]).rem_euclid(self.period_mm);
            let touching_mm = 0.5 * (self.width_mm[i] + self.width_mm[next]);
            let lacking_mm = gap_mm.min(touching_mm) - (gap_mm + all[next][k] - all[i][k]);
            if lacking_mm > 0.0 {
                all[i][k] -= 0.5 * lacking_mm;
                all[next][k] += 0.5 * lacking_mm;
            }
        }
    }
}

/// The displacements of warp and weft.
pub(crate) fn sways([warp, weft]: [&Lane; 2], seed: u64) -> [Vec<Sway>; 2] {
    let across = [
        warp.across_mm(weft.period_mm, seed),
        weft.across_mm(warp.period_mm, seed),
    ];
    // Knots of a thread lie at shares of its period from its first crossing on.
    let along = |own: &Lane, crossing: &Lane, across: &[Vec<f64>], i: usize| -> Vec<f64> {
        if crossing.wander.is_none() {
            return Vec::new();
        }
        let share = (own.position_mm[i] - own.position_mm[0]) / own.period_mm;
        let each = across.iter().map(|knots| periodic_spline(knots, share));
        each.collect()
    };
    let sways = |own: &Lane, crossing: &Lane, mine: &[Vec<f64>], theirs: &[Vec<f64>]| {
        let threads = mine.iter().enumerate();
        let sway = |(i, across_mm): (usize, &Vec<f64>)| Sway {
            across_mm: across_mm.clone(),
            along_mm: along(own, crossing, theirs, i),
        };
        threads.map(sway).collect()
    };
    [
        sways(warp, weft, &across[0], &across[1]),
        sways(weft, warp, &across[1], &across[0]),
    ]
}

/// Moves ends together that pass through one dent of the reed, as far as they have room, so
/// that gaps open between dents.
pub(crate) fn reed(position_mm: &mut [f64], width_mm: &[f64], ends: usize, closer_mm: f64) {
    for (group, widths) in position_mm.chunks_mut(ends).zip(width_mm.chunks(ends)) {
        let middle = 0.5 * (group[0] + group[group.len() - 1]);
        let mut moved = vec![0.0];
        for i in 1..group.len() {
            let gap_mm = group[i] - group[i - 1];
            let touching_mm = 0.5 * (widths[i - 1] + widths[i]);
            let gap_mm = (gap_mm - closer_mm).max(touching_mm.min(gap_mm));
            moved.push(moved[i - 1] + gap_mm);
        }
        let half = 0.5 * moved[moved.len() - 1];
        for (position_mm, moved) in group.iter_mut().zip(moved) {
            *position_mm = middle - half + moved;
        }
    }
}
