//! Speed against error of every way to represent a cloth.

use anyhow::{Context as _, Result};
use clap::Args;
pub use organza_report::bench::Program;
use organza_report::bench::{
    Bench as Benching, BenchPlan, BenchReport, Laboratory, PIXELS_MM, Peer, QUICK_PIXELS_MM,
    Sample, SampleSource, View, WriteError, write_rooms,
};
use organza_scene::auto::lit::Lit;
use organza_scene::auto::table_file;
use organza_scene::overrides;
use organza_scene::scene_file::SceneFile;
use organza_work::values::{parse_share, whole};
use organza_work::{Context, Error, Job, Progress, Waiting, keys, of_file, output};
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A bench of every way to represent a cloth: speed against error.
#[derive(Clone, Debug, Args)]
pub struct Bench {
    /// Fabrics: denim, charmeuse, organza, or fabric files (.toml) [default: those three]
    pub fabrics: Vec<String>,
    /// Folder to write: report.html, report.json, choices.csv and all pictures
    #[arg(short, long, visible_alias = "outdir")]
    pub outfile: PathBuf,
    /// Fewer choices, distances and samples: some minutes instead of half an hour or more
    #[arg(long)]
    pub quick: bool,
    /// Widths of a pixel at the cloth, mm [default: 0.03,0.1,1, quick 0.1,1]
    #[arg(long, value_name = "MM,...", value_parser = parse_pixel_mm, value_delimiter = ',')]
    pub pixel_mm: Vec<f64>,
    /// Ways through each representation: "all", or "usual" for the one that render takes, which then traces the reference, too
    #[arg(long, value_enum, default_value_t = Bench::default().trackers)]
    pub trackers: Trackers,
    /// Also measure how cost grows with size [default: unless --quick or --pixel-mm]
    #[arg(long)]
    pub scaling: bool,
    /// Error of a pixel, as a share of the picture's mean (0.05 is 5 %), within which recommendations are made (repeatable)
    #[arg(long, value_name = "SHARE", value_parser = parse_share, value_delimiter = ',', default_value = "0.02,0.05,0.1,0.2")]
    pub within: Vec<f64>,
    /// Pixels along an edge of the pictures, 4 to 1024
    #[arg(long, value_name = "N", value_parser = whole::<u32>(4..=1024), default_value_t = Bench::default().resolution)]
    pub resolution: u32,
    /// Samples per pixel of every choice, at least 2 [default: 512, quick 192]
    #[arg(long, value_name = "N", value_parser = whole::<u64>(2..=1_000_000))]
    pub spp: Option<u64>,
    /// Samples per pixel of the reference, at least 2 [default: 4096, quick 512]
    #[arg(long, value_name = "N", value_parser = whole::<u64>(2..=1_000_000))]
    pub truth_spp: Option<u64>,
    /// Pictures of another program, as written by benches/peers/mitsuba_bench.py (.json)
    #[arg(long, value_name = "FILE")]
    pub peer: Option<PathBuf>,
    /// Override any key of the scenes in which representations are compared, e.g. --set render.max_bounces=64 (repeatable); the fabric and its representation are set by the command itself
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// What is started for each render; this process's own program if none.
    #[arg(skip)]
    pub program: Option<Program>,
}

impl Default for Bench {
    fn default() -> Bench {
        Bench {
            fabrics: Vec::new(),
            outfile: PathBuf::new(),
            quick: false,
            pixel_mm: Vec::new(),
            trackers: Trackers::All,
            scaling: false,
            within: vec![0.02, 0.05, 0.1, 0.2],
            resolution: 16,
            spp: None,
            truth_spp: None,
            peer: None,
            set: Vec::new(),
            program: None,
        }
    }
}

type BenchJob = Job<Bench>;

/// Which trackers are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Trackers {
    /// Every one of a representation.
    All,
    /// The first of its list.
    Usual,
}

/// A width that eyes and lenses have for a pixel.
fn parse_pixel_mm(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(mm) if (1e-4..=1e3).contains(&mm) => Ok(mm),
        _ => Err("expected millimetres, 0.0001 to 1000".into()),
    }
}

impl Bench {
    /// Measures, and writes into the folder [`Bench::outfile`] as results arrive: a bench that was
    /// stopped resumes there. Returns the recommendations.
    ///
    /// # Errors
    /// Wrong input, a render that fails, or a stop.
    pub fn run(&self, context: &Context) -> Result<Vec<String>, Error> {
        self.check()?;
        Job::run(self, context, bench)
    }

    fn check(&self) -> Result<()> {
        keys::check("resolution", [self.resolution], whole::<u32>(4..=1024))?;
        keys::check("spp", self.spp, whole::<u64>(2..=1_000_000))?;
        keys::check("truth_spp", self.truth_spp, whole::<u64>(2..=1_000_000))?;
        keys::check("within", &self.within, parse_share)?;
        keys::check("pixel_mm", &self.pixel_mm, parse_pixel_mm)?;
        Ok(())
    }
}

fn bench(args: &BenchJob) -> Result<Vec<String>> {
    let started = Instant::now();
    let pixels = args.resolution as usize * args.resolution as usize;
    let peers = match &args.peer {
        Some(path) => Peer::read(path, pixels)?,
        None => Vec::new(),
    };
    output::check_report_folder(&args.outfile, ("pairs.csv", "a comparison"))?;
    check_inputs_elsewhere(args)?;
    // Weaving the fabrics and each trial may take longer than their turn to say so.
    let _waiting = Waiting::new("measuring", &args.context);
    let found = found(args)?;
    // Checked before anything is written, and only once.
    let view = View {
        pixel_mm: 1.0,
        lit: Lit::Front,
    };
    let scene = view.scene("cloth.toml", args.resolution);
    overrides::check_overrides::<SceneFile>(&scene, &args.set)?;
    let folder = |name: &str| {
        let path = args.outfile.join(name);
        output::make_folder(&path)?;
        path.canonicalize()
            .with_context(|| path.display().to_string())
    };
    let (scenes, runs) = (folder("scenes")?, folder("runs")?);
    write_rooms(&write_file, &scenes)?;
    let samples = found
        .into_iter()
        .map(|f| f.sample(&write_file, &scenes))
        .collect::<Result<Vec<Sample>, _>>()?;
    let plan = plan(args, scenes);
    let laboratory = Laboratory::new(
        &write_file,
        runs,
        args.program.clone().map_or_else(Program::this, Ok)?,
        args.context.threads,
        args.context.max_memory_bytes,
    )?;
    let with_scaling = args.scaling || (!args.quick && args.pixel_mm.is_empty());
    let trials = Benching::max_trials(&plan, &samples, with_scaling);
    let progress = Progress::new("rendering", trials as u64, &args.context);
    let count = Cell::new(0);
    let done = || {
        count.set(count.get() + 1);
        progress.at(count.get())
    };
    let bench = Benching::run(&plan, &samples, &peers, with_scaling, &laboratory, &done)?;
    progress.finish();
    let report = BenchReport {
        bench: &bench,
        command: args.context.command.clone(),
        within: &args.within,
        seconds: started.elapsed().as_secs_f64(),
    };
    let json = serde_json::to_string_pretty(&report.json())?;
    let files = [
        ("choices.csv", table_file::write(&bench.rows())?),
        ("report.json", json),
        ("report.md", report.markdown()),
        ("report.html", report.html()?),
    ];
    for (name, text) in files {
        output::write_bytes(&args.outfile.join(name), text.as_bytes())?;
    }
    Ok(report.recommendations())
}

/// Refuses inputs in the folder that the bench fills: one of its files may replace them.
fn check_inputs_elsewhere(args: &BenchJob) -> Result<()> {
    let Ok(folder) = args.outfile.canonicalize() else {
        return Ok(()); // not there yet
    };
    let fabrics = args.fabrics.iter().map(Path::new);
    for read in fabrics.chain(args.peer.as_deref()) {
        if read.canonicalize().is_ok_and(|p| p.starts_with(&folder)) {
            return Err(of_file(
                read,
                format!(
                    "is an input and lies in {}, which the bench fills; expected another folder",
                    args.outfile.display()
                ),
            ));
        }
    }
    Ok(())
}

/// The fabrics that are named, or those that the program brings.
fn found(args: &BenchJob) -> Result<Vec<SampleSource>> {
    let named: Vec<&str> = match args.fabrics.len() {
        0 => Sample::names().to_vec(),
        _ => args.fabrics.iter().map(String::as_str).collect(),
    };
    let found = named
        .into_iter()
        .map(SampleSource::named)
        .collect::<Result<Vec<SampleSource>, _>>()?;
    for (i, one) in found.iter().enumerate() {
        if found.iter().take(i).any(|other| other.name() == one.name()) {
            let name = one.name();
            return Err(of_file(name, "two fabrics have this name"));
        }
    }
    Ok(found)
}

fn plan(args: &BenchJob, scenes: PathBuf) -> BenchPlan {
    let (pixels_mm, spp, truth_spp) = if args.quick {
        (QUICK_PIXELS_MM.to_vec(), 192, 512)
    } else {
        (PIXELS_MM.to_vec(), 512, 4096)
    };
    BenchPlan {
        quick: args.quick,
        every_tracker: args.trackers == Trackers::All,
        pixels_mm: match args.pixel_mm.is_empty() {
            true => pixels_mm,
            false => args.pixel_mm.clone(),
        },
        resolution: args.resolution,
        spp: args.spp.unwrap_or(spp),
        truth_spp: args.truth_spp.unwrap_or(truth_spp),
        set: args.set.clone(),
        scenes,
    }
}

/// Writes a file of the bench.
fn write_file(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    Ok(output::write_bytes(path, bytes)?)
}
