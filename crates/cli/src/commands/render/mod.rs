//! `organza render`

mod contact_sheet;
mod engine;
mod made_scene;
mod results;
mod scene;
mod summary;
mod tracing;

pub use summary::CLAMPED;

use super::{Command, with_threads};
use crate::building::watched;
use crate::checkpoint;
use crate::denoising::Denoiser;
use crate::display_server::{Address, DisplayServer};
use crate::error::{InputError, after_option, input, of_file, of_option};
use crate::flags::display::DisplayArgs;
use crate::flags::studio::StudioArgs;
use crate::flags::values::{
    parse_crop, parse_duration, parse_positive, parse_seed, parse_share, whole,
};
use crate::flags::{CacheArgs, CommonArgs, MemoryArgs, set_help};
use crate::identity::{self, Identity, crop_edges};
use crate::interrupt;
use crate::kept_light;
use crate::output;
use crate::output::note;
use crate::picture;
use crate::process_usage::cpu_seconds;
use crate::progress::Progress;
use crate::sample_ranges::parse_range;
use crate::schedule::{Stop, Targets};
use crate::version;
use crate::waiting::Waiting;
use anyhow::{Context, Result};
use clap::Args;
use clap::builder::ArgPredicate;
use engine::{Chosen, EngineName};
use organza_cache::Key;
use organza_picture::{FORMATS, Format, Layers, Rendered};
use organza_scene::scene_file::CacheName;
use organza_transport::{
    CachePlan, CacheReport, Crop, Engine, KernelRefusal, RenderError, Rendering,
};
use scene::Built;
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use summary::Times;

/// `organza render`
#[derive(Clone, Debug, Args)]
#[command(about = "Path-trace a scene, or any cloth in a studio, to .exr (linear, with variance and AOVs) or .png", after_help = "Examples:\n  organza render twill-3-1-s -o twill.png\n  organza render my_draft.wif -o my_draft.png --studio macro\n  organza render scenes/fabrics/denim.toml -o denim.png --spp 128\n  organza render scenes/first_light.toml -o first_light.exr --spp 256 --stats\n\nA cloth in a studio takes up to a minute on two cores; Ctrl-C keeps the picture so far.", mut_arg("set", |a| a.help(set_help::SCENE)),
    mut_arg("outfile", |a| a.help(outfile_help())))]
pub struct RenderArgs {
    /// Scene or fabric file (TOML), draft (.wif), or the name of a weave such as twill-3-1-s
    pub scene: PathBuf,
    /// Further ones, with --contact-sheet
    pub more_scenes: Vec<PathBuf>,
    /// Picture to write; its ending chooses the format
    #[arg(
        short,
        long,
        required = false,
        required_unless_present = "contact_sheet",
        default_value_if("contact_sheet", ArgPredicate::IsPresent, "sheet.png")
    )]
    pub outfile: PathBuf,
    /// Render all scenes at a small size to one labelled picture instead (.png)
    #[arg(long, value_name = "SHEET.png", conflicts_with_all = contact_sheet::CONFLICTS)]
    pub contact_sheet: Option<PathBuf>,
    /// Longer edge of a picture on a contact sheet, pixels [default: 256]
    #[arg(long, value_name = "N", value_parser = whole::<u32>(16..=2048))]
    pub cell_px: Option<u32>,
    /// Samples per pixel, at least 1; the maximum with --time-limit or a target error [default: the scene's; with a target error 65536]
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1..=u64::from(u32::MAX)))]
    pub spp: Option<u32>,
    /// Seed of all random numbers [default: the scene's]
    #[arg(long, value_name = "N", value_parser = parse_seed)]
    pub seed: Option<u64>,
    /// Render only these pixels: left, top, right, bottom (right and bottom outside), counted from the upper left
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true, value_parser = parse_crop)]
    pub crop: Option<Crop>,
    /// Take only these samples of every pixel; `organza merge` combines the parts (.exr)
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = parse_range, conflicts_with = "spp")]
    pub samples: Option<Range<u64>>,
    /// Stop when this time has passed since the start, e.g. 60s, 5m, 2h; a bare number is seconds
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = parse_duration)]
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
    pub engine: EngineName,
    /// Remove the noise of the picture by Open Image Denoise, where that is installed. An .exr keeps the noisy colours in noisy.R, noisy.G and noisy.B; of a .png the noisy picture is written beside it, NAME.noisy.png
    #[arg(long)]
    pub denoise: bool,
    /// Show the picture while it renders, in a viewer with tev's protocol that listens there, e.g. 127.0.0.1:14158
    #[arg(long, value_name = "HOST:PORT", value_parser = Address::parse)]
    pub display_server: Option<Address>,
    /// Print counts of collisions, shadow steps and rejected samples, fireflies and memory
    #[arg(long)]
    pub stats: bool,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub studio: StudioArgs,
    #[command(flatten)]
    pub display: DisplayArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for RenderArgs {
    const NAME: &'static str = "render";
    const OUTPUT: Option<&'static str> = Some("picture.exr");

    fn common(&mut self) -> Option<&mut CommonArgs> {
        Some(&mut self.common)
    }

    fn run(&self) -> Result<()> {
        if let Some(path) = &self.contact_sheet {
            return contact_sheet::run(self, path);
        }
        if let Some(more) = self.more_scenes.first() {
            let why = "expected one scene; several are rendered with --contact-sheet";
            return Err(of_file(more, why));
        }
        if self.cell_px.is_some() {
            return Err(after_option("cell_px", "belongs to --contact-sheet"));
        }
        let format = picture::format(&self.outfile)?;
        if let (Some(part), false) = (&self.samples, format.keeps_sums) {
            return Err(InputError::after_option(
                "samples",
                format!(
                    "{}..{} makes a part, and parts are merged from {}; name one",
                    part.start,
                    part.end,
                    Format::list_endings(|f| f.keeps_sums)
                ),
            )
            .in_file(&self.outfile)
            .into());
        }
        let mut outputs = vec![self.outfile.clone()];
        if self.denoise {
            outputs = picture::files_of_denoised(&self.outfile)?;
        }
        if let Some(path) = &self.save_light {
            for picture in &outputs {
                output::check_distinct(("the light", path), ("the picture", picture))?;
            }
            if let Some(checkpoint) = &self.checkpoint {
                output::check_distinct(("the light", path), ("the checkpoint", checkpoint))?;
            }
            outputs.push(path.clone());
        }
        for path in &outputs {
            output::check_writable(path)?;
            output::check_not_an_input(path, [&self.scene].into_iter().chain(&self.load_light))?;
        }
        if let Some(path) = &self.checkpoint {
            check_checkpoint(path, self)?;
            // A program that runs the command has its own way to stop it.
            if self.common.host.caller().is_none() {
                interrupt::watch()?;
            }
        }
        with_threads(&self.common, || match made_scene::in_studio(self)? {
            Some(args) => render(&args),
            None => render(self),
        })
    }
}

impl RenderArgs {
    /// The flag that keeps or takes learned light, if one is given.
    fn light_flag(&self) -> Option<&'static str> {
        let save = self.save_light.as_ref().map(|_| "--save-light");
        save.or_else(|| self.load_light.as_ref().map(|_| "--load-light"))
    }
}

/// Every format that can be written.
fn outfile_help() -> String {
    let written = FORMATS.iter().filter(|f| f.writer.is_some());
    let one = |f: &&&Format| format!(".{} ({})", f.endings[0], f.keeps);
    let formats: Vec<String> = written.map(|f| one(&f)).collect();
    format!("Picture to write: {}", formats.join("; "))
}

/// Refuses to lose what stands in the checkpoint's place.
fn check_checkpoint(path: &Path, args: &RenderArgs) -> Result<()> {
    output::check_writable(path)?;
    output::check_distinct(("the checkpoint", path), ("the picture", &args.outfile))?;
    output::check_not_an_input(path, [&args.scene])?;
    if path.exists() && !args.resume {
        return Err(of_file(
            path,
            "already exists; continue it with --resume, or remove it",
        ));
    }
    Ok(())
}

/// The errors that end a render.
fn targets(args: &RenderArgs) -> Targets {
    Targets {
        picture: args.target_error,
        median: args.target_median_error,
    }
}

/// A render before its first sample.
struct Prepared<'a> {
    rendering: Rendering<'a>,
    identity: Identity,
    why_walk: Option<KernelRefusal>,
}

/// Chooses the engine of a scene and lays the scene out for it.
fn prepare<'a>(args: &RenderArgs, built: &'a Built) -> Result<Prepared<'a>> {
    let Built { file, scene, .. } = built;
    let settings = scene::settings(args, file, scene)?;
    let waiting = Waiting::new("laying out", &args.common);
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
    if args.spp.is_none() && args.samples.is_none() && !targets(args).can_be_met_beside(&shared) {
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
fn cache_plan(args: &RenderArgs, built: &Built, key: &Key) -> Result<Option<CachePlan>> {
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
        let light = kept_light::read(path, key, &args.scene, plan.bytes / 8)?;
        plan.kept = Some(Arc::new(light));
    }
    Ok(plan)
}

/// Refuses to keep light where none is learned, and light that was learned in matter that is laid
/// out otherwise.
fn check_light(
    args: &RenderArgs,
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
    args: &RenderArgs,
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
    args: &RenderArgs,
    rendering: Rendering<'a>,
    plan: &CachePlan,
) -> Result<Rendering<'a>> {
    const UNITS: f64 = 1e4;
    let progress = Progress::new("learning", UNITS as u64, &args.common);
    let rendering = rendering.with_cache(plan, &|share| {
        let answer = progress.at((share * UNITS) as u64);
        match interrupt::came() {
            true => ControlFlow::Break(()),
            false => answer,
        }
    })?;
    progress.finish();
    if let Some(cache) = rendering.cache()
        && cache.is_surely_above(plan.block_error)
        && !args.common.quiet
    {
        note!(
            "organza: warning: {}: the cache of radiance is off by {:.1} % of the mean in blocks \
             of {edge} x {edge} pixels, more than render.cache_error allows{after}",
            args.scene.display(),
            100.0 * cache.block_error().0,
            edge = CacheReport::BLOCK,
            after = match args.load_light {
                Some(_) => "",
                None => ", after four times the usual learning",
            },
        );
    }
    Ok(rendering)
}

fn render(args: &RenderArgs) -> Result<()> {
    let started = Instant::now();
    let denoiser = args.denoise.then(|| Denoiser::find(false)).transpose()?;
    let built = watched(&args.common, &args.cache, |loader| {
        scene::build(args, loader)
    })?;
    let file = &built.file;
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
    let display = args.display_server.as_ref().map(|address| {
        let (name, size) = (args.outfile.to_string_lossy(), rendering.film().size());
        DisplayServer::start(address, &name, size, args.common.quiet)
    });
    // What is built is lost in any case; from here on the first interrupt keeps the picture.
    if args.checkpoint.is_none() && args.common.host.caller().is_none() {
        interrupt::watch()?;
    }
    let (rendering, stop) = tracing::trace(args, &identity, rendering, started, display.as_ref())?;
    let saved = match &args.checkpoint {
        Some(path) => checkpoint::save(path, &identity, &rendering),
        None => Ok(()),
    };
    if let (Some(path), Stop::Interrupted, Ok(())) = (&args.checkpoint, stop, &saved) {
        return Err(anyhow::anyhow!(
            "interrupted with {}; saved to {}, continue with --resume",
            summary::describe_samples_taken(&rendering),
            path.display()
        ));
    }
    let times = Times {
        setup_cpu_s,
        prepare_cpu_s,
        prepare_s,
        render_cpu_s: cpu_seconds() - setup_cpu_s,
        render_s: began.elapsed().as_secs_f64(),
    };
    let attributes = summary::attributes(args, file, &identity, &rendering);
    let in_file = !picture::is_linear(&args.outfile);
    let shown = args.display.over(file.render.display());
    let shown = picture::resolved(&args.outfile, rendering.film(), shown, args.common.quiet);
    let errors = summary::cache_errors(&rendering);
    let rendered = Rendered {
        layers: Layers {
            direct: rendering.direct(),
            cache_error: errors.as_deref(),
        },
        ..Rendered::new(rendering.film(), shown, &attributes)
    };
    let figures = || {
        let why = why_walk.as_ref();
        let shown = in_file.then_some(shown);
        summary::figures(
            &rendering,
            why,
            &built.chosen,
            &times,
            shown,
            times.render_s,
        )
    };
    let host = &args.common.host;
    host.give(|| results::of(rendering.film(), rendered.layers, figures()));
    match &denoiser {
        _ if !host.writes() => {}
        Some(denoiser) => {
            let threads = args.common.threads;
            denoiser.write(&args.outfile, &rendered, threads, built.max_bytes)?;
        }
        None => picture::write(&args.outfile, &rendered)?,
    }
    let total_s = started.elapsed().as_secs_f64();
    if !args.common.quiet {
        let paths = rendering.stats().paths - paths_before;
        summary::print(
            args,
            file,
            &rendering,
            why_walk.as_ref(),
            paths,
            &times,
            total_s,
        );
        summary::print_reason(&rendering, stop, targets(args));
    }
    if args.json {
        summary::print_json(
            &rendering,
            why_walk.as_ref(),
            &built.chosen,
            &times,
            in_file.then_some(shown),
            total_s,
        )?;
    }
    if let Some(display) = display {
        display.finish(rendering.film());
    }
    if stop == Stop::Interrupted {
        return Err(anyhow::anyhow!(
            "interrupted with {}; {} holds the picture so far",
            summary::describe_samples_taken(&rendering),
            args.outfile.display()
        ));
    }
    // The picture is whole whatever became of the checkpoint.
    saved.with_context(|| {
        format!(
            "the picture {} with {} is written, but not the checkpoint",
            args.outfile.display(),
            summary::describe_samples_taken(&rendering)
        )
    })?;
    summary::check_no_sample_rejected(&rendering, &args.outfile)
}
