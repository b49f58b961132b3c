//! Threads and repeat of a weave from the peaks of a spectrum, where no single thread is seen.
//!
//! All waves of a weave whose crossings repeat lie on a lattice of frequencies: with frequencies `f`
//! across the warp and `g` across the weft, per pixel, and a [`Repeat`] of `n` ends, moved by `s` after
//! `m` picks, they are `u f + v g` with `u = k / n` and `v = (j - s k / n) / m` for whole `k` and `j`.
//! A few of them tell the threads apart although these are finer than two pixels.
//!
//! Costs and thresholds below are chosen, not derived: by drawn cloth and three real photographs.

use crate::thread_grid::{MAX_SKEW_DEG, lean_deg};
use crate::{Peak, Repeat, Spectrum};
use glam::{DMat2, DVec2};

/// The warp may lean so far from the vertical of the picture, and the weft from its horizontal,
/// degrees: whatever repeats suits a weave that may be turned far.
const MAX_LEAN_DEG: f64 = 10.0;
/// Threads per pixel, at least and at most.
const THREADS: [f64; 2] = [0.03, 0.68];
/// Spacings may differ by this factor.
const MAX_RATIO: f64 = 3.0;
/// A peak is a wave of the weave if it is so near to it, cycles per pixel.
const NEAR: f64 = 0.005;
/// Crossings that a repeat has in addition cost so much of what the peaks say.
const COST_OF_CROSSING: f64 = 0.01;
/// What repeats cost that are none of a plain weave, a twill or a satin, and spacings that differ by a
/// factor of e: both are rare.
const COST_OF_KIND: f64 = 0.2;
const COST_OF_RATIO: f64 = 0.1;
/// What threads cost whose direction is not that of the streaks, and the difference, degrees, that counts
/// wholly.
const COST_OF_STREAKS: f64 = 0.06;
const STREAKS_DEG: f64 = 5.0;
/// Peaks of a spectrum that are considered.
pub(crate) const PEAKS: usize = 24;
/// Peaks whose place makes a guess, and those whose sums do.
const STRONGEST: usize = 5;
const SUMMED: usize = 8;
/// Guesses that are kept.
const KEPT: usize = 80;
/// The back may be nearer to the camera than the front, or farther, by this factor.
const MAX_SCALE: f64 = 1.25;
/// Steps of the search for that factor.
const SCALE_STEP: f64 = 1.005;
/// Share of what the peaks say that a weave must explain; half of that against the light.
const MIN_EXPLAINED: f64 = 0.2;

/// Spacing, direction and repeat of the threads of a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeaveLattice {
    /// Threads per pixel across the warp and across the weft.
    pub frequency: [DVec2; 2],
    /// How crossings repeat.
    pub repeat: Repeat,
    /// Share of what the peaks say that lies on the lattice, less what chance and complexity cost.
    pub score: f64,
    /// The same without these costs.
    pub explained: f64,
}

/// A wave of the weave that a spectrum shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Cycles per pixel.
    pub frequency: DVec2,
    /// Cycles per end and per pick.
    pub of_threads: DVec2,
    /// See [`Peak::strength`].
    pub strength: f64,
}

/// What a spectrum shows of threads.
struct Seen {
    peaks: Vec<Peak>,
    /// Lean of warp and weft by the streaks that thick and thin threads make, degrees.
    streaks_deg: [f64; 2],
}

impl Seen {
    fn new(spectrum: &Spectrum) -> Seen {
        let direction = |axis: usize, deg: f64| {
            let (sin, cos) = deg.to_radians().sin_cos();
            match axis {
                0 => DVec2::new(cos, sin),
                _ => DVec2::new(-sin, cos),
            }
        };
        let streaks_deg = [0, 1].map(|axis| {
            let most = (2.0 * MAX_LEAN_DEG) as i32;
            let tried = (-most..=most).map(|k| 0.5 * f64::from(k));
            let all = tried.map(|deg| (deg, spectrum.along(direction(axis, deg))));
            all.max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |m| m.0)
        });
        Seen {
            peaks: spectrum.peaks(PEAKS),
            streaks_deg,
        }
    }
}

/// The greatest common divisor.
fn divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { divisor(b, a % b) }
}

fn may_be_thread(f: DVec2, axis: usize) -> bool {
    lean_deg(f, axis).abs() < MAX_LEAN_DEG && (THREADS[0]..THREADS[1]).contains(&f.length())
}

/// What a peak says: the square of the logarithm of its power over that of the noise.
fn weight(peak: &Peak) -> f64 {
    (peak.strength * peak.strength / 3.0).ln().max(0.0).powi(2)
}

/// The repeats that are considered: small ones, and those that move by some ends with each pick.
fn repeats() -> Vec<Repeat> {
    let small = |r: &Repeat| r.count() <= 8 || r.picks == 1;
    let weaves = |r: &Repeat| r.drafts().iter().any(|d| Repeat::of_draft(d) == *r);
    Repeat::all().filter(small).filter(weaves).collect()
}

impl WeaveLattice {
    /// The lattices that explain the spectra of one photograph or of both sides of a cloth, one for
    /// each photograph: the best first, then those of other repeats.
    pub fn find(photographs: &[Spectrum]) -> Vec<Vec<WeaveLattice>> {
        let seen: Vec<Seen> = photographs.iter().map(Seen::new).collect();
        let Some(front) = seen.first() else {
            return Vec::new();
        };
        let mut list = Vec::new();
        for guess in guesses(front) {
            let mut sides = vec![guess];
            for other in &seen[1..] {
                sides.extend(guess.scaled_to(other));
            }
            if sides.len() == photographs.len() {
                list.push(sides);
            }
        }
        let total = |sides: &[WeaveLattice]| sides.iter().map(|s| s.score).sum::<f64>();
        list.sort_by(|a, b| total(b).total_cmp(&total(a)));
        let mut kept: Vec<Vec<WeaveLattice>> = Vec::new();
        for sides in list {
            let first = &sides[0];
            let is_new = !kept.iter().any(|k| k[0].repeat == first.repeat);
            let least = |k: usize| if k == 0 { 1.0 } else { 0.5 } * MIN_EXPLAINED;
            let explains = |(k, s): (usize, &WeaveLattice)| s.explained > least(k);
            if is_new && sides.iter().enumerate().all(explains) {
                kept.push(sides);
            }
        }
        kept
    }

    fn new(frequency: [DVec2; 2], repeat: Repeat, seen: &Seen) -> WeaveLattice {
        let mut lattice = WeaveLattice {
            frequency,
            repeat,
            score: 0.0,
            explained: 0.0,
        };
        let (mut hit, mut all) = (0.0, 0.0);
        for peak in &seen.peaks {
            let (wave, away) = lattice.nearest(peak.frequency);
            // What is finer than a thread is faint.
            let order = wave.abs().max_element().max(1.0);
            hit += weight(peak) * (-(away / NEAR).powi(2)).exp() / (order * order);
            all += weight(peak);
        }
        let [f, g] = frequency;
        let waves_per_area = repeat.count() as f64 / f.perp_dot(g).abs();
        let chance = std::f64::consts::PI * NEAR * NEAR * waves_per_area;
        let [a, b] = [0, 1].map(|k| lean_deg(frequency[k], k));
        let off = [a - seen.streaks_deg[0], b - seen.streaks_deg[1]];
        let off = off.map(|o| COST_OF_STREAKS * (o / STREAKS_DEG).powi(2).min(1.0));
        let slant = 0.02 * ((a - b) / 3.0).powi(2) + off[0] + off[1];
        lattice.explained = hit / f64::max(all, 1e-12);
        let ratio = COST_OF_RATIO * (f.length() / g.length()).ln().powi(2);
        let kind = match repeat {
            Repeat {
                ends,
                shift,
                picks: 1,
            } if divisor(ends, shift) == 1 => 0.0,
            _ => COST_OF_KIND,
        };
        let crossings = COST_OF_CROSSING * repeat.count() as f64;
        lattice.score = lattice.explained - chance - crossings - slant - ratio - kind;
        lattice
    }

    fn threads(&self) -> DMat2 {
        DMat2::from_cols(self.frequency[0], self.frequency[1])
    }

    /// The wave nearest to a frequency, in cycles per end and pick, and how far away it is, cycles
    /// per pixel. The mean is no wave.
    fn nearest(&self, frequency: DVec2) -> (DVec2, f64) {
        let Repeat { ends, shift, picks } = self.repeat;
        let at = self.threads().inverse() * frequency;
        let k = (at.x * ends as f64).round();
        let u = k / ends as f64;
        let first = -(shift as f64) * u;
        let v = (first + (at.y * picks as f64 - first).round()) / picks as f64;
        let wave = DVec2::new(u, v);
        let away = (self.threads() * wave - frequency).length();
        match wave == DVec2::ZERO {
            true => (wave, f64::INFINITY),
            false => (wave, away),
        }
    }

    /// The waves among the peaks, the strongest first.
    pub fn waves(&self, peaks: &[Peak]) -> Vec<Wave> {
        let wave = |peak: &Peak| {
            let (of_threads, away) = self.nearest(peak.frequency);
            (away < 2.0 * NEAR).then_some(Wave {
                frequency: peak.frequency,
                of_threads,
                strength: peak.strength,
            })
        };
        peaks.iter().filter_map(wave).collect()
    }

    /// The lattice of the same repeat that suits its waves best.
    fn refined(self, seen: &Seen) -> WeaveLattice {
        let (mut left, mut right) = (DMat2::ZERO, DMat2::ZERO);
        for wave in self.waves(&seen.peaks) {
            let w = wave.strength.ln_1p();
            let outer = |a: DVec2, b: DVec2| DMat2::from_cols(a * b.x, a * b.y);
            left += w * outer(wave.of_threads, wave.of_threads);
            right += w * outer(wave.frequency, wave.of_threads);
        }
        if left.determinant().abs() < 1e-9 {
            return self;
        }
        let threads = right * left.inverse();
        let better = WeaveLattice::new([threads.x_axis, threads.y_axis], self.repeat, seen);
        if better.score > self.score {
            better
        } else {
            self
        }
    }

    /// The same weave in another photograph, from nearer or farther.
    fn scaled_to(&self, seen: &Seen) -> Option<WeaveLattice> {
        let steps = (MAX_SCALE.ln() / SCALE_STEP.ln()) as i32;
        let tried = (-steps..=steps).map(|k| {
            let scaled = self.frequency.map(|f| f * SCALE_STEP.powi(k));
            WeaveLattice::new(scaled, self.repeat, seen)
        });
        let best = tried.max_by(|a, b| a.score.total_cmp(&b.score))?;
        Some(best.refined(seen).refined(seen))
    }
}

/// Lattices that may explain peaks, the best first: the frequency of one system is a peak, or the sum of
/// two, that of the other follows from a strong peak that is some wave.
fn guesses(seen: &Seen) -> Vec<WeaveLattice> {
    let peaks = &seen.peaks;
    let both = |count: usize| -> Vec<DVec2> {
        let first = peaks.iter().take(count).map(|p| p.frequency);
        first.flat_map(|f| [f, -f]).collect()
    };
    let mut threads = both(peaks.len());
    let summed = both(SUMMED);
    for (i, a) in summed.iter().enumerate() {
        threads.extend(summed[..i].iter().map(|b| *a + *b));
    }
    let strongest = both(STRONGEST);
    let repeats = repeats();
    let mut list: Vec<WeaveLattice> = Vec::new();
    for axis in [0, 1] {
        for &thread in threads.iter().filter(|f| may_be_thread(**f, axis)) {
            for repeat in &repeats {
                for wave in waves_of(*repeat) {
                    let [own, other] = [wave[axis], wave[1 - axis]];
                    if other == 0.0 {
                        continue;
                    }
                    for &peak in &strongest {
                        let beside = (peak - own * thread) / other;
                        let frequency = match axis {
                            0 => [thread, beside],
                            _ => [beside, thread],
                        };
                        if suits(beside, 1 - axis, frequency) {
                            list.push(WeaveLattice::new(frequency, *repeat, seen));
                        }
                    }
                }
            }
        }
    }
    list.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<WeaveLattice> = Vec::new();
    for guess in list {
        let same = |k: &&WeaveLattice| {
            let [a, b] = [0, 1].map(|i| k.frequency[i].distance(guess.frequency[i]));
            k.repeat == guess.repeat && a.max(b) < NEAR
        };
        if !kept.iter().any(|k| same(&k)) {
            kept.push(guess);
        }
        if kept.len() == KEPT {
            break;
        }
    }
    let mut kept: Vec<WeaveLattice> = kept
        .into_iter()
        .map(|k| k.refined(seen).refined(seen))
        .collect();
    kept.sort_by(|a, b| b.score.total_cmp(&a.score));
    kept
}

fn suits(beside: DVec2, axis: usize, frequency: [DVec2; 2]) -> bool {
    let ratio = frequency[0].length() / frequency[1].length();
    let [a, b] = [0, 1].map(|k| lean_deg(frequency[k], k));
    may_be_thread(beside, axis)
        && (a - b).abs() < MAX_SKEW_DEG
        && (1.0 / MAX_RATIO..MAX_RATIO).contains(&ratio)
}

/// Waves of a repeat of less than a thread, in cycles per end and pick.
fn waves_of(repeat: Repeat) -> Vec<DVec2> {
    let Repeat { ends, shift, picks } = repeat;
    let mut list = Vec::new();
    for k in -(ends as i64)..=ends as i64 {
        let u = k as f64 / ends as f64;
        let first = -(shift as f64) * u;
        for j in -(2 * picks as i64 + shift as i64)..=2 * picks as i64 + shift as i64 {
            let v = (first + j as f64) / picks as f64;
            if v.abs() <= 1.0 && (u, v) != (0.0, 0.0) {
                list.push(DVec2::new(u, v));
            }
        }
    }
    list
}
