//! The samples of one picture: which engine takes them, in passes that a change ends at once.

use crate::news::Cost;
use organza_scene::scene_file::SceneFile;
use organza_transport::{
    CachePlan, EngineChoice, Film, Integrator, KernelRefusal, LearnWatch, Refusal, RenderError,
    RenderSettings, Rendering, Scene, engine,
};
use std::time::{Duration, Instant};

/// How long a pass should take: between two pictures of the page.
const PASS: Duration = Duration::from_millis(400);

/// What a picture needs beside its scene.
pub struct PicturePlan<'a> {
    /// The scene's file.
    pub file: &'a SceneFile,
    /// Samples of a pixel; the file's if none.
    pub samples: Option<u64>,
    /// Bytes that matter and tables may take.
    pub max_bytes: u64,
    /// The general walk takes the samples, without anything to be laid out first.
    pub is_walked: bool,
}

/// A picture in the making.
pub struct Tracing<'a> {
    rendering: Rendering<'a>,
    /// What is still to be learned before the first sample.
    to_learn: Option<CachePlan>,
    why_walk: Option<KernelRefusal>,
    seconds: f64,
    /// Of these, what was spent before the first sample.
    learned_s: f64,
    per_sample: Option<Duration>,
}

/// Why there is no picture.
#[derive(Debug)]
pub enum Stop {
    /// Nobody wants it any more.
    Unwanted,
    /// It cannot be made.
    Failed(String),
}

/// The same plan for somebody who waits: less is learned.
fn soon(plan: CachePlan) -> CachePlan {
    const SHARE: f64 = 0.25;
    CachePlan {
        work: (SHARE * plan.work as f64) as u64,
        ..plan
    }
}

fn stop(why: RenderError) -> Stop {
    match why {
        RenderError::Interrupted => Stop::Unwanted,
        why => Stop::Failed(why.to_string()),
    }
}

impl<'a> Tracing<'a> {
    /// A picture without samples.
    ///
    /// # Errors
    /// A scene that no engine renders as its file asks, in the memory allowed.
    pub fn new(scene: &'a Scene, plan: &PicturePlan<'_>) -> Result<Tracing<'a>, Stop> {
        let table = &plan.file.render;
        let failed = |why: String| Stop::Failed(why);
        let integrator = Integrator::from(table.integrator);
        let is_constant = scene.media.iter().all(|m| m.is_piecewise_constant());
        if integrator == Integrator::Regular && !is_constant {
            return Err(failed(
                "render.integrator: \"regular\" steps through constant voxels; \"woodcock\" \
                 renders this scene"
                    .into(),
            ));
        }
        let settings = RenderSettings {
            integrator,
            samples: 0..plan.samples.unwrap_or(u64::from(table.spp)),
            max_bounces: table.max_bounces.unwrap_or(u32::MAX),
            seed: table.seed,
            crop: None,
        };
        let made = match (table.clamp, plan.is_walked) {
            (None, false) => engine(scene, &settings, EngineChoice::Fastest, plan.max_bytes),
            _ => Err(KernelRefusal::Clamp),
        };
        let rendering = Rendering::new(scene, settings).map_err(|e| failed(e.to_string()))?;
        let needed = scene.hierarchy_bytes();
        let (rendering, why_walk) = match made {
            Ok(engine) => (rendering.with_engine(engine), None),
            Err(why @ KernelRefusal::Kernel(Refusal::TooManyPieces)) => {
                return Err(failed(why.to_string()));
            }
            Err(_) if needed > plan.max_bytes => {
                return Err(failed(format!(
                    "explicit fibres need about {needed} bytes of memory, {} are allowed: show \
                     the cloth by another model, or allow more",
                    plan.max_bytes
                )));
            }
            Err(why) => (rendering, Some(why)),
        };
        let rendering = match table.clamp {
            Some(limit) => rendering.with_clamp(limit),
            None => rendering,
        };
        // A glance of a few samples is there before anything could be learned for it.
        let camera = plan.file.camera.as_ref();
        let camera = camera.filter(|_| plan.samples.is_none());
        let to_learn = camera.and_then(|c| table.cache_plan(c.resolution));
        Ok(Tracing {
            rendering,
            to_learn: to_learn.map(soon),
            why_walk,
            seconds: 0.0,
            learned_s: 0.0,
            per_sample: None,
        })
    }

    /// Whether light can be learned before the first sample.
    pub fn can_learn(&self) -> bool {
        self.rendering.engine().is_some_and(|e| e.can_learn())
    }

    /// Whether it is learned for this picture.
    pub fn learns(&self) -> bool {
        self.to_learn.is_some() && self.can_learn()
    }

    /// Learns what samples look up, if they do.
    ///
    /// # Errors
    /// `watch` broke.
    pub fn learn(self, watch: &LearnWatch<'_>) -> Result<Tracing<'a>, Stop> {
        let Some(plan) = &self.to_learn else {
            return Ok(self);
        };
        let began = Instant::now();
        let rendering = self.rendering.with_cache(plan, watch).map_err(stop)?;
        Ok(Tracing {
            rendering,
            to_learn: None,
            learned_s: began.elapsed().as_secs_f64(),
            ..self
        })
    }

    /// Takes about as many samples as fit into a pass, at most `most`.
    ///
    /// # Errors
    /// It is not wanted any more, or the paths fail.
    pub fn pass(
        self,
        most: u64,
        is_wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Tracing<'a>, Stop> {
        use std::ops::ControlFlow::{Break, Continue};
        let fit = self.per_sample.map_or(1, |per_sample| {
            (PASS.as_secs_f64() / per_sample.as_secs_f64().max(1e-9)) as u64
        });
        let samples = fit.clamp(1, most.max(1)).min(self.rendering.left());
        let flow = || if is_wanted() { Continue(()) } else { Break(()) };
        let began = Instant::now();
        let rendering = self.rendering.take(samples, &|_| flow()).map_err(stop)?;
        let took = began.elapsed();
        Ok(Tracing {
            rendering,
            seconds: self.seconds + took.as_secs_f64(),
            per_sample: Some(took.div_f64(samples.max(1) as f64)),
            ..self
        })
    }

    /// Samples of every pixel that are taken.
    pub fn taken(&self) -> u64 {
        let taken = self.rendering.taken();
        taken.end - taken.start
    }

    /// Samples of every pixel still to take.
    pub fn left(&self) -> u64 {
        self.rendering.left()
    }

    /// What was gathered so far.
    pub fn film(&self) -> &Film {
        self.rendering.film()
    }

    /// What it has cost.
    pub fn cost(&self, build_s: f64) -> Cost {
        let samples = self.taken();
        let noise = (samples > 1).then(|| self.rendering.relative_error());
        let median_noise = (samples > 1).then(|| self.rendering.pixel_errors().median);
        let shared = self.rendering.shared_pixel_noise().median;
        // Samples do not lessen what they share.
        let to_5_percent = |noise: f64| {
            let [falls, may_be_left] = [noise, 0.05].map(|n: f64| n * n - shared * shared);
            let seconds = self.learned_s + self.seconds * falls / may_be_left;
            (may_be_left > 0.0).then_some(seconds)
        };
        Cost {
            samples,
            build_s,
            render_s: self.learned_s + self.seconds,
            noise,
            median_noise,
            seconds_to_5_percent: median_noise.and_then(to_5_percent),
            paths_per_s: self.rendering.stats().paths as f64
                / (self.learned_s + self.seconds).max(1e-9),
            engine: self.rendering.engine().map_or("walk", |e| e.name()).into(),
            why_walk: self.why_walk.as_ref().map(ToString::to_string),
        }
    }
}
