//! Pictures of scenes, and of cloths in a studio.

mod engine;
mod made_scene;
mod output;
mod results;
mod scene;
mod summary;
mod tracing;

pub use engine::EngineName;
pub use output::Picture;
pub use studio::StudioName;
pub use summary::CLAMPED;

use crate::studio;
use anyhow::Result;
use clap::Args;
use engine::Chosen;
use organza_cache::Key;
use organza_picture::Format;
use organza_scene::scene_file::CacheName;
use organza_transport::{
    CachePlan, CacheReport, Crop, Engine, KernelRefusal, RenderError, Rendering,
};
use organza_work::building::watched;
use organza_work::denoising::Denoiser;
use organza_work::identity::{self, Identity, crop_edges};
use organza_work::process_usage::cpu_seconds;
use organza_work::sample_ranges::parse_range;
use organza_work::schedule::{Stop, Targets};
use organza_work::values::{
    parse_crop, parse_duration, parse_positive, parse_seed, parse_share, whole,
};
use organza_work::{
    Context, Error, InputError, Job, Place, PlaceKind, Progress, Request, Stopped, Waiting,
    checkpoint, input, kept_light, keys, of_file, of_option, output as files, picture, version,
};
use scene::Built;
use serde::Deserialize;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use summary::Times;

/// A picture of a scene, or of a cloth in a studio.
#[derive(Clone, Debug, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Render {
    /// Scene or fabric file (TOML), draft (.wif), or the name of a weave such as twill-3-1-s
    pub scene: PathBuf,
    /// Samples per pixel, at least 1; the maximum with --time-limit or a target error [default: the scene's; with a target error 65536]
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1..=u64::from(u32::MAX)))]
    pub spp: Option<u32>,
    /// Seed of all random numbers [default: the scene's]
    #[arg(long, value_name = "N", value_parser = parse_seed)]
    #[serde(deserialize_with = "keys::some_seed")]
    pub seed: Option<u64>,
    /// Render only these pixels: left, top, right, bottom (right and bottom outside), counted from the upper left
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true, value_parser = parse_crop)]
    #[serde(deserialize_with = "keys::crop")]
    pub crop: Option<Crop>,
    /// Take only these samples of every pixel; `organza merge` combines the parts (.exr)
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = parse_range, conflicts_with = "spp")]
    #[serde(deserialize_with = "keys::range")]
    pub samples: Option<Range<u64>>,
    /// Stop when this time has passed since the start, e.g. 60s, 5m, 2h; a bare number is seconds
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = parse_duration)]
    #[serde(deserialize_with = "keys::time")]
    pub time_limit: Option<Duration>,
    /// Stop when the standard error of the pixels (root mean square) is at most this fraction of the picture's mean, e.g. 0.02
    #[arg(long, value_name = "FRACTION", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Stop when half the pixels that met matter have a standard error of at most this fraction of their own value, e.g. 0.01; with --target-error, when both are reached
    #[arg(long, value_name = "FRACTION", value_parser = parse_share)]
    pub target_median_error: Option<f64>,
    /// Darken single samples above this radiance, which biases the picture; --stats prints how much light that removes [default: the scene's, or no limit]
    #[arg(long, value_name = "RADIANCE", value_parser = parse_positive)]
    pub clamp: Option<f64>,
    /// Save the state to this file at intervals, at the end, and on Ctrl-C, SIGTERM and SIGHUP
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Time between checkpoints
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = parse_duration, default_value = "60s", requires = "checkpoint")]
    #[serde(deserialize_with = "keys::some_time")]
    pub checkpoint_every: Duration,
    /// Resume from the checkpoint
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,
    /// Keep the light that is learned at later fibres in this file, for other pictures of the same cloth and lights
    #[arg(long, value_name = "FILE")]
    pub save_light: Option<PathBuf>,
    /// Take light of this file, which --save-light wrote for the same cloth and lights, instead of learning it: for other cameras, as on a turntable
    #[arg(long, value_name = "FILE")]
    pub load_light: Option<PathBuf>,
    /// Engine that traces the paths; auto uses a graphics card or the widest vector kernel that computer and scene allow, otherwise the general walk. The noise depends on which of the three traces, not on the width of the kernel
    #[arg(long, alias = "backend", value_enum, default_value = "auto")]
    #[serde(deserialize_with = "keys::name")]
    pub engine: EngineName,
    /// Remove the noise of the picture by Open Image Denoise, where that is installed. An .exr keeps the noisy colours in noisy.R, noisy.G and noisy.B; of a .png the noisy picture is written beside it, NAME.noisy.png
    #[arg(long)]
    pub denoise: bool,
    /// Camera and lights for a fabric, a draft or a weave [default: swatch]; a scene has its own
    #[arg(long, value_name = "STUDIO", value_enum)]
    #[serde(deserialize_with = "keys::some_name")]
    pub studio: Option<StudioName>,
    /// Make yarns that the threads have no room for finer until they fit
    #[arg(long)]
    pub fit_yarn: bool,
    /// Override any key of the scene file, e.g. --set render.seed=7 or --set object.0.fabric=my.toml (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    #[serde(deserialize_with = "keys::overrides")]
    pub set: Vec<String>,
}

impl Default for Render {
    fn default() -> Render {
        Render {
            scene: PathBuf::new(),
            spp: None,
            seed: None,
            crop: None,
            samples: None,
            time_limit: None,
            target_error: None,
            target_median_error: None,
            clamp: None,
            checkpoint: None,
            checkpoint_every: Duration::from_secs(60),
            resume: false,
            save_light: None,
            load_light: None,
            engine: EngineName::Auto,
            denoise: false,
            studio: None,
            fit_yarn: false,
            set: Vec::new(),
        }
    }
}

type RenderJob = Job<Render>;

impl Request for Render {
    const NAME: &'static str = "render";
    type Output = Picture;

    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        let format = picture::format(path)?;
        if let (Some(part), false) = (&self.samples, format.keeps_sums) {
            let parts = format!("{}..{} makes a part", part.start, part.end);
            let endings = Format::list_endings(|f| f.keeps_sums);
            let why = format!("{parts}, and parts are merged from {endings}; name one");
            let e = InputError::after_option("samples", why).in_file(path);
            return Err(anyhow::Error::new(e).into());
        }
        match self.denoise {
            true => Ok(picture::files_of_denoised(path)?),
            false => Ok(vec![path.to_owned()]),
        }
    }

    fn further_places(&self) -> Vec<Place> {
        let light = Place::of_key(self.save_light.as_ref(), PlaceKind::File);
        let checkpoint = Place::of_key(self.checkpoint.as_ref(), PlaceKind::Continued);
        light.into_iter().chain(checkpoint).collect()
    }

    fn check(&self, context: &Context) -> Result<()> {
        keys::check("spp", self.spp, whole::<u32>(1..=u64::from(u32::MAX)))?;
        let shares = [
            ("target_error", self.target_error),
            ("target_median_error", self.target_median_error),
        ];
        for (field, share) in shares {
            keys::check(field, share, parse_share)?;
        }
        keys::check("clamp", self.clamp, parse_positive)?;
        let samples = self.samples.as_ref();
        let samples = samples.map(|part| format!("{}..{}", part.start, part.end));
        keys::check("samples", samples, parse_range)?;
        if self.scene.as_os_str().is_empty() {
            return Err(of_option(
                "scene",
                "expected a scene, a fabric, a draft or a weave",
            ));
        }
        if self.samples.is_some() && self.spp.is_some() {
            return Err(of_option("samples", "cannot be combined with --spp"));
        }
        if self.resume && self.checkpoint.is_none() {
            return Err(of_option("resume", "expected a --checkpoint, too"));
        }
        let read = [&self.scene].into_iter().chain(&self.load_light);
        for path in &context.outputs {
            files::check_not_an_input(path, read.clone())?;
        }
        if let Some(path) = &self.save_light {
            for picture in &context.outputs {
                files::check_distinct(("the light", path), ("the picture", picture))?;
            }
            if let Some(checkpoint) = &self.checkpoint {
                files::check_distinct(("the light", path), ("the checkpoint", checkpoint))?;
            }
            context.check_writable(path)?;
            files::check_not_an_input(path, read.clone())?;
        }
        if let Some(path) = &self.checkpoint {
            context.check_writable(path)?;
            for picture in &context.outputs {
                files::check_distinct(("the checkpoint", path), ("the picture", picture))?;
            }
            files::check_not_an_input(path, [&self.scene])?;
            if path.exists() && !self.resume {
                let why = "already exists; continue it with --resume, or remove it";
                return Err(of_file(path, why));
            }
        }
        if self.denoise {
            if context.outputs.is_empty() {
                let why =
                    "expected an --outfile, too: only the picture that is written is denoised";
                return Err(of_option("denoise", why));
            }
            Denoiser::find(false)?;
        }
        Ok(())
    }

    fn work(job: &RenderJob) -> Result<Picture> {
        match made_scene::in_studio(job)? {
            Some(made) => render(&made),
            None => render(job),
        }
    }
}

impl Render {
    /// Width and height of the picture, pixels, once the scene was read and checked; nothing is built.
    ///
    /// # Errors
    /// What is wrong with the scene.
    pub fn resolution(&self, context: &Context) -> Result<[u32; 2], Error> {
        Job::run(self, context, |job| {
            let made = made_scene::in_studio(job)?;
            scene::resolution(made.as_ref().unwrap_or(job))
        })
    }

    /// The errors that end it.
    fn targets(&self) -> Targets {
        Targets {
            picture: self.target_error,
            median: self.target_median_error,
        }
    }

    /// The flag that keeps or takes learned light, if one is given.
    fn light_flag(&self) -> Option<&'static str> {
        let save = self.save_light.as_ref().map(|_| "--save-light");
        save.or_else(|| self.load_light.as_ref().map(|_| "--load-light"))
    }
}

/// A render before its first sample.
struct Prepared<'a> {
    rendering: Rendering<'a>,
    identity: Identity,
    why_walk: Option<KernelRefusal>,
}

/// Chooses the engine of a scene and lays the scene out for it.
fn prepare<'a>(args: &RenderJob, built: &'a Built) -> Result<Prepared<'a>> {
    let Built { file, scene, .. } = built;
    let settings = scene::settings(args, file, scene)?;
    let waiting = Waiting::new("laying out", &args.context);
    let engine = engine::choose(args, file, scene, &settings, built.max_bytes)?;
    drop(waiting);
    engine.warn(args);
    let rendering = Rendering::new(scene, settings).map_err(|e| match e {
        RenderError::EmptyCrop(..) => of_option("crop", e),
        _ => input(e.to_string()),
    })?;
    let mut identity = Identity {
        code: version::code(),
        seed: file.render.seed,
        crop: crop_edges(rendering.crop()),
        engine: engine.kind(),
        engines: String::new(),
        inputs: built.inputs.clone(),
        scene: built.digest.clone(),
    };
    let key = kept_light::key(&built.lit, &built.inputs);
    let plan = cache_plan(args, built, &key)?;
    let Chosen { engine, why_walk } = engine;
    check_light(args, engine.as_deref(), plan.as_ref())?;
    if let (Some(engine), Some(plan)) = (&engine, &plan) {
        check_cache(args, engine.as_ref(), plan, built.max_bytes)?;
    }
    let rendering = match engine {
        Some(engine) => rendering.with_engine(engine),
        None => rendering,
    };
    let rendering = match file.render.clamp {
        Some(limit) => rendering.with_clamp(limit),
        None => rendering,
    };
    let rendering = match file.render.direct {
        true => rendering.with_direct(),
        false => rendering,
    };
    let rendering = match plan {
        Some(plan) => learned(args, rendering, &plan)?,
        None => rendering,
    };
    if let Some(path) = &args.save_light
        && let Some(light) = rendering.kept_light()
    {
        kept_light::write(path, &key, &args.scene, &light)?;
    }
    // Without a bound, samples would be taken for a target that they cannot reach.
    let shared = Targets {
        picture: Some(rendering.shared_noise()),
        median: Some(rendering.shared_pixel_noise().median),
    };
    if args.spp.is_none() && args.samples.is_none() && !args.targets().can_be_met_beside(&shared) {
        return Err(of_file(
            &args.scene,
            format!(
                "the light that samples share has {:.1} % of noise, {:.1} % of a pixel in the \
                 median, above the target error; more samples do not lessen it; expected \
                 render.cache = \"second-fibre\", a higher render.cache_learning, or --spp",
                100.0 * rendering.shared_noise(),
                100.0 * rendering.shared_pixel_noise().median
            ),
        ));
    }
    if let Some(cache) = rendering.cache() {
        identity.scene = identity::with_cache(&identity.scene, cache.digest);
    }
    Ok(Prepared {
        rendering,
        identity,
        why_walk,
    })
}

/// What the picture learns, with the light that it is given.
fn cache_plan(args: &RenderJob, built: &Built, key: &Key) -> Result<Option<CachePlan>> {
    let (file, mut table) = (&built.file, built.file.render.clone());
    let resolution = file.camera(&args.scene)?.resolution;
    // A small picture leaves it out by itself.
    if args.light_flag().is_some()
        && table.cache.is_none()
        && table.cache_plan(resolution).is_none()
    {
        table.cache = Some(CacheName::SecondFibre);
    }
    let mut plan = table.cache_plan(resolution);
    if let (Some(path), Some(plan)) = (&args.load_light, &mut plan) {
        let light = kept_light::read(
            path,
            key,
            &args.scene,
            plan.bytes / 8,
            &args.context.loader(),
        )?;
        plan.kept = Some(Arc::new(light));
    }
    Ok(plan)
}

/// Refuses to keep light where none is learned, and light that was learned in matter that is laid
/// out otherwise.
fn check_light(
    args: &RenderJob,
    engine: Option<&dyn Engine>,
    plan: Option<&CachePlan>,
) -> Result<()> {
    let Some(flag) = args.light_flag() else {
        return Ok(());
    };
    let (Some(engine), Some(plan)) = (engine.filter(|engine| engine.can_learn()), plan) else {
        return Err(InputError::of_option(
            flag,
            "this picture has no cache of radiance; expected cloth of fibres on a processor, \
             render.cache other than \"off\", and no clamp",
        )
        .in_file(&args.scene)
        .into());
    };
    if let (Some(path), Some(light)) = (&args.load_light, &plan.kept)
        && !engine.takes_light(light)
    {
        return Err(of_file(
            path,
            format!(
                "is light of another level of detail than this camera shows of {}",
                args.scene.display()
            ),
        ));
    }
    Ok(())
}

/// Refuses a cache for which the matter leaves no memory.
fn check_cache(
    args: &RenderJob,
    engine: &dyn Engine,
    plan: &CachePlan,
    max_bytes: u64,
) -> Result<()> {
    let left = max_bytes.saturating_sub(engine.memory_bytes());
    if !engine.can_learn() || plan.bytes <= left {
        return Ok(());
    }
    let why = match left >> 20 {
        0 => "render.cache = \"off\"".into(),
        mib => format!("render.cache_mib of at most {mib}"),
    };
    Err(of_file(
        &args.scene,
        format!(
            "the cache of radiance takes up to {} MiB of memory, and {} are left of {} that are \
             allowed; expected {why}, or more memory",
            plan.bytes >> 20,
            left >> 20,
            max_bytes >> 20
        ),
    ))
}

/// The same rendering once its cache is learned.
fn learned<'a>(
    args: &RenderJob,
    rendering: Rendering<'a>,
    plan: &CachePlan,
) -> Result<Rendering<'a>> {
    const UNITS: f64 = 1e4;
    let progress = Progress::new("learning", UNITS as u64, &args.context);
    let rendering = rendering.with_cache(plan, &|share| progress.at((share * UNITS) as u64))?;
    progress.finish();
    if let Some(cache) = rendering.cache()
        && cache.is_surely_above(plan.block_error)
    {
        args.context.warn(format!(
            "{}: the cache of radiance is off by {:.1} % of the mean in blocks \
             of {edge} x {edge} pixels, more than render.cache_error allows{after}",
            args.scene.display(),
            100.0 * cache.block_error().0,
            edge = CacheReport::BLOCK,
            after = match args.load_light {
                Some(_) => "",
                None => ", after four times the usual learning",
            },
        ));
    }
    Ok(rendering)
}

fn render(args: &RenderJob) -> Result<Picture> {
    let started = Instant::now();
    let denoiser = args.denoise.then(|| Denoiser::find(false)).transpose()?;
    let built = watched(&args.context, |loader| scene::build(args, loader))?;
    let (began, setup_cpu_s) = (Instant::now(), cpu_seconds());
    let Prepared {
        rendering,
        mut identity,
        why_walk,
    } = prepare(args, &built)?;
    let prepare_cpu_s = cpu_seconds() - setup_cpu_s;
    let prepare_s = began.elapsed().as_secs_f64();
    let rendering = match args.checkpoint.as_deref().filter(|_| args.resume) {
        Some(path) => {
            let why = why_walk.as_ref().map(ToString::to_string);
            checkpoint::resume(path, &mut identity, why.as_deref(), rendering)?
        }
        None => rendering,
    };
    let paths_before = rendering.stats().paths;
    args.context.listener.picture(rendering.film());
    let (rendering, stop) = tracing::trace(args, &identity, rendering, started)?;
    let saved = match &args.checkpoint {
        Some(path) => checkpoint::save(path, &identity, &rendering),
        None => Ok(()),
    };
    if stop == Stop::Interrupted {
        match &args.checkpoint {
            Some(path) if saved.is_ok() => {
                let taken = summary::describe_samples_taken(&rendering);
                let at = path.display();
                let why =
                    format!("interrupted with {taken}; saved to {at}, continue with --resume");
                return Err(anyhow::Error::msg(why));
            }
            _ if !args.context.keeps_stopped => return Err(Stopped.into()),
            _ => {}
        }
    }
    let times = Times {
        setup_cpu_s,
        prepare_cpu_s,
        prepare_s,
        render_cpu_s: cpu_seconds() - setup_cpu_s,
        render_s: began.elapsed().as_secs_f64(),
    };
    let finished = output::Finished {
        args,
        built: &built,
        identity: &identity,
        why_walk: why_walk.as_ref(),
        times,
        stop,
        paths_before,
        started,
    };
    Ok(finished.picture(rendering, denoiser, saved))
}
