//! Measurements of reflection and transmission of a patch of cloth.

mod bands;
mod in_plane;
mod klems;
mod layout;
mod output;
mod ptm;
pub(crate) mod results;
mod rgl;
mod rows;
mod shade;
mod sweep;
mod tensor_tree;
mod textures;

pub use bands::BandName;
pub use klems::KlemsBasisName;
pub use layout::LayoutName;
pub use output::{Measurement, Values};

use anyhow::Result;
use clap::Args;
use glam::UVec2;
use layout::{Found, Kind, with_ending};
use organza_basis::{SegmentSource, Watch};
use organza_measure::{
    Angles, Effort, Pair, PairValue, TableErrors, TexelGrid, VolumePatch, parse_incident,
    parse_pairs,
};
use organza_scene::file_kind::Wanted as FileKind;
use organza_scene::loader::Loader;
use organza_scene::patches::{AnyPatch, PatchModel, texel_grid};
use organza_scene::representation::{Build, EXPLICIT_FIBRES, ShownAs, TABLE};
use organza_scene::scene_file::{self, IntegratorName, is_scene_text};
use organza_scene::{LoadedScene, fabric_file, far_table};
use organza_work::building::watched;
use organza_work::patch_model::{OWN, patch_model};
use organza_work::values::{
    parse_grid, parse_level, parse_micrometres, parse_paths, parse_positive, parse_rgl_grid,
    parse_rows, parse_seed, parse_share, whole,
};
use organza_work::{
    Context, Error, InputError, Job, Progress, Request, after_option, input, keys, of_file,
    of_option, output as files,
};
use serde::Deserialize;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A measurement of a patch of cloth.
#[derive(Clone, Debug, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Measure {
    /// A fabric file, or a scene file whose objects are measured (TOML)
    pub file: PathBuf,
    /// Directions to measure: CSV with the columns theta_i,phi_i,theta_o,phi_o in degrees, of directions that point away from the cloth, towards light and viewer; theta from 0 to 180, above 90 behind the cloth
    #[arg(long, value_name = "FILE", required_unless_present = "layout")]
    pub pairs: Option<PathBuf>,
    /// Directions to measure by name
    #[arg(long, value_enum, conflicts_with = "pairs")]
    #[serde(deserialize_with = "keys::some_name")]
    pub layout: Option<LayoutName>,
    /// Measure the reflected, transmitted, directly transmitted and absorbed shares of light from each incident direction instead of the BSDF of pairs; --pairs then needs only theta_i,phi_i
    #[arg(long)]
    pub albedo: bool,
    /// Measure only these rows of the table, counted from 0; they have the values that they have in the whole table
    #[arg(long, value_name = "A..B", allow_hyphen_values = true, value_parser = parse_rows)]
    #[serde(deserialize_with = "keys::range")]
    pub rows: Option<Range<usize>>,
    /// Model of the cloth
    #[arg(long, default_value = OWN, value_parser = patch_model())]
    #[serde(deserialize_with = "organza_work::patch_model::named")]
    pub model: PatchModel,
    /// Paths per pair, at least 2; the maximum with --target-error
    #[arg(long, value_name = "N", default_value_t = Measure::default().spp, value_parser = parse_paths)]
    pub spp: u64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = Measure::default().seed, value_parser = parse_seed)]
    #[serde(deserialize_with = "keys::seed")]
    pub seed: u64,
    /// Stop a pair when the standard error of every channel is below this share of the value, e.g. 0.02 for 2 % (with --albedo: of the incident light); not of pictures and the layouts klems, tensor-tree and ptm
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
    #[serde(deserialize_with = "keys::names")]
    pub bands: Vec<BandName>,
    /// Patches of --layout klems
    #[arg(long, value_enum, default_value = "full")]
    #[serde(deserialize_with = "keys::name")]
    pub klems_basis: KlemsBasisName,
    /// Dimensions of --layout tensor-tree: 4 for cloth, 3 for scattering that is the same at every azimuth of the light, which is then averaged
    #[arg(long, value_name = "N", default_value_t = Measure::default().tree_rank, value_parser = whole::<u32>(3..=4))]
    pub tree_rank: u32,
    /// Depth of --layout tensor-tree: 2^N cells along each dimension; 1 to 7 for rank 3, 1 to 6 for rank 4
    #[arg(long, value_name = "N", default_value_t = Measure::default().tree_depth, value_parser = whole::<u32>(1..=7))]
    pub tree_depth: u32,
    /// Join cells of --layout tensor-tree that differ by at most this share of their value, apart from noise, e.g. 0.05 for 5 %
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub prune: Option<f64>,
    /// Directions of --layout rgl: polar angles (2 to 90) and azimuths (3 to 360) of the light, and nodes along each side of the square of exitant directions (4 to 256)
    #[arg(long, value_name = "POLAR,AZIMUTHS,SIDE", value_parser = parse_rgl_grid, default_value = "12,24,32")]
    pub rgl_grid: [u32; 3],
    /// Positions of the lamp of --layout ptm, 12 to 1000, spread out to 75 degrees from the normal
    #[arg(long, value_name = "N", default_value_t = Measure::default().ptm_lamps, value_parser = whole::<u32>(12..=1000))]
    pub ptm_lamps: u32,
    /// Degrees between positions of the lamp of --layout sweep
    #[arg(long, value_name = "DEG", default_value_t = Measure::default().step, value_parser = parse_positive)]
    pub step: f64,
    /// Texels of the longer side of pictures (.exr, .ptm), 1 to 4096
    #[arg(long, value_name = "N", default_value_t = Measure::default().texels, value_parser = whole::<u32>(1..=4096))]
    pub texels: u32,
    /// Level of detail of a fabric; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = Measure::default().level, value_parser = parse_level)]
    pub level: u8,
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM", value_parser = parse_micrometres)]
    pub voxel_um: Option<f32>,
    /// Override any key of the fabric or scene file, e.g. --set warp.per_cm=30 for a fabric, --set render.seed=7 for a scene (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    #[serde(deserialize_with = "keys::overrides")]
    pub set: Vec<String>,
    /// Whether the values will be listed as JSON, which takes ten times the memory.
    #[arg(skip)]
    #[serde(skip)]
    pub lists_json: bool,
    /// The file that it is for, see [`Request::adapt_to`].
    #[arg(skip)]
    #[serde(skip)]
    pub table: Option<PathBuf>,
}

impl Default for Measure {
    fn default() -> Measure {
        Measure {
            file: PathBuf::new(),
            pairs: None,
            layout: None,
            albedo: false,
            rows: None,
            model: PatchModel::Own,
            spp: 16384,
            seed: 0,
            target_error: None,
            grid: [6, 12],
            bands: vec![BandName::Visible],
            klems_basis: KlemsBasisName::Full,
            tree_rank: 4,
            tree_depth: 4,
            prune: None,
            rgl_grid: [12, 24, 32],
            ptm_lamps: 48,
            step: 5.0,
            texels: 64,
            level: 0,
            voxel_um: None,
            set: Vec::new(),
            lists_json: false,
            table: None,
        }
    }
}

impl Request for Measure {
    const NAME: &'static str = "measure";
    type Output = Measurement;

    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        self.table = Some(path.to_owned());
        self.lists_json |= self.ending() == "json";
        Ok(vec![path.to_owned()])
    }

    fn check(&self, context: &Context) -> Result<()> {
        keys::check("spp", [self.spp], parse_paths)?;
        keys::check("target_error", self.target_error, parse_share)?;
        keys::check("prune", self.prune, parse_share)?;
        keys::check("step", [self.step], parse_positive)?;
        keys::check("texels", [self.texels], whole::<u32>(1..=4096))?;
        keys::check("tree_rank", [self.tree_rank], whole::<u32>(3..=4))?;
        keys::check("tree_depth", [self.tree_depth], whole::<u32>(1..=7))?;
        keys::check("ptm_lamps", [self.ptm_lamps], whole::<u32>(12..=1000))?;
        keys::check("voxel_um", self.voxel_um, parse_micrometres)?;
        keys::check("grid", [keys::listed(&self.grid)], parse_grid)?;
        keys::check("rgl_grid", [keys::listed(&self.rgl_grid)], parse_rgl_grid)?;
        if self.file.as_os_str().is_empty() {
            return Err(of_option("file", "expected a fabric or a scene file"));
        }
        if self.pairs.is_some() && self.layout.is_some() {
            return Err(of_option("pairs", "cannot be combined with --layout"));
        }
        for path in &context.outputs {
            files::check_not_an_input(path, self.pairs.iter().chain([&self.file]))?;
        }
        self.check_ending()?;
        self.check_target_error()?;
        bands::check(self)?;
        if self.pairs.is_none() {
            let job = Job {
                request: self.clone(),
                context: context.clone(),
            };
            directions(&job)?.rows(self.rows.as_ref())?;
        }
        Ok(())
    }

    fn work(job: &Job<Measure>) -> Result<Measurement> {
        let directions = directions(job)?;
        let rows = directions.rows(job.rows.as_ref())?;
        let subject = watched(&job.context, |loader| subject(job, loader))?;
        measure(job, &directions, rows, &subject)
    }
}

impl Measure {
    /// Ending of the file that it is for, in lower case; empty if it is for none.
    fn ending(&self) -> String {
        output::ending_of(self.table.as_deref().unwrap_or(Path::new("")))
    }

    /// The layout that is measured all at once, if it is one.
    fn whole(&self) -> Option<&'static layout::Whole> {
        let layout = self.layout.filter(|_| self.pairs.is_none());
        layout.and_then(|l| l.0.whole())
    }

    /// Refuses files of a layout for other directions.
    fn check_ending(&self) -> Result<()> {
        let (ending, whole) = (self.ending(), self.whole());
        let takers = with_ending(&ending);
        if !takers.is_empty() && whole.and_then(|w| w.ending) != Some(&*ending) {
            let takers = takers.join(" or ");
            return Err(input(format!(
                "a table that ends in .{ending} needs {takers}"
            )));
        }
        let is_other = whole.map_or(self.albedo, |w| !w.needs_ending);
        if ending == textures::ENDING && is_other {
            return Err(input(format!(
                "a table that ends in .{ending} needs pairs of directions: --pairs, or a layout of \
                 pairs, without --albedo"
            )));
        }
        Ok(())
    }

    /// Refuses a target error where every direction takes as many paths.
    fn check_target_error(&self) -> Result<()> {
        let what = match (self.whole(), self.layout) {
            (Some(whole), Some(layout)) if !whole.takes_target_error => {
                format!("--layout {}", layout.0.name)
            }
            (None, _) if self.ending() == textures::ENDING => "pictures of the tile".to_owned(),
            _ => return Ok(()),
        };
        if self.target_error.is_none() {
            return Ok(());
        }
        let takers = layout::with_target_error();
        let why = format!("does not apply to {what}, but to --pairs and the layouts {takers}");
        Err(after_option("target_error", why))
    }
}

/// The directions that are measured.
enum Directions {
    /// The BSDF of pairs.
    Pairs(Vec<Pair>),
    /// Where the light of these goes.
    Incident(Vec<Angles>),
    /// A picture of the tile for each pair.
    Textures(Vec<Pair>),
    /// All those of a layout.
    Whole(&'static layout::Whole),
}

impl Directions {
    /// The rows to measure: those asked for, or all.
    ///
    /// # Errors
    /// Rows that the table does not have, or a measurement that is no table of rows.
    fn rows(&self, asked: Option<&Range<usize>>) -> Result<Range<usize>> {
        let count = match self {
            Directions::Pairs(list) | Directions::Textures(list) => list.len(),
            Directions::Incident(list) => list.len(),
            Directions::Whole(_) => 0,
        };
        let Some(rows) = asked else {
            return Ok(0..count);
        };
        let why = match self {
            Directions::Pairs(_) | Directions::Incident(_) if rows.end <= count => {
                return Ok(rows.clone());
            }
            Directions::Pairs(_) | Directions::Incident(_) => {
                format!("the table has {count} rows; expected rows within 0..{count}")
            }
            Directions::Textures(_) => "pictures of the tile are measured all at once".into(),
            Directions::Whole(_) => {
                "this layout is measured all at once; take irawan, grid or --pairs".into()
            }
        };
        let (start, end) = (rows.start, rows.end);
        Err(after_option("rows", format!("{start}..{end}: {why}")))
    }
}

/// What the request asks for.
///
/// # Errors
/// Options that contradict each other, or a wrong file of pairs.
fn directions(job: &Job<Measure>) -> Result<Directions> {
    let layout = job.layout.map_or(&rows::IRAWAN, |l| l.0);
    let ending = job.ending();
    if let Some(path) = &job.pairs {
        let text = job.context.loader().text_of(path, FileKind::Text)?;
        let parsed = if job.albedo {
            parse_incident(&text).map(Directions::Incident)
        } else {
            parse_pairs(&text).map(Directions::Pairs)
        };
        let parsed = parsed.map_err(|e| InputError::from(e).in_file(path))?;
        return Ok(as_textures(&ending, parsed));
    }
    match &layout.kind {
        Kind::Rows {
            pairs,
            incident,
            check,
        } => {
            check(job)?;
            Ok(match job.albedo {
                true => Directions::Incident(incident(job)),
                false => as_textures(&ending, Directions::Pairs(pairs(job))),
            })
        }
        Kind::Whole(_) if job.albedo => Err(after_option(
            "albedo",
            "goes with pairs, not with this layout",
        )),
        Kind::Whole(whole) => {
            if let (true, Some(own)) = (whole.needs_ending && job.table.is_some(), whole.ending)
                && ending != own
            {
                let name = layout.name;
                let why = format!("{name} needs a table that ends in .{own}");
                return Err(after_option("layout", why));
            }
            (whole.check)(job)?;
            Ok(Directions::Whole(whole))
        }
    }
}

fn as_textures(ending: &str, directions: Directions) -> Directions {
    match directions {
        Directions::Pairs(pairs) if ending == textures::ENDING => Directions::Textures(pairs),
        other => other,
    }
}

/// What is measured.
pub(crate) struct Subject {
    /// As each of the bands sees it.
    patches: Vec<AnyPatch>,
    grid: TexelGrid,
    thickness_mm: f64,
    /// How a fabric is shown; none of a scene.
    shown: Option<ShownAs>,
}

fn subject(job: &Job<Measure>, loader: &Loader<'_>) -> Result<Subject> {
    if is_scene_text(&job.file, &loader.text_of(&job.file, FileKind::Either)?)? {
        let subject = scene_subject(job, loader)?;
        job.context.check_outputs(loader)?;
        return Ok(subject);
    }
    let build = job.context.patch_options(loader, job.voxel_um, job.level);
    let mut fabric = fabric_file::load(&job.file, &job.set, loader)?;
    job.context.check_outputs(loader)?;
    let shown = job.model.of(&fabric, &job.file)?;
    let patches = bands::patches(job, &mut fabric, shown, &build)?;
    Ok(Subject {
        patches,
        grid: texel_grid(&fabric, job.texels),
        thickness_mm: f64::from(fabric.cloth.tile().bounds_mm.size().z),
        shown: Some(shown),
    })
}

/// The objects of a scene file.
fn scene_subject(job: &Job<Measure>, loader: &Loader<'_>) -> Result<Subject> {
    if bands::beyond_light(job) {
        let why = "is a scene; --bands measures a fabric file";
        return Err(of_file(&job.file, why));
    }
    let mut file = scene_file::load(&job.file, &job.set, loader)?;
    match job.model {
        PatchModel::Own => {}
        PatchModel::Is(r) if r == &EXPLICIT_FIBRES => {
            file.render.integrator = IntegratorName::Fibres
        }
        PatchModel::Is(other) => {
            let model = other.name;
            let why = format!("is a scene; --model {model} measures a fabric file");
            return Err(of_file(&job.file, why));
        }
    }
    let loaded = LoadedScene::new(file, &job.file, loader)?;
    let scene = loaded.build(job.context.max_memory_bytes, loader)?;
    let patch = VolumePatch::new(scene, loaded.file.render.integrator.into())
        .map_err(|e| of_file(&job.file, e))?;
    let bounds = patch.bounds_mm();
    let grid = TexelGrid {
        low_mm: bounds.min.truncate(),
        size_mm: bounds.size().truncate(),
        texels: UVec2::splat(job.texels),
    };
    Ok(Subject {
        patches: vec![Box::new(patch)],
        grid,
        thickness_mm: f64::from(bounds.size().z),
        shown: None,
    })
}

/// What all measurements know.
pub(crate) struct Measuring<'a> {
    job: &'a Job<Measure>,
    subject: &'a Subject,
    effort: Effort,
    watch: Watch<'a>,
    whole: Option<&'static layout::Whole>,
}

impl Measuring<'_> {
    /// The cloth in the first band.
    fn patch(&self) -> &AnyPatch {
        &self.subject.patches[0]
    }

    /// The name of the file without its ending.
    fn name(&self) -> String {
        let name = self.job.file.file_stem().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }

    /// How many directions a whole layout has, in all bands.
    fn count(&self) -> usize {
        let count = self.whole.map_or(0, |whole| (whole.count)(self));
        count * self.subject.patches.len()
    }
}

fn measure(
    job: &Job<Measure>,
    directions: &Directions,
    rows: Range<usize>,
    subject: &Subject,
) -> Result<Measurement> {
    let mut measuring = Measuring {
        job,
        subject,
        effort: Effort {
            paths: job.spp,
            seed: job.seed,
            target_error: job.target_error,
        },
        watch: &organza_basis::unwatched,
        whole: match directions {
            Directions::Whole(whole) => Some(whole),
            _ => None,
        },
    };
    let count = match directions {
        Directions::Textures(_) => {
            rows.len() * subject.grid.texels.element_product() as usize * subject.patches.len()
        }
        Directions::Whole(_) => measuring.count(),
        _ => rows.len() * subject.patches.len(),
    };
    let progress = Progress::new(
        "measuring",
        job.spp.saturating_mul(count as u64),
        &job.context,
    );
    let watch = |paths| progress.add(paths);
    measuring.watch = &watch;
    let Found {
        values,
        paths,
        heavy_tails,
        count,
    } = match directions {
        Directions::Pairs(list) => rows::measure_pairs(&measuring, list, rows)?,
        Directions::Incident(list) => rows::measure_albedos(&measuring, list, rows)?,
        Directions::Textures(pairs) => textures::measure(&measuring, pairs)?,
        Directions::Whole(whole) => (whole.measure)(&measuring)?,
    };
    let seconds = progress.finish();
    Ok(Measurement {
        dark: values.dark(subject.shown),
        values,
        paths,
        heavy_tails,
        count,
        seconds,
        file: job.file.clone(),
        seed: job.seed,
        model: match (subject.shown, job.model) {
            (Some(shown), _) => shown.representation.name,
            (None, PatchModel::Is(representation)) => representation.name,
            (None, PatchModel::Own) => OWN,
        },
    })
}

/// Adds the errors of a table itself to those of what was measured of it.
fn widen(m: &Measuring<'_>, add: impl FnOnce(&TableErrors) -> bool) -> Result<()> {
    let context = &m.job.context;
    if m.subject.shown.is_none_or(|s| s.representation != &TABLE) {
        return Ok(());
    }
    let path = far_table::beside(&m.job.file);
    let (_, about) = far_table::read(&path, &context.loader())?;
    let known: TableErrors = serde_json::from_value(about).unwrap_or_default();
    if !add(&known) {
        context.warn(format!(
            "{}: does not say how far it is off, and no standard error has it; organza table with \
             --held-out measures it",
            path.display()
        ));
    }
    Ok(())
}

/// Median of the standard errors as shares of their values.
fn median_error(list: &[PairValue]) -> Option<String> {
    let channels = list
        .iter()
        .flat_map(|v| v.bsdf.mean.into_iter().zip(v.bsdf.se));
    let mut shares: Vec<f64> = channels.filter(|v| v.0 > 0.0).map(|(m, s)| s / m).collect();
    shares.sort_by(f64::total_cmp);
    let median = shares.get(shares.len() / 2)?;
    Some(format!(
        "median standard error {:.2} % of the value",
        100.0 * median
    ))
}

/// How many pairs of how many met no light in any path: their standard error is zero as their
/// value is, and has no information. Surfaces are exact.
fn dark_pairs(shown: Option<ShownAs>, list: &[PairValue]) -> [usize; 2] {
    let is_dark = |v: &&PairValue| [v.bsdf.mean, v.bsdf.se] == [[0.0; 3]; 2];
    match shown {
        Some(s) if matches!(s.representation.build, Build::Surface(_)) => [0, list.len()],
        _ => [list.iter().filter(is_dark).count(), list.len()],
    }
}
