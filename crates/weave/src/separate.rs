//! Pushes curves apart in space until they touch at most: fibres of nonwovens, yarns of nets and of
//! files, loops and tufts of pile.
//!
//! Curves are polylines in a room that repeats in x and y. Rounds of pushes between pieces that
//! are too near alternate with smoothing of the displacements along each curve, so that a curve
//! bends around another and gets no kink. The last rounds only push. Pieces are visited in the
//! order of their cells: equal lines give equal results. Curves that are held in places keep their
//! lengths.

use glam::{DVec2, DVec3};
use std::cmp::Ordering;

/// A curve, with one radius.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    pub points: Vec<DVec3>,
    pub radius_mm: f64,
    /// What separates the line from its next copy; `None` for one that ends.
    pub period: Option<DVec3>,
    /// Which points stay where they are. A line that has such points keeps the lengths of its
    /// pieces; empty for one that is free and may stretch.
    pub held: Vec<bool>,
}

/// The space of the curves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    /// Period in x and y.
    pub size_mm: DVec2,
    /// Heights between which points stay, unless they begin outside.
    pub faces_mm: [f64; 2],
}

/// Rounds, those at the end that do not smooth, and pushes within a round.
const ROUNDS: usize = 6;
const PUSHING_ROUNDS: usize = 3;
const PUSHES: usize = 6;
/// Share of the differences along a curve that smoothing removes after a round.
const SMOOTHING: f64 = 0.25;
/// Sweeps that give the pieces of held lines their lengths back, after every push and at the end.
const SWEEPS: usize = 2;
const LAST_SWEEPS: usize = 40;
/// Pieces are neighbours in a round when their distance is below this many sums of radii.
const REACH: f64 = 1.6;
/// Pieces of one curve are neighbours when the length between them is above this many radii.
const OWN_REACH: f64 = 8.0;

/// The largest number of cells in which pieces are sought, 4 bytes each.
const MAX_CELLS: usize = 1 << 24;

/// A piece of a line: its line, its first point, and its middle.
struct Piece {
    line: u32,
    first: u32,
    middle: DVec3,
}

/// Two pieces that may touch, and the shift that brings the second next to the first.
struct Pair {
    pieces: [u32; 2],
    shift: DVec2,
}

impl Line {
    fn pieces(&self) -> usize {
        match self.period {
            Some(_) => self.points.len(),
            None => self.points.len().saturating_sub(1),
        }
    }

    /// The ends of a piece, and the index of the second.
    fn ends(&self, first: usize) -> ([DVec3; 2], usize) {
        let next = first + 1;
        match self.period {
            Some(p) if next == self.points.len() => ([self.points[first], self.points[0] + p], 0),
            _ => ([self.points[first], self.points[next]], next),
        }
    }

    pub fn length_mm(&self) -> f64 {
        self.lengths_mm().sum()
    }

    fn lengths_mm(&self) -> impl Iterator<Item = f64> {
        let pieces = (0..self.pieces()).map(|i| self.ends(i).0);
        pieces.map(|[a, b]| a.distance(b))
    }

    fn is_held(&self, point: usize) -> bool {
        self.held.get(point).is_some_and(|held| *held)
    }

    /// Length between two pieces along the line, in pieces.
    fn apart(&self, a: u32, b: u32) -> usize {
        let apart = a.abs_diff(b) as usize;
        match self.period {
            Some(_) => apart.min(self.points.len() - apart),
            None => apart,
        }
    }
}

/// The closest points of two pieces, as shares of their lengths.
fn closest([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> (f64, f64) {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv) = (u.length_squared(), u.dot(v), v.length_squared());
    let (uw, vw) = (u.dot(w), v.dot(w));
    let flat = uu * vv - uv * uv;
    let s = if flat > 1e-12 * uu * vv {
        ((uv * vw - vv * uw) / flat).clamp(0.0, 1.0)
    } else {
        0.5
    };
    let t = if vv > 0.0 { (uv * s + vw) / vv } else { 0.0 };
    let t = t.clamp(0.0, 1.0);
    let s = if uu > 0.0 { (uv * t - uw) / uu } else { 0.0 };
    (s.clamp(0.0, 1.0), t)
}

/// Cells of the room in which pieces are found.
struct Cells {
    counts: [usize; 3],
    low: f64,
    room: Room,
    depth: f64,
    /// Where each cell begins in `order`.
    starts: Vec<u32>,
    /// Pieces by cell, with their middles.
    order: Vec<(u32, DVec3)>,
}

impl Cells {
    fn new(pieces: &[Piece], reach_mm: f64, room: Room) -> Cells {
        let heights = pieces.iter().map(|p| p.middle.z);
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| {
            (l.min(z), h.max(z))
        });
        let depth = (high - low).max(1e-9);
        let count = |size: f64| ((size / reach_mm) as usize).clamp(1, MAX_CELLS);
        let mut counts = [room.size_mm.x, room.size_mm.y, depth].map(count);
        // In long rooms cells are short all the same; in large ones there are not too many.
        while counts.iter().product::<usize>() > MAX_CELLS {
            let axis = (0..3).max_by_key(|&a| counts[a]).unwrap_or(0);
            counts[axis] = counts[axis].div_ceil(2);
        }
        let mut cells = Cells {
            counts,
            low,
            room,
            depth,
            starts: Vec::new(),
            order: vec![(0, DVec3::ZERO); pieces.len()],
        };
        let total: usize = cells.counts.iter().product();
        let mut starts = vec![0u32; total + 1];
        for p in pieces {
            starts[cells.index(cells.cell(p.middle)) + 1] += 1;
        }
        for i in 0..total {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        for (i, p) in pieces.iter().enumerate() {
            let at = &mut next[cells.index(cells.cell(p.middle))];
            cells.order[*at as usize] = (i as u32, p.middle);
            *at += 1;
        }
        cells.starts = starts;
        cells
    }

    fn cell(&self, at: DVec3) -> [usize; 3] {
        let [nx, ny, nz] = self.counts;
        let wrapped =
            |x: f64, size: f64, n: usize| ((x / size - (x / size).floor()) * n as f64) as usize % n;
        let z = ((at.z - self.low) / self.depth * nz as f64) as usize;
        [
            wrapped(at.x, self.room.size_mm.x, nx),
            wrapped(at.y, self.room.size_mm.y, ny),
            z.min(nz - 1),
        ]
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.counts[1] + y) * self.counts[0] + x
    }

    /// The cells from one before to one after along an axis, each once.
    fn around(&self, axis: usize, at: usize) -> impl Iterator<Item = usize> + use<> {
        let n = self.counts[axis];
        let wraps = axis < 2;
        let few = n < 3;
        (0..if few { n } else { 3 }).filter_map(move |i| match (few, wraps) {
            (true, _) => Some(i),
            (_, true) => Some((at + n + i - 1) % n),
            _ => (at + i).checked_sub(1).filter(|z| *z < n),
        })
    }
}

impl Room {
    /// The whole periods that bring a displacement closest to zero.
    fn nearest(&self, apart: DVec3) -> DVec2 {
        -(apart.truncate() / self.size_mm).round() * self.size_mm
    }
}

/// The number of pairs of pieces that lie in the same cells of a room, in either order: what
/// pushing lines apart costs, in pairs of neighbours.
pub(crate) fn crowding(lines: &[Line], room: Room) -> u64 {
    let pieces = pieces_of(lines);
    let cells = Cells::new(&pieces, reach_of(lines, &pieces, REACH), room);
    let counts = cells.starts.windows(2).map(|w| u64::from(w[1] - w[0]));
    counts.map(|n| n * n).sum()
}

/// The largest distance of the middles of pieces that are nearer than `reach` sums of their radii.
fn reach_of(lines: &[Line], pieces: &[Piece], reach: f64) -> f64 {
    let length = |p: &Piece| {
        let [a, b] = lines[p.line as usize].ends(p.first as usize).0;
        a.distance(b)
    };
    let longest = pieces.iter().map(length).fold(0.0, f64::max);
    let thickest = lines.iter().map(|l| l.radius_mm).fold(0.0, f64::max);
    longest + reach * 2.0 * thickest
}

fn pieces_of(lines: &[Line]) -> Vec<Piece> {
    let mut all = Vec::new();
    for (l, line) in lines.iter().enumerate() {
        for i in 0..line.pieces() {
            let [a, b] = line.ends(i).0;
            all.push(Piece {
                line: l as u32,
                first: i as u32,
                middle: 0.5 * (a + b),
            });
        }
    }
    all
}

/// Pairs of pieces that are nearer than `reach` sums of their radii.
fn pairs_of(lines: &[Line], pieces: &[Piece], room: Room, reach: f64) -> Vec<Pair> {
    let farthest = reach_of(lines, pieces, reach);
    let cells = Cells::new(pieces, farthest, room);
    let half = 0.5 * room.size_mm;
    let mut pairs = Vec::new();
    for (place, &(i, _)) in cells.order.iter().enumerate() {
        let p = &pieces[i as usize];
        let line = &lines[p.line as usize];
        let [x, y, z] = cells.cell(p.middle);
        let own = cells.index([x, y, z]);
        for cz in cells.around(2, z) {
            for cy in cells.around(1, y) {
                for cx in cells.around(0, x) {
                    let cell = cells.index([cx, cy, cz]);
                    // Each two cells are looked at once.
                    let from = match cell.cmp(&own) {
                        Ordering::Less => continue,
                        Ordering::Equal => place + 1,
                        Ordering::Greater => cells.starts[cell] as usize,
                    };
                    for &(j, middle) in &cells.order[from..cells.starts[cell + 1] as usize] {
                        let mut apart = middle - p.middle;
                        let mut shift = DVec2::ZERO;
                        if apart.x.abs() > half.x || apart.y.abs() > half.y {
                            shift = room.nearest(apart);
                            apart += shift.extend(0.0);
                        }
                        if apart.length_squared() > farthest * farthest {
                            continue;
                        }
                        let q = &pieces[j as usize];
                        let limit = reach * (line.radius_mm + lines[q.line as usize].radius_mm);
                        if p.line == q.line {
                            let between = line.apart(p.first, q.first).saturating_sub(1);
                            let between_mm = between as f64 * line.length_mm_of_piece();
                            if between_mm < OWN_REACH * line.radius_mm {
                                continue;
                            }
                        }
                        let pair = Pair {
                            pieces: [i, j],
                            shift,
                        };
                        if gap(lines, pieces, &pair).2.length_squared() < limit * limit {
                            pairs.push(pair);
                        }
                    }
                }
            }
        }
    }
    pairs
}

impl Line {
    /// Length of one of its pieces, which are all about equally long.
    fn length_mm_of_piece(&self) -> f64 {
        let [a, b] = self.ends(0).0;
        a.distance(b)
    }
}

/// Where two pieces are closest, and the way from the first to the second there.
fn gap(lines: &[Line], pieces: &[Piece], pair: &Pair) -> (f64, f64, DVec3) {
    let [p, q] = pair.pieces.map(|i| &pieces[i as usize]);
    let first = lines[p.line as usize].ends(p.first as usize).0;
    let shift = pair.shift.extend(0.0);
    let second = lines[q.line as usize]
        .ends(q.first as usize)
        .0
        .map(|at| at + shift);
    let (s, t) = closest(first, second);
    let apart = second[0].lerp(second[1], t) - first[0].lerp(first[1], s);
    (s, t, apart)
}

/// Moves the point at the share `s` of a piece by `by`, as far as its ends are free.
fn shift(line: &mut Line, first: usize, s: f64, by: DVec3) {
    let next = line.ends(first).1;
    let scale = 1.0 / ((1.0 - s).powi(2) + s * s);
    for (point, share) in [(first, 1.0 - s), (next, s)] {
        if !line.is_held(point) {
            line.points[point] += share * scale * by;
        }
    }
}

/// Gives the pieces of a line their lengths back, sweep by sweep.
fn restore_lengths(line: &mut Line, lengths_mm: &[f64], sweeps: usize) {
    for i in (0..sweeps).flat_map(|_| 0..lengths_mm.len()) {
        let ([a, b], next) = line.ends(i);
        let free = [i, next].map(|p| f64::from(u8::from(!line.is_held(p))));
        let both = free[0] + free[1];
        if both > 0.0 {
            let along = (b - a).try_normalize().unwrap_or(DVec3::Z);
            let excess = (a.distance(b) - lengths_mm[i]) / both * along;
            line.points[i] += free[0] * excess;
            line.points[next] -= free[1] * excess;
        }
    }
}

/// Pushes the lines apart.
pub(crate) fn separate(lines: &mut [Line], room: Room) {
    let before: Vec<Vec<DVec3>> = lines.iter().map(|l| l.points.clone()).collect();
    let lengths_mm = |l: &Line| match l.held.is_empty() {
        true => Vec::new(),
        false => l.lengths_mm().collect(),
    };
    let lengths_mm: Vec<Vec<f64>> = lines.iter().map(lengths_mm).collect();
    let restore = |lines: &mut [Line], sweeps| {
        for (line, lengths_mm) in lines.iter_mut().zip(&lengths_mm) {
            restore_lengths(line, lengths_mm, sweeps);
        }
    };
    let mut pieces = Vec::new();
    let mut pairs = Vec::new();
    for round in 0..ROUNDS {
        // Later rounds move lines less.
        if round < 2 || round % 2 == 1 {
            pieces = pieces_of(lines);
            pairs = pairs_of(lines, &pieces, room, REACH);
        }
        for _ in 0..PUSHES {
            let mut moved = false;
            for pair in &pairs {
                let (s, t, apart) = gap(lines, &pieces, pair);
                let [p, q] = pair.pieces.map(|i| &pieces[i as usize]);
                let (a, b) = (p.line as usize, q.line as usize);
                let wanted = lines[a].radius_mm + lines[b].radius_mm;
                let distance = apart.length();
                if distance >= wanted {
                    continue;
                }
                moved = true;
                // Lines that cross in one point part along the normal of both.
                let toward = apart.try_normalize().unwrap_or(DVec3::Z);
                let push = 0.5 * (wanted - distance) * toward;
                shift(&mut lines[a], p.first as usize, s, -push);
                shift(&mut lines[b], q.first as usize, t, push);
            }
            restore(lines, SWEEPS);
            for (line, before) in lines.iter_mut().zip(&before) {
                for (at, first) in line.points.iter_mut().zip(before) {
                    let [low, high] = room.faces_mm;
                    at.z = at.z.clamp(low.min(first.z), high.max(first.z));
                }
            }
            if !moved {
                break;
            }
        }
        if round + PUSHING_ROUNDS < ROUNDS {
            for (line, before) in lines.iter_mut().zip(&before) {
                smooth(line, before);
            }
        }
    }
    restore(lines, LAST_SWEEPS);
}

/// Smooths the displacements of a line.
fn smooth(line: &mut Line, before: &[DVec3]) {
    let n = line.points.len();
    if n < 3 {
        return;
    }
    let moved: Vec<DVec3> = line
        .points
        .iter()
        .zip(before)
        .map(|(p, b)| *p - *b)
        .collect();
    for i in 0..n {
        if line.is_held(i) {
            continue;
        }
        let (a, b) = match line.period {
            Some(_) => ((i + n - 1) % n, (i + 1) % n),
            None => (i.saturating_sub(1), (i + 1).min(n - 1)),
        };
        line.points[i] += SMOOTHING * (0.5 * (moved[a] + moved[b]) - moved[i]);
    }
}

/// The share of the sum of radii by which lines still reach into each other where they touch:
/// the mean over pairs of pieces that are nearer than that sum, and the largest; and the number
/// of such pairs.
pub(crate) fn overlap(lines: &[Line], room: Room) -> (f64, f64, usize) {
    let pieces = pieces_of(lines);
    let (mut sum, mut most, mut count) = (0.0, 0.0f64, 0);
    for pair in pairs_of(lines, &pieces, room, 1.0) {
        let [p, q] = pair
            .pieces
            .map(|i| &lines[pieces[i as usize].line as usize]);
        let share = 1.0 - gap(lines, &pieces, &pair).2.length() / (p.radius_mm + q.radius_mm);
        sum += share;
        most = most.max(share);
        count += 1;
    }
    (sum / f64::max(count as f64, 1.0), most, count)
}

#[cfg(test)]
mod tests;
