//! Colours of single threads: stripes and checks.
//!
//! At each crossing of a draft one thread is seen, so that a thread's colour is the mean over the crossings
//! where it lies on top. The draft is the one with which these means leave the least: threads of
//! several colours tell warp from weft by colour alone.

use crate::drafts::names;
use crate::{Photograph, ThreadGrid};
use glam::DVec2;
use organza_weave::Draft;

/// Half the width of the part of a crossing that speaks for it, in spacings: its borders show the next
/// threads.
const MIDDLE: f64 = 0.3;
/// Threads of each system that must be seen, and those by which the draft is found.
const FEWEST: usize = 12;
const SEARCHED: usize = 60;
/// Threads are coloured if their colours explain this share of what one colour of each system leaves of
/// brightness or of hue, and differ by this share of their mean, a standard deviation in one channel. Threads
/// of one colour differ by 0.05 to 0.14, since yarns are uneven (chosen by drawn cloth).
const EXPLAINED: f64 = 0.6;
const DIFFER: f64 = 0.15;
/// Threads are of one colour if the logarithms of their channels differ by less.
const ALIKE: f64 = 0.45;
/// The darkest channel of a thread, as a share of the mean of its system.
const DARKEST: f64 = 0.02;
/// Share of the threads that must agree with a sequence of colours that repeats.
const AGREE: f64 = 0.95;

/// The colours of all threads of a photograph.
#[derive(Clone, Debug)]
pub struct ThreadColours {
    /// The draft with which threads have the plainest colours, as it is named.
    pub draft: Draft,
    /// The drafts by name, the likeliest first, with shares that fall with what they leave.
    pub likely: Vec<(String, f64)>,
    /// Share that the threads' colours explain of what one colour of each system leaves.
    pub explained: f64,
    /// Share that they explain of what one colour of each place of the draft leaves: light and shadow of a
    /// weave are at the same places of each repeat.
    pub beyond_repeat: f64,
    /// Threads of the draft at the first crossing that is seen.
    offset: [usize; 2],
    /// The first warp and weft thread that are seen.
    first: [i64; 2],
    /// Linear colours of warp and weft threads, where they are seen.
    colours: [Vec<Option<[f64; 3]>>; 2],
    /// The mean of each system.
    mean: [[f64; 3]; 2],
}

/// Square roots of a colour, in which highlights count for less; then their mean, and the differences of red
/// and blue from green as shares of it.
type Features = [f64; 6];
/// Of these, the ones by which drafts are judged.
const JUDGED: std::ops::Range<usize> = 3..6;
/// A mean root below which differences fade, as a share of the photograph's.
const DARK: f64 = 0.1;

/// Sums of features, and how many.
#[derive(Clone, Copy, Default)]
struct Sum {
    features: Features,
    count: f64,
}

impl Sum {
    fn add(&mut self, features: &Features) {
        let all = self.features.iter_mut().zip(features);
        all.for_each(|(sum, f)| *sum += f);
        self.count += 1.0;
    }

    /// The colour that the mean roots have.
    fn colour(&self) -> [f64; 3] {
        [0, 1, 2].map(|c| (self.features[c] / self.count.max(1.0)).powi(2))
    }

    /// The squares of the sums that are judged, over the count.
    fn squares(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.features[JUDGED.start + k].powi(2) / self.count.max(1.0))
    }
}

/// The middles of the crossings of a photograph.
struct Middles {
    first: [i64; 2],
    count: [usize; 2],
    /// Rows of weft threads from the bottom, `None` where less than half is seen.
    list: Vec<Option<Features>>,
}

impl Middles {
    fn new(photograph: &Photograph, grid: &ThreadGrid) -> Middles {
        let [width, height] = photograph.size();
        let (w, h) = (width as f64, height as f64);
        let corners = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)];
        let corners = corners.map(|(x, y)| grid.thread(DVec2::new(x, y)));
        let low = corners.iter().copied().fold(DVec2::MAX, DVec2::min).floor();
        let high = corners.iter().copied().fold(DVec2::MIN, DVec2::max).ceil();
        let count = (high - low).as_usizevec2() + 1;
        let mut sums = vec![[0.0f64; 4]; count.x * count.y];
        for y in 0..height {
            for x in 0..width {
                let at = grid.thread(DVec2::new(x as f64, y as f64));
                if (at - at.round()).abs().max_element() > MIDDLE {
                    continue;
                }
                let cell = (at.round() - low).as_usizevec2();
                let sum = &mut sums[cell.y * count.x + cell.x];
                let colour = photograph.pixel(x, y);
                (0..3).for_each(|c| sum[c] += colour[c]);
                sum[3] += 1.0;
            }
        }
        let area = 1.0 / grid.frequency[0].perp_dot(grid.frequency[1]).abs();
        let half = (0.5 * area * (2.0 * MIDDLE).powi(2)).max(1.0);
        let roots = |s: &[f64; 4]| (s[3] >= half).then(|| [0, 1, 2].map(|c| (s[c] / s[3]).sqrt()));
        let roots: Vec<Option<[f64; 3]>> = sums.iter().map(roots).collect();
        let bright = |[r, g, b]: [f64; 3]| (r + g + b) / 3.0;
        let (mut total, mut seen) = (0.0, 0.0);
        for root in roots.iter().flatten() {
            total += bright(*root);
            seen += 1.0;
        }
        let floor = DARK * total / f64::max(seen, 1.0) + 1e-9;
        let features = |root: &[f64; 3]| {
            let [r, g, b] = *root;
            let mean = bright(*root);
            [
                r,
                g,
                b,
                mean,
                (r - g) / (mean + floor),
                (b - g) / (mean + floor),
            ]
        };
        Middles {
            first: [low.x as i64, low.y as i64],
            count: count.into(),
            list: roots.iter().map(|r| r.as_ref().map(features)).collect(),
        }
    }

    /// The crossings that are seen among so many threads in the middle: both threads, counted from the first,
    /// and the features.
    fn seen(&self, most: usize) -> Vec<([usize; 2], Features)> {
        let range = self.count.map(|n| {
            let first = n.saturating_sub(most) / 2;
            first..first.saturating_add(most)
        });
        let all = self.list.iter().enumerate();
        let seen = all.filter_map(|(k, f)| Some(([k % self.count[0], k / self.count[0]], (*f)?)));
        seen.filter(|(at, _)| range[0].contains(&at[0]) && range[1].contains(&at[1]))
            .collect()
    }

    /// The thread that lies on top at a crossing: those of the warp first, then those of the weft.
    fn on_top(&self, draft: &Draft, [e, p]: [usize; 2], offset: [usize; 2]) -> usize {
        let (ends, picks) = draft.repeat();
        match draft.warp_up((e + offset[0]) % ends, (p + offset[1]) % picks) {
            true => e,
            false => self.count[0] + p,
        }
    }
}

/// Sums of the features of crossings by their class, and what the means of the classes leave of each feature
/// that is judged, a sum of squares.
fn by_class(
    seen: &[([usize; 2], Features)],
    count: usize,
    class: impl Fn([usize; 2]) -> usize,
) -> (Vec<Sum>, [f64; 3]) {
    let mut sums = vec![Sum::default(); count];
    let mut left = [0.0; 3];
    for (at, features) in seen {
        sums[class(*at)].add(features);
        for (square, k) in left.iter_mut().zip(JUDGED) {
            *square += features[k] * features[k];
        }
    }
    for own in sums.iter().map(Sum::squares) {
        (0..3).for_each(|k| left[k] -= own[k]);
    }
    (sums, left.map(|v| v.max(1e-12)))
}

/// The share of one feature that threads explain of what others leave, at most.
fn share(by_threads: &[f64; 3], others: &[f64; 3]) -> f64 {
    let all = by_threads.iter().zip(others);
    all.map(|(t, s)| 1.0 - t / s).fold(0.0, f64::max)
}

impl ThreadColours {
    /// Finds the colours of threads that are seen one by one, with the given draft or with a named one;
    /// `None` if one colour of each system will do.
    pub fn find(
        photograph: &Photograph,
        grid: &ThreadGrid,
        given: Option<&Draft>,
    ) -> Option<ThreadColours> {
        let middles = Middles::new(photograph, grid);
        let searched = middles.seen(SEARCHED);
        if middles.count.iter().any(|n| *n < FEWEST) || searched.len() < FEWEST * FEWEST {
            return None;
        }
        let count = middles.count.iter().sum();
        let drafts: Vec<(String, Draft)> = match given {
            Some(draft) => vec![("given".to_owned(), draft.clone())],
            None => {
                let named = |name: String| Some((name.clone(), Draft::named(&name).ok()?));
                names().into_iter().filter_map(named).collect()
            }
        };
        let mut list: Vec<(f64, String, Draft, [usize; 2])> = Vec::new();
        for (name, draft) in drafts {
            let (ends, picks) = draft.repeat();
            let offsets = (0..ends).flat_map(|e| (0..picks).map(move |p| [e, p]));
            let left = |offset| {
                let on_top = |at| middles.on_top(&draft, at, offset);
                let (_, left) = by_class(&searched, count, on_top);
                // The noise of each feature is unknown, so that logarithms are summed.
                (left.iter().map(|v| v.ln()).sum::<f64>(), offset)
            };
            let best = offsets.map(left).min_by(|a, b| a.0.total_cmp(&b.0));
            list.extend(best.map(|(left, offset)| (left, name, draft, offset)));
        }
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Crossings of one thread are alike, so that each thread speaks once.
        let threads = middles
            .count
            .iter()
            .map(|n| n.min(&SEARCHED))
            .sum::<usize>() as f64;
        let weight = |left: f64| (0.5 * threads * (list[0].0 - left)).exp();
        let total: f64 = list.iter().map(|l| weight(l.0)).sum();
        let shares = list
            .iter()
            .map(|l| (l.1.clone(), weight(l.0) / total.max(1e-12)));
        let likely = shares.collect();
        let (_, _, draft, offset) = list.first().cloned()?;
        let all = middles.seen(usize::MAX);
        let on_top = |at| middles.on_top(&draft, at, offset);
        let (threads, by_threads) = by_class(&all, count, on_top);
        let (warp, weft) = threads.split_at(middles.count[0]);
        let system = |at| usize::from(on_top(at) >= middles.count[0]);
        let (systems, by_systems) = by_class(&all, 2, system);
        let (ends, picks) = draft.repeat();
        let place = |[e, p]: [usize; 2]| (p + offset[1]) % picks * ends + (e + offset[0]) % ends;
        let (_, by_places) = by_class(&all, ends * picks, place);
        let mean = [0, 1].map(|k| systems[k].colour());
        let mut colours: [Vec<Option<[f64; 3]>>; 2] = Default::default();
        let mut most: f64 = 0.0;
        for k in 0..2 {
            let own = |sum: &Sum| (sum.count > 0.0).then(|| sum.colour());
            colours[k] = [warp, weft][k].iter().map(own).collect();
            for c in 0..3 {
                let square = |v: &[f64; 3]| (v[c] / mean[k][c].max(1e-9) - 1.0).powi(2);
                let seen = colours[k].iter().flatten();
                let (squares, count) = seen.fold((0.0, 0.0), |(s, n), v| (s + square(v), n + 1.0));
                most = most.max(f64::sqrt(squares / f64::max(count, 1.0)));
            }
        }
        let explained = share(&by_threads, &by_systems);
        (explained > EXPLAINED && most > DIFFER).then_some(ThreadColours {
            draft,
            likely,
            explained,
            beyond_repeat: share(&by_threads, &by_places),
            offset,
            first: middles.first,
            colours,
            mean,
        })
    }

    /// The photograph as if all threads of a system had its mean colour.
    pub fn evened(&self, photograph: &Photograph, grid: &ThreadGrid) -> Photograph {
        let (ends, picks) = self.draft.repeat();
        let places = [ends, picks];
        photograph.scaled(|x, y| {
            let at = grid.thread(DVec2::new(x as f64, y as f64)).round();
            let at = [at.x as i64, at.y as i64];
            let thread = [0, 1].map(|k| {
                let last = self.colours[k].len() as i64 - 1;
                (at[k] - self.first[k]).clamp(0, last) as usize
            });
            let of_draft = [0, 1].map(|k| (thread[k] + self.offset[k]) % places[k]);
            let k = usize::from(!self.draft.warp_up(of_draft[0], of_draft[1]));
            let mean = self.mean[k];
            let own = self.colours[k][thread[k]].unwrap_or(mean);
            [0, 1, 2].map(|c| mean[c] / own[c].max(DARKEST * mean[c]).max(1e-9))
        })
    }

    /// The colours of a system's threads as shares of its mean, from the draft's first thread on: one
    /// repeat, where they repeat. Threads that are nearly alike have the same.
    pub fn sequence(&self, system: usize) -> Vec<[f64; 3]> {
        let mean = self.mean[system];
        let share = |own: &[f64; 3]| {
            let of = |c: usize| (own[c] / mean[c].max(1e-9)).max(DARKEST);
            [0, 1, 2].map(of)
        };
        let shares: Vec<Option<[f64; 3]>> = self.colours[system]
            .iter()
            .map(|own| own.as_ref().map(share))
            .collect();
        let kinds = kinds(&shares);
        let n = kinds.len();
        let agrees = |period: usize| {
            let pairs = (period..n).filter_map(|i| Some((kinds[i]?, kinds[i - period]?)));
            let (same, all) = pairs.fold((0u32, 0u32), |(s, n), (a, b)| {
                (s + u32::from(a == b), n + 1)
            });
            f64::from(same) >= AGREE * f64::from(all)
        };
        let period = (1..=n / 2).find(|p| agrees(*p)).unwrap_or(n);
        // The mean colour of each kind, and the most common kind at each place.
        let mut sums = vec![[0.0; 4]; n];
        for (kind, share) in kinds.iter().zip(&shares) {
            if let (Some(kind), Some(share)) = (kind, share) {
                (0..3).for_each(|c| sums[*kind][c] += share[c]);
                sums[*kind][3] += 1.0;
            }
        }
        let common = |place: usize| {
            let here = || (place..n).step_by(period).filter_map(|i| kinds[i]);
            let times = |kind: usize| here().filter(|k| *k == kind).count();
            here().max_by_key(|kind| (times(*kind), usize::MAX - kind))
        };
        let first = self.offset[system] % period;
        let kind_of = |j: usize| common((j + period - first) % period);
        (0..period)
            .map(|j| kind_of(j).map_or([1.0; 3], |kind| mean_of(sums[kind])))
            .collect()
    }
}

fn mean_of(sum: [f64; 4]) -> [f64; 3] {
    [0, 1, 2].map(|c| sum[c] / sum[3].max(1.0))
}

/// The kind of each colour: that of the first one it is like, by means that follow what they gather.
fn kinds(colours: &[Option<[f64; 3]>]) -> Vec<Option<usize>> {
    let mut sums: Vec<[f64; 4]> = Vec::new();
    let mut kind = |colour: [f64; 3]| {
        let logs = colour.map(f64::ln);
        let away = |sum: &[f64; 4]| {
            let mean = mean_of(*sum);
            let off = (0..3).map(|c| (mean[c] - logs[c]).abs());
            off.fold(0.0, f64::max)
        };
        let near = sums.iter().map(away).enumerate();
        let near = near.min_by(|a, b| a.1.total_cmp(&b.1));
        let kind = match near {
            Some((kind, distance)) if distance < ALIKE => kind,
            _ => {
                sums.push([0.0; 4]);
                sums.len() - 1
            }
        };
        (0..3).for_each(|c| sums[kind][c] += logs[c]);
        sums[kind][3] += 1.0;
        kind
    };
    colours.iter().map(|c| c.map(&mut kind)).collect()
}
