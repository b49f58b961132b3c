//! Comparisons of the models of a fabric, with each other or with measured values.

use anyhow::Result;
use clap::Args;
use organza_measure::{Effort, irawan_layout};
use organza_report::comparison::{Comparison, ComparisonPlan, Measurement, judge};
use organza_scene::fabric_file;
use organza_scene::patches::{AnyPatch, PatchModel, fabric_patch, texel_grid};
use organza_scene::representation::{EXPLICIT_FIBRES, Representation, SURFACE, ShownAs, TABLE};
use organza_work::building::watched;
use organza_work::output_folder::write_folder;
use organza_work::patch_model::patch_model;
use organza_work::values::{
    parse_level, parse_micrometres, parse_paths, parse_seed, parse_share, whole,
};
use organza_work::{
    Context, Error, InputError, Job, Output, PlaceKind, Progress, Request, Results, Waiting, keys,
    measured_values, of_file, of_option, output,
};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A comparison of the models of a fabric with each other or with measured values.
#[derive(Clone, Debug, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Compare {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// What to compare; the first is the reference unless --data is
    /// [default: fibres if memory allows, auto, surface if the fabric has one]
    #[arg(long, value_delimiter = ',', value_parser = patch_model())]
    #[serde(deserialize_with = "organza_work::patch_model::list")]
    pub models: Vec<PatchModel>,
    /// Measured values to compare with, as the reference: CSV with r,g,b or a WINDOW file (.xml)
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// Paths per pair, at least 2
    #[arg(long, value_name = "N", default_value_t = Compare::default().spp, value_parser = parse_paths)]
    pub spp: u64,
    /// Stop a pair when the standard error of every channel is below this share of the value (0.05 is 5 %)
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Texels of the longer side of the pictures, 8 to 4096
    #[arg(long, value_name = "N", default_value_t = Compare::default().texels, value_parser = whole::<u32>(8..=4096))]
    pub texels: u32,
    /// Paths per texel of the pictures, at least 2
    #[arg(long, value_name = "N", default_value_t = Compare::default().texel_spp, value_parser = parse_paths)]
    pub texel_spp: u64,
    /// Median relative error below which models agree (0.15 is 15 %)
    #[arg(long, value_name = "SHARE", default_value_t = Compare::default().limit, value_parser = parse_share)]
    pub limit: f64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = Compare::default().seed, value_parser = parse_seed)]
    #[serde(deserialize_with = "keys::seed")]
    pub seed: u64,
    /// Level of detail of the volumes; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = Compare::default().level, value_parser = parse_level)]
    pub level: u8,
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM", value_parser = parse_micrometres)]
    pub voxel_um: Option<f32>,
    /// Override any key of the fabric file, e.g. --set warp.per_cm=30 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    #[serde(deserialize_with = "keys::overrides")]
    pub set: Vec<String>,
}

impl Default for Compare {
    fn default() -> Compare {
        Compare {
            fabric: PathBuf::new(),
            models: Vec::new(),
            data: None,
            spp: 1024,
            target_error: None,
            texels: 96,
            texel_spp: 64,
            limit: 0.15,
            seed: 0,
            level: 0,
            voxel_um: None,
            set: Vec::new(),
        }
    }
}

/// The files of a comparison's folder.
const FILES: [&str; 3] = ["pairs.csv", "report.json", "report.html"];

impl Request for Compare {
    const NAME: &'static str = "compare";
    type Output = Compared;

    const OUTPUT: PlaceKind = PlaceKind::Folder;

    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        output::check_report_folder(path, ("choices.csv", "the report of a bench"))?;
        Ok(vec![path.to_owned()])
    }

    fn check(&self, context: &Context) -> Result<()> {
        keys::check("spp", [self.spp], parse_paths)?;
        keys::check("texel_spp", [self.texel_spp], parse_paths)?;
        keys::check("target_error", self.target_error, parse_share)?;
        keys::check("limit", [self.limit], parse_share)?;
        keys::check("texels", [self.texels], whole::<u32>(8..=4096))?;
        keys::check("voxel_um", self.voxel_um, parse_micrometres)?;
        if self.fabric.as_os_str().is_empty() {
            return Err(of_option("fabric", "expected a fabric file"));
        }
        if !self.models.is_empty() && self.distinct().len() + usize::from(self.data.is_some()) < 2 {
            let why = "expected two models or more, or --data";
            return Err(of_option("models", why));
        }
        for folder in &context.outputs {
            for name in FILES {
                output::check_not_an_input(&folder.join(name), &self.data)?;
            }
        }
        Ok(())
    }

    fn work(job: &Job<Compare>) -> Result<Compared> {
        Ok(Compared(compare(job)?))
    }
}

impl Compare {
    /// The models that are named, each once.
    fn distinct(&self) -> Vec<PatchModel> {
        let mut list: Vec<PatchModel> = Vec::new();
        for model in &self.models {
            if !list.contains(model) {
                list.push(*model);
            }
        }
        list
    }
}

fn compare(job: &Job<Compare>) -> Result<Comparison> {
    let context = &job.context;
    let _waiting = Waiting::new("comparing", context);
    let data = job
        .data
        .as_deref()
        .map(|path| measured_values::read(path, context));
    let data = data.transpose()?;
    let fabric = watched(context, |loader| {
        Ok(fabric_file::load(&job.fabric, &job.set, loader)?)
    })?;
    let mut models = job.distinct();
    let models_are_chosen = !models.is_empty();
    if !models_are_chosen {
        models = vec![PatchModel::Is(&EXPLICIT_FIBRES), PatchModel::Own];
        let loader = context.loader();
        let ready = [&SURFACE, &TABLE].into_iter();
        let ready = ready.filter(|r| (r.is_ready)(&fabric, &job.fabric, &loader));
        models.extend(ready.map(PatchModel::Is));
    }
    let plan = ComparisonPlan {
        layout: match &data {
            Some(values) => values.iter().map(|v| v.pair).collect(),
            None => irawan_layout(),
        },
        effort: Effort {
            paths: job.spp,
            seed: job.seed,
            target_error: job.target_error,
        },
        grid: texel_grid(&fabric, job.texels),
        texel_paths: job.texel_spp,
    };
    let mut measured = Vec::new();
    if let Some(values) = data {
        measured.push(Measurement::of_data("data", values));
    }
    let mut seen = Vec::new();
    for model in models {
        let shown = model.of(&fabric, &job.fabric)?;
        // The fabric's own may be one that is named as well.
        if seen.contains(&shown) {
            continue;
        }
        seen.push(shown);
        let patch = watched(context, |loader| {
            let build = context.patch_options(loader, job.voxel_um, job.level);
            Ok(fabric_patch(&fabric, &job.fabric, shown, &build)?)
        });
        let patch = match patch {
            Err(why)
                if !models_are_chosen
                    && !context.stop.is_asked()
                    && leaves_out(shown.representation, &why) =>
            {
                context.note(format!("fibres are left out: {why}"));
                continue;
            }
            patch => patch?,
        };
        measured.push(measure(job, &plan, shown, &patch)?);
    }
    if measured.len() < 2 {
        let why = "the volume is its only model; add a [surface] section (organza fit creates one)";
        return Err(of_file(&job.fabric, why));
    }
    let name = fabric.file.name.clone();
    Ok(Comparison {
        name: name.unwrap_or_else(|| job.fabric.display().to_string()),
        command: context.command.clone(),
        judged: judge(&measured, job.seed),
        measured,
        limit: job.limit,
    })
}

/// Whether a comparison of the usual models continues without one that is refused:
/// explicit fibres that do not fit into memory.
fn leaves_out(model: &Representation, why: &anyhow::Error) -> bool {
    model == &EXPLICIT_FIBRES && why.is::<InputError>()
}

fn measure(
    job: &Job<Compare>,
    plan: &ComparisonPlan,
    shown: ShownAs,
    patch: &AnyPatch,
) -> Result<Measurement> {
    let name = shown.representation.name;
    let paths = plan.layout.len() as u64 * job.spp;
    let progress = Progress::new(name, paths, &job.context);
    Ok(plan.measure(name, patch, &|paths| progress.add(paths))?)
}

/// What models differ by.
pub struct Compared(pub Comparison);

impl Output for Compared {
    /// The report, and its values of every model.
    fn results(&self) -> Result<Results, Error> {
        let mut results = Results::default().with_figure("report", self.0.json());
        for measurement in &self.0.measured {
            let of_model = crate::measure::results::pairs(&measurement.layout, measurement.paths);
            let named = of_model.arrays.into_iter();
            let named = named.map(|(name, array)| (format!("{}.{name}", measurement.model), array));
            results.arrays.extend(named);
        }
        Ok(results)
    }

    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        let json = serde_json::to_string_pretty(&self.0.json()).map_err(anyhow::Error::from)?;
        let texts = [
            self.0.pairs_csv().map_err(anyhow::Error::from)?,
            json,
            self.0.html().map_err(anyhow::Error::from)?,
        ];
        let files = FILES.iter().zip(texts);
        let files = files.map(|(name, text)| ((*name).to_owned(), text.into_bytes()));
        write_folder(path, &files.collect::<Vec<_>>())?;
        Ok(FILES.map(|name| path.join(name)).to_vec())
    }
}
