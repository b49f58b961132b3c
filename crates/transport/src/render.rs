//! Pictures: every pixel's paths, in parallel, in passes.

use crate::{Film, Integrator, Scene, Stats, trace_path};
use glam::UVec2;
use organza_basis::PathRng;
use rayon::prelude::*;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A rectangle of the film: `min` inside, `max` outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// Upper left pixel.
    pub min: UVec2,
    /// One past the lower right pixel.
    pub max: UVec2,
}

/// How much to trace.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderSettings {
    /// Tracker.
    pub integrator: Integrator,
    /// Sample indices to take, of every pixel.
    pub samples: Range<u64>,
    /// Longest path in scattering events.
    pub max_bounces: u32,
    /// Names all random numbers.
    pub seed: u64,
    /// Part of the film, or all of it.
    pub crop: Option<Crop>,
}

/// How far a render has come, told between rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pass {
    /// Paths finished.
    pub paths_done: u64,
    /// Paths there will be.
    pub paths_total: u64,
}

/// Why a render gave no picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// The crop holds no pixel of the film.
    #[error("the crop {min} .. {max} holds no pixel of a {size} picture", min = .0.min, max = .0.max, size = .1)]
    EmptyCrop(Crop, UVec2),
    /// Extinctions above their bound: the picture would be biased.
    #[error(
        "{violations} of {lookups} look-ups exceeded their majorant; the picture would be biased"
    )]
    MajorantViolations {
        /// How many.
        violations: u64,
        /// Out of how many.
        lookups: u64,
    },
    /// The progress callback asked to stop.
    #[error("interrupted")]
    Interrupted,
}

/// Samples of a pixel between two looks at the clock.
const SAMPLES_PER_PASS: u64 = 16;

/// Traces a picture.
///
/// `watch` is told of progress between rows, from any thread, and may break to
/// stop the render.
///
/// # Errors
/// An empty crop, a majorant violation, or an interruption.
pub fn render(
    scene: &Scene,
    settings: &RenderSettings,
    watch: &(dyn Fn(Pass) -> ControlFlow<()> + Sync),
) -> Result<(Film, Stats), RenderError> {
    let resolution = scene.camera.resolution();
    let crop = settings.crop.unwrap_or(Crop {
        min: UVec2::ZERO,
        max: resolution,
    });
    if crop.min.cmpge(crop.max).any() || crop.max.cmpgt(resolution).any() {
        return Err(RenderError::EmptyCrop(crop, resolution));
    }
    let size = crop.max - crop.min;
    let mut film = Film::new(size);
    let spp = settings.samples.end.saturating_sub(settings.samples.start);
    let paths_total = spp * u64::from(size.x) * u64::from(size.y);
    let paths_done = AtomicU64::new(0);
    let stopped = AtomicBool::new(false);
    let mut stats = Stats::default();
    let mut first = settings.samples.start;
    while first < settings.samples.end {
        let last = (first + SAMPLES_PER_PASS).min(settings.samples.end);
        let pass = film
            .pixels_mut()
            .par_chunks_mut(size.x as usize)
            .enumerate()
            .map(|(row, pixels)| {
                let mut stats = Stats::default();
                if stopped.load(Ordering::Relaxed) {
                    return stats;
                }
                for (column, out) in pixels.iter_mut().enumerate() {
                    let pixel = crop.min + UVec2::new(column as u32, row as u32);
                    let stream = u64::from(pixel.y) * u64::from(resolution.x) + u64::from(pixel.x);
                    for index in first..last {
                        let mut rng = PathRng::new(settings.seed, stream, index);
                        let sample = trace_path(
                            scene,
                            pixel,
                            settings.integrator,
                            settings.max_bounces,
                            &mut rng,
                            &mut stats,
                        );
                        if sample.radiance.is_valid() {
                            out.add(&sample);
                        } else {
                            stats.rejected += 1;
                        }
                    }
                }
                let paths = (last - first) * u64::from(size.x);
                let done = paths_done.fetch_add(paths, Ordering::Relaxed) + paths;
                let told = Pass {
                    paths_done: done,
                    paths_total,
                };
                if watch(told).is_break() {
                    stopped.store(true, Ordering::Relaxed);
                }
                stats
            })
            .reduce(Stats::default, |mut a, b| {
                a.merge(&b);
                a
            });
        stats.merge(&pass);
        if stopped.load(Ordering::Relaxed) {
            return Err(RenderError::Interrupted);
        }
        first = last;
    }
    if stats.majorant_violations > 0 {
        return Err(RenderError::MajorantViolations {
            violations: stats.majorant_violations,
            lookups: stats.tentative + stats.shadow_steps,
        });
    }
    Ok((film, stats))
}
