//! Photographs whose threads are straightened and whose light is evened: wrinkles move threads about,
//! which the phases of two waves of the weave show.

use crate::photograph::box_mean;
use crate::weave_lattice::{PEAKS, Wave};
use crate::{Photograph, PhotographError, Spectrum, ThreadGrid, WeaveLattice};
use glam::{DMat2, DVec2};
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

/// Pixels between places whose phase is found.
const STEP: usize = 8;
/// Pixels from thread to thread below which single threads are not seen.
pub const FINE_PX: f64 = 5.0;
/// Pixels from thread to thread in a straightened photograph, of the finer system.
const PIXELS: f64 = 6.0;
/// Sides of the part that is straightened, and of the straightened one, pixels, at most: more shows
/// no other weave.
const MAX_PART: usize = 1280;
const MAX_SIDE: f64 = 2560.0;
/// Share of the sides that is kept: borders have threads that no phase is known of.
const KEPT: f64 = 0.96;
/// Radius of the squares in which light is even, repeats.
const EVEN_REPEATS: f64 = 2.0;
/// Least sine of the angle between two waves that tell both coordinates, and the least strength of the
/// fainter one, as a multiple of the noise.
const MIN_SINE: f64 = 0.3;
const MIN_STRENGTH: f64 = 8.0;

/// Photographs of one cloth whose crossings lie on one regular grid.
#[derive(Clone, Debug)]
pub struct Straightened {
    /// The photographs, in the order given.
    pub photographs: Vec<Photograph>,
    /// Where the threads lie in each of them, but for a shift by part of a repeat.
    pub grid: ThreadGrid,
    /// The lattice in the first photograph as it was.
    pub lattice: WeaveLattice,
    /// Width and height of the straightened photographs as shares of the first one.
    pub share: DVec2,
}

/// Finds the weave in photographs of one cloth, the face first, and straightens them if its threads
/// have fewer than `fine_px` pixels, as [`FINE_PX`]; `None` if these are seen one by one. Each may have
/// a scale of its own.
///
/// # Errors
/// No weave explains the spectrum.
pub fn straightened(
    photographs: &[&Photograph],
    fine_px: f64,
) -> Result<Option<Straightened>, PhotographError> {
    let whole = photographs.first().map_or([1; 2], |p| p.size());
    let photographs: Vec<Photograph> = photographs.iter().map(|p| p.middle(MAX_PART)).collect();
    let spectra_of = |small: bool| -> Vec<Spectrum> {
        let local = |p: &Photograph| Spectrum::local(p, small);
        photographs.iter().map(local).collect()
    };
    let mut spectra = spectra_of(false);
    let mut found = WeaveLattice::find(&spectra).into_iter().next();
    if found.is_none() {
        spectra = spectra_of(true);
        found = WeaveLattice::find(&spectra).into_iter().next();
    }
    let nothing = || PhotographError::NoThreads {
        seen: match spectra.first().and_then(|s| s.peaks(1).first().copied()) {
            Some(peak) => format!(
                "the strongest wave, of {:.1} pixels, is {:.1} times the noise; with those beside it it \
                 makes no weave",
                1.0 / peak.frequency.length(),
                peak.strength
            ),
            None => "no wave stands out of the noise".to_owned(),
        },
    };
    let lattices = found.ok_or_else(nothing)?;
    let is_fine = |f: DVec2| f.length() * fine_px > 1.0;
    if !lattices
        .iter()
        .take(1)
        .any(|l| l.frequency.into_iter().any(is_fine))
    {
        return Ok(None);
    }
    let fields: Option<Vec<Field>> = photographs
        .iter()
        .zip(&lattices)
        .zip(&spectra)
        .map(|((photograph, lattice), spectrum)| Field::new(photograph, lattice, spectrum))
        .collect();
    let fields = fields.ok_or_else(nothing)?;
    let (Some(first), Some(lattice)) = (fields.first(), lattices.first()) else {
        return Err(nothing());
    };
    let [w, h] = photographs[0].size();
    let size = DVec2::new(w as f64, h as f64);
    // What all photographs show: those from nearer show fewer threads.
    let shown = |f: &Field| f.threads.determinant().abs().sqrt();
    let nearest = fields.iter().map(shown).fold(f64::INFINITY, f64::min);
    let finest = first
        .frequency()
        .iter()
        .map(|f| f.length())
        .fold(0.0, f64::max);
    let scale = (PIXELS * finest).max(1.0);
    let out = size * (KEPT * (nearest / shown(first)).min(1.0) * scale);
    let out = out.min(DVec2::splat(MAX_SIDE)).floor();
    let (columns, rows) = (out.x as usize, out.y as usize);
    let straight = fields.iter().zip(&photographs).map(|(field, photograph)| {
        // The threads in the middle are taken for the same.
        let by = field.thread_at_middle - first.thread_at_middle;
        let pixels: Vec<[f32; 3]> = (0..rows)
            .rev()
            .flat_map(|y| (0..columns).map(move |x| (x, y)))
            .map(|(x, y)| {
                let from_middle = (DVec2::new(x as f64, y as f64) + 0.5 - 0.5 * out) / scale;
                let thread = first.thread_at_middle + first.threads * from_middle + by;
                photograph.between(field.place(thread))
            })
            .collect();
        let straight = Photograph::new(columns, rows, &pixels)?;
        let [f, g] = first.frequency().map(|f| f.length());
        let threads = lattice.repeat.ends.max(lattice.repeat.all_picks()) as f64;
        let radius = EVEN_REPEATS * threads * scale / f.min(g);
        Ok(straight.evened(radius as usize))
    });
    let straight: Vec<Photograph> = straight.collect::<Result<_, PhotographError>>()?;
    let frequency = first.frequency().map(|f| f / scale);
    let columns = DMat2::from_cols(frequency[0], frequency[1]).transpose();
    let middle = 0.5 * out - 0.5;
    Ok(Some(Straightened {
        photographs: straight,
        grid: ThreadGrid {
            frequency,
            origin: middle - columns.inverse() * first.thread_at_middle,
        },
        lattice: *lattice,
        share: out / scale / DVec2::new(whole[0] as f64, whole[1] as f64),
    }))
}

/// Thread coordinates all over a photograph.
struct Field {
    /// From places, pixels, to thread coordinates, in the mean.
    threads: DMat2,
    middle: DVec2,
    thread_at_middle: DVec2,
    /// By how much threads are moved from where they are in the mean, pixels, at nodes.
    moved: Vec<DVec2>,
    nodes: [usize; 2],
}

impl Field {
    /// `None` if no two waves of the lattice stand out.
    fn new(photograph: &Photograph, lattice: &WeaveLattice, spectrum: &Spectrum) -> Option<Field> {
        let peaks = spectrum.peaks(PEAKS);
        let waves = lattice.waves(&peaks);
        let first = *waves.first()?;
        let sine = |w: &Wave| {
            let cross = first.of_threads.perp_dot(w.of_threads);
            cross.abs() / (first.of_threads.length() * w.of_threads.length())
        };
        let second = waves.iter().find(|w| sine(w) > MIN_SINE);
        let second = *second.filter(|w| w.strength > MIN_STRENGTH)?;
        let shortest = |w: &[Wave]| {
            let lengths = w.iter().map(|w| w.frequency.length());
            lengths.fold(f64::INFINITY, f64::min)
        };
        // Far narrower in frequency than the distance between waves.
        let radius = (1.0 / shortest(&waves).max(0.03)).round() as usize;
        let contrast = photograph.contrast();
        let nodes = photograph.size().map(|n| n.div_ceil(STEP) + 1);
        let phases = [first, second].map(|wave| {
            let found = demodulated(photograph, &contrast, wave.frequency, radius, nodes);
            unwrapped(&found, nodes)
        });
        let to_threads = DMat2::from_cols(first.of_threads, second.of_threads)
            .transpose()
            .inverse();
        let place =
            |k: usize| DVec2::new((k % nodes[0]) as f64, (k / nodes[0]) as f64) * STEP as f64;
        let cycles = |k: usize| {
            let of = |i: usize, wave: Wave| wave.frequency.dot(place(k)) + phases[i][k].0;
            DVec2::new(of(0, first), of(1, second))
        };
        let thread: Vec<DVec2> = (0..nodes[0] * nodes[1])
            .map(|k| to_threads * cycles(k))
            .collect();
        let weight = |k: usize| phases[0][k].1.min(phases[1][k].1).max(1e-12);
        // The plane through them.
        let total: f64 = (0..thread.len()).map(weight).sum();
        let mean = |f: &dyn Fn(usize) -> DVec2| {
            (0..thread.len()).map(|k| weight(k) * f(k)).sum::<DVec2>() / total
        };
        let (place_mean, thread_mean) = (mean(&place), mean(&|k| thread[k]));
        let outer = |a: DVec2, b: DVec2| DMat2::from_cols(a * b.x, a * b.y);
        let (mut left, mut right) = (DMat2::ZERO, DMat2::ZERO);
        for (k, t) in thread.iter().enumerate() {
            let from = place(k) - place_mean;
            left += weight(k) * outer(from, from);
            right += weight(k) * outer(t - thread_mean, from);
        }
        let threads = right * left.inverse();
        let back = threads.inverse();
        if !back.is_finite() {
            return None;
        }
        let moved = (0..thread.len())
            .map(|k| back * (thread[k] - thread_mean) - (place(k) - place_mean))
            .collect();
        let [w, h] = photograph.size();
        let middle = DVec2::new(w as f64, h as f64) * 0.5 - 0.5;
        Some(Field {
            threads,
            middle,
            thread_at_middle: thread_mean + threads * (middle - place_mean),
            moved,
            nodes,
        })
    }

    /// Threads per pixel across the warp and across the weft, in the mean.
    fn frequency(&self) -> [DVec2; 2] {
        [self.threads.row(0), self.threads.row(1)]
    }

    fn moved_at(&self, place: DVec2) -> DVec2 {
        let last = DVec2::new((self.nodes[0] - 1) as f64, (self.nodes[1] - 1) as f64);
        let at = (place / STEP as f64).clamp(DVec2::ZERO, last - 1e-6);
        let low = at.floor();
        let share = at - low;
        let node = |dx: usize, dy: usize| {
            self.moved[(low.y as usize + dy) * self.nodes[0] + low.x as usize + dx]
        };
        node(0, 0)
            .lerp(node(1, 0), share.x)
            .lerp(node(0, 1).lerp(node(1, 1), share.x), share.y)
    }

    /// The place of thread coordinates.
    fn place(&self, thread: DVec2) -> DVec2 {
        let mean = self.middle + self.threads.inverse() * (thread - self.thread_at_middle);
        (0..4).fold(mean, |place, _| mean - self.moved_at(place))
    }
}

/// The wave of a frequency around each node: real and imaginary part of its amplitude.
fn demodulated(
    photograph: &Photograph,
    contrast: &[f64],
    frequency: DVec2,
    radius: usize,
    nodes: [usize; 2],
) -> Vec<DVec2> {
    let [w, h] = photograph.size();
    let turned = |part: fn(f64) -> f64| -> Vec<f64> {
        let mut values: Vec<f64> = (0..w * h)
            .map(|i| {
                let place = DVec2::new((i % w) as f64, (i / w) as f64);
                contrast[i] * part(-TAU * frequency.dot(place))
            })
            .collect();
        for _ in 0..2 {
            values = box_mean(&values, w, h, radius);
        }
        values
    };
    let (re, im) = (turned(f64::cos), turned(f64::sin));
    let node = |k: usize| {
        let x = (k % nodes[0] * STEP).min(w - 1);
        let y = (k / nodes[0] * STEP).min(h - 1);
        DVec2::new(re[y * w + x], im[y * w + x])
    };
    (0..nodes[0] * nodes[1]).map(node).collect()
}

/// Phases, cycles, that change by less than half a cycle from node to node where the wave is
/// strong, and amplitudes. Nodes follow their strongest neighbour.
fn unwrapped(waves: &[DVec2], [nx, ny]: [usize; 2]) -> Vec<(f64, f64)> {
    let mut list: Vec<(f64, f64)> = waves
        .iter()
        .map(|w| (w.y.atan2(w.x) / TAU, w.length()))
        .collect();
    let order = |amplitude: f64| amplitude.to_bits();
    let mut is_done = vec![false; list.len()];
    let first = (0..list.len()).max_by(|a, b| list[*a].1.total_cmp(&list[*b].1));
    let mut open: BinaryHeap<(u64, usize, usize)> = first.map(|k| (0, k, k)).into_iter().collect();
    while let Some((_, k, from)) = open.pop() {
        if std::mem::replace(&mut is_done[k], true) {
            continue;
        }
        let near = list[from].0;
        list[k].0 += (near - list[k].0).round();
        let (x, y) = (k % nx, k / nx);
        let beside = [
            (x > 0).then(|| k - 1),
            (x + 1 < nx).then(|| k + 1),
            (y > 0).then(|| k - nx),
            (y + 1 < ny).then(|| k + nx),
        ];
        for next in beside.into_iter().flatten().filter(|n| !is_done[*n]) {
            open.push((order(list[next].1), next, k));
        }
    }
    list
}
