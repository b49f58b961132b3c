//! `organza compare`

use super::{Command, with_threads};
use crate::building::watched;
use crate::error::{InputError, input};
use crate::flags::patch_model::patch_model;
use crate::flags::values::{parse_level, parse_paths, parse_seed, parse_share, whole};
use crate::flags::{CommonArgs, MemoryArgs, VoxelArgs};
use crate::output;
use crate::output::note;
use crate::progress::Progress;
use crate::report::{Judged, Measurement, Picture, Report, display, exposure};
use anyhow::{Context, Result};
use clap::Args;
use organza_measure::{
    Angles, Difference, Effort, Pair, PairValue, TexelGrid, difference, in_plane_layout,
    irawan_layout, measure_albedos, measure_pairs, measure_texture, parse_values, read_klems,
    reciprocity,
};
use organza_scene::patches::{AnyPatch, PatchModel, PatchOptions, fabric_patch, texel_grid};
use organza_scene::representation::{FIBRES, Representation, SURFACE, ShownAs};
use organza_scene::{fabric_file, read};
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// `organza compare`
#[derive(Debug, Args)]
#[command(
    about = "Compare the models of a fabric with each other or with measured values",
    after_help = "Example:\n  organza compare scenes/fabrics/organza.toml -o report --spp 256"
)]
pub struct CompareArgs {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// Folder to write: report.html, report.json, pairs.csv
    #[arg(short, long, visible_alias = "outfile")]
    pub outdir: PathBuf,
    /// What to compare; the first is the reference unless --data is
    /// [default: fibres if memory allows, auto, surface if the fabric has one]
    #[arg(long, value_delimiter = ',', value_parser = patch_model())]
    pub models: Vec<PatchModel>,
    /// Measured values to compare with, as the reference: CSV with r,g,b or a WINDOW file (.xml)
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// Paths per pair, at least 2
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = parse_paths)]
    pub spp: u64,
    /// Stop a pair when the standard error of every channel is below this share of the value (0.05 is 5 %)
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Texels of the longer side of the pictures, 8 to 4096
    #[arg(long, value_name = "N", default_value_t = 96, value_parser = whole::<u32>(8..=4096))]
    pub texels: u32,
    /// Paths per texel of the pictures, at least 2
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = parse_paths)]
    pub texel_spp: u64,
    /// Median relative error below which models agree (0.15 is 15 %)
    #[arg(long, value_name = "SHARE", default_value_t = 0.15, value_parser = parse_share)]
    pub limit: f64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_seed)]
    pub seed: u64,
    /// Level of detail of the volumes; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_level)]
    pub level: u8,
    #[command(flatten)]
    pub voxel: VoxelArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for CompareArgs {
    const NAME: &'static str = "compare";

    fn run(&self) -> Result<()> {
        run(self)
    }
}

/// Angle of the light in the planes of weft and warp, degrees.
const IN_PLANE_DEG: f64 = 30.0;

/// Pairs of measured data that are compared at most.
const MOST_DATA: usize = 2000;

/// Runs the command.
pub fn run(args: &CompareArgs) -> Result<()> {
    let mut models = args.models.clone();
    let mut seen = Vec::new();
    models.retain(|m| {
        !seen.contains(m) && {
            seen.push(*m);
            true
        }
    });
    if !models.is_empty() && models.len() + usize::from(args.data.is_some()) < 2 {
        return Err(input("--models: expected two models or more, or --data"));
    }
    output::check_report_folder(&args.outdir, ("choices.csv", "the report of a bench"))?;
    for name in ["report.html", "report.json", "pairs.csv"] {
        output::check_not_an_input(&args.outdir.join(name), &args.data)?;
    }
    let data = args.data.as_deref().map(read_data).transpose()?;
    with_threads(&args.common, || {
        let fabric = watched(args.common.quiet, |loader| {
            Ok(fabric_file::load(&args.fabric, &args.common.set, loader)?)
        })?;
        let models_are_chosen = !models.is_empty();
        if !models_are_chosen {
            models = vec![PatchModel::Is(&FIBRES), PatchModel::Own];
            let has_surface = fabric.file.surface.is_some();
            models.extend(has_surface.then_some(PatchModel::Is(&SURFACE)));
        }
        let grid = texel_grid(&fabric, args.texels);
        let layout: Vec<Pair> = match &data {
            Some(values) => values.iter().map(|v| v.pair).collect(),
            None => irawan_layout(),
        };
        let mut measured = Vec::new();
        if let Some(values) = data {
            measured.push(Measurement {
                model: "data".into(),
                layout: values,
                in_plane: Vec::new(),
                albedos: Vec::new(),
                pictures: Vec::new(),
                reciprocity: None,
                paths: 0,
                seconds: 0.0,
            });
        }
        let mut seen = Vec::new();
        for model in models {
            let shown = model.of(&fabric, &args.fabric)?;
            // The fabric's own may be one that is named as well.
            if seen.contains(&shown) {
                continue;
            }
            seen.push(shown);
            let patch = watched(args.common.quiet, |loader| {
                let build = PatchOptions {
                    loader,
                    voxel_um: args.voxel.voxel_um,
                    level: args.level,
                    max_memory_bytes: args.memory.max_memory,
                };
                Ok(fabric_patch(&fabric, &args.fabric, shown, &build)?)
            });
            let patch = match patch {
                Err(why)
                    if !models_are_chosen
                        && leaves_out(shown.representation, &why, args.common.quiet) =>
                {
                    continue;
                }
                patch => patch?,
            };
            measured.push(measure(args, shown, &patch, &layout, &grid)?);
        }
        if measured.len() < 2 {
            return Err(input(format!(
                "{}: the volume is its only model; add a [surface] section (organza fit creates one)",
                args.fabric.display()
            )));
        }
        let judged = judge(args, &measured)?;
        let name = fabric.file.name.clone();
        let report = Report {
            name: name.unwrap_or_else(|| args.fabric.display().to_string()),
            command: std::env::args().collect::<Vec<_>>().join(" "),
            reference: measured.first().map_or(String::new(), |m| m.model.clone()),
            lights: lights().iter().map(|l| l.0.to_owned()).collect(),
            measured,
            judged,
            limit: args.limit,
        };
        write(args, &report)
    })
}

/// Whether a comparison of the usual models goes on without one that is refused:
/// explicit fibres that do not fit into memory. Reported, unless `quiet`.
fn leaves_out(model: &Representation, why: &anyhow::Error, quiet: bool) -> bool {
    let leaves_out = model == &FIBRES && why.is::<InputError>();
    if leaves_out && !quiet {
        note!("fibres are left out: {why}");
    }
    leaves_out
}

/// Measured values of a file, thinned evenly to what is compared.
///
/// # Errors
/// Names the file and the place.
pub fn read_data(path: &Path) -> Result<Vec<PairValue>> {
    let text = read::text(path)?;
    let is_xml = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("xml"));
    let list = if is_xml {
        let bsdf = read_klems(&text).map_err(|e| input(format!("{}: {e}", path.display())))?;
        bsdf.pairs()
    } else {
        parse_values(&text).map_err(|e| input(format!("{}:{e}", path.display())))?
    };
    let step = list.len().div_ceil(MOST_DATA).max(1);
    // Steps that share no factor with the width of a matrix visit all of it.
    Ok(list.into_iter().step_by(step).collect())
}

/// Lights of the pictures, seen along the normal.
fn lights() -> [(&'static str, Angles); 3] {
    let angles = |theta_deg, phi_deg| Angles { theta_deg, phi_deg };
    [
        ("Lit from the front, along the warp", angles(45.0, 90.0)),
        ("Lit from the front, along the weft", angles(45.0, 0.0)),
        ("Lit from behind", angles(160.0, 60.0)),
    ]
}

fn measure(
    args: &CompareArgs,
    shown: ShownAs,
    patch: &AnyPatch,
    layout: &[Pair],
    grid: &TexelGrid,
) -> Result<Measurement> {
    let started = Instant::now();
    let effort = Effort {
        paths: args.spp,
        seed: args.seed,
        target_error: args.target_error,
    };
    let progress = Progress::new(
        shown.representation.name,
        layout.len() as u64 * args.spp,
        args.common.quiet,
    );
    let done = std::sync::atomic::AtomicU64::new(0);
    let watch = |paths| {
        progress.at(done.fetch_add(paths, std::sync::atomic::Ordering::Relaxed) + paths);
    };
    let main = measure_pairs(patch, layout, &effort, &watch)?;
    let in_plane = measure_pairs(patch, &in_plane_layout(IN_PLANE_DEG), &effort, &watch)?;
    let reverse: Vec<Pair> = in_plane
        .list
        .iter()
        .map(|v| Pair {
            incident: v.pair.exitant,
            exitant: v.pair.incident,
        })
        .collect();
    let again = Effort {
        seed: args.seed ^ 0x5eed,
        ..effort
    };
    let reverse = measure_pairs(patch, &reverse, &again, &watch)?;
    let from = |theta_deg, phi_deg| Angles { theta_deg, phi_deg };
    let incident = [
        from(0.0, 0.0),
        from(60.0, 0.0),
        from(60.0, 90.0),
        from(180.0, 0.0),
    ];
    let many = Effort {
        paths: (16 * args.spp).max(8192),
        target_error: None,
        ..effort
    };
    let albedos = measure_albedos(patch, &incident, &many, &watch)?;
    let mut pictures = Vec::new();
    for (_, light) in lights() {
        let pair = Pair {
            incident: light,
            exitant: from(0.0, 0.0),
        };
        let texture = measure_texture(patch, pair, grid, args.texel_spp, args.seed)?;
        pictures.push(Picture {
            size: grid.texels.to_array(),
            pixels: texture.mean,
        });
    }
    progress.finish();
    Ok(Measurement {
        model: shown.representation.name.into(),
        reciprocity: reciprocity(&in_plane.list, &reverse.list),
        paths: main.stats.paths + in_plane.stats.paths + albedos.stats.paths,
        layout: main.list,
        in_plane: in_plane.list,
        albedos: albedos.list,
        pictures,
        seconds: started.elapsed().as_secs_f64(),
    })
}

fn judge(args: &CompareArgs, measured: &[Measurement]) -> Result<Vec<Judged>> {
    let Some((reference, others)) = measured.split_first() else {
        return Ok(Vec::new());
    };
    let side = |list: &[PairValue], back: bool| -> Vec<PairValue> {
        let wanted = |v: &&PairValue| (v.pair.exitant.theta_deg > 90.0) == back;
        list.iter().filter(wanted).copied().collect()
    };
    let against = |a: &[PairValue], b: &[PairValue]| -> Difference { difference(a, b, args.seed) };
    let mut judged = Vec::new();
    for m in others {
        let mut flip = Vec::new();
        for (p, q) in m.pictures.iter().zip(&reference.pictures) {
            let gain = exposure(q.pixels.iter().flatten().map(|&v| f64::from(v)));
            let [w, h] = p.size;
            let image = |p| nv_flip::FlipImageRgb8::with_data(w, h, &display(p, gain));
            let error = nv_flip::flip(image(q), image(p), nv_flip::DEFAULT_PIXELS_PER_DEGREE);
            let mean = nv_flip::FlipPool::from_image(&error).mean();
            let map = error.apply_color_lut(&nv_flip::magma_lut());
            flip.push((mean, map.to_vec()));
        }
        judged.push(Judged {
            model: m.model.clone(),
            layout: against(&m.layout, &reference.layout),
            reflection: against(&side(&m.in_plane, false), &side(&reference.in_plane, false)),
            transmission: against(&side(&m.in_plane, true), &side(&reference.in_plane, true)),
            flip,
        });
    }
    Ok(judged)
}

fn write(args: &CompareArgs, report: &Report) -> Result<()> {
    std::fs::create_dir_all(&args.outdir)
        .map_err(|e| input(format!("{}: {}", args.outdir.display(), read::io_words(&e))))?;
    let save = |name: &str, text: &str| {
        output::write_file(&args.outdir.join(name), |out| {
            out.write_all(text.as_bytes()).context("writing failed")
        })
    };
    let mut csv = String::from("model,theta_i,phi_i,theta_o,phi_o,r,g,b,se_r,se_g,se_b\n");
    for m in &report.measured {
        for v in m.layout.iter().chain(&m.in_plane) {
            let (i, o) = (v.pair.incident, v.pair.exitant);
            let _ = write!(
                csv,
                "{},{},{},{},{}",
                m.model, i.theta_deg, i.phi_deg, o.theta_deg, o.phi_deg
            );
            for x in v.bsdf.mean.iter().chain(&v.bsdf.se) {
                let _ = write!(csv, ",{x}");
            }
            csv.push('\n');
        }
    }
    let measured: Vec<_> = report
        .measured
        .iter()
        .map(|m| {
            json!({
                "model": m.model, "layout": m.layout, "in_plane": m.in_plane,
                "albedo": m.albedos, "reciprocity_se": m.reciprocity,
                "paths": m.paths, "seconds": m.seconds,
            })
        })
        .collect();
    let judged: Vec<_> = report
        .judged
        .iter()
        .map(|j| {
            json!({
                "model": j.model, "layout": j.layout, "in_plane_reflected": j.reflection,
                "in_plane_transmitted": j.transmission,
                "flip": j.flip.iter().map(|f| f.0).collect::<Vec<_>>(),
                "agrees": j.layout.median.is_below(report.limit),
            })
        })
        .collect();
    let all = json!({
        "name": report.name, "command": report.command, "reference": report.reference,
        "limit": report.limit, "lights": report.lights,
        "differences": judged, "measured": measured,
    });
    save("pairs.csv", &csv)?;
    save("report.json", &serde_json::to_string_pretty(&all)?)?;
    save("report.html", &report.html()?)?;
    if !args.common.quiet {
        for j in &report.judged {
            let m = &j.layout.median;
            note!(
                "{} against {}: median error {:.1} % ({:.1} to {:.1}), noise alone {:.1} %, 80th percentile {:.1} %",
                j.model,
                report.reference,
                100.0 * m.value,
                100.0 * m.low,
                100.0 * m.high,
                100.0 * j.layout.noise_median,
                100.0 * j.layout.percentile_80.value,
            );
        }
    }
    Ok(())
}
