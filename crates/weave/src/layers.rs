//! Layers of a weave: threads of one system that lie over others of it, as in double cloth,
//! backed cloth and supplementary weft.
//!
//! Layers follow from the draft. Where one end passes over a pick and the next end passes under it,
//! the pick lies between the two, and the first end lies higher. If neighbours keep that order from one such pick
//! to the next while one of them interlaces with the picks between, they need not lie side by
//! side: one may slide over the other. Neighbours that change places from pick to pick, as in
//! every weave of one layer, press on each other sideways.

use crate::Draft;
use glam::DVec2;

/// Most layers of a system: with more, the draft counts as one layer.
const MAX_LAYERS: usize = 5;
/// Least share of the crossings through which a pair keeps its order, and how many crossings must
/// tell the order for each time that it changes (estimated): layers change places in blocks of
/// four threads or more.
const MIN_KEPT: f64 = 0.5;
const TOLD_PER_CHANGE: usize = 4;
/// Least share of the threads and the next of each other layer that are stacked: those at the
/// borders of such blocks are not.
const MIN_STACKED: f64 = 0.85;
/// Least share of the crossings that tell the order of a pair: that of neighbouring plain layers.
const MIN_TOLD: f64 = 1.0 / MAX_LAYERS as f64;
/// Least share of the crossings between those, at which a thread of the pair interlaces: that of
/// a satin of eight (estimated).
const MIN_BETWEEN: f64 = 0.1;
/// Neighbours of different layers keep at least this share of their distance when each layer
/// spreads out evenly.
const MIN_GAP: f64 = 0.35;
/// Sweeps in which layers spread out, and what is left of a distance then.
const SWEEPS: usize = 400;
const UNEVEN: f64 = 1e-4;

/// One system of a draft and how its threads pass the others.
#[derive(Clone, Copy)]
pub(crate) enum Sheds<'a> {
    Warp(&'a Draft),
    Weft(&'a Draft),
}

impl Sheds<'_> {
    fn threads(self) -> usize {
        match self {
            Sheds::Warp(d) => d.ends(),
            Sheds::Weft(d) => d.picks(),
        }
    }

    fn crossings(self) -> usize {
        match self {
            Sheds::Warp(d) => d.picks(),
            Sheds::Weft(d) => d.ends(),
        }
    }

    fn is_over(self, thread: usize, crossing: usize) -> bool {
        match self {
            Sheds::Warp(d) => d.warp_up(thread, crossing),
            Sheds::Weft(d) => !d.warp_up(crossing, thread),
        }
    }

    /// At each crossing 1 where thread `i` lies over thread `k`, -1 where it lies under it, 0
    /// where they change places; `None` where they lie side by side.
    fn order(self, i: usize, k: usize) -> Option<Vec<i8>> {
        let n = self.crossings();
        let told = |c| i8::from(self.is_over(i, c)) - i8::from(self.is_over(k, c));
        let mut order: Vec<i8> = (0..n).map(told).collect();
        let first = order.iter().position(|o| *o != 0)?;
        let (mut last, mut count, mut changes) = (first, 0usize, 0usize);
        let (mut kept, mut between) = (0usize, 0usize);
        for c in first + 1..=first + n {
            let here = order[c % n];
            if here == 0 {
                continue;
            }
            count += 1;
            if here == order[last % n] {
                kept += c - last;
                between += c - last - 1;
                order[last % n..n.min(c)].fill(here);
                if c > n {
                    order[..c - n].fill(here);
                }
            } else {
                changes += 1;
            }
            last = c;
        }
        let share = |of: usize| of as f64 / n as f64;
        let is_told = share(count) >= MIN_TOLD && share(between) >= MIN_BETWEEN;
        let is_kept = share(kept) >= MIN_KEPT && count >= TOLD_PER_CHANGE * changes;
        (is_told && is_kept).then_some(order)
    }
}

/// Which layer each thread of a system belongs to.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layers {
    /// Numbered as they first occur.
    of: Vec<usize>,
    pub count: usize,
    /// Whether all keep their places through the repeat.
    stay: bool,
}

/// Two threads of a system, one over the other.
#[derive(Clone, Debug)]
pub(crate) struct Stacked {
    pub threads: [usize; 2],
    /// At each crossing 1 where the first lies over the second, -1 where under it, 0 where they
    /// change places.
    pub order: Vec<i8>,
    /// Least distance of their heights at each crossing, millimetres: 0 where one passes beside
    /// the other.
    pub apart_mm: Vec<f64>,
    /// What it would be if one lay straight over the other.
    pub above_mm: Vec<f64>,
}

impl Layers {
    /// All threads beside each other.
    pub fn single(threads: usize) -> Layers {
        Layers {
            of: vec![0; threads],
            count: 1,
            stay: true,
        }
    }

    /// The layers of a draft. Where too few threads of different layers lie over each other,
    /// there is one.
    pub fn new(sheds: Sheds) -> Layers {
        let n = sheds.threads();
        let single = Layers::single(n);
        let mut of = Vec::with_capacity(n);
        // The last thread of each layer.
        let mut last: Vec<usize> = Vec::new();
        for i in 0..n {
            // The layer whose last thread is nearest and lies beside this one.
            let mut by_distance: Vec<usize> = (0..last.len()).collect();
            by_distance.sort_by_key(|&layer| std::cmp::Reverse(last[layer]));
            let beside = |layer: &usize| sheds.order(last[*layer], i).is_none();
            let layer = by_distance.into_iter().find(beside).unwrap_or(last.len());
            if layer == last.len() {
                if layer == MAX_LAYERS {
                    return single;
                }
                last.push(i);
            }
            last[layer] = i;
            of.push(layer);
        }
        let mut layers = Layers {
            of,
            count: last.len(),
            stay: true,
        };
        if layers.count == 1 {
            return layers;
        }
        if !layers.interleave() {
            return single;
        }
        let mut stacked = 0;
        let others = layers.count - 1;
        for i in 0..n {
            for layer in (0..layers.count).filter(|layer| *layer != layers.of[i]) {
                if let Some(order) = sheds.order(i, layers.next(i, layer)) {
                    stacked += 1;
                    layers.stay &= !(order.contains(&1) && order.contains(&-1));
                }
            }
        }
        if f64::from(stacked) < MIN_STACKED * (n * others) as f64 {
            return single;
        }
        layers
    }

    /// The next thread after `i` of a layer, around the repeat.
    fn next(&self, i: usize, layer: usize) -> usize {
        let n = self.of.len();
        let mut after = (1..=n).map(|d| (i + d) % n);
        after.find(|k| self.of[*k] == layer).unwrap_or(i)
    }

    /// Whether threads of the fullest layer pass between those of the others: layers that lie
    /// beside each other are none.
    fn interleave(&self) -> bool {
        let n = self.of.len();
        let fullest = (0..self.count).max_by_key(|layer| self.threads(*layer).len());
        let others = (0..n).filter(|i| Some(self.of[*i]) != fullest);
        let is_near = |i: usize| (1..=MAX_LAYERS).any(|d| Some(self.of[(i + d) % n]) == fullest);
        let near = others.clone().filter(|i| is_near(*i)).count();
        near as f64 >= MIN_STACKED * others.count() as f64
    }

    /// The threads of a layer.
    pub fn threads(&self, layer: usize) -> Vec<usize> {
        let all = (0..self.of.len()).filter(|i| self.of[*i] == layer);
        all.collect()
    }

    /// Share of the threads that the fullest layer has.
    pub fn fullest_share(&self) -> f64 {
        let fullest = (0..self.count).map(|layer| self.threads(layer).len()).max();
        fullest.unwrap_or(0) as f64 / self.of.len() as f64
    }

    /// Each thread and the next of its layer, with the distance between their positions.
    fn neighbours(&self, position_mm: &[f64], period_mm: f64) -> Vec<(usize, usize, f64)> {
        let mut all = Vec::with_capacity(self.of.len());
        for layer in 0..self.count {
            let threads = self.threads(layer);
            for (j, &i) in threads.iter().enumerate() {
                let (k, turn) = match threads.get(j + 1) {
                    Some(&k) => (k, 0.0),
                    None => (threads[0], period_mm),
                };
                all.push((i, k, position_mm[k] + turn - position_mm[i]));
            }
        }
        all
    }

    /// Middle of each thread across the system, growing, from the space that each takes up. The
    /// threads of a layer spread out evenly as far as those of others leave their order, unless
    /// layers change places: there their threads pass beside each other.
    pub fn positions_mm(&self, spacing_mm: &[f64]) -> Vec<f64> {
        let mut period_mm = 0.0;
        let in_order: Vec<f64> = spacing_mm
            .iter()
            .map(|s| {
                period_mm += s;
                period_mm - 0.5 * s
            })
            .collect();
        if self.count == 1 || !self.stay {
            return in_order;
        }
        let n = spacing_mm.len();
        // Layers of few threads stay where their threads are.
        let spread: Vec<f64> = (0..self.count)
            .map(|layer| {
                let own_mm: f64 = self.threads(layer).iter().map(|i| spacing_mm[*i]).sum();
                (period_mm / own_mm).min(self.count as f64)
            })
            .collect();
        let share_mm = |i: usize, k: usize| 0.5 * (spacing_mm[i] + spacing_mm[k]);
        let beside = self.neighbours(&in_order, period_mm).into_iter();
        let beside = beside.map(|(i, k, _)| (i, k, spread[self.of[i]] * share_mm(i, k)));
        let next = (0..n).map(|i| (i, (i + 1) % n, MIN_GAP * share_mm(i, (i + 1) % n)));
        let least: Vec<(usize, usize, f64)> = beside.chain(next).collect();
        let mut at_mm = in_order.clone();
        for _ in 0..SWEEPS {
            let mut most = 0.0f64;
            for &(i, k, least_mm) in &least {
                let turn = if k <= i { period_mm } else { 0.0 };
                let lacks_mm = least_mm - (at_mm[k] + turn - at_mm[i]);
                if i != k && lacks_mm > 0.0 {
                    at_mm[i] -= 0.5 * lacks_mm;
                    at_mm[k] += 0.5 * lacks_mm;
                    most = most.max(lacks_mm / least_mm);
                }
            }
            if most < UNEVEN {
                break;
            }
        }
        // The way there may cross: as much of it as keeps the order.
        let gap_mm = |at_mm: &[f64], i: usize| {
            let k = (i + 1) % n;
            let turn = if k <= i { period_mm } else { 0.0 };
            at_mm[k] + turn - at_mm[i]
        };
        let part = |i: usize| {
            let least_mm = 0.5 * MIN_GAP * share_mm(i, (i + 1) % n);
            let (from_mm, to_mm) = (gap_mm(&in_order, i), gap_mm(&at_mm, i));
            match to_mm < least_mm {
                true => ((from_mm - least_mm) / (from_mm - to_mm)).max(0.0),
                false => 1.0,
            }
        };
        let part = (0..n).map(part).fold(1.0, f64::min);
        let places = in_order.iter().zip(&at_mm);
        places.map(|(a, b)| a + part * (b - a)).collect()
    }

    /// The widest that each thread can be without pressing on the others of its layer.
    pub fn rooms_mm(&self, spacing_mm: &[f64], position_mm: &[f64]) -> Vec<f64> {
        if self.count == 1 {
            return spacing_mm.to_vec();
        }
        let period_mm = spacing_mm.iter().sum();
        let mut rooms = vec![period_mm; spacing_mm.len()];
        for (i, k, gap_mm) in self.neighbours(position_mm, period_mm) {
            let both = spacing_mm[i] + spacing_mm[k];
            for t in [i, k] {
                rooms[t] = rooms[t].min(2.0 * gap_mm * spacing_mm[t] / both);
            }
        }
        rooms
    }

    /// The pairs of threads of different layers that lie over each other or are the nearest.
    /// `half_mm` gives half the width and height of a thread at a crossing.
    pub fn stacked(
        &self,
        sheds: Sheds,
        position_mm: &[f64],
        period_mm: f64,
        half_mm: &dyn Fn(usize, usize) -> DVec2,
    ) -> Vec<Stacked> {
        let n = self.of.len();
        let mut all = Vec::new();
        if self.count == 1 {
            return all;
        }
        let crossings = sheds.crossings();
        let widest_mm: Vec<f64> = (0..n)
            .map(|i| (0..crossings).fold(0.0, |w: f64, c| w.max(half_mm(i, c).x)))
            .collect();
        let most_mm = widest_mm.iter().copied().fold(0.0, f64::max);
        for i in 0..n {
            let mut seen = [false; MAX_LAYERS];
            seen[self.of[i]] = true;
            for d in 1..n {
                let k = (i + d) % n;
                let turn = if k < i { period_mm } else { 0.0 };
                let across_mm = position_mm[k] + turn - position_mm[i];
                let is_next = !std::mem::replace(&mut seen[self.of[k]], true);
                let beyond = across_mm > widest_mm[i] + most_mm;
                if beyond && seen[..self.count].iter().all(|s| *s) && !is_next {
                    break;
                }
                let near = is_next || across_mm < widest_mm[i] + widest_mm[k];
                // Round the repeat the same pair is met from the other side.
                let is_farther = across_mm > period_mm - across_mm
                    || (across_mm == period_mm - across_mm && k < i);
                if self.of[k] == self.of[i] || !near || is_farther {
                    continue;
                }
                let Some(order) = sheds.order(i, k) else {
                    continue;
                };
                let apart = |c: usize| {
                    let half = half_mm(i, c) + half_mm(k, c);
                    half.y * (1.0 - (across_mm / half.x).powi(2)).max(0.0).sqrt()
                };
                all.push(Stacked {
                    threads: [i, k],
                    apart_mm: (0..crossings).map(apart).collect(),
                    above_mm: (0..crossings)
                        .map(|c| (half_mm(i, c) + half_mm(k, c)).y)
                        .collect(),
                    order,
                });
            }
        }
        all
    }
}

#[cfg(test)]
mod tests;
