//! Centrelines of woven yarns: the heights that cost the least strain and
//! collision energy [Montazeri2020, section 3.1].
//!
//! Every yarn is a periodic C1 cubic with a knot at each crossing and one knot between
//! neighbouring crossings; its strain energy is `k/2` times the integral of the squared slope.
//! Given the heights at crossings, the best slopes and the best knots between have a closed
//! form (see [`Strain`]), so that only the heights at crossings are left to find. Crossing
//! yarns repel each other as soft spheres do, which makes the total energy convex: there is one
//! minimum, and L-BFGS finds it.

mod heights;

use crate::layers::Stacked;
use crate::path::Hermite;
use crate::{Draft, Error};
use argmin::core::{CostFunction, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use heights::Heights;
use rayon::prelude::*;
use std::sync::Arc;

/// Where the threads of one system lie and how they meet the others.
#[derive(Clone, Debug)]
pub(crate) struct System {
    /// Centre of each thread across the system, growing, millimetres.
    pub position_mm: Vec<f64>,
    /// Length after which the system repeats.
    pub period_mm: f64,
    /// Half the height of each thread's cross-section, millimetres.
    pub half_height_mm: Vec<f64>,
    /// Resistance to crimp.
    pub stiffness: Vec<f64>,
    /// Threads of the system that lie over others of it.
    pub stacked: Vec<Stacked>,
}

/// Heights of warp and weft yarns at rest.
#[derive(Clone, Debug)]
pub(crate) struct Relaxed {
    pub warp: Vec<Hermite>,
    pub weft: Vec<Hermite>,
    /// Largest overlap of two threads, as a share of the sum of their radii.
    pub compression: f64,
    /// Force with which threads press on each other at the crossings, by end, then pick: 1
    /// where it is at least the mean of all that touch.
    pub pressure: Vec<f64>,
}

/// Stiffness of a contact in units of `k S^2 / D` (softer yarn, size of the
/// soft spheres, spacing): stiffer contacts deviate less from touching where forces
/// differ, and take more iterations.
const CONTACT: f64 = 10.0;
/// Force that draws stacked threads together at each crossing, in the same units: small beside
/// those at crossings, which are of order one, but enough to close the gap between layers that
/// nothing else joins.
const PULL: f64 = 0.02;
/// Forces in a plain weave press soft spheres to `(2 C / (2 C + 9/4))^(1/4)` of their size,
/// whatever its scale: from `9/4 q = 2 C (q^-3 - q)`. Spheres are larger than the yarns by this
/// factor, so that yarns at rest touch.
const REST: f64 = 0.973_699;
/// Where crossing threads are nearer than this share of their radii, the
/// minimiser has failed.
const MIN_GAP: f64 = 0.9;
/// Root mean square of the gradient at rest, in units of the mean `k S^2 / D`
/// per `S`; forces at crossings are of order one.
const TOLERANCE: f64 = 1e-3;

/// Number of crossings per parallel task.
const MIN_CROSSINGS_PER_TASK: usize = 8192;

/// Finds the heights at rest. On one side of threads that do not interlace nothing holds them;
/// they stay where they touch. `touching_mm` gives the distance between the centres of an end and a
/// pick at which they touch, if it is not the sum of half their heights.
pub(crate) fn relax(
    draft: &Draft,
    warp: &System,
    weft: &System,
    touching_mm: Option<&[f64]>,
    max_iterations: u64,
) -> Result<Relaxed, Error> {
    let problem = Weave::new(draft, warp, weft, touching_mm);
    let start = problem.start();
    let count = start.len() as f64;
    let failed = |e: argmin::core::Error| Error::Relaxation(e.to_string());
    let search = MoreThuenteLineSearch::new()
        .with_c(1e-4, 0.9)
        .map_err(failed)?;
    let solver = LBFGS::new(search, 5)
        .with_tolerance_grad(TOLERANCE * count.sqrt())
        .map_err(failed)?
        .with_tolerance_cost(0.0)
        .map_err(failed)?;
    let result = Executor::new(&problem, solver)
        .configure(|state| {
            state
                .param(Heights(start.clone()))
                .max_iters(max_iterations)
        })
        .run()
        .map_err(failed)?;
    let heights = result.state().get_best_param().map_or(&start, |h| &h.0);
    if heights.iter().any(|h| !h.is_finite()) {
        return Err(Error::Relaxation("heights are not finite".to_owned()));
    }
    problem.relaxed(heights)
}

/// The closed form of the strain of a periodic cubic with knots at crossings
/// `s_i` and halfway between.
///
/// With `D_i = s_(i+1) - s_i` and `d_i = h_(i+1) - h_i`, minimising the sum of
/// the exact segment energies over the halfway knots leaves `9/8 d^2 / D - d
/// (a0 + a1) / 8 + D (a0^2 + a1^2) / 16` per interval, in which the slopes at
/// crossings no longer meet; each is best at the slope of the chord between
/// its neighbours, `a_i = (d_(i-1) + d_i) / (D_(i-1) + D_i)`.
#[derive(Clone, Debug)]
struct Strain {
    /// Knots of all yarns of a system.
    knots_mm: Arc<[f64]>,
    /// `9/8 / D_i`.
    chord: Vec<f64>,
    /// `1 / (16 (D_(i-1) + D_i))`.
    slope: Vec<f64>,
}

impl Strain {
    /// For yarns that cross the threads of `crossed`.
    fn new(crossed: &System) -> Strain {
        let x = &crossed.position_mm;
        let n = x.len();
        let mut knots = Vec::with_capacity(2 * n + 1);
        for (i, &a) in x.iter().enumerate() {
            let b = x.get(i + 1).copied().unwrap_or(x[0] + crossed.period_mm);
            knots.extend([a, 0.5 * (a + b)]);
        }
        knots.push(x[0] + crossed.period_mm);
        let interval = |i: usize| knots[2 * i + 2] - knots[2 * i];
        Strain {
            chord: (0..n).map(|i| 1.125 / interval(i)).collect(),
            slope: (0..n)
                .map(|i| 1.0 / (16.0 * (interval((i + n - 1) % n) + interval(i))))
                .collect(),
            knots_mm: knots.into(),
        }
    }

    /// `scale` times the integral of the squared slope, and its gradient added
    /// to `gradient`.
    fn add(&self, h: &[f64], scale: f64, gradient: &mut [f64]) -> f64 {
        let n = h.len();
        let mut energy = 0.0;
        let (mut before, mut i) = (n - 1, 0);
        for after in (1..n).chain([0]) {
            let chord = h[after] - h[i];
            let across = h[after] - h[before];
            let c = self.chord[i] * chord;
            let a = self.slope[i] * across;
            energy += c * chord - a * across;
            gradient[after] += 2.0 * scale * (c - a);
            gradient[i] -= 2.0 * scale * c;
            gradient[before] += 2.0 * scale * a;
            (before, i) = (i, after);
        }
        scale * energy
    }

    /// The curve with the given heights at its crossings.
    fn curve(&self, h: &[f64]) -> Hermite {
        let n = h.len();
        let width = |i: usize| self.knots_mm[2 * i + 2] - self.knots_mm[2 * i];
        let slope: Vec<f64> = (0..n)
            .map(|i| {
                let before = (i + n - 1) % n;
                (h[(i + 1) % n] - h[before]) / (width(before) + width(i))
            })
            .collect();
        let mut curve = Hermite {
            knots_mm: self.knots_mm.clone(),
            height_mm: Vec::with_capacity(2 * n),
            slope: Vec::with_capacity(2 * n),
        };
        for i in 0..n {
            let after = (i + 1) % n;
            let (a0, a1, half) = (slope[i], slope[after], 0.5 * width(i));
            let halfway = 0.5 * (h[i] + h[after]) + half * (a0 - a1) / 24.0;
            curve.height_mm.extend([h[i], halfway]);
            curve
                .slope
                .extend([a0, (3.0 * (h[after] - h[i]) / half + a0 + a1) / 8.0]);
        }
        curve
    }
}

/// Soft spheres: `1/q^2 + q^2 - 2` of the gap `q` in units of the radii, zero from 1 on
/// [Kaldor2008]; and its derivative. Below one half the potential continues as its second-order
/// expansion, so that the energy stays finite and convex whatever a line search tries; a
/// solution must not lie there.
fn contact(q: f64) -> (f64, f64) {
    const EDGE: f64 = 0.5;
    if q >= 1.0 {
        return (0.0, 0.0);
    }
    let at = |q: f64| {
        (
            1.0 / (q * q) + q * q - 2.0,
            2.0 * q - 2.0 / (q * q * q),
            2.0 + 6.0 / (q * q * q * q),
        )
    };
    if q >= EDGE {
        let (value, slope, _) = at(q);
        return (value, slope);
    }
    let ((value, slope, bend), away) = (at(EDGE), q - EDGE);
    (
        value + away * (slope + 0.5 * bend * away),
        slope + bend * away,
    )
}

/// The energy of a weave. The parameters are the heights of every warp yarn
/// at its crossings, then those of every weft yarn, in units of `length_mm`;
/// energies are in units of length^2 over the mean spacing.
struct Weave<'a> {
    draft: &'a Draft,
    warp: Side<'a>,
    weft: Side<'a>,
    /// Mean sum of radii at a crossing.
    length_mm: f64,
}

/// One system in the energy.
struct Side<'a> {
    system: &'a System,
    strain: Strain,
    /// Of each crossing, thread by thread: the inverse size of the soft
    /// spheres, negative where the thread lies below.
    per_gap: Vec<f64>,
    /// Half the stiffness of each thread in the units of the energy.
    scale: Vec<f64>,
    /// For each thread, those of its own system that lie over or under it.
    stacked: Vec<Vec<Over>>,
}

/// A thread over or under a first one of its system.
struct Over {
    thread: usize,
    /// 1 where it lies under the first, -1 where over it, 0 where they change places.
    order: Vec<i8>,
    /// Size of the soft spheres; 0 where the two pass beside each other.
    size: Vec<f64>,
    /// By how much less than their size they are apart, since neither lies straight over the
    /// other.
    nearer: Vec<f64>,
}

impl Over {
    /// The lists of a system's threads.
    fn of_threads(system: &System, length_mm: f64) -> Vec<Vec<Over>> {
        let mut all: Vec<Vec<Over>> = system.position_mm.iter().map(|_| Vec::new()).collect();
        for pair in &system.stacked {
            let [a, b] = pair.threads;
            for (own, thread, sign) in [(a, b, 1), (b, a, -1)] {
                let size = |(apart_mm, above_mm): (&f64, &f64)| match *apart_mm > 0.0 {
                    true => above_mm / (length_mm * REST),
                    false => 0.0,
                };
                let nearer = |(apart_mm, above_mm): (&f64, &f64)| (above_mm - apart_mm) / length_mm;
                let places = || pair.apart_mm.iter().zip(&pair.above_mm);
                all[own].push(Over {
                    thread,
                    order: pair.order.iter().map(|o| sign * o).collect(),
                    size: places().map(size).collect(),
                    nearer: places().map(nearer).collect(),
                });
            }
        }
        all
    }

    /// Energy of the pair of threads, of which half is counted for each; the gradient for the
    /// first is added.
    fn add(&self, softer: f64, own: &[f64], other: &[f64], gradient: &mut [f64]) -> f64 {
        let mut energy = 0.0;
        for (c, order) in self.order.iter().enumerate() {
            let (size, order) = (self.size[c], f64::from(*order));
            // Nothing would end the pull of two that pass beside each other.
            if order == 0.0 || size == 0.0 {
                continue;
            }
            let gap = order * (own[c] - other[c]);
            energy += PULL * softer * gap;
            gradient[c] += PULL * softer * order;
            let apart = gap + self.nearer[c];
            if apart < size {
                let scale = CONTACT * softer * size * size;
                let (value, slope) = contact(apart / size);
                energy += scale * value;
                gradient[c] += scale * slope * order / size;
            }
        }
        0.5 * energy
    }
}

impl<'a> Weave<'a> {
    fn new(
        draft: &'a Draft,
        warp: &'a System,
        weft: &'a System,
        touching_mm: Option<&[f64]>,
    ) -> Weave<'a> {
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let length_mm = mean(&warp.half_height_mm) + mean(&weft.half_height_mm);
        let spacing = |s: &System| s.period_mm / s.position_mm.len() as f64;
        let spacing_mm = 0.5 * (spacing(warp) + spacing(weft));
        let picks = draft.picks();
        let of_warp = |e: usize, p: usize| match touching_mm {
            Some(all) => all[e * picks + p],
            None => warp.half_height_mm[e] + weft.half_height_mm[p],
        };
        type OfCrossing<'f, T> = &'f dyn Fn(usize, usize) -> T;
        let side = |own: &'a System,
                    other: &System,
                    above: OfCrossing<bool>,
                    touching_mm: OfCrossing<f64>| {
            let (threads, crossings) = (own.position_mm.len(), other.position_mm.len());
            let per_gap = |i: usize, j: usize| {
                let size = touching_mm(i, j) / (length_mm * REST);
                if above(i, j) { 1.0 / size } else { -1.0 / size }
            };
            Side {
                strain: Strain::new(other),
                per_gap: (0..threads)
                    .flat_map(|i| (0..crossings).map(move |j| (i, j)))
                    .map(|(i, j)| per_gap(i, j))
                    .collect(),
                scale: own.stiffness.iter().map(|k| 0.5 * k * spacing_mm).collect(),
                stacked: Over::of_threads(own, length_mm),
                system: own,
            }
        };
        Weave {
            draft,
            warp: side(warp, weft, &|e, p| draft.warp_up(e, p), &of_warp),
            weft: side(weft, warp, &|p, e| !draft.warp_up(e, p), &|p, e| {
                of_warp(e, p)
            }),
            length_mm,
        }
    }

    /// Yarns touch at every crossing, and each yarn makes half of the displacement.
    fn start(&self) -> Vec<f64> {
        let gaps = self.warp.per_gap.iter().chain(&self.weft.per_gap);
        gaps.map(|g| 0.5 * REST / g).collect()
    }

    /// The energy of thread `i` of `side`, whose threads have the heights `all`, and its gradient
    /// with respect to the thread's own. The threads that it crosses have the heights `others`,
    /// thread by thread; half the energy of a contact is counted for each of its two threads.
    fn thread(
        &self,
        side: &Side,
        other: &Side,
        i: usize,
        all: &[f64],
        others: &[f64],
        gradient: &mut [f64],
    ) -> f64 {
        let threads = side.scale.len();
        let crossings = gradient.len();
        let heights = |i: usize| &all[i * crossings..][..crossings];
        let own = heights(i);
        let per_gap = &side.per_gap[i * own.len()..][..own.len()];
        let mut energy = side.strain.add(own, side.scale[i], gradient);
        for (j, (h, per_gap)) in own.iter().zip(per_gap).enumerate() {
            let q = per_gap * (h - others[j * threads + i]);
            if q < 1.0 {
                let softer = side.system.stiffness[i].min(other.system.stiffness[j]);
                let scale = CONTACT * softer / (per_gap * per_gap);
                let (value, slope) = contact(q);
                energy += 0.5 * scale * value;
                gradient[j] += scale * slope * per_gap;
            }
        }
        let stiffness = &side.system.stiffness;
        for over in &side.stacked[i] {
            let softer = stiffness[i].min(stiffness[over.thread]);
            energy += over.add(softer, own, heights(over.thread), gradient);
        }
        energy
    }

    /// Threads are evaluated in parallel, and their energies are added in the order of the
    /// threads.
    fn energy(&self, h: &[f64], gradient: &mut [f64]) -> f64 {
        let (ends, picks) = (self.draft.ends(), self.draft.picks());
        let (warp, weft) = h.split_at(ends * picks);
        let (warp_gradient, weft_gradient) = gradient.split_at_mut(ends * picks);
        let system = |side, other, all: &[f64], others: &[f64], gradient: &mut [f64], n: usize| {
            let threads = gradient.par_chunks_mut(n).enumerate();
            let energies: Vec<f64> = threads
                .with_min_len(1 + MIN_CROSSINGS_PER_TASK / n)
                .map(|(i, gradient)| {
                    gradient.fill(0.0);
                    self.thread(side, other, i, all, others, gradient)
                })
                .collect();
            energies.iter().sum::<f64>()
        };
        system(&self.warp, &self.weft, warp, weft, warp_gradient, picks)
            + system(&self.weft, &self.warp, weft, warp, weft_gradient, ends)
    }

    /// The energy, for the minimiser, whose searches do not end where it has no bound.
    fn finite_energy(&self, h: &Heights, gradient: &mut [f64]) -> Result<f64, argmin::core::Error> {
        let energy = self.energy(&h.0, gradient);
        if !energy.is_finite() {
            return Err(argmin::core::Error::msg("the energy is not finite"));
        }
        Ok(energy)
    }

    /// Gap of a crossing in units of the sum of the radii.
    fn gap(&self, h: &[f64], e: usize, p: usize) -> f64 {
        let (ends, picks) = (self.draft.ends(), self.draft.picks());
        let difference = h[e * picks + p] - h[ends * picks + p * ends + e];
        self.warp.per_gap[e * picks + p] * difference / REST
    }

    /// The largest overlap of stacked threads, as a share of the sum of their radii.
    fn stacked_compression(&self, h: &[f64]) -> f64 {
        let (ends, picks) = (self.draft.ends(), self.draft.picks());
        let (warp, weft) = h.split_at(ends * picks);
        let mut most = 0.0f64;
        for (side, h, n) in [(&self.warp, warp, picks), (&self.weft, weft, ends)] {
            for (i, over) in side.stacked.iter().enumerate() {
                for over in over {
                    for c in (0..n).filter(|c| over.size[*c] > 0.0 && over.order[*c] != 0) {
                        let gap =
                            f64::from(over.order[c]) * (h[i * n + c] - h[over.thread * n + c]);
                        most = most.max(1.0 - (gap + over.nearer[c]) / (over.size[c] * REST));
                    }
                }
            }
        }
        most
    }

    /// See [`Relaxed::pressure`].
    fn pressure(&self, h: &[f64]) -> Vec<f64> {
        let (ends, picks) = (self.draft.ends(), self.draft.picks());
        let force = |c: usize| {
            let (e, p) = (c / picks, c % picks);
            let (_, slope) = contact(REST * self.gap(h, e, p));
            let (warp, weft) = (self.warp.system.stiffness[e], self.weft.system.stiffness[p]);
            warp.min(weft) * slope.abs() / self.warp.per_gap[c].abs()
        };
        let forces: Vec<f64> = (0..ends * picks).map(force).collect();
        let touching = forces.iter().filter(|f| **f > 0.0);
        let mean = touching.clone().sum::<f64>() / touching.count().max(1) as f64;
        let share = |f: f64| if mean > 0.0 { (f / mean).min(1.0) } else { 0.0 };
        forces.into_iter().map(share).collect()
    }

    /// Curves in millimetres, the cloth's middle at height zero.
    fn relaxed(&self, h: &[f64]) -> Result<Relaxed, Error> {
        let (ends, picks) = (self.draft.ends(), self.draft.picks());
        let mut compression = self.stacked_compression(h);
        for e in 0..ends {
            for p in 0..picks {
                compression = compression.max(1.0 - self.gap(h, e, p));
            }
        }
        if compression > 1.0 - MIN_GAP {
            return Err(Error::Relaxation(format!(
                "threads rest {:.0} % inside each other; more iterations may help",
                100.0 * compression
            )));
        }
        let mm: Vec<f64> = h.iter().map(|v| v * self.length_mm).collect();
        let (warp, weft) = mm.split_at(ends * picks);
        let mut relaxed = Relaxed {
            warp: warp
                .chunks(picks)
                .map(|h| self.warp.strain.curve(h))
                .collect(),
            weft: weft
                .chunks(ends)
                .map(|h| self.weft.strain.curve(h))
                .collect(),
            compression,
            pressure: self.pressure(h),
        };
        let all = relaxed.warp.iter_mut().chain(&mut relaxed.weft);
        let middle = 0.5
            * (mm.iter().copied().fold(f64::INFINITY, f64::min)
                + mm.iter().copied().fold(f64::NEG_INFINITY, f64::max));
        for h in all.flat_map(|c| &mut c.height_mm) {
            *h -= middle;
        }
        Ok(relaxed)
    }
}

impl CostFunction for &Weave<'_> {
    type Param = Heights;
    type Output = f64;

    fn cost(&self, h: &Heights) -> Result<f64, argmin::core::Error> {
        self.finite_energy(h, &mut vec![0.0; h.0.len()])
    }
}

impl Gradient for &Weave<'_> {
    type Param = Heights;
    type Gradient = Heights;

    fn gradient(&self, h: &Heights) -> Result<Heights, argmin::core::Error> {
        let mut gradient = vec![0.0; h.0.len()];
        self.finite_energy(h, &mut gradient)?;
        Ok(Heights(gradient))
    }
}

#[cfg(test)]
mod tests;
