//! Volumes of cloth from micro-CT.

mod cloth;
mod input;
mod record;

use anyhow::{Context as _, Result};
use clap::{Args, ValueEnum};
use glam::DVec3;
use organza_basis::{Budget, Stopped};
pub use organza_scan::Denoise;
use organza_scan::input::{SampleType, Slices};
use organza_scan::{
    DEFAULT_DENOISE, Scan as Scanning, ScanError, ScanSettings, ScannedField, Slab, Stage, Survey,
};
use organza_volume::ovox::SourceFile;
use organza_volume::{Octree, ovox};
use organza_work::journal::{Journal, Work};
use organza_work::values::{parse_positive, whole};
use organza_work::{
    Context, Error, Job, Output, Place, PlaceKind, Progress, Request, Results, identity, keys,
    of_file, output,
};
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use serde_json::json;
use sha2::{Digest, Sha256};
use std::io::Read;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

/// The volume of a cloth from a micro-CT scan.
#[derive(Clone, Debug, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scan {
    /// A multi-page TIFF, a .vti, raw data with --raw-size, several TIFF or PNG files of one slice each, or a folder of such
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Edge of a voxel, micrometres, or its edges X,Y,Z [default: the spacing of a .vti, as millimetres]
    #[arg(long, value_name = "UM", value_parser = parse_voxel)]
    #[serde(deserialize_with = "voxel_um")]
    pub voxel_um: Option<DVec3>,
    /// Raw data: values along a row, rows of a slice, slices
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_size, requires = "raw_type")]
    pub raw_size: Option<[u64; 3]>,
    /// Raw data: type of the values
    #[arg(long, value_name = "TYPE", requires = "raw_size")]
    #[serde(deserialize_with = "keys::some_name")]
    pub raw_type: Option<RawType>,
    /// Raw data: bytes before the first value
    #[arg(long, value_name = "BYTES", default_value_t = Scan::default().raw_header, requires = "raw_size", value_parser = whole::<u64>(0..=u64::MAX))]
    pub raw_header: u64,
    /// Raw data: the most significant byte of a value comes first
    #[arg(long, requires = "raw_size")]
    pub raw_big_endian: bool,
    /// A .vti: name of the array of values
    #[arg(long, value_name = "NAME")]
    pub array: Option<String>,
    /// Grey value between air and fibre [default: Otsu's, moved to the middle between both]
    #[arg(long, value_name = "GREY", value_parser = parse_grey)]
    pub threshold: Option<f32>,
    /// Grey value of air [default: the most frequent below the threshold]
    #[arg(long, value_name = "GREY", value_parser = parse_grey)]
    pub air: Option<f32>,
    /// Grey value of a voxel full of fibre [default: measured in the middle of fibres]
    #[arg(long, value_name = "GREY", value_parser = parse_grey)]
    pub fibre: Option<f32>,
    /// Noise filter: none, median (3 x 3 x 3), or the deviation of a Gaussian in voxels [default: 0.7]
    #[arg(long, value_name = "FILTER", value_parser = parse_denoise)]
    #[serde(deserialize_with = "denoise")]
    pub denoise: Option<Denoise>,
    /// Radius of the fibres, micrometres [default: measured]
    #[arg(long, value_name = "UM", value_parser = parse_positive)]
    pub fibre_radius_um: Option<f64>,
    /// Single-scattering albedo of the fibres, three numbers from 0 to 1
    #[arg(long, value_name = "R,G,B", value_parser = parse_colour, conflicts_with = "colour")]
    pub albedo: Option<[f32; 3]>,
    /// Colour of a thick heap of the fibres, linear Rec.709 [default: 0.8,0.8,0.8, undyed cloth]
    #[arg(long, visible_alias = "color", value_name = "R,G,B", value_parser = parse_colour)]
    pub colour: Option<[f32; 3]>,
    /// Ratio of end-on to broadside extinction of straight fibres: their roughness
    #[arg(long, value_name = "SHARE", default_value_t = Scan::default().end_on_ratio, value_parser = parse_ratio)]
    pub end_on_ratio: f32,
    /// The volume repeats without end in x and y as it was scanned
    #[arg(long, conflicts_with_all = ["flatten", "tile"])]
    pub repeat_xy: bool,
    /// Number of levels of detail, 1 to 8 [default: as many as fit, at most 6]
    #[arg(long, value_name = "N", value_parser = whole::<u8>(1..=8))]
    pub levels: Option<u8>,
    /// Keep finished slabs in this file: the same command resumes an interrupted scan
    #[arg(long, value_name = "FILE")]
    pub journal: Option<PathBuf>,
    /// Turn the cloth flat: z out of its face, x along the weft, and bends subtracted as a polynomial of heights of this degree, 0 to 6 (0: a plane) [default: 4, where the flag has no value]
    #[arg(long, value_name = "DEGREE", num_args = 0..=1, require_equals = true, default_missing_value = "4", value_parser = whole::<u32>(0..=u64::from(organza_scan::MAX_DEGREE)))]
    pub flatten: Option<u32>,
    /// Tell warp and weft apart, as two materials with optics of their own
    #[arg(long)]
    pub yarns: bool,
    /// Cut a tile that repeats in x and y without a seam
    #[arg(long)]
    pub tile: bool,
    /// Least periods of the tile along x and y, voxels [default: half of the scan]
    #[arg(long, value_name = "X,Y", requires = "tile", value_parser = cloth::parse_period)]
    pub least_period: Option<[u32; 2]>,
}

impl Default for Scan {
    fn default() -> Scan {
        Scan {
            files: Vec::new(),
            voxel_um: None,
            raw_size: None,
            raw_type: None,
            raw_header: 0,
            raw_big_endian: false,
            array: None,
            threshold: None,
            air: None,
            fibre: None,
            denoise: None,
            fibre_radius_um: None,
            albedo: None,
            colour: None,
            end_on_ratio: 0.1,
            repeat_xy: false,
            levels: None,
            journal: None,
            flatten: None,
            yarns: false,
            tile: false,
            least_period: None,
        }
    }
}

type ScanJob = Job<Scan>;

/// The type of raw values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RawType {
    /// Unsigned, 8 bits
    U8,
    /// Signed, 8 bits
    I8,
    /// Unsigned, 16 bits
    U16,
    /// Signed, 16 bits
    I16,
    /// Floats of 32 bits
    F32,
}

impl RawType {
    fn sample(self) -> SampleType {
        match self {
            RawType::U8 => SampleType::U8,
            RawType::I8 => SampleType::I8,
            RawType::U16 => SampleType::U16,
            RawType::I16 => SampleType::I16,
            RawType::F32 => SampleType::F32,
        }
    }
}

/// Numbers between commas.
fn numbers<T: std::str::FromStr>(text: &str) -> Option<Vec<T>> {
    text.split(',').map(|n| n.trim().parse().ok()).collect()
}

fn parse_voxel(text: &str) -> Result<DVec3, String> {
    let is_edge = |x: &f64| *x > 0.0 && x.is_finite();
    match numbers::<f64>(text).as_deref() {
        Some([x]) if is_edge(x) => Ok(DVec3::splat(*x)),
        Some(&[x, y, z]) if [x, y, z].iter().all(is_edge) => Ok(DVec3::new(x, y, z)),
        _ => Err("expected one number of micrometres above 0, or three, X,Y,Z".into()),
    }
}

fn parse_size(text: &str) -> Result<[u64; 3], String> {
    match numbers::<u64>(text).as_deref() {
        Some(&[x, y, z]) if x > 0 && y > 0 && z > 0 => Ok([x, y, z]),
        _ => Err("expected three whole numbers above 0, X,Y,Z".into()),
    }
}

fn parse_grey(text: &str) -> Result<f32, String> {
    let number = text.trim().parse().ok().filter(|x: &f32| x.is_finite());
    number.ok_or_else(|| "expected a grey value of the file, a number".into())
}

fn parse_colour(text: &str) -> Result<[f32; 3], String> {
    match numbers::<f32>(text).as_deref() {
        Some(&[r, g, b]) if [r, g, b].iter().all(|c| (0.0..=1.0).contains(c)) => Ok([r, g, b]),
        _ => Err("expected three numbers from 0 to 1, R,G,B".into()),
    }
}

fn parse_ratio(text: &str) -> Result<f32, String> {
    let number = text.trim().parse().ok();
    let number = number.filter(|x: &f32| (0.0..=1.0).contains(x));
    number.ok_or_else(|| "expected a number from 0 to 1".into())
}

fn parse_denoise(text: &str) -> Result<Denoise, String> {
    match text.trim() {
        "none" => Ok(Denoise::None),
        "median" => Ok(Denoise::Median),
        other => match other.parse::<f32>() {
            Ok(s) if (0.0..=10.0).contains(&s) => Ok(Denoise::Gaussian(s)),
            _ => Err("expected none, median, or a number of voxels from 0 to 10".into()),
        },
    }
}

/// One edge of a voxel, or three.
fn voxel_um<'de, D: Deserializer<'de>>(from: D) -> Result<Option<DVec3>, D::Error> {
    #[derive(Deserialize)]
    #[serde(
        untagged,
        expecting = "expected one number of micrometres above 0, or three"
    )]
    enum Edges {
        One(f64),
        Three([f64; 3]),
    }
    let text = match Option::<Edges>::deserialize(from)? {
        Some(Edges::One(edge)) => edge.to_string(),
        Some(Edges::Three(edges)) => keys::listed(&edges),
        None => return Ok(None),
    };
    parse_voxel(&text).map(Some).map_err(D::Error::custom)
}

/// The name of a filter, or the deviation of a Gaussian.
fn denoise<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Denoise>, D::Error> {
    let text = keys::some_text(from)?;
    let read = text.map(|text| parse_denoise(&text));
    read.transpose().map_err(D::Error::custom)
}

impl Request for Scan {
    const NAME: &'static str = "scan";
    type Output = ScannedVolume;

    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        output::check_ending(path, &["ovox"])?;
        Ok(vec![path.to_owned()])
    }

    fn further_places(&self) -> Vec<Place> {
        let journal = Place::of_key(self.journal.as_ref(), PlaceKind::Continued);
        journal.into_iter().collect()
    }

    fn check(&self, context: &Context) -> Result<()> {
        keys::check("fibre_radius_um", self.fibre_radius_um, parse_positive)?;
        keys::check("end_on_ratio", [self.end_on_ratio], parse_ratio)?;
        keys::check("levels", self.levels, whole::<u8>(1..=8))?;
        let greys = [
            ("threshold", self.threshold),
            ("air", self.air),
            ("fibre", self.fibre),
        ];
        for (field, grey) in greys {
            keys::check(field, grey, parse_grey)?;
        }
        for (field, colour) in [("albedo", &self.albedo), ("colour", &self.colour)] {
            keys::check(field, colour.map(|c| keys::listed(&c)), parse_colour)?;
        }
        if self.raw_size.is_some() != self.raw_type.is_some() {
            let why = "expected together with --raw-type";
            return Err(organza_work::of_option("raw_size", why));
        }
        let degree = whole::<u32>(0..=u64::from(organza_scan::MAX_DEGREE));
        keys::check("flatten", self.flatten, degree)?;
        let period = self.least_period.map(|p| keys::listed(&p));
        keys::check("least_period", period, cloth::parse_period)?;
        for (field, is_wrong, why) in [
            (
                "repeat_xy",
                self.repeat_xy && (self.flatten.is_some() || self.tile),
                "cannot be combined with --flatten or --tile",
            ),
            (
                "albedo",
                self.albedo.is_some() && self.colour.is_some(),
                "cannot be combined with --colour",
            ),
            (
                "least_period",
                self.least_period.is_some() && !self.tile,
                "expected together with --tile",
            ),
            (
                "raw_header",
                self.raw_header > 0 && self.raw_size.is_none(),
                "expected together with --raw-size",
            ),
            (
                "raw_big_endian",
                self.raw_big_endian && self.raw_size.is_none(),
                "expected together with --raw-size",
            ),
        ] {
            if is_wrong {
                return Err(organza_work::of_option(field, why));
            }
        }
        if self.files.is_empty() {
            return Err(organza_work::of_option("files", "expected a scan"));
        }
        let files = input::files(&self.files)?;
        input::check(self, &files)?;
        for path in context.outputs.iter().chain(&self.journal) {
            output::check_not_an_input(path, &files)?;
        }
        if let Some(journal) = &self.journal {
            context.check_writable(journal)?;
            for path in &context.outputs {
                output::check_distinct(("the journal", journal), ("the volume", path))?;
            }
        }
        Ok(())
    }

    fn work(job: &ScanJob) -> Result<ScannedVolume> {
        scan(job, &input::files(&job.files)?)
    }
}

/// The volume of a scan.
pub struct ScannedVolume {
    /// Its voxels.
    pub octree: Octree,
    /// The files that the volume file keeps: how it was made.
    kept: Vec<SourceFile>,
    voxels: u64,
    started: Instant,
    context: Context,
}

impl ScannedVolume {
    /// What a person reads of it, written to a file of this name.
    pub fn line(&self, path: &Path) -> String {
        let (voxels, seconds) = (self.voxels, self.started.elapsed().as_secs_f64());
        format!(
            "{}: {} voxels with fibre of {voxels} at {:.3} um, {:.1} MiB in memory, {seconds:.1} s \
             ({:.2} million voxels a second)",
            path.display(),
            self.octree.occupied_voxels(),
            1e3 * self.octree.voxel_mm(0).max_element(),
            self.octree.memory_bytes() as f64 / f64::from(1 << 20),
            voxels as f64 / seconds / 1e6,
        )
    }

    fn write_to(&self, out: &mut dyn output::SeekWrite) -> Result<()> {
        ovox::write(&self.octree, &self.kept, out).context("writing the volume failed")
    }
}

impl Output for ScannedVolume {
    fn results(&self) -> Result<Results, Error> {
        let bytes = self.context.run(|| {
            let mut bytes = std::io::Cursor::new(Vec::new());
            self.write_to(&mut bytes)?;
            Ok(bytes)
        })?;
        Ok(Results {
            files: vec![("volume.ovox".to_owned(), bytes.into_inner())],
            ..Results::default()
        })
    }

    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        let write = || output::write_file(path, |out| self.write_to(out));
        self.context.run(write)?;
        Ok(vec![path.to_owned()])
    }
}

/// An error of a scan; whatever is wrong with bytes or settings is wrong input.
fn failed(name: &str, e: ScanError) -> anyhow::Error {
    match e {
        ScanError::Io(e) => anyhow::Error::new(e).context(format!("cannot read {name}")),
        e => of_file(name, e),
    }
}

fn scan(args: &ScanJob, files: &[PathBuf]) -> Result<ScannedVolume> {
    let started = Instant::now();
    let name = input::name_of(&args.files);
    let fail = |e| failed(&name, e);
    let allowed = args.context.memory_bytes();
    let budget = &mut Budget::new(allowed);
    let mut slices = input::open(args, files, budget)?;
    let settings = settings(args, &*slices).map_err(|why| of_file(&name, why))?;
    let bars = Bars::new(args);
    let survey = Scanning::survey(&mut *slices, &settings, budget, &|s, d| bars.at(s, d));
    let survey = survey.map_err(fail)?;
    bars.finish();
    let scan = Scanning::new(&*slices, &settings, &survey, budget).map_err(fail)?;
    for line in record::lines(&*slices, &settings, &survey) {
        args.context.note(format!("{name}: {line}"));
    }
    if let Some(warning) = record::warning(&settings, &survey) {
        args.context.warn(format!("{name}: {warning}"));
    }
    let field = slabs(args, files, &mut *slices, &scan, &survey, &settings, budget)?;
    drop(slices);
    let field = cloth::made(args, field, &name, budget)?;
    let octree = octree(args, &field, budget)?;
    if octree.occupied_voxels() == 0 {
        return Err(of_file(&name, "no voxel holds fibre"));
    }
    let kept = record::files(args, &name, &settings, &survey, &field)?;
    Ok(ScannedVolume {
        voxels: field.dims().as_u64vec3().element_product(),
        octree,
        kept,
        started,
        context: args.context.clone(),
    })
}

/// The settings of a request.
fn settings(args: &ScanJob, slices: &dyn Slices) -> Result<ScanSettings, String> {
    let voxel_mm = match (args.voxel_um, slices.shape().spacing) {
        (Some(um), _) => um * 1e-3,
        (None, Some(mm)) => mm,
        (None, None) => {
            return Err("the file names no size of voxels: give --voxel-um".into());
        }
    };
    Ok(ScanSettings {
        denoise: args.denoise.unwrap_or(DEFAULT_DENOISE),
        threshold: args.threshold,
        air: args.air,
        fibre: args.fibre,
        fibre_radius_mm: args.fibre_radius_um.map(|um| (um * 1e-3) as f32),
        ..ScanSettings::new(voxel_mm)
    })
}

/// The field of all slabs, from the journal or from the slices.
fn slabs(
    args: &ScanJob,
    files: &[PathBuf],
    slices: &mut dyn Slices,
    scan: &Scanning,
    survey: &Survey,
    settings: &ScanSettings,
    budget: &mut Budget,
) -> Result<ScannedField> {
    let name = input::name_of(&args.files);
    let fail = |e| failed(&name, e);
    let mut journal = match &args.journal {
        Some(path) => {
            let key = journal_key(args, files, scan, survey, settings)?;
            let work = Work {
                command: "scan",
                key: &key,
            };
            // The bytes of the slabs, in order.
            let journal = Journal::<Vec<u8>>::open(path, &work)?;
            if journal.count() > 0 {
                args.context.note(format!(
                    "{}: {} of {} slabs are finished",
                    path.display(),
                    journal.count(),
                    scan.slab_count()
                ));
            }
            Some(journal)
        }
        None => None,
    };
    let count = scan.slab_count();
    let bar = Progress::new("scanning", (1000 * count) as u64, &args.context);
    let mut field = scan.field(budget).map_err(fail)?;
    for index in 0..count {
        let known = match &mut journal {
            Some(journal) => journal.read(index)?,
            None => None,
        };
        let known = known.and_then(|bytes| Slab::from_bytes(scan, index, &bytes));
        let slab = match known {
            Some(slab) => slab,
            None => {
                let watch = |_: Stage, share: f32| bar.at((1000.0 * (index as f32 + share)) as u64);
                let slab = scan.slab(slices, index, &watch).map_err(fail)?;
                // One that is damaged stays: those after it have their places.
                if let Some(journal) = &mut journal
                    && journal.count() == index
                {
                    journal.add(&slab.to_bytes())?;
                }
                slab
            }
        };
        budget
            .take(slab.memory_bytes(), "voxels with fibre")
            .map_err(|e| fail(e.into()))?;
        slab.add_to(&mut field);
        Stopped::check(bar.at((1000 * (index + 1)) as u64))?;
    }
    bar.finish();
    field.repeats = args.repeat_xy;
    Ok(field)
}

fn octree(args: &ScanJob, field: &ScannedField, budget: &Budget) -> Result<Octree> {
    let bar = Progress::new("octree", 1000, &args.context);
    let progress = |share: f32| bar.at((1000.0 * share) as u64);
    let octree = field.octree(args.levels, Some(budget.left()), &progress);
    bar.finish();
    octree.map_err(|e| of_file(input::name_of(&args.files), e))
}

/// What the slabs of a journal depend on beside the code: the bytes of all files, the settings and
/// what was found with them.
fn journal_key(
    args: &ScanJob,
    files: &[PathBuf],
    scan: &Scanning,
    survey: &Survey,
    settings: &ScanSettings,
) -> Result<String> {
    let digests: Result<Vec<String>> = files.iter().map(|f| digest(f)).collect();
    let key = json!({
        "files": digests?,
        "array": args.array,
        "raw": format!("{:?}", (args.raw_size, args.raw_type, args.raw_header, args.raw_big_endian)),
        "settings": format!("{settings:?}"),
        "survey": format!("{survey:?}"),
        "slab": scan.slab_slices(),
    });
    Ok(key.to_string())
}

/// The SHA-256 of a file.
fn digest(path: &Path) -> Result<String> {
    let cannot = || format!("cannot read {}", path.display());
    let mut file = std::fs::File::open(path).with_context(cannot)?;
    let mut digest = Sha256::new();
    let mut buffer = vec![0u8; 1 << 20];
    loop {
        match file.read(&mut buffer).with_context(cannot)? {
            0 => return Ok(identity::hex(&digest.finalize())),
            n => digest.update(&buffer[..n]),
        }
    }
}

/// The tasks of the survey, one for each stage.
struct Bars<'a> {
    args: &'a ScanJob,
    present: Mutex<Option<(Stage, Progress)>>,
}

impl<'a> Bars<'a> {
    fn new(args: &'a ScanJob) -> Bars<'a> {
        Bars {
            args,
            present: Mutex::new(None),
        }
    }

    fn at(&self, stage: Stage, share: f32) -> ControlFlow<()> {
        let mut present = self
            .present
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        if present.as_ref().is_none_or(|(s, _)| *s != stage) {
            let label = match stage {
                Stage::Range => "range",
                Stage::Levels => "levels",
                Stage::Radius => "radius",
                Stage::Slab => "scanning",
            };
            let bar = Progress::new(label, 1000, &self.args.context);
            if let Some((_, before)) = present.replace((stage, bar)) {
                before.finish();
            }
        }
        match present.as_ref() {
            Some((_, bar)) => bar.at((1000.0 * share) as u64),
            None => ControlFlow::Continue(()),
        }
    }

    fn finish(&self) {
        let mut present = self
            .present
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some((_, bar)) = present.take() {
            bar.finish();
        }
    }
}
