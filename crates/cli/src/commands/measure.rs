//! `organza measure`

use super::with_threads;
use crate::error::input;
use crate::flags::{LayoutName, MeasureArgs, PatchModel};
use crate::progress::Progress;
use crate::scattering::{ScatteringModel, ScatteringTable};
use crate::scene_build::{self, BuildOptions};
use crate::scene_file::{IntegratorName, SceneFile, is_scene};
use crate::{fabric_file, output, read};
use anyhow::{Context, Result};
use glam::{DVec3, UVec2};
use organza_measure::{
    Angles, Effort, MeasureError, Pair, PatchResponse, SurfacePatch, VolumePatch, irawan_incident,
    irawan_layout, measure_albedos, measure_openness, measure_pairs, parse_incident, parse_pairs,
    write_albedos, write_pairs,
};
use organza_transport::{
    AnyMedium, Camera, CameraPose, Integrator, PixelFilter, Projection, Scene, Stats,
};
use serde_json::{Value, json};
use std::sync::atomic::{AtomicU64, Ordering};

/// Runs the command.
pub fn run(args: &MeasureArgs) -> Result<()> {
    if let Some(path) = &args.outfile {
        output::check_writable(path)?;
    }
    let directions = directions(args)?;
    with_threads(&args.common, || {
        let scene = is_scene(&read::text(&args.file)?);
        match (args.model, scene) {
            (PatchModel::Volume, false) => measure(args, &directions, &fabric_volume(args)?),
            (PatchModel::Volume, true) => measure(args, &directions, &scene_volume(args)?),
            (PatchModel::Surface, false) => {
                let fabric = fabric_file::load(&args.file, &args.common.set)?;
                let surface = fabric.surface(&args.file)?;
                measure(args, &directions, &SurfacePatch(surface))
            }
            (PatchModel::Fibres, false) => measure(args, &directions, &fabric_fibres(args)?),
            (PatchModel::Fibres, true) => {
                let mut file: SceneFile = read::toml(&args.file, &args.common.set)?;
                file.render.integrator = IntegratorName::Fibres;
                measure(args, &directions, &patch_of_scene(args, &file)?)
            }
            (PatchModel::Surface, true) => Err(input(format!(
                "{}: is a scene; --model surface measures a fabric file",
                args.file.display()
            ))),
        }
    })
}

/// What to measure.
enum Directions {
    Pairs(Vec<Pair>),
    Incident(Vec<Angles>),
}

fn directions(args: &MeasureArgs) -> Result<Directions> {
    if let Some(path) = &args.pairs {
        let text = read::text(path)?;
        let parsed = if args.albedo {
            parse_incident(&text).map(Directions::Incident)
        } else {
            parse_pairs(&text).map(Directions::Pairs)
        };
        return parsed.map_err(|e| input(format!("{}:{e}", path.display())));
    }
    let LayoutName::Irawan = args.layout.unwrap_or(LayoutName::Irawan);
    Ok(if args.albedo {
        Directions::Incident(irawan_incident())
    } else {
        Directions::Pairs(irawan_layout())
    })
}

fn patch(args: &MeasureArgs, scene: Scene, integrator: Integrator) -> Result<VolumePatch> {
    VolumePatch::new(scene, integrator).map_err(|e| input(format!("{}: {e}", args.file.display())))
}

/// The endless cloth of a fabric file.
fn fabric_volume(args: &MeasureArgs) -> Result<VolumePatch> {
    let fabric = fabric_file::load(&args.file, &args.common.set)?;
    let model = ScatteringTable::default()
        .over(fabric.file.scattering)
        .map_err(|why| input(format!("{}: scattering{why}", args.file.display())))?;
    if model == ScatteringModel::Explicit {
        let fibres = fabric.explicit_fibres(&args.file, args.max_memory, args.common.quiet)?;
        return patch_of(args, fibres);
    }
    let octree = fabric.voxelize(
        &args.file,
        model.footprint(),
        args.voxel_um,
        None,
        args.max_memory,
        args.common.quiet,
    )?;
    let levels = octree.level_count();
    let medium = model
        .medium(&fabric, &args.file, octree, args.level)?
        .ok_or_else(|| {
            input(format!(
                "--level {}: the octree has {levels} levels, from 0",
                args.level
            ))
        })?;
    patch_of(args, medium)
}

/// The fibres of a fabric file.
fn fabric_fibres(args: &MeasureArgs) -> Result<VolumePatch> {
    let fabric = fabric_file::load(&args.file, &args.common.set)?;
    let fibres = fabric.explicit_fibres(&args.file, args.max_memory, args.common.quiet)?;
    patch_of(args, fibres)
}

fn patch_of(args: &MeasureArgs, medium: AnyMedium) -> Result<VolumePatch> {
    // A goniometer has no camera, but every scene does.
    let pose = CameraPose {
        origin_mm: DVec3::Z,
        target_mm: DVec3::ZERO,
        up: DVec3::Y,
    };
    let projection = Projection::Orthographic { width_mm: 1.0 };
    let scene = Scene {
        media: vec![medium],
        lights: Vec::new(),
        camera: Camera::new(projection, pose, UVec2::ONE, PixelFilter::Box)?,
    };
    patch(args, scene, Integrator::Woodcock)
}

/// The objects of a scene file.
fn scene_volume(args: &MeasureArgs) -> Result<VolumePatch> {
    let file: SceneFile = read::toml(&args.file, &args.common.set)?;
    patch_of_scene(args, &file)
}

fn patch_of_scene(args: &MeasureArgs, file: &SceneFile) -> Result<VolumePatch> {
    let build = BuildOptions {
        scene_path: &args.file,
        quiet: args.common.quiet,
        max_memory_bytes: args.max_memory,
    };
    let scene = scene_build::scene(file, &build)?;
    patch(args, scene, file.render.integrator.into())
}

fn measure(args: &MeasureArgs, directions: &Directions, patch: &impl PatchResponse) -> Result<()> {
    let effort = Effort {
        paths: args.spp,
        seed: args.seed,
        target_error: args.target_error,
    };
    let count = match directions {
        Directions::Pairs(list) => list.len(),
        Directions::Incident(list) => list.len(),
    };
    let total = args.spp.saturating_mul(count as u64);
    let progress = Progress::new("measuring", total, args.common.quiet);
    let done = AtomicU64::new(0);
    let watch = |paths| progress.at(done.fetch_add(paths, Ordering::Relaxed) + paths);
    let failed = |e: MeasureError| anyhow::Error::new(e);
    let (list, stats, openness) = match directions {
        Directions::Pairs(pairs) => {
            let told = measure_pairs(patch, pairs, &effort, &watch).map_err(failed)?;
            write(args, |out| write_pairs(&told.list, out))?;
            (json!(told.list), told.stats, None)
        }
        Directions::Incident(incident) => {
            let told = measure_albedos(patch, incident, &effort, &watch).map_err(failed)?;
            write(args, |out| write_albedos(&told.list, out))?;
            let openness = measure_openness(patch, &effort).map_err(failed)?;
            (json!(told.list), told.stats, Some(openness))
        }
    };
    let seconds = progress.finish();
    report(args, count, list, &stats, openness, seconds)
}

fn write(
    args: &MeasureArgs,
    table: impl FnOnce(&mut dyn output::SeekWrite) -> std::io::Result<()>,
) -> Result<()> {
    match &args.outfile {
        None => Ok(()),
        Some(path) => {
            output::write_file(path, |out| table(out).context("writing the table failed"))
        }
    }
}

#[allow(clippy::print_stdout, clippy::print_stderr)]
fn report(
    args: &MeasureArgs,
    count: usize,
    list: Value,
    stats: &Stats,
    openness: Option<(f64, f64)>,
    seconds: f64,
) -> Result<()> {
    if args.json {
        let what = if args.albedo { "albedo" } else { "pairs" };
        let mut told = json!({
            "file": args.file,
            "model": match args.model {
                PatchModel::Volume => "volume",
                PatchModel::Fibres => "fibres",
                PatchModel::Surface => "surface",
            },
            "seed": args.seed,
            "paths": stats.paths,
            what: list,
        });
        if let (Value::Object(map), Some((open, se))) = (&mut told, openness) {
            map.insert("openness".into(), json!(open));
            map.insert("cover_factor".into(), json!(1.0 - open));
            map.insert("se_openness".into(), json!(se));
        }
        println!("{}", serde_json::to_string_pretty(&told)?);
    }
    if !args.common.quiet {
        let what = if args.albedo { "directions" } else { "pairs" };
        eprintln!(
            "{}: {count} {what}, {} paths in {seconds:.1} s ({:.2} M paths/s)",
            args.file.display(),
            stats.paths,
            stats.paths as f64 / seconds.max(1e-9) * 1e-6,
        );
        if let Some((open, se)) = openness {
            eprintln!(
                "openness {open:.4} +- {se:.4}, cover factor {:.4}",
                1.0 - open
            );
        }
    }
    Ok(())
}
