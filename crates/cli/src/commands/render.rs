//! `organza render`

use super::{Command, with_threads};
use crate::building::watched;
use crate::checkpoint;
use crate::error::input;
use crate::flags::values::{
    parse_crop, parse_duration, parse_positive, parse_seed, parse_share, whole,
};
use crate::flags::{CommonArgs, MemoryArgs, set_help};
use crate::identity::{self, Identity, crop_words};
use crate::interrupt;
use crate::output;
use crate::output::note;
use crate::picture;
use crate::process_usage::{cpu_seconds, peak_memory_bytes};
use crate::progress::Progress;
use crate::sample_ranges::SampleRanges;
use crate::sample_ranges::parse_range;
use crate::schedule::{Next, Schedule, Stop, Targets};
use anyhow::Result;
use clap::Args;
use glam::UVec2;
use organza_picture::{Attributes, Format, Rendered};
use organza_scene::auto::{self, Chosen};
use organza_scene::loader::Loader;
use organza_scene::memory::free_memory_bytes;
use organza_scene::scene_build::{self, BuildOptions};
use organza_scene::scene_file::{self, SceneFile};
use organza_transport::{
    Backend, Crop, Film, Integrator, Kernel, KernelRefusal, Pixel, RenderError, RenderSettings,
    Rendering, Scene, flatten,
};
use serde_json::json;
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};
use std::time::Duration;
use std::time::Instant;

/// `organza render`
#[derive(Debug, Args)]
#[command(about = "Path-trace a scene to .exr (linear, with variance and AOVs) or .png", after_help = "Example:\n  organza render scenes/first_light.toml -o first_light.exr --spp 256 --stats", mut_arg("set", |a| a.help(set_help::SCENE)))]
pub struct RenderArgs {
    /// Scene file (TOML)
    pub scene: PathBuf,
    /// Picture to write: .exr or .png
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Samples per pixel, at least 1; the maximum with --target-error or --time-limit [default: the scene's]
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
    /// Save the state to this file at intervals, when interrupted and at the end
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Time between checkpoints
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = parse_duration, default_value = "60s", requires = "checkpoint")]
    pub checkpoint_every: Duration,
    /// Resume from the checkpoint
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,
    /// Engine that traces the paths; auto uses the widest vector kernel that processor and scene allow, otherwise the general walk
    #[arg(long, value_enum, default_value = "auto")]
    pub backend: BackendName,
    /// Print counts of collisions, shadow steps and rejected samples, fireflies and memory
    #[arg(long)]
    pub stats: bool,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for RenderArgs {
    const NAME: &'static str = "render";

    fn run(&self) -> Result<()> {
        run(self)
    }
}

/// What walks the paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BackendName {
    /// The widest kernel that processor and scene allow, otherwise the walk
    Auto,
    /// The general walk, which supports every scene
    Walk,
    /// The kernel, one path at a time
    Scalar,
    /// The kernel, 16 paths at a time
    Avx2,
    /// The kernel, 32 paths at a time
    Avx512,
}

/// Runs the command.
pub fn run(args: &RenderArgs) -> Result<()> {
    let format = picture::format(&args.outfile)?;
    if let (Some(part), false) = (&args.samples, format.keeps_sums) {
        return Err(input(format!(
            "{}: --samples {}..{} makes a part, and parts are merged from {}; name one",
            args.outfile.display(),
            part.start,
            part.end,
            Format::list_endings(|f| f.keeps_sums)
        )));
    }
    output::check_writable(&args.outfile)?;
    if let Some(path) = &args.checkpoint {
        check_checkpoint(path, args)?;
        interrupt::watch()?;
    }
    with_threads(&args.common, || render_scene(args))
}

/// Refuses to lose what stands in the checkpoint's place.
fn check_checkpoint(path: &Path, args: &RenderArgs) -> Result<()> {
    output::check_writable(path)?;
    let fail = |why: &str| Err(input(format!("{}: {why}", path.display())));
    if path == args.outfile || path == args.scene {
        return fail("is the name of the checkpoint and of another file");
    }
    if path.exists() && !args.resume {
        return fail("already exists; continue it with --resume, or remove it");
    }
    Ok(())
}

fn render_scene(args: &RenderArgs) -> Result<()> {
    let started = Instant::now();
    let built = watched(args.common.quiet, |loader| build(args, loader))?;
    let Built {
        file,
        scene,
        chosen,
        most_bytes,
        inputs,
    } = built;
    let settings = settings(args, &file, &scene)?;
    let kernel = kernel(args, &file, &scene, &settings, most_bytes)?;
    let refusal = kernel.as_ref().err().copied();
    let rendering = Rendering::new(&scene, settings).map_err(|e| match e {
        RenderError::EmptyCrop(..) => input(format!("--crop: {e}")),
        _ => input(e.to_string()),
    })?;
    let rendering = match kernel {
        Ok(kernel) => rendering.with_kernel(kernel),
        Err(_) => rendering,
    };
    let rendering = match file.render.clamp {
        Some(limit) => rendering.with_clamp(limit),
        None => rendering,
    };
    let identity = Identity {
        scene: identity::scene_digest(&file, &inputs, rendering.kernel().is_some()),
        seed: file.render.seed,
        crop: rendering.crop(),
    };
    let (tracing, setup_cpu_s) = (Instant::now(), cpu_seconds());
    let resumed = args.checkpoint.as_deref().filter(|_| args.resume);
    let rendering = match resumed {
        Some(path) => checkpoint::resume(path, &identity, rendering)?,
        None => rendering,
    };
    let paths_before = rendering.stats().paths;
    let (rendering, stop) = trace(args, &identity, rendering, started)?;
    if let Some(path) = &args.checkpoint {
        checkpoint::save(path, &identity, &rendering)?;
        if stop == Stop::Interrupted {
            return Err(anyhow::anyhow!(
                "interrupted with {}; saved to {}, continue with --resume",
                taken_words(&rendering),
                path.display()
            ));
        }
    }
    let render_s = tracing.elapsed().as_secs_f64();
    let render_cpu_s = cpu_seconds() - setup_cpu_s;
    let attributes = attributes(args, &file, &identity, &rendering);
    let film = rendering.film();
    let rendered = Rendered {
        film,
        exposure_stops: file.render.exposure,
        attributes: &attributes,
    };
    picture::write(&args.outfile, &rendered)?;
    warn_of_rejected_samples(&rendering);
    if !args.common.quiet {
        report(
            args,
            &file,
            &rendering,
            refusal.flatten(),
            rendering.stats().paths - paths_before,
            render_s,
            started.elapsed().as_secs_f64(),
        );
        say_why(&rendering, stop, targets(args));
    }
    if args.json {
        let timing = Timing {
            setup_cpu_s,
            render_cpu_s,
            render_s,
            total_s: started.elapsed().as_secs_f64(),
        };
        print_figures(&rendering, refusal.flatten(), &chosen, &timing)?;
    }
    Ok(())
}

/// Samples that no film holds are missing from the picture, which nobody would see.
fn warn_of_rejected_samples(rendering: &Rendering<'_>) {
    let stats = rendering.stats();
    if stats.rejected > 0 {
        note!(
            "organza: warning: {} of {} samples were brighter than {:e} or not finite and are \
             left out: the picture is darker than it should be; use dimmer lights and more \
             exposure",
            stats.rejected,
            stats.paths,
            Pixel::RADIANCE_LIMIT
        );
    }
}

/// A scene that is ready to be rendered.
struct Built {
    file: SceneFile,
    scene: Scene,
    chosen: Vec<Chosen>,
    /// Memory that the film leaves.
    most_bytes: u64,
    /// Digests of the files that the scene names, sorted.
    inputs: Vec<[u8; 32]>,
}

fn build(args: &RenderArgs, loader: &Loader<'_>) -> Result<Built> {
    let mut file = scene_file::load(&args.scene, &args.common.set, loader)?;
    if let Some(spp) = args.spp {
        file.render.spp = spp;
    }
    if let Some(seed) = args.seed {
        file.render.seed = seed;
    }
    if let Some(clamp) = args.clamp {
        file.render.clamp = Some(clamp as f32);
    }
    check(args, &file, loader)?;
    let most_bytes = memory_beside_film(args, &file)?;
    let chosen = auto::resolve(&mut file, &args.scene, loader)?;
    if !args.common.quiet {
        for chosen in &chosen {
            note!("{}: {chosen}", args.scene.display());
        }
    }
    let build = BuildOptions {
        scene_path: &args.scene,
        loader,
        max_memory_bytes: Some(most_bytes),
    };
    let inputs_before = loader.inputs().len();
    let scene = scene_build::scene(&file, &build)?;
    let read = loader.inputs();
    let mut inputs: Vec<_> = read[inputs_before..].iter().map(|i| i.digest).collect();
    inputs.sort_unstable();
    Ok(Built {
        file,
        scene,
        chosen,
        most_bytes,
        inputs,
    })
}

/// Refuses before anything is voxelized what can be checked by then.
fn check(args: &RenderArgs, file: &SceneFile, loader: &Loader<'_>) -> Result<()> {
    let fail = |why| input(format!("{}: render.{why}", args.scene.display()));
    file.render.check().map_err(fail)?;
    scene_build::check(file, &args.scene)?;
    let size = UVec2::from(file.camera.resolution);
    let crop = args.crop.unwrap_or(Crop {
        min: UVec2::ZERO,
        max: size,
    });
    if let Some(why) = crop_fault(crop, size) {
        return Err(input(format!("--crop {}: {why}", crop_words(crop))));
    }
    if let Some(path) = args.checkpoint.as_deref().filter(|_| args.resume) {
        checkpoint::check(path, file.render.seed, crop, &samples(args, file))?;
    }
    scene_build::warn_of_emptiness(file, &args.scene, loader);
    Ok(())
}

/// Which edge of a crop is where it cannot be.
fn crop_fault(crop: Crop, size: UVec2) -> Option<String> {
    let Crop { min, max } = crop;
    for (near, first, far, last, pixels, extent) in [
        ("left", min.x, "right", max.x, size.x, "wide"),
        ("top", min.y, "bottom", max.y, size.y, "high"),
    ] {
        if last > pixels {
            return Some(format!(
                "its {far} edge {last} lies beyond the picture, which is {pixels} pixels {extent}"
            ));
        }
        if first >= last {
            return Some(format!(
                "its {near} edge {first} is not before its {far} edge {last}; no pixel is left"
            ));
        }
    }
    None
}

/// The samples of every pixel that are asked for.
fn samples(args: &RenderArgs, file: &SceneFile) -> Range<u64> {
    let all = || 0..u64::from(file.render.spp);
    args.samples.clone().unwrap_or_else(all)
}

/// Where the time went: of the whole process and of all its threads together
/// (CPU), and as it passed.
struct Timing {
    setup_cpu_s: f64,
    render_cpu_s: f64,
    render_s: f64,
    total_s: f64,
}

fn print_figures(
    rendering: &Rendering<'_>,
    refusal: Option<KernelRefusal>,
    chosen: &[Chosen],
    timing: &Timing,
) -> Result<()> {
    let (film, stats) = (rendering.film(), rendering.stats());
    let known = has_errors(rendering);
    let figures = json!({
        "backend": backend_name(rendering),
        "kernel_refused": refusal.map(|why| why.to_string()),
        "resolution": film.size().to_array(),
        "samples": rendering.taken().end - rendering.taken().start,
        "setup_cpu_s": timing.setup_cpu_s,
        "render_cpu_s": timing.render_cpu_s,
        "render_s": timing.render_s,
        "total_s": timing.total_s,
        "peak_memory_bytes": peak_memory_bytes(),
        "mean": film.mean().map(|m| m.0),
        "standard_error": known.then(|| film.mean().map(|m| m.1)),
        "relative_error": known.then(|| film.relative_error()),
        "collisions": stats.collisions,
        "tentative": stats.tentative,
        "shadow_rays": stats.shadow_rays,
        "shadow_steps": stats.shadow_steps,
        "cut": stats.cut,
        "rejected": stats.rejected,
        "brightest": stats.brightest,
        "chosen": chosen,
    });
    output::print(&(serde_json::to_string_pretty(&figures)? + "\n"))?;
    Ok(())
}

/// Memory that the film leaves to the scene. The film is held twice when it is
/// written or resumed.
fn memory_beside_film(args: &RenderArgs, file: &SceneFile) -> Result<u64> {
    let whole = UVec2::from(file.camera.resolution);
    let size = args
        .crop
        .map_or(whole, |c| c.max.min(whole).saturating_sub(c.min));
    let most = args.memory.max_memory.unwrap_or_else(free_memory_bytes);
    let needed = Film::memory_bytes(size).saturating_mul(2);
    most.checked_sub(needed).ok_or_else(|| {
        input(format!(
            "{}: camera.resolution: a film of {} x {} pixels needs {needed} bytes of memory, \
             {most} are allowed: render fewer pixels, or parts of them with --crop",
            args.scene.display(),
            size.x,
            size.y
        ))
    })
}

/// The errors that end a render.
fn targets(args: &RenderArgs) -> Targets {
    Targets {
        picture: args.target_error,
        median: args.target_median_error,
    }
}

/// Takes samples until the schedule or the user says stop.
fn trace<'a>(
    args: &RenderArgs,
    identity: &Identity,
    mut rendering: Rendering<'a>,
    started: Instant,
) -> Result<(Rendering<'a>, Stop)> {
    let mut schedule = Schedule::new(args.time_limit, targets(args));
    let film_size = rendering.film().size();
    let samples = rendering.left() + rendering.taken().end - rendering.taken().start;
    let paths = samples * u64::from(film_size.x) * u64::from(film_size.y);
    let progress = Progress::new("rendering", paths, args.common.quiet);
    let mut saved = Instant::now();
    let stop = loop {
        let pass = match schedule.next(&rendering, started.elapsed(), interrupt::came()) {
            Next::Stop(stop) => break stop,
            Next::Take(samples) => samples,
        };
        let pass_started = Instant::now();
        rendering = rendering.take(pass, &|timing| {
            progress.at(timing.paths_done);
            ControlFlow::Continue(())
        })?;
        schedule.took(pass, pass_started.elapsed());
        if let Some(path) = &args.checkpoint
            && saved.elapsed() >= args.checkpoint_every
            && rendering.left() > 0
        {
            checkpoint::save(path, identity, &rendering)?;
            saved = Instant::now();
        }
    };
    progress.finish();
    Ok((rendering, stop))
}

fn settings(args: &RenderArgs, file: &SceneFile, scene: &Scene) -> Result<RenderSettings> {
    let integrator = Integrator::from(file.render.integrator);
    if integrator == Integrator::Regular && !scene.media.iter().all(|m| m.is_piecewise_constant()) {
        return Err(input(format!(
            "{}: render.integrator: \"regular\" steps through constant voxels; \
             use interpolation = \"nearest\" and grids of one resolution, \
             event = \"plain\" for virtual scattering, or \"woodcock\"",
            args.scene.display()
        )));
    }
    Ok(RenderSettings {
        integrator,
        samples: samples(args, file),
        max_bounces: file.render.max_bounces.unwrap_or(u32::MAX),
        seed: file.render.seed,
        crop: args.crop,
    })
}

/// The kernel, or why there is none.
fn kernel(
    args: &RenderArgs,
    file: &SceneFile,
    scene: &Scene,
    settings: &RenderSettings,
    most_bytes: u64,
) -> Result<Result<Kernel, Option<KernelRefusal>>> {
    let backend = match args.backend {
        BackendName::Auto => Backend::widest(),
        BackendName::Walk => return Ok(Err(None)),
        BackendName::Scalar => Backend::Scalar,
        BackendName::Avx2 => Backend::Avx2,
        BackendName::Avx512 => Backend::Avx512,
    };
    let made = match file.render.clamp {
        Some(_) => Err(KernelRefusal::Clamp),
        None => flatten(scene, settings, backend, most_bytes),
    };
    match made {
        Err(why) if args.backend != BackendName::Auto => Err(input(format!(
            "--backend {}: {why}; --backend auto would use the general walk",
            backend.name()
        ))),
        made => Ok(made.map_err(Some)),
    }
}

/// The attribute that holds [`organza_transport::Stats::clamped_radiance`]: a whole number,
/// so that parts add up to the unbroken picture's.
pub const CLAMPED: &str = "clamped_radiance_2e-32";

/// What walks the paths, as pictures tell it.
fn backend_name(rendering: &Rendering<'_>) -> &'static str {
    rendering.kernel().map_or("walk", |k| k.backend().name())
}

fn attributes(
    args: &RenderArgs,
    file: &SceneFile,
    identity: &Identity,
    rendering: &Rendering<'_>,
) -> Attributes {
    let name = args.scene.file_name().unwrap_or_default();
    let mut attributes = vec![
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("scene", name.to_string_lossy().into_owned()),
        ("backend", backend_name(rendering).to_owned()),
    ];
    attributes.extend(identity.attributes(&SampleRanges::one(rendering.taken())));
    if let Some(limit) = file.render.clamp {
        attributes.push(("clamp", limit.to_string()));
        let removed = rendering.stats().clamped_radiance;
        attributes.push((CLAMPED, removed.to_string()));
    }
    attributes.into_iter().collect()
}

fn taken_words(rendering: &Rendering<'_>) -> String {
    let taken = rendering.taken().end - rendering.taken().start;
    format!("{taken} of {} samples", taken + rendering.left())
}

/// Whether errors are known: that of a single sample is not, and is no 0.
fn has_errors(rendering: &Rendering<'_>) -> bool {
    let taken = rendering.taken();
    taken.end - taken.start > 1
}

/// A number that is not known of one sample.
const UNKNOWN: &str = "unknown (one sample)";

fn say_why(rendering: &Rendering<'_>, stop: Stop, targets: Targets) {
    let film = rendering.film();
    let why = match stop {
        Stop::Done => "all samples taken",
        Stop::TimeLimit => "time limit reached",
        Stop::TargetError(_) => "",
        Stop::Interrupted => "interrupted",
    };
    let reached = match stop {
        Stop::TargetError(errors) => format!("target error reached{}", errors.words()),
        _ if !targets.are_given() => String::new(),
        _ if !has_errors(rendering) => format!(", error {UNKNOWN}"),
        _ => format!(
            ", target error {}reached{}",
            if targets.are_met(film) { "" } else { "not " },
            targets.errors(film).words()
        ),
    };
    note!(
        "stopped       {why}{reached}; {} a pixel",
        taken_words(rendering)
    );
}

fn report(
    args: &RenderArgs,
    file: &SceneFile,
    rendering: &Rendering<'_>,
    refusal: Option<KernelRefusal>,
    paths: u64,
    render_s: f64,
    total_s: f64,
) {
    let (film, stats) = (rendering.film(), rendering.stats());
    let rate = paths as f64 / render_s.max(1e-9);
    note!(
        "{}: {} x {}, {paths} paths in {total_s:.1} s ({render_s:.1} s tracing, {:.2} M paths/s)",
        args.outfile.display(),
        film.size().x,
        film.size().y,
        rate * 1e-6,
    );
    if !args.stats {
        return;
    }
    let per_path = |n: u64| n as f64 / stats.paths.max(1) as f64;
    let why = refusal.map_or(String::new(), |why| format!(": {why}"));
    note!("backend       {}{why}", backend_name(rendering));
    note!(
        "collisions    {:.3} real, {:.3} tentative a path",
        per_path(stats.collisions),
        per_path(stats.tentative)
    );
    note!(
        "shadow rays   {:.3} a path, {:.3} steps",
        per_path(stats.shadow_rays),
        per_path(stats.shadow_steps)
    );
    note!("cut           {} paths at the bounce limit", stats.cut);
    note!(
        "rejected      {} samples (NaN, infinite, negative or above {:e})",
        stats.rejected,
        Pixel::RADIANCE_LIMIT
    );
    let means = film.mean();
    if file.render.clamp.is_some() {
        let removed = stats.clamped_radiance as f64 / 2f64.powi(32);
        let kept = means.iter().map(|m| m.0).sum::<f64>() * stats.paths as f64;
        note!(
            "clamped       {} samples; {:.4} % of the light removed",
            stats.clamped,
            100.0 * removed / (removed + kept).max(f64::MIN_POSITIVE)
        );
    }
    let known = has_errors(rendering);
    for (name, (mean, se)) in ["red", "green", "blue"].iter().zip(means) {
        match known {
            true => note!("mean {name:<6}   {mean:.6} +- {se:.6}"),
            false => note!("mean {name:<6}   {mean:.6}"),
        }
    }
    let mean = means.iter().map(|m| m.0).sum::<f64>() / 3.0;
    let pixels = film.pixel_errors();
    match known {
        true => note!(
            "error         {:.5} of the mean; of its own value {:.5} in the median pixel, {:.5} in the worst hundredth",
            film.relative_error(),
            pixels.median,
            pixels.worst_hundredth
        ),
        false => note!("error         {UNKNOWN}"),
    }
    note!(
        "brightest     {:.3e}, {:.1} times the mean",
        stats.brightest,
        f64::from(stats.brightest) / mean.max(f64::MIN_POSITIVE)
    );
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let film_mib = mib(Film::memory_bytes(film.size()));
    match peak_memory_bytes() {
        Some(peak) => {
            let tables = rendering.kernel().map_or(0, Kernel::memory_bytes);
            note!(
                "memory        {:.0} MiB at most, {film_mib:.0} of them film, {:.0} laid out for the kernel",
                mib(peak),
                mib(tables)
            );
        }
        None => note!("memory        {film_mib:.0} MiB of film"),
    }
}
