//! Textures and materials of fabrics for other programs.

mod summary;

use anyhow::{Context as _, Result};
use clap::Args;
use glam::{UVec2, Vec2};
use organza_bake::albedo::Albedos;
use organza_bake::fit::{Fitted, SKY_WEIGHT, fit_target};
use organza_bake::layout::{PlannedPair, planned_pairs};
use organza_bake::maps::{BYTES_PER_TEXEL, Maps};
use organza_bake::model::{GLTF, OPENPBR, STANDARD_SURFACE, TARGETS, Target, USD_PREVIEW};
use organza_bake::texel::Texel;
use organza_bake::write::{Baked, FOLDER, folder_files, plain_name};
use organza_basis::{SegmentSource, Stopped};
use organza_measure::fit::Patience;
use organza_measure::{
    Albedo, Angles, Effort, LookSums, Pair, PairValue, TexelGrid, gather_looks, measure_albedos,
    measure_pairs,
};
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::patches::{AnyPatch, PatchModel, fabric_patch, texel_grid};
use organza_scene::representation::{Build, EXPLICIT_FIBRES, ShownAs};
use organza_work::building::watched;
use organza_work::output_folder::write_folder;
use organza_work::patch_model::patch_model;
use organza_work::values::{
    parse_level, parse_micrometres, parse_paths, parse_repeats, parse_seed, whole,
};
use organza_work::{
    Context, Error, Job, Output, PlaceKind, Progress, Request, Results, after_option, keys,
    of_file, of_key, of_option, output,
};
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Textures and materials of a fabric for other programs: glTF, MaterialX, USD.
#[derive(Clone, Debug, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Bake {
    /// Fabric file (TOML); further ones are colourways of it, which the files hold as variants
    #[arg(required = true, value_name = "FABRIC")]
    pub fabrics: Vec<PathBuf>,
    /// Texels of the longer side of the textures, 16 to 4096; if a power of two, so is the other side
    #[arg(long, value_name = "N", default_value_t = Bake::default().resolution, value_parser = whole::<u32>(16..=4096))]
    pub resolution: u32,
    /// Repeats of the draft in the textures, each with fibres of its own [default: the fabric's, or about 20 threads if they have 24 texels each]
    #[arg(long, value_name = "NX,NY", allow_hyphen_values = true, value_parser = parse_repeats)]
    pub repeats: Option<UVec2>,
    /// What is measured: explicit fibres or a volume
    #[arg(long, default_value = "fibres", value_parser = patch_model())]
    #[serde(deserialize_with = "organza_work::patch_model::named")]
    pub model: PatchModel,
    /// Paths per texel of the textures, 4 to 4096
    #[arg(long, value_name = "N", default_value_t = Bake::default().texel_spp, value_parser = whole::<u32>(4..=4096))]
    pub texel_spp: u32,
    /// Pairs of directions that are measured, 64 to 8192; a quarter of them judges the result
    #[arg(long, value_name = "N", default_value_t = Bake::default().pairs, value_parser = whole::<u32>(64..=8192))]
    pub pairs: u32,
    /// Paths per pair, at least 2
    #[arg(long, value_name = "N", default_value_t = Bake::default().spp, value_parser = parse_paths)]
    pub spp: u64,
    /// Texels whose mean stands for the material while it is fitted, 16 to 65536
    #[arg(long, value_name = "N", default_value_t = Bake::default().fit_texels, value_parser = whole::<u32>(16..=65536))]
    pub fit_texels: u32,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = Bake::default().seed, value_parser = parse_seed)]
    #[serde(deserialize_with = "keys::seed")]
    pub seed: u64,
    /// Level of detail of a volume; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = Bake::default().level, value_parser = parse_level)]
    pub level: u8,
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM", value_parser = parse_micrometres)]
    pub voxel_um: Option<f32>,
    /// Override any key of the fabric file, e.g. --set warp.per_cm=30 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    #[serde(deserialize_with = "keys::overrides")]
    pub set: Vec<String>,
}

impl Default for Bake {
    fn default() -> Bake {
        Bake {
            fabrics: Vec::new(),
            resolution: 1024,
            repeats: None,
            model: PatchModel::Is(&EXPLICIT_FIBRES),
            texel_spp: 32,
            pairs: 320,
            spp: 4096,
            fit_texels: 256,
            seed: 0,
            level: 0,
            voxel_um: None,
            set: Vec::new(),
        }
    }
}

type BakeJob = Job<Bake>;

/// The files of the folder beside textures.
const FILES: [&str; 4] = [
    "bake.json",
    "material.glb",
    "material.mtlx",
    "material.usda",
];

/// Polar angles at which light that passes straight through is measured, degrees, and the
/// azimuths: along the weft, along the warp.
const STRAIGHT_DEG: [f64; 3] = [0.0, 30.0, 60.0];

/// Threads of the textures, each way: fewer show that they repeat.
const THREADS: usize = 20;

/// Texels of a thread at least, where there are more repeats than one.
const TEXELS_PER_THREAD: usize = 24;

/// The largest difference of the tiles of colourways, as a share.
const SAME_TILE: f32 = 1e-4;

/// Standard deviation of the smoothing of the relief, as a share of the narrower spacing of
/// threads: single fibres vanish, threads stay round.
const SMOOTHING: f32 = 1.0 / 16.0;

/// The same as a share of the tile, for cloth without a draft.
const SMOOTHING_OF_TILE: f32 = 1.0 / 100.0;

/// How long parameters are searched for.
const PATIENCE: Patience = Patience {
    scan: 24,
    steps: 220,
    stride: 1e-3,
};

/// The most evaluations of a search: the scan and four descents, and the derivatives at the
/// end.
const EVALUATIONS: u64 = 1 + 24 + 4 * 220 + 14;

/// What was measured of a fabric.
struct Measurement {
    plan: Vec<PlannedPair>,
    pairs: Vec<PairValue>,
    straight: Vec<Albedo>,
    looks: Vec<LookSums>,
}

/// A fabric that is baked.
struct Cloth<'a> {
    path: &'a Path,
    fabric: Fabric,
    /// Name of its material.
    name: String,
    /// Folder of its textures.
    folder: String,
    shown: ShownAs,
    grid: TexelGrid,
}

/// What became of it.
struct Made {
    maps: Maps,
    smoothing_mm: f32,
    measured: Measurement,
    fits: Vec<Fitted>,
}

impl Request for Bake {
    const NAME: &'static str = "bake";
    type Output = Baking;

    const OUTPUT: PlaceKind = PlaceKind::Folder;

    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        output::check_report_folder(path, ("choices.csv", "the report of a bench"))?;
        Ok(vec![path.to_owned()])
    }

    fn check(&self, _: &Context) -> Result<()> {
        keys::check("spp", [self.spp], parse_paths)?;
        keys::check("resolution", [self.resolution], whole::<u32>(16..=4096))?;
        keys::check("texel_spp", [self.texel_spp], whole::<u32>(4..=4096))?;
        keys::check("pairs", [self.pairs], whole::<u32>(64..=8192))?;
        keys::check("fit_texels", [self.fit_texels], whole::<u32>(16..=65536))?;
        keys::check("voxel_um", self.voxel_um, parse_micrometres)?;
        let repeats = self.repeats.map(|n| keys::listed(&n.to_array()));
        keys::check("repeats", repeats, parse_repeats)?;
        if self.fabrics.is_empty() {
            return Err(of_option("fabrics", "expected a fabric file"));
        }
        Ok(())
    }

    fn work(job: &BakeJob) -> Result<Baking> {
        bake(job)
    }
}

/// Materials and textures of a fabric and its colourways.
pub struct Baking {
    /// What `bake.json` holds.
    pub report: Value,
    /// The maps of the first fabric.
    pub maps: Maps,
    /// The files by their names.
    pub files: Vec<(String, Vec<u8>)>,
    /// What a person reads of it.
    pub lines: Vec<String>,
}

impl Output for Baking {
    fn results(&self) -> Result<Results, Error> {
        Ok(results(self.report.clone(), &self.maps, self.files.clone()))
    }

    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        write_folder(path, &self.files)?;
        Ok(self.files.iter().map(|(name, _)| path.join(name)).collect())
    }
}

fn bake(args: &BakeJob) -> Result<Baking> {
    let mut cloths = Vec::new();
    for path in &args.fabrics {
        cloths.push(cloth(args, path)?);
    }
    check_colourways(&mut cloths)?;
    let mut made = Vec::new();
    for cloth in &cloths {
        made.push(make(args, cloth)?);
    }
    let colourways: Vec<Baked<'_>> = cloths
        .iter()
        .zip(&made)
        .map(|(cloth, made)| {
            let by = |target: &Target| &made.fits[place_of(target)].parameters;
            Baked {
                name: &cloth.name,
                folder: &cloth.folder,
                maps: &made.maps,
                gltf: by(&GLTF),
                openpbr: by(&OPENPBR),
                standard_surface: by(&STANDARD_SURFACE),
                usd_preview: by(&USD_PREVIEW),
            }
        })
        .collect();
    let (baked, textures) = folder_files(&colourways)?;
    let reports: Vec<summary::Report<'_>> = cloths
        .iter()
        .zip(&made)
        .map(|(cloth, made)| summary::Report {
            cloth,
            made,
            seed: args.seed,
            textures: &textures,
        })
        .collect();
    let mut json = reports.first().context("no fabric")?.json();
    if reports.len() > 1 {
        let others = reports.iter().skip(1).map(summary::Report::json);
        json["colourways"] = others.collect();
    }
    let lines = reports.iter().flat_map(summary::Report::lines).collect();
    let text = serde_json::to_string_pretty(&json)? + "\n";
    let mut files = vec![("bake.json".to_owned(), text.into_bytes())];
    files.extend(baked);
    let first = made.into_iter().next().context("no fabric")?;
    Ok(Baking {
        report: json,
        maps: first.maps,
        files,
        lines,
    })
}

/// Reads a fabric, with as many repeats as its textures show.
fn cloth<'a>(args: &BakeJob, path: &'a Path) -> Result<Cloth<'a>> {
    let fabric = watched(&args.context, |loader| {
        let load = |repeats: Option<UVec2>| {
            let mut changes = args.set.clone();
            changes.extend(repeats.map(|n| format!("tile.repeats=[{}, {}]", n.x, n.y)));
            fabric_file::load(path, &changes, loader)
        };
        let mut fabric = load(args.repeats)?;
        if let Some(draft) = fabric.cloth.draft()
            && args.repeats.is_none()
            && fabric.file.tile.repeats == [1, 1]
        {
            let most = args.resolution as usize / TEXELS_PER_THREAD;
            let of = |n: usize| THREADS.div_ceil(n.max(1)).min(most / n.max(1)).max(1) as u32;
            let repeats = UVec2::new(of(draft.ends()), of(draft.picks()));
            if repeats != UVec2::ONE {
                fabric = load(Some(repeats))?;
            }
        }
        let read = loader.inputs();
        for folder in &args.context.outputs {
            for name in FILES {
                output::check_not_an_input(&folder.join(name), read.iter().map(|i| &i.path))?;
            }
        }
        Ok(fabric)
    })?;
    let shown = args.model.of(&fabric, path)?;
    if matches!(shown.representation.build, Build::Surface(_)) {
        return Err(after_option(
            "model",
            format!(
                "{}: has no geometry to make maps of; expected fibres, packed, plain or microflake",
                shown.representation.name
            ),
        ));
    }
    let mut grid = texel_grid(&fabric, args.resolution);
    if args.resolution.is_power_of_two() {
        grid.texels = UVec2::from(grid.texels.to_array().map(nearest_power_of_two));
    }
    check_memory(args, &grid)?;
    let name = fabric.file.name.clone();
    let name = name.unwrap_or_else(|| {
        let stem = path.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    });
    let threads = fabric.cloth.draft().map(|draft| {
        let count = Vec2::new(draft.ends() as f32, draft.picks() as f32);
        let per_cm = (10.0 * count / fabric.cloth.tile().bounds_mm.size().truncate()).round();
        format!("_{}x{}_per_cm", per_cm.x, per_cm.y)
    });
    Ok(Cloth {
        path,
        name: plain_name(&name) + &threads.unwrap_or_default(),
        folder: FOLDER.to_owned(),
        fabric,
        shown,
        grid,
    })
}

fn nearest_power_of_two(n: u32) -> u32 {
    let above = u64::from(n).next_power_of_two();
    let is_nearer = above * above <= 2 * u64::from(n).pow(2);
    (if is_nearer { above } else { above / 2 }) as u32
}

/// Gives colourways folders of their own.
///
/// # Errors
/// Tiles of different sizes, or the same name twice.
fn check_colourways(cloths: &mut [Cloth<'_>]) -> Result<()> {
    if cloths.len() < 2 {
        return Ok(());
    }
    for (k, cloth) in cloths.iter().enumerate() {
        let (path, first) = (&cloth.path, &cloths[0]);
        let (own, wanted) = (cloth.grid.size_mm, first.grid.size_mm);
        if !own.abs_diff_eq(wanted, SAME_TILE * wanted.max_element()) {
            return Err(of_file(
                path,
                format!(
                    "textures show {:.3} x {:.3} mm, those of {} {:.3} x {:.3} mm; expected a \
                     colourway, which has the same threads",
                    own.x,
                    own.y,
                    first.path.display(),
                    wanted.x,
                    wanted.y
                ),
            ));
        }
        let same = |other: &&Cloth<'_>| other.name == cloth.name;
        if let Some(other) = cloths.iter().take(k).find(same) {
            return Err(of_key(
                path,
                "name",
                format!(
                    "is {}, as in {}; expected a name of its own for each colourway",
                    cloth.name,
                    other.path.display()
                ),
            ));
        }
    }
    for cloth in cloths {
        cloth.folder = format!("{FOLDER}/{}", cloth.name);
    }
    Ok(())
}

/// Measures a cloth, and fits its materials.
fn make(args: &BakeJob, cloth: &Cloth<'_>) -> Result<Made> {
    let (fabric, grid) = (&cloth.fabric, &cloth.grid);
    let patch = watched(&args.context, |loader| {
        let build = args
            .context
            .patch_options(loader, args.voxel_um, args.level);
        Ok(fabric_patch(fabric, cloth.path, cloth.shown, &build)?)
    })?;
    let measured = measure(args, &patch, grid)?;
    let spacing_mm = fabric.thread_spacing_mm();
    let smoothing_mm = if spacing_mm.is_finite() {
        SMOOTHING * spacing_mm
    } else {
        SMOOTHING_OF_TILE * grid.size_mm.max_element()
    };
    let maps = Maps::new(&measured.looks, grid, smoothing_mm);
    let fits = fit(args, &maps, &measured)?;
    Ok(Made {
        maps,
        smoothing_mm,
        measured,
        fits,
    })
}

/// The place of a model among the fits, which are in the order of [`TARGETS`].
fn place_of(target: &Target) -> usize {
    let same = |t: &&Target| t.name == target.name;
    TARGETS.iter().position(same).unwrap_or(0)
}

fn check_memory(args: &BakeJob, grid: &TexelGrid) -> Result<()> {
    // The maps of all colourways are kept until they are written.
    let texels = grid.texels.as_u64vec2().element_product() * args.fabrics.len() as u64;
    let needed = texels.saturating_mul(BYTES_PER_TEXEL);
    let most = args.context.memory_bytes();
    if needed > most {
        return Err(after_option(
            "resolution",
            format!(
                "{}: maps of {} x {} texels need {needed} bytes of memory, {most} are allowed: \
                 take fewer texels",
                args.resolution, grid.texels.x, grid.texels.y
            ),
        ));
    }
    Ok(())
}

fn measure(args: &BakeJob, patch: &AnyPatch, grid: &TexelGrid) -> Result<Measurement> {
    let plan = planned_pairs(args.pairs);
    let effort = Effort::new(args.spp, args.seed);
    let pairs: Vec<Pair> = plan.iter().map(|p| p.pair).collect();
    let straight: Vec<Angles> = STRAIGHT_DEG
        .iter()
        .flat_map(|&theta_deg| [0.0, 90.0].map(|phi_deg| Angles { theta_deg, phi_deg }))
        .collect();
    let texels = grid.texels.as_u64vec2().element_product();
    let total =
        texels * u64::from(args.texel_spp) + (pairs.len() + straight.len()) as u64 * args.spp;
    let progress = Progress::new("measuring", total, &args.context);
    let watch = |paths| progress.add(paths);
    let looks = gather_looks(patch, grid, args.texel_spp, args.seed, &watch)?;
    let pairs = measure_pairs(patch, &pairs, &effort, &watch)?.list;
    let straight = measure_albedos(patch, &straight, &effort, &watch)?.list;
    progress.finish();
    Ok(Measurement {
        plan,
        pairs,
        straight,
        looks,
    })
}

/// Fits all models, in the order of [`TARGETS`]. OpenPBR is first, because the textures have
/// its values; the others use its growth of roughness.
fn fit(args: &BakeJob, maps: &Maps, measured: &Measurement) -> Result<Vec<Fitted>, Stopped> {
    let texels = maps.sample(args.fit_texels, args.seed);
    let albedos = Albedos::new();
    let total = EVALUATIONS * TARGETS.len() as u64;
    let progress = Progress::new("fitting", total, &args.context);
    let mut done = 0;
    let mut one = |target: &Target, roughening: Option<f64>| {
        fit_target(
            target,
            &texels,
            &measured.plan,
            &measured.pairs,
            &albedos,
            SKY_WEIGHT,
            roughening,
            &PATIENCE,
            &mut || {
                done += 1;
                progress.at(done)
            },
        )
    };
    let first = one(&OPENPBR, None)?;
    let roughening = Some(first.parameters.roughening);
    let fits = TARGETS
        .iter()
        .map(|target| match target.name == OPENPBR.name {
            true => Ok(first.clone()),
            false => one(target, roughening),
        })
        .collect::<Result<_, _>>()?;
    progress.finish();
    Ok(fits)
}

/// What another program takes: the report, the maps of the first cloth in rows from the top, and the files.
fn results(json: Value, maps: &Maps, files: Vec<(String, Vec<u8>)>) -> Results {
    let [width, height] = maps.size.to_array().map(|n| n as usize);
    let one = |value: &dyn Fn(&Texel) -> f32| maps.texels.iter().map(value).collect::<Vec<_>>();
    let three =
        |value: &dyn Fn(&Texel) -> [f32; 3]| maps.texels.iter().flat_map(value).collect::<Vec<_>>();
    let plane = [height, width];
    let colours = [height, width, 3];
    let mut results = Results::default()
        .with_figure("bake", json)
        .with_f32("base_color", &colours, three(&|t| t.base().to_array()))
        .with_f32("normal", &colours, three(&|t| t.normal(1.0).to_array()))
        .with_f32(
            "transmitted",
            &colours,
            three(&|t| t.transmitted.to_array()),
        )
        .with_f32("opacity", &plane, one(&|t| t.coverage))
        .with_f32("height_mm", &plane, maps.height_mm.clone());
    results.files = files;
    results
}
