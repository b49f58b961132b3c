//! Threads of a weave that are flattened where others press on them, and rest on each other's
//! surfaces.

use super::lean;
use crate::fit::{Fit, Threads};
use crate::layers::{Sheds, Stacked};
use crate::path::{Hermite, Path};
use crate::relax::{Relaxed, System, relax};
use crate::section::{Pressed, ThreadSection};
use crate::sway::Sway;
use crate::{Draft, Error};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Samples of a thread's surface per crossing.
const SAMPLES: usize = 8;
/// Steps between knots of a curve along which a section is sampled.
const STEPS: usize = 8;
/// Threads are moved apart at most so many times where they share room, by this share of the
/// depth to which they do, since one that is moved up also bends more.
const MOVES: usize = 10;
const MOVE: f64 = 0.8;
/// The largest distance of touching threads, as a multiple of half their heights together.
const FARTHEST: f64 = 1.4;
/// Depth that is left, as a share of the distance of touching threads.
const DEPTH_LEFT: f64 = 0.005;

/// The threads of a weave at rest, with their sections.
pub(super) struct AtRest {
    pub relaxed: Relaxed,
    pub warp: Vec<ThreadSection>,
    pub weft: Vec<ThreadSection>,
}

/// Brings threads to rest. If they flatten, the forces between threads of even section show
/// where they do. Then all rest again at distances at which their surfaces touch: an elliptic
/// thread touches one that bends over it beside the highest point, so that these distances are
/// found by measuring how deep threads lie in each other.
pub(super) fn at_rest(
    draft: &Draft,
    [warp, weft]: [&Threads; 2],
    [warp_system, weft_system]: [&mut System; 2],
    fitted: &Fit,
    sways: &[Vec<Sway>; 2],
    max_iterations: u64,
) -> Result<AtRest, Error> {
    let evenly = |_: usize, _: usize| 1.0;
    warp_system.stacked = stacked(Sheds::Warp(draft), warp, &fitted.warp, warp_system, &evenly);
    weft_system.stacked = stacked(Sheds::Weft(draft), weft, &fitted.weft, weft_system, &evenly);
    let (warp_system, weft_system) = (&*warp_system, &*weft_system);
    let even = relax(draft, warp_system, weft_system, None, max_iterations)?;
    let flattens = |t: &Threads| t.yarns.iter().any(|y| y.flattening.is_some());
    if !flattens(warp) && !flattens(weft) {
        let sections = |all: &[DVec2]| all.iter().copied().map(ThreadSection::even).collect();
        return Ok(AtRest {
            relaxed: even,
            warp: sections(&fitted.warp),
            weft: sections(&fitted.weft),
        });
    }
    let (ends, picks) = (draft.ends(), draft.picks());
    let on_weft: Vec<f64> = (0..picks)
        .flat_map(|p| (0..ends).map(move |e| e * picks + p))
        .map(|c| even.pressure[c])
        .collect();
    let warp = Side {
        threads: warp,
        flatten: &fitted.warp,
        crossed: weft_system,
        pressure: &even.pressure,
        reach_mm: reach_mm(weft, &fitted.weft),
    };
    let weft = Side {
        threads: weft,
        flatten: &fitted.weft,
        crossed: warp_system,
        pressure: &on_weft,
        reach_mm: reach_mm(warp.threads, &fitted.warp),
    };
    let crossing = |c: usize| (c / picks, c % picks);
    let (of_warp, of_weft) = (warp.factors(), weft.factors());
    let (of_warp, of_weft) = (warp.at_crossings(&of_warp), weft.at_crossings(&of_weft));
    let flat = |side: &Side<'_>, sheds, system: &System, factors: &[f64]| {
        let crossings = factors.len() / system.position_mm.len();
        let factor = |i: usize, c: usize| factors[i * crossings + c];
        System {
            stacked: stacked(sheds, side.threads, side.flatten, system, &factor),
            ..system.clone()
        }
    };
    let flat_warp = flat(&warp, Sheds::Warp(draft), warp_system, &of_warp);
    let flat_weft = flat(&weft, Sheds::Weft(draft), weft_system, &of_weft);
    let rest = |touching_mm: &[f64]| {
        relax(
            draft,
            &flat_warp,
            &flat_weft,
            Some(touching_mm),
            max_iterations,
        )
    };
    let mut touching_mm: Vec<f64> = (0..ends * picks)
        .map(crossing)
        .map(|(e, p)| {
            warp_system.half_height_mm[e] / of_warp[e * picks + p]
                + weft_system.half_height_mm[p] / of_weft[p * ends + e]
        })
        .collect();
    let mut relaxed = rest(&touching_mm)?;
    for _ in 0..MOVES {
        let (warp, weft) = (warp.surfaces(&relaxed.warp), weft.surfaces(&relaxed.weft));
        let depth_mm = |c: usize| {
            let (e, p) = crossing(c);
            let (warp, weft) = ((&warp[e], p), (&weft[p], e));
            if draft.warp_up(e, p) {
                depth_mm(warp, weft)
            } else {
                depth_mm(weft, warp)
            }
        };
        let depths_mm: Vec<f64> = (0..ends * picks).into_par_iter().map(depth_mm).collect();
        let mut deepest = 0.0f64;
        for (c, (touching_mm, depth_mm)) in touching_mm.iter_mut().zip(depths_mm).enumerate() {
            let (e, p) = crossing(c);
            let even_mm = warp_system.half_height_mm[e] + weft_system.half_height_mm[p];
            deepest = deepest.max(depth_mm / *touching_mm);
            let moved_mm = *touching_mm + MOVE * depth_mm.max(0.0);
            *touching_mm = moved_mm.min((*touching_mm).max(FARTHEST * even_mm));
        }
        if deepest < DEPTH_LEFT {
            break;
        }
        relaxed = rest(&touching_mm)?;
    }
    Ok(AtRest {
        warp: warp.sections(&relaxed.warp, DVec3::Y, &sways[0]),
        weft: weft.sections(&relaxed.weft, DVec3::X, &sways[1]),
        relaxed,
    })
}

/// The pairs of threads of a system that lie over each other, which are so many times wider at
/// their crossings than their even sections.
fn stacked(
    sheds: Sheds,
    threads: &Threads,
    flatten: &[DVec2],
    system: &System,
    widening: &dyn Fn(usize, usize) -> f64,
) -> Vec<Stacked> {
    let half_mm = |i: usize, c: usize| {
        let factor = widening(i, c);
        threads.yarns[i].radius_mm() * flatten[i] * DVec2::new(factor, factor.recip())
    };
    let position_mm = &system.position_mm;
    threads
        .layers
        .stacked(sheds, position_mm, system.period_mm, &half_mm)
}

/// One system of threads and what presses on it.
struct Side<'a> {
    threads: &'a Threads,
    flatten: &'a [DVec2],
    /// The threads that press on these.
    crossed: &'a System,
    /// By thread, then crossing.
    pressure: &'a [f64],
    /// How far the pressure of each crossing thread reaches.
    reach_mm: Vec<f64>,
}

impl Side<'_> {
    /// Factors on the width of each thread where it is pressed and where it is free. It becomes
    /// no wider than its space.
    fn factors(&self) -> Vec<[f64; 2]> {
        let each = self.threads.yarns.iter().zip(&self.threads.room_mm);
        each.zip(self.flatten)
            .map(|((yarn, room_mm), flatten)| {
                let Some(flattening) = yarn.flattening else {
                    return [1.0; 2];
                };
                let room = room_mm / (2.0 * yarn.radius_mm() * flatten.x);
                [flattening.crossing.min(room.max(1.0)), flattening.float]
            })
            .collect()
    }

    /// What presses on thread `i`, which has these factors.
    fn pressed(&self, i: usize, factors: [f64; 2]) -> Pressed<'_> {
        let crossings = self.crossed.position_mm.len();
        Pressed {
            crossing_mm: &self.crossed.position_mm,
            period_mm: self.crossed.period_mm,
            pressure: &self.pressure[i * crossings..][..crossings],
            reach_mm: &self.reach_mm,
            factors,
        }
    }

    /// Factors on the width at all crossings, by thread, then crossing.
    fn at_crossings(&self, factors: &[[f64; 2]]) -> Vec<f64> {
        let widening = |(i, &f)| self.pressed(i, f).widening(&self.crossed.position_mm);
        factors.iter().enumerate().flat_map(widening).collect()
    }

    fn sections(&self, curves: &[Hermite], axis: DVec3, sways: &[Sway]) -> Vec<ThreadSection> {
        let each = curves.iter().zip(self.factors()).enumerate();
        each.map(|(i, (curve, factors))| {
            let sway = sways.get(i);
            let path = Path::woven(curve, axis, DVec3::ZERO, STEPS, 0.0, sway);
            let knots = 0..curve.height_mm.len();
            let places = knots.flat_map(|k| (0..STEPS).map(move |i| (k, i as f64 / STEPS as f64)));
            let places = places.map(|(k, t)| curve.knots_mm[k] + t * curve.interval(k).0);
            let places_mm: Vec<f64> = places.chain(curve.knots_mm.last().copied()).collect();
            self.pressed(i, factors)
                .section(self.flatten[i], &path, &places_mm)
        })
        .collect()
    }

    fn surfaces(&self, curves: &[Hermite]) -> Vec<Surface> {
        let factors = self.factors();
        let period_mm = self.crossed.period_mm;
        let threads = self.threads.yarns.par_iter().zip(curves).enumerate();
        threads
            .map(|(i, (yarn, curve))| {
                let knots = curve.height_mm.len();
                let steps = (0..knots).flat_map(|k| (0..SAMPLES / 2).map(move |t| (k, t)));
                let steps = steps.map(|(k, t)| (k, t as f64 / (SAMPLES / 2) as f64));
                let (mut places_mm, mut course) = (Vec::new(), Vec::new());
                for (k, t) in steps {
                    places_mm.push(curve.knots_mm[k] + t * curve.interval(k).0);
                    course.push(curve.at(k, t));
                }
                let widening = self.pressed(i, factors[i]).widening(&places_mm);
                let half_mm = yarn.radius_mm() * self.flatten[i];
                let highest_mm = half_mm.y / factors[i][1];
                let lean = lean(curve, highest_mm);
                let n = course.len();
                let slice = |k: usize| {
                    let (height_mm, slope) = course[k];
                    let [before, after] = [(k + n - 1) % n, (k + 1) % n];
                    let step_mm = (places_mm[after] - places_mm[before]).rem_euclid(period_mm);
                    let cos = (lean * slope.atan()).cos();
                    let bend = (course[after].1 - course[before].1) / step_mm;
                    Slice {
                        height_mm,
                        half_mm: DVec2::new(half_mm.x * widening[k], half_mm.y / widening[k]),
                        cos,
                        bend_per_mm: lean * bend * cos.powi(3),
                    }
                };
                Surface {
                    slices: (0..n).map(slice).collect(),
                    places_mm,
                    period_mm,
                }
            })
            .collect()
    }
}

/// The surface of a thread by slices across its axis, [`SAMPLES`] from each crossing to the
/// next.
struct Surface {
    slices: Vec<Slice>,
    places_mm: Vec<f64>,
    period_mm: f64,
}

/// An ellipse that leans with the thread.
#[derive(Clone, Copy)]
struct Slice {
    height_mm: f64,
    /// Half of its width and height.
    half_mm: DVec2,
    /// Cosine of the angle by which it leans, and how that angle changes along the thread.
    cos: f64,
    bend_per_mm: f64,
}

impl Slice {
    /// Height of the surface above (1) or below (-1) the centreline at a distance from the
    /// middle, as that of a thread whose centreline is part of a circle.
    fn rise_mm(&self, across_mm: f64, side: f64) -> f64 {
        let share = across_mm / self.half_mm.x;
        let half = self.half_mm.y * (1.0 - share * share).max(0.0).sqrt();
        let bend = side * self.bend_per_mm;
        let square = self.cos * self.cos - bend * half * (2.0 - bend * half);
        half * (2.0 - bend * half) / (self.cos + square.max(0.0).sqrt())
    }
}

impl Surface {
    /// The slices within half the width of the thread at crossing `j`, with their distance from
    /// there.
    fn near(&self, j: usize, half_width_mm: f64) -> impl Iterator<Item = (f64, Slice)> {
        let n = self.slices.len() as isize;
        let middle = (SAMPLES * j) as isize;
        let at = move |i: isize| {
            let turns = i.div_euclid(n) as f64;
            let k = i.rem_euclid(n) as usize;
            let place_mm = self.places_mm[k] + turns * self.period_mm;
            (place_mm - self.places_mm[middle as usize], self.slices[k])
        };
        let up = (0..n).map(move |i| at(middle + i));
        let down = (1..n).map(move |i| at(middle - i));
        let within = move |(away, _): &(f64, Slice)| away.abs() < half_width_mm;
        up.take_while(within).chain(down.take_while(within))
    }
}

/// How deep the surfaces of two threads lie in each other around their crossing: that above
/// and that below, each with the number of the crossing on it. Negative where they are apart.
fn depth_mm((above, j): (&Surface, usize), (below, i): (&Surface, usize)) -> f64 {
    let [a, b] = [&above.slices[SAMPLES * j], &below.slices[SAMPLES * i]].map(|s| s.half_mm.x);
    let mut deepest = f64::NEG_INFINITY;
    for (along_mm, upper) in above.near(j, b) {
        for (across_mm, lower) in below.near(i, a) {
            let bottom = upper.height_mm - upper.rise_mm(across_mm, -1.0);
            let top = lower.height_mm + lower.rise_mm(along_mm, 1.0);
            deepest = deepest.max(top - bottom);
        }
    }
    deepest
}

/// How far the pressure of crossing threads reaches along a thread: half their width and one
/// of their diameters (estimated).
fn reach_mm(crossing: &Threads, flatten: &[DVec2]) -> Vec<f64> {
    let each = crossing.yarns.iter().zip(flatten);
    each.map(|(y, f)| y.radius_mm() * (f.x + 2.0 * (f.x * f.y).sqrt()))
        .collect()
}
