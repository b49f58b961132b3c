//! `organza measure`

mod bands;
mod ptm;
pub mod results;
mod rgl;
mod shade;
mod summary;
mod tensor_tree;
mod wanted;

use super::with_threads;
use crate::building::watched;
use crate::error::of_file;
use crate::flags::patch_model::{OWN, patch_model};
use crate::flags::values::{
    parse_grid, parse_level, parse_paths, parse_positive, parse_rows, parse_seed, parse_share,
    whole,
};
use crate::flags::{CacheArgs, CommonArgs, MemoryArgs, VoxelArgs, set_help};
use crate::output::note;
use crate::progress::Progress;
use crate::{btf_file, output};
use anyhow::Result;
use bands::BandName;
use clap::Args;
use glam::UVec2;
use organza_basis::SegmentSource;
use organza_measure::{
    Effort, MeasureError, SolarKlems, TableErrors, TexelGrid, VolumePatch, front_and_back,
    measure_albedo_rows, measure_klems, measure_openness, measure_pair_rows, measure_sweep,
    measure_texture, write_albedos, write_klems, write_pairs, write_sweep,
};
use organza_scene::file_kind::Wanted as FileKind;
use organza_scene::loader::Loader;
use organza_scene::patches::{AnyPatch, PatchModel, PatchOptions, texel_grid};
use organza_scene::representation::{EXPLICIT_FIBRES, ShownAs, TABLE};
use organza_scene::scene_file::{self, IntegratorName, is_scene_text};
use organza_scene::{LoadedScene, fabric_file, far_table};
use ptm::PtmArgs;
use rgl::RglArgs;
use serde_json::{Value, json};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use summary::{Summary, dark_pairs, median_error, report, write};
use tensor_tree::TreeArgs;
use wanted::{
    KlemsBasisName, LayoutName, Wanted, check_table_memory, check_texture_memory, wanted,
};

/// `organza measure`
#[derive(Debug, Args)]
#[command(about = "Measure reflection and transmission of a patch of cloth", after_help = "Examples:\n  organza measure scenes/fabrics/organza.toml --pairs pairs.csv -o out.csv --target-error 0.02\n  organza measure scenes/fabrics/organza.toml --layout irawan --albedo --json", mut_arg("set", |a| a.help(set_help::FABRIC_OR_SCENE)))]
pub struct MeasureArgs {
    /// A fabric file, or a scene file whose objects are measured (TOML)
    pub file: PathBuf,
    /// Directions to measure: CSV with the columns theta_i,phi_i,theta_o,phi_o in degrees, of directions that point away from the cloth, towards light and viewer; theta from 0 to 180, above 90 behind the cloth
    #[arg(long, value_name = "FILE", required_unless_present = "layout")]
    pub pairs: Option<PathBuf>,
    /// Directions to measure by name
    #[arg(long, value_enum, conflicts_with = "pairs")]
    pub layout: Option<LayoutName>,
    /// Measure the reflected, transmitted, directly transmitted and absorbed shares of light from each incident direction instead of the BSDF of pairs; --pairs then needs only theta_i,phi_i
    #[arg(long)]
    pub albedo: bool,
    /// Measure only these rows of the table, counted from 0; they have the values that they have in the whole table
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = parse_rows)]
    pub rows: Option<Range<usize>>,
    /// Table to write: .csv (the angles with r,g,b and their standard errors), .json, .xml (WINDOW and Radiance, with --layout klems or tensor-tree), .bsdf (Mitsuba, with --layout rgl), .ptm (with --layout ptm), .exr (one picture of the tile per pair)
    #[arg(short, long, required_unless_present = "json")]
    pub outfile: Option<PathBuf>,
    /// Model of the cloth
    #[arg(long, default_value = OWN, value_parser = patch_model())]
    pub model: PatchModel,
    /// Paths per pair, at least 2; the maximum with --target-error
    #[arg(long, value_name = "N", default_value_t = 16384, value_parser = parse_paths)]
    pub spp: u64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_seed)]
    pub seed: u64,
    /// Stop a pair when the standard error of every channel is below this share of the value, e.g. 0.02 for 2 % (with --albedo: of the incident light)
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Polar steps on each side and azimuths of --layout grid
    #[arg(long, value_name = "POLAR,AZIMUTHS", allow_hyphen_values = true, value_parser = parse_grid, default_value = "6,12")]
    pub grid: [u32; 2],
    /// Bands in which the cloth is seen: visible, nir or solar; visible,solar together with --layout klems (both in one .xml) or en14501
    #[arg(
        long,
        value_enum,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "visible"
    )]
    pub bands: Vec<BandName>,
    /// Patches of --layout klems
    #[arg(long, value_enum, default_value = "full")]
    pub klems_basis: KlemsBasisName,
    #[command(flatten)]
    pub tree: TreeArgs,
    #[command(flatten)]
    pub rgl: RglArgs,
    #[command(flatten)]
    pub ptm: PtmArgs,
    /// Degrees between positions of the lamp of --layout sweep
    #[arg(long, value_name = "DEG", default_value_t = 5.0, value_parser = parse_positive)]
    pub step: f64,
    /// Texels of the longer side of pictures (.exr, .ptm), 1 to 4096
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = whole::<u32>(1..=4096))]
    pub texels: u32,
    /// Level of detail of a fabric; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_level)]
    pub level: u8,
    #[command(flatten)]
    pub voxel: VoxelArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub cache: CacheArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

command!(MeasureArgs, "measure", "table.csv");

/// Runs the command.
pub fn run(args: &MeasureArgs) -> Result<()> {
    if let Some(path) = &args.outfile {
        output::check_writable(path)?;
        output::check_not_an_input(path, args.pairs.iter().chain([&args.file]))?;
    }
    let wanted = wanted(args)?;
    let rows = wanted.rows(args.rows.as_ref())?;
    bands::check(args, &wanted)?;
    with_threads(&args.common, || {
        let subject = watched(&args.common, &args.cache, |loader| {
            if is_scene_text(&args.file, &loader.text_of(&args.file, FileKind::Either)?)? {
                let subject = scene_subject(args, loader)?;
                check_outfile(args, loader)?;
                return Ok(subject);
            }
            let build = PatchOptions {
                loader,
                voxel_um: args.voxel.voxel_um,
                level: args.level,
                max_memory_bytes: args.memory.max_memory,
            };
            let mut fabric = fabric_file::load(&args.file, &args.common.set, loader)?;
            check_outfile(args, loader)?;
            let shown = args.model.of(&fabric, &args.file)?;
            let patches = bands::patches(args, &mut fabric, shown, &build)?;
            Ok(Subject {
                patches,
                grid: texel_grid(&fabric, args.texels),
                thickness_mm: f64::from(fabric.cloth.tile().bounds_mm.size().z),
                shown: Some(shown),
            })
        })?;
        measure(args, (&wanted, rows), &subject)
    })
}

/// What is measured.
struct Subject {
    /// As each of the bands sees it.
    patches: Vec<AnyPatch>,
    grid: TexelGrid,
    thickness_mm: f64,
    /// How a fabric is shown; none of a scene.
    shown: Option<ShownAs>,
}

/// Refuses a table that is one of the files read.
fn check_outfile(args: &MeasureArgs, loader: &Loader<'_>) -> Result<()> {
    match &args.outfile {
        Some(path) => output::check_not_an_input(path, loader.inputs().iter().map(|i| &i.path)),
        None => Ok(()),
    }
}

/// Whether the table to write ends in `.ending`.
fn ends_in(args: &MeasureArgs, ending: &str) -> bool {
    let path = args.outfile.as_ref();
    path.is_some_and(|p| {
        p.extension()
            .is_some_and(|e| e.eq_ignore_ascii_case(ending))
    })
}

/// The objects of a scene file.
fn scene_subject(args: &MeasureArgs, loader: &Loader<'_>) -> Result<Subject> {
    if bands::beyond_light(args) {
        return Err(of_file(
            &args.file,
            "is a scene; --bands measures a fabric file",
        ));
    }
    let mut file = scene_file::load(&args.file, &args.common.set, loader)?;
    match args.model {
        PatchModel::Own => {}
        PatchModel::Is(r) if r == &EXPLICIT_FIBRES => {
            file.render.integrator = IntegratorName::Fibres
        }
        PatchModel::Is(other) => {
            return Err(of_file(
                &args.file,
                format!("is a scene; --model {} measures a fabric file", other.name),
            ));
        }
    }
    let loaded = LoadedScene::new(file, &args.file, loader)?;
    let scene = loaded.build(args.memory.max_memory, loader)?;
    let patch = VolumePatch::new(scene, loaded.file.render.integrator.into())
        .map_err(|e| of_file(&args.file, e))?;
    let bounds = patch.bounds_mm();
    let grid = TexelGrid {
        low_mm: bounds.min.truncate(),
        size_mm: bounds.size().truncate(),
        texels: UVec2::splat(args.texels),
    };
    Ok(Subject {
        patches: vec![Box::new(patch)],
        grid,
        thickness_mm: f64::from(bounds.size().z),
        shown: None,
    })
}

fn measure(
    args: &MeasureArgs,
    (wanted, rows): (&Wanted, Range<usize>),
    subject: &Subject,
) -> Result<()> {
    let (patches, grid, shown) = (&subject.patches, &subject.grid, subject.shown);
    let patch = &patches[0];
    let effort = Effort {
        paths: args.spp,
        seed: args.seed,
        target_error: args.target_error,
    };
    let count = match wanted {
        Wanted::Textures(_) => rows.len() * grid.texels.element_product() as usize,
        Wanted::Rgl(grid) => grid.pairs() as usize,
        Wanted::Ptm(lamps) => *lamps as usize * grid.texels.element_product() as usize,
        _ => rows.len(),
    };
    let count = count * patches.len();
    let total = args.spp.saturating_mul(count as u64);
    let progress = Progress::new("measuring", total, &args.common);
    let done = AtomicU64::new(0);
    let host = &args.common.host;
    let watch = |paths| progress.at(done.fetch_add(paths, Ordering::Relaxed) + paths);
    let failed = |e: MeasureError| anyhow::Error::new(e);
    let mut summary = Summary {
        what: "pairs",
        list: Value::Null,
        extra: Vec::new(),
        result_line: None,
        dark: [0, 0],
        heavy_tails: 0,
        count,
        paths: 0,
    };
    match wanted {
        Wanted::Pairs(pairs) => {
            let result = measure_pair_rows(patch, pairs, rows, &effort, &watch);
            let mut result = result.map_err(failed)?;
            widen(args, shown, |table| table.widen_pairs(&mut result.list))?;
            write(args, |out| write_pairs(&result.list, out))?;
            host.give(|| results::pairs(&result.list, result.stats.paths));
            summary.list = listed(args, &result.list);
            summary.paths = result.stats.paths;
            summary.heavy_tails = result.heavy_tails;
            summary.result_line = median_error(&result.list);
            summary.dark = dark_pairs(shown, &result.list);
        }
        Wanted::Incident(incident) => {
            let result = measure_albedo_rows(patch, incident, rows, &effort, &watch);
            let mut result = result.map_err(failed)?;
            let mut of_table = 0.0;
            widen(args, shown, |table| {
                of_table = table.noise.first().map_or(0.0, |normal| normal.straight);
                table.widen_albedos(&mut result.list)
            })?;
            write(args, |out| write_albedos(&result.list, out))?;
            let (open, se) =
                measure_openness(patch, &effort, &|_| host.goes_on()).map_err(failed)?;
            let se = se.hypot(of_table);
            host.give(|| results::albedos(&result.list, [open, se], result.stats.paths));
            summary.what = "albedo";
            summary.list = listed(args, &result.list);
            summary.paths = result.stats.paths;
            summary.heavy_tails = result.heavy_tails;
            summary.extra = vec![
                ("openness", json!(open)),
                ("cover_factor", json!(1.0 - open)),
                ("se_openness", json!(se)),
            ];
            let cover = 1.0 - open;
            summary.result_line = Some(format!(
                "openness {open:.4} +- {se:.4}, cover factor {cover:.4}"
            ));
        }
        Wanted::Textures(pairs) => {
            check_texture_memory(args, pairs.len() as u64, grid)?;
            let mut textures = Vec::with_capacity(pairs.len());
            for pair in pairs {
                let texture = measure_texture(patch, *pair, grid, args.spp, args.seed, &watch);
                textures.push(texture.map_err(failed)?);
            }
            summary.what = "textures";
            summary.list = listed(args, pairs);
            summary.paths = args.spp * count as u64;
            host.give(|| results::textures(&textures, grid));
            if let Some(path) = &args.outfile {
                btf_file::write(path, &textures, grid)?;
            }
        }
        Wanted::Klems(basis) => {
            let result = measure_klems(patch, *basis, args.spp, args.seed, &watch);
            let (bsdf, stats) = result.map_err(failed)?;
            let mut solar = None;
            if let Some(patch) = patches.get(1) {
                let result = measure_klems(patch, *basis, args.spp, args.seed, &watch);
                let (sun, more) = result.map_err(failed)?;
                summary.paths += more.paths;
                let (openness, _) =
                    measure_openness(patch, &effort, &|_| host.goes_on()).map_err(failed)?;
                solar = Some((sun, openness));
            }
            let name = args.file.file_stem().unwrap_or_default().to_string_lossy();
            if ends_in(args, "xml") {
                let solar = solar.as_ref().map(|(bsdf, openness)| SolarKlems {
                    bsdf,
                    thickness_mm: subject.thickness_mm,
                    openness: *openness,
                });
                let text = write_klems(&bsdf, solar, &name)?;
                write(args, |out| out.write_all(text.as_bytes()))?;
            } else {
                write(args, |out| write_pairs(&bsdf.pairs(), out))?;
            }
            host.give(|| results::klems(&bsdf, stats.paths));
            summary.dark = dark_pairs(shown, &bsdf.pairs());
            summary.what = "klems";
            summary.list = listed(args, &bsdf.pairs());
            summary.paths += stats.paths;
            let along = [
                bsdf.hemispherical(&bsdf.reflection[0], 0),
                bsdf.hemispherical(&bsdf.transmission[0], 0),
            ];
            summary.result_line = Some(format!(
                "along the normal R {:.4?}, T {:.4?}",
                along[0], along[1]
            ));
        }
        Wanted::TensorTree(layout) => {
            tensor_tree::run(args, *layout, patch, &watch, &mut summary)?;
        }
        Wanted::Rgl(grid) => {
            rgl::run(args, *grid, (patch, shown), (&effort, &watch), &mut summary)?;
        }
        Wanted::Ptm(lamps) => {
            ptm::run(args, *lamps, (patch, grid), &watch, &mut summary)?;
        }
        Wanted::Shade => {
            shade::run(args, patches, (&effort, &watch), &mut summary)?;
        }
        Wanted::Sweep(lamps) => {
            let sweep = measure_sweep(patch, lamps, &effort, &watch).map_err(failed)?;
            write(args, |out| write_sweep(&sweep, out))?;
            let [front, back] = front_and_back(&sweep);
            host.give(|| results::sweep(&sweep, [front, back]));
            summary.what = "sweep";
            summary.list = listed(args, &sweep);
            summary.paths = args.spp * count as u64;
            summary.extra = vec![("front_lit", json!(front)), ("back_lit", json!(back))];
            summary.result_line = Some(format!("front-lit {front:.4?}, back-lit {back:.4?}"));
        }
    }
    let seconds = progress.finish();
    report(args, shown, summary, seconds)
}

/// Adds the errors of a table itself to those of what was measured of it.
fn widen(
    args: &MeasureArgs,
    shown: Option<ShownAs>,
    add: impl FnOnce(&TableErrors) -> bool,
) -> Result<()> {
    if !shown.is_some_and(|s| s.representation == &TABLE) {
        return Ok(());
    }
    let path = far_table::beside(&args.file);
    let (_, about) = far_table::read(&path, &args.common.host.loader())?;
    let known: TableErrors = serde_json::from_value(about).unwrap_or_default();
    if !add(&known) && !args.common.quiet {
        note!(
            "organza: warning: {}: does not say how far it is off, and no standard error has it; \
             organza table with --held-out measures it",
            path.display()
        );
    }
    Ok(())
}

/// Values as JSON, which takes ten times the memory, where somebody wants it.
fn listed(args: &MeasureArgs, list: &(impl serde::Serialize + ?Sized)) -> Value {
    if args.json || ends_in(args, "json") {
        json!(list)
    } else {
        Value::Null
    }
}
