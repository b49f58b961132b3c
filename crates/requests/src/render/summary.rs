//! What a render says of itself: in its file, on the terminal, as JSON.

use super::RenderJob;
use glam::UVec2;
use organza_picture::Attributes;
use organza_scene::auto::Chosen;
use organza_scene::scene_file::SceneFile;
use organza_transport::{CacheReport, Film, KernelRefusal, Pixel, Rendering, Tail};
use organza_work::identity::Identity;
use organza_work::process_usage::peak_memory_bytes;
use organza_work::sample_ranges::SampleRanges;
use organza_work::schedule::{Stop, Targets};
use organza_work::version;
use serde_json::json;

/// Where the time went: of the whole process and of all its threads together
/// (CPU), and as it passed; seconds.
pub struct Times {
    /// Before the first path, CPU.
    pub setup_cpu_s: f64,
    /// Of `render_cpu_s`, before the first sample: sorting fibres into cells, learning light.
    pub prepare_cpu_s: f64,
    /// The same by the clock.
    pub prepare_s: f64,
    /// Of the paths, CPU.
    pub render_cpu_s: f64,
    /// Of the paths, as it passed.
    pub render_s: f64,
}

/// The figures of a render.
pub fn figures(
    rendering: &Rendering<'_>,
    why_walk: Option<&KernelRefusal>,
    chosen: &[Chosen],
    times: &Times,
) -> serde_json::Value {
    let (film, stats) = (rendering.film(), rendering.stats());
    let known = has_errors(rendering);
    json!({
        "backend": backend_name(rendering),
        "kernel_refused": why_walk.map(|why| why.to_string()),
        "resolution": film.size().to_array(),
        "samples": rendering.taken().end - rendering.taken().start,
        "setup_cpu_s": times.setup_cpu_s,
        "prepare_cpu_s": times.prepare_cpu_s,
        "prepare_s": times.prepare_s,
        "render_cpu_s": times.render_cpu_s,
        "render_s": times.render_s,
        "peak_memory_bytes": peak_memory_bytes(),
        "mean": film.mean().map(|m| m.0),
        "standard_error": known.then(|| film.mean().map(|m| m.1)),
        "relative_error": known.then(|| rendering.relative_error()),
        "collisions": stats.collisions,
        "tentative": stats.tentative,
        "shadow_rays": stats.shadow_rays,
        "shadow_steps": stats.shadow_steps,
        "cut": stats.cut,
        "rejected": stats.rejected,
        "brightest": stats.brightest,
        "heavy_tail": film.tail(stats.brightest).map(|tail| tail.is_heavy()),
        "cache": rendering.cache().map(|cache| json!({
            "learning_paths": cache.paths,
            "sharing_paths": cache.shared_paths,
            "bins": cache.bins,
            "mean_error": cache.mean_error,
            "block_error_squared": cache.block_error_squared,
            "shared_noise": cache.shared_noise,
        })),
        "chosen": chosen,
        "display": null,
    })
}

/// The attribute that holds [`organza_film::Stats::clamped_radiance`]: a whole number,
/// so that parts add up to the unbroken picture's.
pub const CLAMPED: &str = "clamped_radiance_2e-32";

/// What takes the paths, as pictures name it.
fn backend_name(rendering: &Rendering<'_>) -> &'static str {
    rendering.engine().map_or("walk", |engine| engine.name())
}

/// The error of the cache about every pixel, if the samples use one.
pub fn cache_errors(rendering: &Rendering<'_>) -> Option<Vec<f32>> {
    let (map, crop) = (&rendering.cache()?.error_map, rendering.crop());
    let row = |y: u32| (crop.min.x..crop.max.x).map(move |x| map.at(UVec2::new(x, y)));
    Some((crop.min.y..crop.max.y).flat_map(row).collect())
}

/// What was learned before the first sample, and how far it is off.
fn describe_cache(cache: &CacheReport) -> String {
    let ([mean, mean_se], (blocks, at_most)) = (cache.mean_error, cache.block_error());
    let [second, first] = cache.bins;
    let shared = match first {
        0 => String::new(),
        _ => format!(
            "; {first} bins at first fibres by {} paths, with {:.1} % of noise",
            cache.shared_paths,
            100.0 * cache.shared_noise,
        ),
    };
    let learned = match cache.paths {
        0 => "that were loaded".to_owned(),
        paths => format!("by {paths} paths"),
    };
    format!(
        "{second} bins {learned}{shared}; its error is {:.2} +- {:.2} % of the mean, {:.1} % in \
         blocks of {edge} x {edge} pixels (below {:.1} %)",
        100.0 * mean,
        100.0 * mean_se,
        100.0 * blocks,
        100.0 * at_most,
        edge = CacheReport::BLOCK,
    )
}

/// What the picture file records of how it was made.
pub fn attributes(
    args: &RenderJob,
    file: &SceneFile,
    identity: &Identity,
    rendering: &Rendering<'_>,
) -> Attributes {
    let name = args.scene.file_name().unwrap_or_default();
    let mut attributes = vec![
        ("version", version::VERSION.to_owned()),
        ("scene", name.to_string_lossy().into_owned()),
        ("backend", identity.all_engines(rendering)),
    ];
    attributes.extend(identity.attributes(&SampleRanges::one(rendering.taken())));
    if let Some(cache) = rendering.cache() {
        attributes.push(("cache", describe_cache(cache)));
    }
    if let Some(limit) = file.render.clamp {
        attributes.push(("clamp", limit.to_string()));
        let removed = rendering.stats().clamped_radiance;
        attributes.push((CLAMPED, removed.to_string()));
    }
    attributes.into_iter().collect()
}

/// Samples that no film holds are missing from the picture, which nobody would see: how many, in
/// words; none if there are none.
pub fn describe_rejected(rendering: &Rendering<'_>, picture: &str) -> Option<String> {
    let stats = rendering.stats();
    (stats.rejected > 0).then(|| {
        format!(
            "{} of {} samples were brighter than {:e} or not finite and are left out of {picture}, \
             which is darker than it should be; use dimmer lights and more exposure",
            stats.rejected,
            stats.paths,
            Pixel::RADIANCE_LIMIT,
        )
    })
}

/// How many samples are taken, of how many.
pub fn describe_samples_taken(rendering: &Rendering<'_>) -> String {
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

/// Why the render stopped.
pub fn reason(rendering: &Rendering<'_>, stop: Stop, targets: Targets) -> String {
    let why = match stop {
        Stop::Done => "all samples taken",
        Stop::TimeLimit => "time limit reached",
        Stop::TargetError(_) => "",
        Stop::Interrupted => "interrupted",
    };
    let reached = match stop {
        Stop::TargetError(errors) => format!("target error reached{}", errors.description()),
        _ if !targets.are_given() => String::new(),
        _ if !has_errors(rendering) => format!(", error {UNKNOWN}"),
        _ => format!(
            ", target error {}reached{}",
            if targets.are_met(rendering) {
                ""
            } else {
                "not "
            },
            targets.errors(rendering).description()
        ),
    };
    format!(
        "stopped       {why}{reached}; {} a pixel",
        describe_samples_taken(rendering)
    )
}

/// Warns where few samples have most of the noise: a clamp takes the tail away, and the light in it.
pub fn warn_of_tail(args: &RenderJob, file: &SceneFile, rendering: &Rendering<'_>) {
    let (film, stats) = (rendering.film(), rendering.stats());
    if file.render.clamp.is_none()
        && let Some(tail) = film.tail(stats.brightest).filter(Tail::is_heavy)
    {
        args.context.warn(format!(
            "{}: the brightest sample has {:.0} % of the squares of all, and the noisiest pixel \
             {:.0} % of the noise: others as bright may not have been met, and standard errors are \
             too small; take more samples",
            args.context
                .outputs
                .first()
                .unwrap_or(&args.scene)
                .display(),
            100.0 * tail.sample,
            100.0 * tail.pixel
        ));
    }
}

/// An error that no standard error holds.
pub fn cache_line(rendering: &Rendering<'_>) -> Option<String> {
    let cache = rendering.cache()?;
    Some(format!("cache         {}", describe_cache(cache)))
}

/// The counts that `--stats` prints.
pub fn details(
    file: &SceneFile,
    rendering: &Rendering<'_>,
    why_walk: Option<&KernelRefusal>,
) -> Vec<String> {
    let (film, stats) = (rendering.film(), rendering.stats());
    let mut lines = Vec::new();
    let per_path = |n: u64| n as f64 / stats.paths.max(1) as f64;
    let why = why_walk.map_or(String::new(), |why| format!(": {why}"));
    lines.push(format!("backend       {}{why}", backend_name(rendering)));
    lines.push(format!(
        "collisions    {:.3} real, {:.3} tentative a path",
        per_path(stats.collisions),
        per_path(stats.tentative)
    ));
    lines.push(format!(
        "shadow rays   {:.3} a path, {:.3} steps",
        per_path(stats.shadow_rays),
        per_path(stats.shadow_steps)
    ));
    lines.push(format!(
        "cut           {} paths at the bounce limit",
        stats.cut
    ));
    lines.push(format!(
        "rejected      {} samples (NaN, infinite, negative or above {:e})",
        stats.rejected,
        Pixel::RADIANCE_LIMIT
    ));
    let means = film.mean();
    if file.render.clamp.is_some() {
        let removed = stats.clamped_radiance as f64 / 2f64.powi(32);
        let kept = means.iter().map(|m| m.0).sum::<f64>() * stats.paths as f64;
        lines.push(format!(
            "clamped       {} samples; {:.4} % of the light removed",
            stats.clamped,
            100.0 * removed / (removed + kept).max(f64::MIN_POSITIVE)
        ));
    }
    let known = has_errors(rendering);
    for (name, (mean, se)) in ["red", "green", "blue"].iter().zip(means) {
        match known {
            true => lines.push(format!("mean {name:<6}   {mean:.6} +- {se:.6}")),
            false => lines.push(format!("mean {name:<6}   {mean:.6}")),
        }
    }
    let mean = means.iter().map(|m| m.0).sum::<f64>() / 3.0;
    let pixels = rendering.pixel_errors();
    match known {
        true => lines.push(format!(
            "error         {:.5} of the mean; of its own value {:.5} in the median pixel, {:.5} in the worst hundredth",
            rendering.relative_error(),
            pixels.median,
            pixels.worst_hundredth
        )),
        false => lines.push(format!("error         {UNKNOWN}")),
    }
    lines.push(format!(
        "brightest     {:.3e}, {:.1} times the mean",
        stats.brightest,
        f64::from(stats.brightest) / mean.max(f64::MIN_POSITIVE)
    ));
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let film_mib = mib(Film::memory_bytes(film.size()));
    match peak_memory_bytes() {
        Some(peak) => {
            let tables = rendering.engine().map_or(0, |engine| engine.memory_bytes());
            let saved = rendering.engine().and_then(|engine| engine.saved_memory());
            let saved = saved.map_or(String::new(), |what| format!("; not enough for {what}"));
            lines.push(format!(
                "memory        {:.0} MiB at most, {film_mib:.0} of them film, {:.0} laid out for the kernel{saved}",
                mib(peak),
                mib(tables)
            ));
        }
        None => lines.push(format!("memory        {film_mib:.0} MiB of film")),
    }
    lines
}
