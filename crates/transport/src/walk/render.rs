//! Pictures: every pixel's paths, in parallel, in passes.

use crate::{Film, Integrator, PathSample, Pixel, PixelErrors, Scene, Stats, trace_path};
use glam::UVec2;
use organza_basis::PathRng;
use organza_kernel::fibres::{CachePlan, CacheReport, KeptLight, LearnWatch};
use organza_kernel::{Block, Engine, Lost};
use rayon::prelude::*;
use std::ops::{ControlFlow, Range};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A rectangle of the film: `min` inside, `max` outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// Upper left pixel.
    pub min: UVec2,
    /// One past the lower right pixel.
    pub max: UVec2,
}

impl Crop {
    /// Between two pixels.
    pub const fn new(min: UVec2, max: UVec2) -> Crop {
        Crop { min, max }
    }
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

/// Progress of a render, reported between rows.
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
    /// Sums have room for a limited number of samples.
    #[error("samples {0:?}: a pixel can take sample indices below {limit}", limit = u32::MAX)]
    TooManySamples(Range<u64>),
    /// What was gathered before does not belong to these settings.
    #[error("the film to resume from has another size or other samples")]
    ForeignFilm,
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
    /// The device that traced the paths is gone.
    #[error(transparent)]
    Lost(#[from] Lost),
    /// The progress callback asked to stop.
    #[error("interrupted")]
    Interrupted,
}

/// Samples of a pixel between two looks at the clock.
const SAMPLES_PER_PASS: u64 = 16;

/// Called between rows, from any thread, with the progress; may break to stop.
pub type Watch<'a> = dyn Fn(Pass) -> ControlFlow<()> + Sync + 'a;

/// A picture in the making. However its samples are split into calls of
/// [`Rendering::take`], the film comes out the same, bit for bit.
pub struct Rendering<'a> {
    scene: &'a Scene,
    engine: Option<Box<dyn Engine + 'a>>,
    clamp: Option<f32>,
    settings: RenderSettings,
    crop: Crop,
    film: Film,
    direct: Option<Film>,
    stats: Stats,
    next: u64,
    cache: Option<CacheReport>,
}

impl<'a> Rendering<'a> {
    /// A picture without samples.
    ///
    /// # Errors
    /// An empty crop, or sample indices beyond what a pixel can hold.
    pub fn new(scene: &'a Scene, settings: RenderSettings) -> Result<Rendering<'a>, RenderError> {
        let resolution = scene.camera.resolution();
        let crop = settings.crop.unwrap_or(Crop::new(UVec2::ZERO, resolution));
        if crop.min.cmpge(crop.max).any() || crop.max.cmpgt(resolution).any() {
            return Err(RenderError::EmptyCrop(crop, resolution));
        }
        if settings.samples.end > u64::from(u32::MAX) {
            return Err(RenderError::TooManySamples(settings.samples));
        }
        Ok(Rendering {
            scene,
            engine: None,
            clamp: None,
            crop,
            film: Film::new(crop.max - crop.min),
            direct: None,
            stats: Stats::default(),
            next: settings.samples.start,
            cache: None,
            settings,
        })
    }

    /// Has the paths walked by an engine of the kernel, made from the same scene and
    /// settings, instead of by the general walk. Samples are other ones then.
    pub fn with_engine(mut self, engine: Box<dyn Engine + 'a>) -> Self {
        self.engine = Some(engine);
        self
    }

    /// Has the engine learn a cache of radiance before the first sample: the same of the same
    /// scene, seed and plan, on any number of threads. Nothing changes for an engine or a
    /// scene without one, such as the general walk. The error of the cache is in no pixel's
    /// variance; [`Rendering::cache`] has an estimate of it.
    ///
    /// # Errors
    /// `watch` broke.
    pub fn with_cache(
        mut self,
        plan: &CachePlan,
        watch: &LearnWatch<'_>,
    ) -> Result<Self, RenderError> {
        if let Some(engine) = &self.engine {
            let learned = engine.learn(plan, watch);
            self.cache = learned.map_err(|_| RenderError::Interrupted)?;
        }
        Ok(self)
    }

    /// Fills a film of direct light beside the picture: what comes straight to the camera or by one
    /// event ([`PathSample::direct`](crate::PathSample::direct)). An engine for graphics cards, and a
    /// cache in the mode [`CacheMode::FirstFibre`](crate::CacheMode::FirstFibre), do not know it.
    pub fn with_direct(mut self) -> Self {
        self.direct = Some(Film::new(self.film.size()));
        self
    }

    /// The film of direct light, if it is filled.
    pub fn direct(&self) -> Option<&Film> {
        self.direct.as_ref()
    }

    /// What was learned and is of use to other pictures of the same cloth.
    pub fn kept_light(&self) -> Option<KeptLight> {
        self.engine.as_ref()?.kept_light()
    }

    /// What was learned, if the samples use a cache.
    pub fn cache(&self) -> Option<&CacheReport> {
        self.cache.as_ref()
    }

    /// [`Film::relative_error`], with the noise of what samples share.
    pub fn relative_error(&self) -> f64 {
        self.film().relative_error().hypot(self.shared_noise())
    }

    /// [`Film::pixel_errors`], with the noise of what samples share.
    pub fn pixel_errors(&self) -> PixelErrors {
        let (errors, shared) = (self.film().pixel_errors(), self.shared_pixel_noise());
        PixelErrors {
            median: errors.median.hypot(shared.median),
            worst_hundredth: errors.worst_hundredth.hypot(shared.worst_hundredth),
        }
    }

    /// [`Rendering::shared_noise`] over the value of a pixel.
    pub fn shared_pixel_noise(&self) -> PixelErrors {
        let noises = self.cache.as_ref().map(|cache| cache.shared_noise_of_value);
        let [median, worst_hundredth] = noises.unwrap_or_default();
        PixelErrors {
            median,
            worst_hundredth,
        }
    }

    /// Noise of the light that samples share, which more of them do not lessen, over the mean
    /// of the picture.
    pub fn shared_noise(&self) -> f64 {
        self.cache.as_ref().map_or(0.0, |cache| cache.shared_noise)
    }

    /// Darkens every sample whose brightest channel is above `limit` to it, which
    /// removes light; [`Stats::clamped_radiance`] is how much. The
    /// general walk does so, never the kernel.
    pub fn with_clamp(mut self, limit: f32) -> Self {
        self.clamp = Some(limit);
        self.engine = None;
        self
    }

    /// What walks the paths; `None` is the general walk.
    pub fn engine(&self) -> Option<&(dyn Engine + 'a)> {
        self.engine.as_deref()
    }

    /// Resumes from what an earlier rendering of the same scene, seed and crop
    /// had gathered when `next` was its next sample, direct light among it if that is filled here.
    ///
    /// # Errors
    /// A film of another size, or `next` outside the samples.
    pub fn resume(
        mut self,
        (film, direct): (Film, Option<Film>),
        stats: Stats,
        next: u64,
    ) -> Result<Self, RenderError> {
        let samples = &self.settings.samples;
        let fits = |film: &Film| film.size() == self.film.size();
        let is_same = fits(&film)
            && direct.as_ref().is_none_or(fits)
            && direct.is_some() == self.direct.is_some();
        if !is_same || next < samples.start || next > samples.end {
            return Err(RenderError::ForeignFilm);
        }
        (self.film, self.direct, self.stats, self.next) = (film, direct, stats, next);
        Ok(self)
    }

    /// Takes the next `samples` of every pixel, or as many as are left.
    ///
    /// # Errors
    /// A majorant violation, a lost device, or `watch` broke; what was gathered is then lost.
    pub fn take(mut self, samples: u64, watch: &Watch<'_>) -> Result<Self, RenderError> {
        if self.left() == 0 {
            return Ok(self);
        }
        let range = self.settings.samples.clone();
        let indices = self.next..self.next.saturating_add(samples).min(range.end);
        let size = self.film.size();
        let paths = |samples: u64| samples * u64::from(size.x) * u64::from(size.y);
        let paths_total = paths(range.end.saturating_sub(range.start));
        let paths_done = AtomicU64::new(paths(self.next - range.start));
        let (stopped, lost) = (AtomicBool::new(false), OnceLock::new());
        let (scene, settings, crop) = (self.scene, &self.settings, self.crop);
        let clamp = self.clamp.unwrap_or(f32::INFINITY);
        let engine = self.engine.as_deref();
        let threads = rayon::current_num_threads() as u32;
        let rows = engine.map_or(1, |engine| engine.rows_per_block(size.y, threads));
        let of_block = (rows * size.x) as usize;
        let direct: Vec<Option<&mut [Pixel]>> = match &mut self.direct {
            Some(film) => film.pixels_mut().chunks_mut(of_block).map(Some).collect(),
            None => (0..size.y.div_ceil(rows)).map(|_| None).collect(),
        };
        let stats = self
            .film
            .pixels_mut()
            .par_chunks_mut(of_block)
            .zip(direct)
            .enumerate()
            .map(|(block, (pixels, mut direct))| {
                let mut stats = Stats::default();
                if stopped.load(Ordering::Relaxed) {
                    return stats;
                }
                let paths = (indices.end - indices.start) * pixels.len() as u64;
                let min = crop.min + UVec2::new(0, block as u32 * rows);
                if let Some(engine) = engine {
                    let mut block = Block {
                        pixels,
                        direct,
                        width: size.x,
                        min,
                        samples: indices.start as u32..indices.end as u32,
                        takes: None,
                    };
                    match engine.take(&mut block) {
                        Ok(found) => stats = found,
                        Err(gone) => {
                            let _ = lost.set(gone);
                            stopped.store(true, Ordering::Relaxed);
                            return stats;
                        }
                    }
                } else {
                    for (column, out) in pixels.iter_mut().enumerate() {
                        let pixel = min + UVec2::new(column as u32, 0);
                        let indices = indices.clone();
                        let out = (out, direct.as_mut().map(|film| &mut film[column]));
                        add_samples(scene, settings, clamp, pixel, indices, out, &mut stats);
                    }
                }
                let state = Pass {
                    paths_done: paths_done.fetch_add(paths, Ordering::Relaxed) + paths,
                    paths_total,
                };
                if watch(state).is_break() {
                    stopped.store(true, Ordering::Relaxed);
                }
                stats
            })
            .reduce(Stats::default, |mut a, b| {
                a.merge(&b);
                a
            });
        self.stats.merge(&stats);
        if let Some(lost) = lost.into_inner() {
            return Err(lost.into());
        }
        if stopped.load(Ordering::Relaxed) {
            return Err(RenderError::Interrupted);
        }
        if self.stats.majorant_violations > 0 {
            return Err(RenderError::MajorantViolations {
                violations: self.stats.majorant_violations,
                lookups: self.stats.tentative + self.stats.shadow_steps,
            });
        }
        self.next = indices.end;
        Ok(self)
    }

    /// Sample indices taken so far.
    pub fn taken(&self) -> Range<u64> {
        self.settings.samples.start..self.next
    }

    /// Samples of every pixel still to take.
    pub fn left(&self) -> u64 {
        self.settings.samples.end.saturating_sub(self.next)
    }

    /// The pixels of the whole picture that the film covers.
    pub fn crop(&self) -> Crop {
        self.crop
    }

    /// What was gathered so far.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// What the trackers did so far.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }

    /// The film, and that of direct light if it is filled.
    pub fn into_films(self) -> (Film, Option<Film>) {
        (self.film, self.direct)
    }

    /// Film and counts.
    pub fn into_parts(self) -> (Film, Stats) {
        (self.film, self.stats)
    }
}

/// Adds samples to one pixel, and their direct light to another.
pub(crate) fn add_samples(
    scene: &Scene,
    settings: &RenderSettings,
    clamp: f32,
    pixel: UVec2,
    indices: Range<u64>,
    (out, mut direct): (&mut Pixel, Option<&mut Pixel>),
    stats: &mut Stats,
) {
    let width = scene.camera.resolution().x;
    let stream = u64::from(pixel.y) * u64::from(width) + u64::from(pixel.x);
    for index in indices {
        let mut rng = PathRng::new(settings.seed, stream, index);
        let mut sample = trace_path(
            scene,
            pixel,
            settings.integrator,
            settings.max_bounces,
            &mut rng,
            stats,
        );
        if Pixel::accepts(&sample) {
            let brightest = sample.radiance.max_component();
            stats.brightest = stats.brightest.max(brightest);
            sample.radiance = stats.clamp(sample.radiance, clamp);
            out.add(&sample, index as u32);
            if let Some(out) = &mut direct {
                let kept = clamp.min(brightest) / brightest.max(f32::MIN_POSITIVE);
                let radiance = kept * sample.direct;
                out.add(&PathSample { radiance, ..sample }, index as u32);
            }
        } else {
            stats.rejected += 1;
        }
    }
}

/// Traces a picture in one go.
///
/// # Errors
/// An empty crop, too many samples, a majorant violation, or an interruption.
pub fn render(
    scene: &Scene,
    settings: &RenderSettings,
    watch: &Watch<'_>,
) -> Result<(Film, Stats), RenderError> {
    let mut rendering = Rendering::new(scene, settings.clone())?;
    while rendering.left() > 0 {
        rendering = rendering.take(SAMPLES_PER_PASS, watch)?;
    }
    Ok(rendering.into_parts())
}
