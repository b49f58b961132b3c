//! `organza render`

use super::with_threads;
use crate::error::input;
use crate::flags::RenderArgs;
use crate::picture::{self, Attribute, PictureKind};
use crate::progress::Progress;
use crate::scene_build::{self, BuildOptions};
use crate::scene_file::SceneFile;
use crate::{output, read};
use anyhow::Result;
use organza_transport::{Film, Integrator, RenderError, RenderSettings, Scene, Stats, render};
use std::ops::ControlFlow;

/// Runs the command.
pub fn run(args: &RenderArgs) -> Result<()> {
    PictureKind::of(&args.outfile)?;
    output::check_writable(&args.outfile)?;
    with_threads(&args.common, || render_scene(args))
}

fn render_scene(args: &RenderArgs) -> Result<()> {
    let started = std::time::Instant::now();
    let mut file: SceneFile = read::toml(&args.scene, &args.common.set)?;
    if let Some(spp) = args.spp {
        file.render.spp = spp;
    }
    if let Some(seed) = args.seed {
        file.render.seed = seed;
    }
    let build = BuildOptions {
        scene_path: &args.scene,
        quiet: args.common.quiet,
        max_memory_bytes: args.max_memory,
    };
    let scene = scene_build::scene(&file, &build)?;
    let settings = settings(args, &file, &scene)?;
    let size = settings
        .crop
        .map_or(scene.camera.resolution(), |c| c.max - c.min);
    let paths = u64::from(file.render.spp) * u64::from(size.x) * u64::from(size.y);
    let progress = Progress::new("rendering", paths, args.common.quiet);
    let (film, stats) = render(&scene, &settings, &|pass| {
        progress.at(pass.paths_done);
        ControlFlow::Continue(())
    })
    .map_err(|e| match e {
        RenderError::EmptyCrop(..) => input(format!("--crop: {e}")),
        _ => e.into(),
    })?;
    let seconds = progress.finish();
    let attributes = attributes(args, &file);
    picture::write(&args.outfile, &film, file.render.exposure, &attributes)?;
    if !args.common.quiet {
        report(
            args,
            &film,
            &stats,
            seconds,
            started.elapsed().as_secs_f64(),
        );
    }
    Ok(())
}

fn settings(args: &RenderArgs, file: &SceneFile, scene: &Scene) -> Result<RenderSettings> {
    if file.render.spp == 0 {
        return Err(input(format!(
            "{}: render.spp: expected at least 1",
            args.scene.display()
        )));
    }
    let integrator = Integrator::from(file.render.integrator);
    if integrator == Integrator::Regular && !scene.media.iter().all(|m| m.is_piecewise_constant()) {
        return Err(input(format!(
            "{}: render.integrator: \"regular\" steps through constant voxels; \
             use interpolation = \"nearest\" and grids of one resolution, or \"woodcock\"",
            args.scene.display()
        )));
    }
    Ok(RenderSettings {
        integrator,
        samples: 0..u64::from(file.render.spp),
        max_bounces: file.render.max_bounces.unwrap_or(u32::MAX),
        seed: file.render.seed,
        crop: args.crop,
    })
}

fn attributes(args: &RenderArgs, file: &SceneFile) -> Vec<Attribute> {
    let name = args.scene.file_name().unwrap_or_default();
    vec![
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("scene", name.to_string_lossy().into_owned()),
        ("spp", file.render.spp.to_string()),
        ("seed", file.render.seed.to_string()),
        ("backend", "scalar".to_owned()),
    ]
}

#[allow(clippy::print_stderr)]
fn report(args: &RenderArgs, film: &Film, stats: &Stats, render_s: f64, total_s: f64) {
    let rate = stats.paths as f64 / render_s.max(1e-9);
    eprintln!(
        "{}: {} x {}, {} paths in {total_s:.1} s ({render_s:.1} s tracing, {:.2} M paths/s)",
        args.outfile.display(),
        film.size().x,
        film.size().y,
        stats.paths,
        rate * 1e-6,
    );
    if !args.stats {
        return;
    }
    let per_path = |n: u64| n as f64 / stats.paths.max(1) as f64;
    eprintln!(
        "collisions    {:.3} real, {:.3} tentative a path",
        per_path(stats.collisions),
        per_path(stats.tentative)
    );
    eprintln!(
        "shadow rays   {:.3} a path, {:.3} steps",
        per_path(stats.shadow_rays),
        per_path(stats.shadow_steps)
    );
    eprintln!("cut           {} paths at the bounce limit", stats.cut);
    eprintln!(
        "rejected      {} samples (NaN, infinite or negative)",
        stats.rejected
    );
    for (name, (mean, se)) in ["red", "green", "blue"].iter().zip(film.mean()) {
        eprintln!("mean {name:<6}   {mean:.6} +- {se:.6}");
    }
}
