//! `organza compare`

use super::with_threads;
use crate::building::watched;
use crate::error::{InputError, of_file, of_io, of_option};
use crate::flags::patch_model::patch_model;
use crate::flags::values::{parse_level, parse_paths, parse_seed, parse_share, whole};
use crate::flags::{CacheArgs, CommonArgs, MemoryArgs, VoxelArgs};
use crate::host::Host;
use crate::output;
use crate::output::note;
use crate::progress::Progress;
use crate::results::Results;
use crate::waiting::Waiting;
use anyhow::{Context, Result};
use clap::Args;
use organza_measure::{Effort, PairValue, irawan_layout, parse_values, read_klems};
use organza_report::comparison::{Comparison, ComparisonPlan, Measurement, judge};
use organza_scene::fabric_file;
use organza_scene::file_kind::Wanted;
use organza_scene::patches::{AnyPatch, PatchModel, PatchOptions, fabric_patch, texel_grid};
use organza_scene::representation::{EXPLICIT_FIBRES, Representation, SURFACE, ShownAs, TABLE};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

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
    pub cache: CacheArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

command!(CompareArgs, "compare", "report");

/// Pairs of measured data that are compared at most.
const MAX_DATA: usize = 2000;

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
        return Err(of_option(
            "models",
            "expected two models or more, or --data",
        ));
    }
    output::check_report_folder(&args.outdir, ("choices.csv", "the report of a bench"))?;
    for name in ["report.html", "report.json", "pairs.csv"] {
        output::check_not_an_input(&args.outdir.join(name), &args.data)?;
    }
    let _waiting = Waiting::new("comparing", &args.common);
    let host = &args.common.host;
    let data = args.data.as_deref().map(|path| read_data(path, host));
    let data = data.transpose()?;
    with_threads(&args.common, || {
        let fabric = watched(&args.common, &args.cache, |loader| {
            Ok(fabric_file::load(&args.fabric, &args.common.set, loader)?)
        })?;
        let models_are_chosen = !models.is_empty();
        if !models_are_chosen {
            models = vec![PatchModel::Is(&EXPLICIT_FIBRES), PatchModel::Own];
            let loader = host.loader();
            let ready = [&SURFACE, &TABLE].into_iter();
            let ready = ready.filter(|r| (r.is_ready)(&fabric, &args.fabric, &loader));
            models.extend(ready.map(PatchModel::Is));
        }
        let plan = ComparisonPlan {
            layout: match &data {
                Some(values) => values.iter().map(|v| v.pair).collect(),
                None => irawan_layout(),
            },
            effort: Effort {
                paths: args.spp,
                seed: args.seed,
                target_error: args.target_error,
            },
            grid: texel_grid(&fabric, args.texels),
            texel_paths: args.texel_spp,
        };
        let mut measured = Vec::new();
        if let Some(values) = data {
            measured.push(Measurement::of_data("data", values));
        }
        let mut seen = Vec::new();
        for model in models {
            let shown = model.of(&fabric, &args.fabric)?;
            // The fabric's own may be one that is named as well.
            if seen.contains(&shown) {
                continue;
            }
            seen.push(shown);
            let patch = watched(&args.common, &args.cache, |loader| {
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
            measured.push(measure(args, &plan, shown, &patch)?);
        }
        if measured.len() < 2 {
            return Err(of_file(
                &args.fabric,
                "the volume is its only model; add a [surface] section (organza fit creates one)",
            ));
        }
        let name = fabric.file.name.clone();
        let comparison = Comparison {
            name: name.unwrap_or_else(|| args.fabric.display().to_string()),
            command: host.command_line(),
            judged: judge(&measured, args.seed),
            measured,
            limit: args.limit,
        };
        write(args, &comparison)
    })
}

/// Whether a comparison of the usual models continues without one that is refused:
/// explicit fibres that do not fit into memory. Reported, unless `quiet`.
fn leaves_out(model: &Representation, why: &anyhow::Error, quiet: bool) -> bool {
    let leaves_out = model == &EXPLICIT_FIBRES && why.is::<InputError>();
    if leaves_out && !quiet {
        note!("fibres are left out: {why}");
    }
    leaves_out
}

/// Measured values of a file, thinned evenly to what is compared.
///
/// # Errors
/// Names the file and the place.
pub fn read_data(path: &Path, host: &Host) -> Result<Vec<PairValue>> {
    let text = host.loader().text_of(path, Wanted::Text)?;
    let is_xml = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("xml"));
    let list = if is_xml {
        let bsdf = read_klems(&text).map_err(|e| of_file(path, e))?;
        bsdf.pairs()
    } else {
        parse_values(&text).map_err(|e| InputError::from(e).in_file(path))?
    };
    let step = list.len().div_ceil(MAX_DATA).max(1);
    // Steps that share no factor with the width of a matrix visit all of it.
    Ok(list.into_iter().step_by(step).collect())
}

fn measure(
    args: &CompareArgs,
    plan: &ComparisonPlan,
    shown: ShownAs,
    patch: &AnyPatch,
) -> Result<Measurement> {
    let name = shown.representation.name;
    let paths = plan.layout.len() as u64 * args.spp;
    let progress = Progress::new(name, paths, &args.common);
    let done = AtomicU64::new(0);
    let watch = |paths| progress.at(done.fetch_add(paths, Ordering::Relaxed) + paths);
    let measured = plan.measure(name, patch, &watch)?;
    progress.finish();
    Ok(measured)
}

/// The report, its values of every model, and its page.
fn results(comparison: &Comparison) -> Results {
    let mut results = Results::default().with_figure("report", comparison.json());
    for measurement in &comparison.measured {
        let of_model = super::measure::results::pairs(&measurement.layout, measurement.paths);
        let named = of_model.arrays.into_iter();
        let named = named.map(|(name, array)| (format!("{}.{name}", measurement.model), array));
        results.arrays.extend(named);
    }
    results
}

fn write(args: &CompareArgs, comparison: &Comparison) -> Result<()> {
    args.common.host.give(|| results(comparison));
    if !args.common.host.writes() {
        return Ok(());
    }
    std::fs::create_dir_all(&args.outdir).map_err(|e| of_io(&args.outdir, &e))?;
    let json = serde_json::to_string_pretty(&comparison.json())?;
    let files = [
        ("pairs.csv", comparison.pairs_csv()?),
        ("report.json", json),
        ("report.html", comparison.html()?),
    ];
    for (name, text) in files {
        output::write_file(&args.outdir.join(name), |out| {
            out.write_all(text.as_bytes()).context("writing failed")
        })?;
    }
    if !args.common.quiet {
        for line in comparison.summary() {
            note!("{line}");
        }
    }
    Ok(())
}
