//! Far-field tables of fabrics.

mod report;
mod texture;

pub use report::MadeTable;

use anyhow::{Context as _, Result};
use clap::Args;
use organza_basis::Stopped;
use organza_measure::{
    Effort, HeldOutError, MOST_STEPS, NodeSums, Pair, PairValue, RingNoise, Sharpened, Sharpening,
    far_matrix, held_out_errors, held_out_pairs, measure_node, measure_pair_rows, ring_noise,
};
use organza_scatter::{Footprint, Surface};
use organza_scene::fabric_file;
use organza_scene::far_table::{ENDING, FABRIC_KEY, TEXTURE_KEY};
use organza_scene::loader::Loader;
use organza_scene::patches::{AnyPatch, PatchModel, fabric_patch};
use organza_scene::representation::{EXPLICIT_FIBRES, ShownAs, TABLE};
use organza_surface::table::{
    FarTable, MAX_TEXELS, Rings, TableParts, TextureLayout, balance, write_table,
};
use organza_work::building::watched;
use organza_work::number_journal::{NumberJournal, PAIR_NUMBERS, pair_numbers, pair_values};
use organza_work::patch_model::patch_model;
use organza_work::values::{parse_micrometres, parse_paths, parse_seed, parse_share, whole};
use organza_work::{
    Context, Error, Job, Place, PlaceKind, Progress, Request, after_option, journal, keys,
    of_option, output, version,
};
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// The far-field table of a fabric, which `model = "table"` shows.
#[derive(Clone, Debug, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Table {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// Model that light is traced through
    #[arg(long, default_value = "fibres", value_parser = patch_model())]
    #[serde(deserialize_with = "organza_work::patch_model::named")]
    pub model: PatchModel,
    /// Paths of light from each of the table's nodes; the maximum with --target-error
    #[arg(long, value_name = "N", default_value_t = Table::default().spp, value_parser = parse_paths)]
    pub spp: u64,
    /// Stop when the table's error at the held-out pairs up to 80 degrees, noise taken out, is below this share, e.g. 0.05 for 5 %
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Pairs of directions that are measured apart from the table, to find its error; 0 for none
    #[arg(long, value_name = "N", default_value_t = Table::default().held_out, value_parser = whole::<usize>(0..=4096))]
    pub held_out: usize,
    /// Paths of each held-out pair
    #[arg(long, value_name = "N", default_value_t = Table::default().held_out_spp, value_parser = parse_paths)]
    pub held_out_spp: u64,
    /// Steps of the iteration that undoes the smoothing between the nodes; more make highlights sharper and the table noisier [default: until the noise of the paths is reached]
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0..=u64::from(MOST_STEPS)))]
    pub sharpen: Option<u32>,
    /// Most texels of the texture, with which the table shows threads; 0 for a table without one
    #[arg(long, value_name = "N", default_value_t = Table::default().texels, value_parser = whole::<u32>(0..=u64::from(MAX_TEXELS)))]
    pub texels: u32,
    /// Paths from each texel and each of the texture's 58 nodes
    #[arg(long, value_name = "N", default_value_t = Table::default().texel_spp, value_parser = parse_paths)]
    pub texel_spp: u64,
    /// Save what was traced to this file, and resume from it
    #[arg(long, value_name = "FILE")]
    pub journal: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = Table::default().seed, value_parser = parse_seed)]
    #[serde(deserialize_with = "keys::seed")]
    pub seed: u64,
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM", value_parser = parse_micrometres)]
    pub voxel_um: Option<f32>,
    /// Override any key of the fabric file, e.g. --set warp.per_cm=30 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    #[serde(deserialize_with = "keys::overrides")]
    pub set: Vec<String>,
}

impl Default for Table {
    fn default() -> Table {
        Table {
            fabric: PathBuf::new(),
            model: PatchModel::Is(&EXPLICIT_FIBRES),
            spp: 131_072,
            target_error: None,
            held_out: 64,
            held_out_spp: 16_384,
            sharpen: None,
            texels: 1024,
            texel_spp: 256,
            journal: None,
            seed: 0,
            voxel_um: None,
            set: Vec::new(),
        }
    }
}

type TableJob = Job<Table>;

/// With a target error, the first table has one in so many of the paths.
const FIRST_SHARE: u64 = 8;
/// Held-out pairs that the journal keeps together.
const PAIRS_AT_ONCE: usize = 8;

impl Request for Table {
    const NAME: &'static str = "table";
    type Output = MadeTable;

    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        output::check_ending(path, &[ENDING])?;
        Ok(vec![path.to_owned()])
    }

    fn further_places(&self) -> Vec<Place> {
        let journal = Place::of_key(self.journal.as_ref(), PlaceKind::Continued);
        journal.into_iter().collect()
    }

    fn check(&self, context: &Context) -> Result<()> {
        for (field, paths) in [
            ("spp", self.spp),
            ("held_out_spp", self.held_out_spp),
            ("texel_spp", self.texel_spp),
        ] {
            keys::check(field, [paths], parse_paths)?;
        }
        keys::check("target_error", self.target_error, parse_share)?;
        keys::check("held_out", [self.held_out], whole::<usize>(0..=4096))?;
        keys::check(
            "sharpen",
            self.sharpen,
            whole::<u32>(0..=u64::from(MOST_STEPS)),
        )?;
        keys::check(
            "texels",
            [self.texels],
            whole::<u32>(0..=u64::from(MAX_TEXELS)),
        )?;
        keys::check("voxel_um", self.voxel_um, parse_micrometres)?;
        if self.fabric.as_os_str().is_empty() {
            return Err(of_option("fabric", "expected a fabric file"));
        }
        if self.model == PatchModel::Is(&TABLE) {
            return Err(of_option("model", "a table cannot be made from a table"));
        }
        if self.target_error.is_some() && self.held_out < 8 {
            return Err(after_option(
                "target_error",
                "needs --held-out 8 or more, at which the error is measured",
            ));
        }
        for path in &context.outputs {
            output::check_not_an_input(path, [&self.fabric])?;
        }
        if let Some(journal) = &self.journal {
            context.check_writable(journal)?;
            for path in &context.outputs {
                output::check_distinct(("the journal", journal), ("the table", path))?;
            }
            output::check_not_an_input(journal, [&self.fabric])?;
        }
        Ok(())
    }

    fn work(job: &TableJob) -> Result<MadeTable> {
        let (work, about) = watched(&job.context, |loader| prepare(job, loader))?;
        make(job, work, about)
    }
}

/// What paths are traced through, and what is known of it.
struct Work {
    patch: AnyPatch,
    rings: Rings,
    shown: ShownAs,
    journal: NumberJournal,
    paths: AtomicU64,
    /// The surface model of the fabric, whose error at the held-out pairs is printed, too.
    surface: Option<Box<dyn Surface>>,
    /// The texels of the texture, if there is to be one.
    texels: Option<TextureLayout>,
    /// The spacing of threads, or an eighth of the period where there are none.
    spacing_mm: f32,
}

fn prepare(args: &TableJob, loader: &Loader<'_>) -> Result<(Work, Value)> {
    let fabric = fabric_file::load(&args.fabric, &args.set, loader)?;
    args.context.check_outputs(loader)?;
    let rings = Rings::usual();
    let texels = texture::layout(&fabric, args.texels);
    check_memory(args, &rings, texels.as_ref())?;
    let shown = args.model.of(&fabric, &args.fabric)?;
    let options = args.context.patch_options(loader, args.voxel_um, 0);
    let patch = fabric_patch(&fabric, &args.fabric, shown, &options)?;
    let has_surface = fabric.file.surface.is_some() && args.held_out > 0;
    let surface = has_surface.then(|| fabric.surface(&args.fabric));
    let surface = surface.transpose()?.map(|s| s.surface);
    let about = json!({
        "program": format!("organza {}", version::VERSION),
        "fabric": fabric.file.name.clone().unwrap_or_else(|| args.fabric.display().to_string()),
        FABRIC_KEY: fabric.look_digest(),
        "model": shown.to_string(),
        "voxel_um": args.voxel_um,
        "seed": args.seed,
    });
    let texels = texels.and_then(|layout| texture::at_height(layout, &patch, args.seed));
    let key = json!({ "table": 2, "of": about, "held_out": args.held_out_spp });
    let key = key.to_string();
    let of = journal::Work {
        command: "table",
        key: &key,
    };
    let journal = NumberJournal::open(args.journal.as_deref(), &of)?;
    let work = Work {
        patch,
        rings,
        shown,
        journal,
        paths: AtomicU64::new(0),
        surface,
        texels,
        spacing_mm: texture::spacing_mm(&fabric),
    };
    Ok((work, about))
}

/// The sums of all nodes, and the matrices that are made of them.
fn check_memory(args: &TableJob, rings: &Rings, texels: Option<&TextureLayout>) -> Result<()> {
    let n = rings.sphere() as u64;
    // For each channel the sums, their means, the values, the means of the values and room to
    // smooth them; at the end the pairs twice.
    let needed = n * n * 8 * (3 * 6 + 3) + texels.map_or(0, texture::memory_bytes);
    let allowed = args.context.memory_bytes();
    if needed > allowed {
        return Err(of_option(
            "max_memory",
            format!(
                "a table takes {} MiB while it is made; {} MiB are allowed",
                needed >> 20,
                allowed >> 20
            ),
        ));
    }
    Ok(())
}

impl Work {
    /// Traces paths of all nodes and adds them to the sums.
    fn trace(
        &mut self,
        args: &TableJob,
        paths: std::ops::Range<u64>,
        sums: &mut [NodeSums],
    ) -> Result<()> {
        let nodes = self.rings.sphere();
        let total = (paths.end - paths.start) * nodes as u64;
        let progress = Progress::new("tracing", total, &args.context);
        let length = NodeSums::list_length(nodes);
        let place = |node: usize| [node as f64, paths.start as f64, paths.end as f64];
        // So many that the threads are busy, and few enough that little is lost by an
        // interruption.
        let at_once = 4 * rayon::current_num_threads();
        for first in (0..nodes).step_by(at_once) {
            let these = first..(first + at_once).min(nodes);
            let (patch, rings) = (&self.patch, &self.rings);
            let with_known = these
                .clone()
                .map(|node| (node, self.journal.has(&place(node))));
            let found: Vec<_> = with_known
                .collect::<Vec<_>>()
                .into_par_iter()
                .map(|(node, is_known)| {
                    let result = match is_known {
                        true => None,
                        false => Some(measure_node(patch, rings, node, paths.clone(), args.seed)),
                    };
                    Stopped::check(progress.add(paths.end - paths.start))?;
                    result.transpose()
                })
                .collect::<Result<_, _>>()?;
            for (node, found) in these.zip(found) {
                let list = self.journal.once(&place(node), length, || {
                    let (sums, stats) = found.unwrap_or_default();
                    self.paths.fetch_add(stats.paths, Ordering::Relaxed);
                    Ok(sums.to_list())
                })?;
                let more = NodeSums::from_list(&list, nodes)
                    .with_context(|| format!("the sums of node {node} have another length"))?;
                if let Some(sum) = sums.get_mut(node) {
                    sum.merge(&more);
                }
            }
        }
        progress.finish();
        Ok(())
    }

    /// The truth at the held-out pairs.
    fn truth(&mut self, args: &TableJob, pairs: &[Pair]) -> Result<Vec<PairValue>> {
        let total = args.held_out_spp * pairs.len() as u64;
        let progress = Progress::new("measuring", total, &args.context);
        let watch = |paths| progress.add(paths);
        let effort = Effort::new(args.held_out_spp, args.seed);
        let mut all = Vec::with_capacity(pairs.len());
        for first in (0..pairs.len()).step_by(PAIRS_AT_ONCE) {
            let rows = first..(first + PAIRS_AT_ONCE).min(pairs.len());
            let place = [-1.0, first as f64, rows.end as f64];
            let list = self.journal.once(&place, PAIR_NUMBERS * rows.len(), || {
                let found = measure_pair_rows(&self.patch, pairs, rows.clone(), &effort, &watch)?;
                self.paths.fetch_add(found.stats.paths, Ordering::Relaxed);
                Ok(pair_numbers(&found.list))
            })?;
            all.extend(pair_values(&pairs[rows], args.held_out_spp, &list));
        }
        progress.finish();
        Ok(all)
    }
}

/// A table that was made.
struct Made {
    parts: TableParts,
    table: FarTable,
    paths_per_node: u64,
    residual: f64,
    sharpened: Sharpened,
    noise: Vec<RingNoise>,
    errors: Vec<HeldOutError>,
}

fn make(args: &TableJob, mut work: Work, mut about: Value) -> Result<MadeTable> {
    let started = std::time::Instant::now();
    let pairs = held_out_pairs(args.held_out, args.seed);
    let truth = work.truth(args, &pairs)?;
    let nodes = work.rings.sphere();
    let mut sums = vec![NodeSums::default(); nodes];
    let mut end = match args.target_error {
        Some(_) => args.spp.div_ceil(FIRST_SHARE).max(2),
        None => args.spp,
    };
    let mut begin = 0;
    let made = loop {
        work.trace(args, begin..end, &mut sums)?;
        let made = solve(args, &work, &sums, &truth, end)?;
        let worst = made.errors.iter().take(2).fold(0.0f64, |m, e| m.max(e.rms));
        let enough = args.target_error.is_none_or(|target| worst <= target);
        if enough || end >= args.spp {
            break made;
        }
        (begin, end) = (end, (2 * end).min(args.spp));
    };
    let surface = work.surface.as_deref().map(|s| errors(s, &truth));
    let worst = made.errors.iter().take(2).fold(0.0f64, |m, e| m.max(e.rms));
    if let Some(target) = args.target_error
        && worst > target
    {
        args.context.warn(format!(
            "{}: the error {:.1} % is above --target-error; more --spp helps against noise, not \
             against what lies between the nodes",
            args.context
                .outputs
                .first()
                .unwrap_or(&args.fabric)
                .display(),
            100.0 * worst
        ));
    }
    if let Some(map) = about.as_object_mut() {
        map.insert("paths_per_node".into(), json!(made.paths_per_node));
        map.insert("sharpened".into(), json!(made.sharpened));
        map.insert("held_out_paths".into(), json!(args.held_out_spp));
        map.insert("noise".into(), json!(made.noise));
        map.insert("errors".into(), json!(made.errors));
        if let Some(surface) = surface {
            map.insert("errors_of_surface_model".into(), json!(surface));
        }
    }
    let texture = texture::make(args, &mut work)?;
    if let (Some(texture), Some(map)) = (&texture, about.as_object_mut()) {
        let measured = texture::errors(args, &mut work, &made.table, texture)?;
        map.insert(TEXTURE_KEY.into(), measured);
    }
    let parts = texture.as_ref().map(|t| &t.parts);
    let bytes = write_table(&made.parts, parts, &about).context("writing the table failed")?;
    Ok(MadeTable {
        bytes,
        about,
        paths: work.paths.load(Ordering::Relaxed),
        seconds: started.elapsed().as_secs_f64(),
        fabric: args.fabric.clone(),
        shown: work.shown,
        made,
    })
}

/// The errors of a surface at the held-out pairs.
fn errors(surface: &dyn Surface, truth: &[PairValue]) -> Vec<HeldOutError> {
    let value = |v: &PairValue| {
        let (w_in, w_out) = (v.pair.incident.direction(), v.pair.exitant.direction());
        let value = surface.eval(w_out, w_in, Footprint::FAR);
        value.0.to_array().map(f64::from)
    };
    let values: Vec<[f64; 3]> = truth.iter().map(value).collect();
    held_out_errors(&values, truth)
}

fn solve(
    args: &TableJob,
    work: &Work,
    sums: &[NodeSums],
    truth: &[PairValue],
    paths_per_node: u64,
) -> Result<Made> {
    let sharpening = args.sharpen.map_or(Sharpening::ToNoise, Sharpening::Steps);
    let found = far_matrix(&work.rings, sums, sharpening);
    let (matrix, sharpened) = found.context("nodes without paths")?;
    let balanced = balance(&matrix);
    let table = FarTable::new(balanced.parts.clone()).context("the measured table is none")?;
    Ok(Made {
        errors: errors(&table, truth),
        parts: balanced.parts,
        residual: balanced.residual,
        sharpened,
        noise: ring_noise(&work.rings, sums),
        table,
        paths_per_node,
    })
}
