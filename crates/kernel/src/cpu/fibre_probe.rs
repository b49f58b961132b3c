//! Paths from anywhere through explicit fibres, for measurements.

use super::fibre_engine::run;
use crate::fibres::cache::CacheUse;
use crate::fibres::matter::FibreMatter;
use crate::fibres::walk::Walk;
use crate::fibres::work::{End, Start, WAVE, Work};
use glam::DVec3;
use organza_basis::Rgb;
use organza_film::{Escape, PathSample, Stats};
use organza_lanes::Backend;
use organza_lanes::math::pixel_key;
use organza_light::Light;
use std::ops::Range;
use std::sync::Arc;

/// Fibres that are measured.
pub struct FibreProbe {
    matter: Arc<FibreMatter>,
    backend: Backend,
}

/// Longest path in events: one that is never absorbed and cannot get out would not
/// end.
const MAX_EVENTS: u32 = 1 << 20;

/// Paths to trace.
pub struct ProbePaths<'a> {
    /// What lights the fibres.
    pub lights: &'a [Light],
    /// Names all random numbers.
    pub seed: u64,
    /// Names those of these paths.
    pub stream: u64,
    /// Their numbers.
    pub paths: Range<u64>,
    /// Origin in mm and unit direction of a path.
    pub start: &'a (dyn Fn(u64) -> (DVec3, DVec3) + Sync),
}

impl FibreProbe {
    /// Fibres in cells and a back end, which the processor must have.
    pub fn new(matter: Arc<FibreMatter>, backend: Backend) -> FibreProbe {
        FibreProbe { matter, backend }
    }

    /// What the paths found, in their order.
    pub fn trace(&self, paths: &ProbePaths<'_>) -> (Vec<PathSample>, Stats) {
        let count = paths.paths.end.saturating_sub(paths.paths.start) as usize;
        let mut work = ProbeWork {
            paths,
            next: paths.paths.start,
            under_way: [0; WAVE],
            samples: vec![PathSample::default(); count],
        };
        let walk = Walk {
            matter: &self.matter,
            lights: paths.lights,
            max_bounces: MAX_EVENTS,
            // A path escapes once.
            importance: None,
            cache: CacheUse::default(),
        };
        let stats = run(&walk, self.backend, &mut work);
        (work.samples, stats)
    }
}

struct ProbeWork<'a> {
    paths: &'a ProbePaths<'a>,
    next: u64,
    under_way: [u64; WAVE],
    samples: Vec<PathSample>,
}

impl Work for ProbeWork<'_> {
    fn begin(&mut self, slot: usize, stats: &mut Stats) -> Option<Start> {
        if self.next >= self.paths.paths.end {
            return None;
        }
        let path = self.next;
        self.next += 1;
        self.under_way[slot] = path;
        stats.paths += 1;
        let (origin_mm, direction) = (self.paths.start)(path);
        // Two names make one, so that paths beyond 2^32 have their own numbers.
        let stream = self.paths.stream ^ (path >> 32).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Some(Start {
            origin_mm,
            direction,
            key: pixel_key(self.paths.seed, stream),
            index: path as u32,
        })
    }

    fn end(&mut self, slot: usize, end: &End<'_>, _: &mut Stats) {
        let index = self.under_way[slot] - self.paths.paths.start;
        self.samples[index as usize] = PathSample {
            radiance: Rgb(end.radiance),
            direct: Rgb(end.direct),
            bounces: end.bounces,
            first: end.first,
            absorbed: Rgb(end.absorbed),
            escape: end.escape.map(|(direction, carried)| Escape {
                direction,
                throughput: Rgb(carried),
            }),
        };
    }
}
