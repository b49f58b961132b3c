//! How irregular the threads of a cloth came out.

use super::{Centreline, Cloth, CurveLevel, ThreadAtRest};
use crate::protruding::Beside;
use crate::strand::Strand;
use crate::sway::Sway;
use glam::DVec2;
use organza_basis::Segment;
use rayon::prelude::*;

/// Samples along a thread.
const SAMPLES: usize = 256;
/// Threads of a system whose hairs are generated and measured.
const MEASURED_THREADS: usize = 64;

/// Figures of one system of threads, over all its threads in the tile. A small tile holds few
/// threads, whose figures scatter about those that the fabric asks for.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SystemIrregularity {
    /// Coefficient of variation of the mass per length: the `CVm` of an evenness tester.
    pub mass_cv_percent: f64,
    /// Coefficient of variation of the twist of the fibres; 0 without twist.
    pub twist_cv_percent: f64,
    /// Length of fibre that protrudes from the yarn per length of yarn: the index `H` of a
    /// hairiness tester. The first 64 threads count.
    pub hairiness: f64,
    /// Root mean square of the distance of threads from their straight line, sideways,
    /// micrometres.
    pub sideways_um: f64,
    /// Width of the threads' cross-sections, least and most, millimetres.
    pub width_mm: [f64; 2],
    /// Height of the threads' cross-sections, least and most, millimetres.
    pub height_mm: [f64; 2],
}

/// Figures of warp and weft; a knit has only a weft.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Irregularity {
    /// Warp of a woven cloth.
    pub warp: Option<SystemIrregularity>,
    /// Weft of a woven cloth, courses of a knit, imported yarns.
    pub weft: Option<SystemIrregularity>,
}

/// Moments of a figure that varies along threads.
#[derive(Default)]
struct Moments {
    count: f64,
    sum: f64,
    square: f64,
}

impl Moments {
    fn add(&mut self, x: f64) {
        self.count += 1.0;
        self.sum += x;
        self.square += x * x;
    }

    fn deviation(&self) -> f64 {
        let mean = self.sum / self.count;
        (self.square / self.count - mean * mean).max(0.0).sqrt()
    }

    fn cv_percent(&self) -> f64 {
        let mean = self.sum / self.count;
        if mean == 0.0 {
            return 0.0;
        }
        100.0 * self.deviation() / mean.abs()
    }
}

struct System {
    threads: usize,
    mass: Moments,
    twist: Moments,
    protruding_mm: f64,
    measured_mm: f64,
    sideways: Moments,
    least_mm: DVec2,
    most_mm: DVec2,
}

impl System {
    fn new() -> System {
        System {
            threads: 0,
            mass: Moments::default(),
            twist: Moments::default(),
            protruding_mm: 0.0,
            measured_mm: 0.0,
            sideways: Moments::default(),
            least_mm: DVec2::INFINITY,
            most_mm: DVec2::ZERO,
        }
    }

    /// Adds a thread; `protruding_mm` is the length of its hairs outside the yarn, if it is
    /// measured.
    fn add(&mut self, strand: &Strand, sway: Option<&Sway>, protruding_mm: Option<f64>) {
        self.threads += 1;
        for i in 0..SAMPLES {
            let s = i as f64 / SAMPLES as f64;
            self.sideways
                .add(sway.map_or(0.0, |sway| sway.across_mm(s)));
        }
        let fibres = f64::from(strand.yarn.fibres_per_ply * strand.yarn.plies);
        let length_mm = strand.path.length_mm();
        let twist = strand.closure.twist_rad_per_mm(length_mm);
        let thinness = strand.profile.map_or(1.0, |p| p.mean(|m| 1.0 / m));
        for i in 0..SAMPLES {
            let s = i as f64 / SAMPLES as f64;
            let mass = strand.profile.map_or(1.0, |p| p.mass(s));
            let size_mm = 2.0 * strand.scale(s) * strand.yarn.radius_mm() * strand.section.at(s);
            self.least_mm = self.least_mm.min(size_mm);
            self.most_mm = self.most_mm.max(size_mm);
            self.mass.add(fibres * mass);
            self.twist.add(twist / (mass * thinness));
        }
        if let Some(protruding_mm) = protruding_mm {
            self.measured_mm += length_mm;
            self.protruding_mm += protruding_mm;
        }
    }

    fn figures(&self) -> Option<SystemIrregularity> {
        (self.threads > 0).then(|| SystemIrregularity {
            mass_cv_percent: self.mass.cv_percent(),
            twist_cv_percent: self.twist.cv_percent(),
            hairiness: self.protruding_mm / self.measured_mm,
            sideways_um: 1e3 * self.sideways.deviation(),
            width_mm: [self.least_mm.x, self.most_mm.x],
            height_mm: [self.least_mm.y, self.most_mm.y],
        })
    }
}

/// Length of all hairs outside the yarn.
fn protruding_mm(strand: &Strand) -> f64 {
    let mut beside = Beside { strand, nearest: 0 };
    let mut hair = None;
    let mut sum = 0.0;
    strand.emit_hairs(0, &mut |s: &Segment| {
        let middle = 0.5 * (s.start_mm + s.end_mm).as_dvec3();
        if hair.replace(s.fibre) != Some(s.fibre) {
            beside.search(middle);
        }
        if beside.follow(middle).1 > 1.0 {
            sum += f64::from(s.length_mm());
        }
    });
    sum
}

impl Cloth {
    /// How irregular the threads came out. Their hairs are generated, their fibres are not.
    pub fn irregularity(&self) -> Irregularity {
        let [mut warp, mut weft] = [(); 2].map(|()| System::new());
        let protruding_mm = self.protruding_mm();
        for (batch, thread) in self.threads.iter().enumerate() {
            let Some(is_warp) = is_warp(thread) else {
                continue;
            };
            let system = if is_warp { &mut warp } else { &mut weft };
            let path = self.path(thread, CurveLevel::Fibre);
            let sway = match &thread.line {
                Centreline::Woven { sway, .. } => sway.as_ref(),
                _ => None,
            };
            system.add(&self.strand(batch, &path), sway, protruding_mm[batch]);
        }
        Irregularity {
            warp: warp.figures(),
            weft: weft.figures(),
        }
    }

    /// Length of all hairs outside the yarn, of each thread whose hairs are measured.
    fn protruding_mm(&self) -> Vec<Option<f64>> {
        let mut so_far = [0; 2];
        let is_measured: Vec<bool> = self
            .threads
            .iter()
            .map(|thread| {
                is_warp(thread).is_some_and(|is_warp| {
                    so_far[usize::from(is_warp)] += 1;
                    so_far[usize::from(is_warp)] <= MEASURED_THREADS
                })
            })
            .collect();
        let measured = is_measured.into_par_iter().enumerate();
        measured
            .map(|(batch, is_measured)| {
                is_measured.then(|| {
                    let path = self.path(&self.threads[batch], CurveLevel::Fibre);
                    protruding_mm(&self.strand(batch, &path))
                })
            })
            .collect()
    }
}

/// Whether a thread is one of the warp or of the weft; `None` of threads that are in neither.
fn is_warp(thread: &ThreadAtRest) -> Option<bool> {
    match &thread.line {
        Centreline::Bare(_) | Centreline::Laid { .. } => None,
        Centreline::Woven { axis, .. } => Some(axis.y > 0.5),
        _ => Some(false),
    }
}
