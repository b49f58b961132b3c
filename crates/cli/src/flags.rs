//! Every command and flag; help, completions and man pages come from here.

use crate::sample_ranges::parse_range;
use clap::{Args, CommandFactory, Parser, Subcommand};
use glam::UVec2;
use organza_measure::KlemsBasis;
use organza_transport::Crop;
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

/// Volumetric cloth renderer: weave drafts to fibres to light.
#[derive(Debug, Parser)]
#[command(
    name = "organza",
    version,
    arg_required_else_help = true,
    after_help = "Try first:\n  organza render scenes/first_light.toml -o first_light.png\n  organza weave twill-3-1-s -o twill.png"
)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Path-trace a scene to .exr (linear, with variance and AOVs) or .png
    Render(RenderArgs),
    /// Combine renders of disjoint sample ranges into the unbroken render, exactly
    Merge(MergeArgs),
    /// Turn one tile of a fabric into a volume file
    Voxelize(VoxelizeArgs),
    /// Measure reflection and transmission of a patch of cloth
    Measure(MeasureArgs),
    /// Compare the models of a fabric with each other or with measured values
    Compare(CompareArgs),
    /// Find the surface or the fibres that measured values ask for
    Fit(FitArgs),
    /// Draw a draft or a fabric's weave
    Weave(WeaveArgs),
    /// Write a scene for another renderer
    Export(ExportArgs),
    /// Tell what is in a draft, fabric, scene or volume file
    Info(InfoArgs),
    /// Print the completions of a shell
    Completions(CompletionsArgs),
    /// Write the manual pages
    Man(ManArgs),
}

/// The definition of the whole command line.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Flags that every command takes.
#[derive(Debug, Args)]
pub struct CommonArgs {
    /// Threads to use [default: all cores]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Say nothing but errors
    #[arg(long)]
    pub quiet: bool,
    /// Override any key of the input file, e.g. --set render.seed=7 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
}

/// `organza render`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza render scenes/first_light.toml -o first_light.exr --spp 256 --stats"
)]
pub struct RenderArgs {
    /// Scene file (TOML)
    pub scene: PathBuf,
    /// Picture to write: .exr or .png
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Samples per pixel [default: the scene's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: Option<u32>,
    /// Seed of all random numbers [default: the scene's]
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Render only these pixels: left, top, right, bottom (right and bottom outside)
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_crop)]
    pub crop: Option<Crop>,
    /// Take only these samples of every pixel; parts are put together by `organza merge`
    #[arg(long, value_name = "A..B", value_parser = parse_range, conflicts_with = "spp")]
    pub samples: Option<Range<u64>>,
    /// Stop when this time has passed since the start, e.g. 60s, 5m, 2h
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub time_limit: Option<Duration>,
    /// Stop when the standard error of the pixels (root mean square) is this fraction of the picture's mean, e.g. 0.02
    #[arg(long, value_name = "FRACTION", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Save what was gathered to this file now and then, when interrupted and at the end
    #[arg(long, value_name = "FILE")]
    pub checkpoint: Option<PathBuf>,
    /// Time between two checkpoints
    #[arg(long, value_name = "TIME", value_parser = parse_duration, default_value = "60s", requires = "checkpoint")]
    pub checkpoint_every: Duration,
    /// Go on from the checkpoint
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,
    /// What walks the paths; auto takes the widest vectors there are where the scene allows it, else the general walk
    #[arg(long, value_enum, default_value = "auto")]
    pub backend: BackendName,
    /// Print counts of collisions, shadow steps and rejected samples, fireflies and memory
    #[arg(long)]
    pub stats: bool,
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// What walks the paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BackendName {
    /// The widest kernel there is where the scene allows it, else the walk
    Auto,
    /// The general walk, which can do every scene
    Walk,
    /// The kernel, one path at a time
    Scalar,
    /// The kernel, 16 paths at a time
    Avx2,
    /// The kernel, 32 paths at a time
    Avx512,
}

/// `organza merge`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza render scenes/first_light.toml --samples 0..128 -o a.exr\n  organza render scenes/first_light.toml --samples 128..256 -o b.exr\n  organza merge a.exr b.exr -o all.exr"
)]
pub struct MergeArgs {
    /// Pictures of one scene and seed (.exr), with no sample in common
    #[arg(required = true)]
    pub parts: Vec<PathBuf>,
    /// Picture to write (.exr)
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
    /// Say nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

/// `organza export`
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Which renderer
    #[command(subcommand)]
    pub to: ExportTo,
}

/// The renderers that scenes are written for.
#[derive(Debug, Subcommand)]
pub enum ExportTo {
    /// Mitsuba 3: scene.xml with .vol grids
    Mitsuba(MitsubaArgs),
}

/// `organza export mitsuba`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza export mitsuba scenes/first_light.toml -o mitsuba --repeats 4,4\n  mitsuba -m scalar_rgb mitsuba/scene.xml\n\nMitsuba 3.9.1 draws directions of its sggx phase function in a wrong frame (its issue 1728): its pictures come out too dark. benches/peers/mitsuba_values.py loads a scene with the frame mended."
)]
pub struct MitsubaArgs {
    /// Scene file (TOML)
    pub scene: PathBuf,
    /// Folder to write to; made if there is none
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Periods in x and y to write of a cloth without end, around where the camera looks
    #[arg(long, value_name = "NX,NY", value_parser = parse_repeats)]
    pub repeats: Option<UVec2>,
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// `organza voxelize`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza voxelize scenes/fabrics/organza.toml -o organza.ovox --voxel-um 10"
)]
pub struct VoxelizeArgs {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// Volume to write: .ovox (the whole octree), .vdb (OpenVDB) or .vol (Mitsuba: three files, .sigma_t.vol, .sggx.vol and .albedo.vol)
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// Level of detail that .vdb and .vol hold; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub level: u8,
    /// Store 16-bit floats (.vdb)
    #[arg(long)]
    pub half: bool,
    /// Do not compress (.vdb)
    #[arg(long)]
    pub raw: bool,
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM")]
    pub voxel_um: Option<f32>,
    /// Number of levels of detail [default: as many as fit, at most 6]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=8))]
    pub levels: Option<u8>,
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// `organza measure`
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  organza measure scenes/fabrics/organza.toml --pairs pairs.csv -o out.csv --target-error 0.02\n  organza measure scenes/fabrics/organza.toml --layout irawan --albedo --json"
)]
pub struct MeasureArgs {
    /// A fabric file, or a scene file whose objects are measured (TOML)
    pub file: PathBuf,
    /// Directions to measure: CSV with the columns theta_i,phi_i,theta_o,phi_o in degrees, all away from the cloth; theta up to 180 on either side
    #[arg(long, value_name = "FILE", required_unless_present = "layout")]
    pub pairs: Option<PathBuf>,
    /// Directions to measure by name
    #[arg(long, value_enum, conflicts_with = "pairs")]
    pub layout: Option<LayoutName>,
    /// Measure where light from each incident direction goes, reflected, transmitted, straight through and absorbed, instead of the BSDF of pairs; --pairs then needs only theta_i,phi_i
    #[arg(long)]
    pub albedo: bool,
    /// Table to write: .csv (the angles with r,g,b and their standard errors), .json, .xml (WINDOW, with --layout klems), .exr (one picture of the tile per pair)
    #[arg(short, long, required_unless_present = "json")]
    pub outfile: Option<PathBuf>,
    /// What stands for the cloth
    #[arg(long, value_enum, default_value = "volume")]
    pub model: PatchModel,
    /// Paths per pair, or the most of them with --target-error
    #[arg(long, value_name = "N", default_value_t = 16384, value_parser = clap::value_parser!(u64).range(2..))]
    pub spp: u64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Stop a pair when the standard error of every channel is below this share of the value (with --albedo: of the incident light)
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Polar steps on each side and azimuths of --layout grid
    #[arg(long, value_name = "POLAR,AZIMUTHS", value_parser = parse_grid, default_value = "6,12")]
    pub grid: [u32; 2],
    /// Patches of --layout klems
    #[arg(long, value_enum, default_value = "full")]
    pub klems_basis: KlemsBasisName,
    /// Degrees between positions of the lamp of --layout sweep
    #[arg(long, value_name = "DEG", default_value_t = 5.0, value_parser = parse_share)]
    pub step: f64,
    /// Texels of the longer side of pictures (.exr)
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub texels: u32,
    /// Level of detail of a fabric; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub level: u8,
    /// Edge of a fabric's finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM")]
    pub voxel_um: Option<f32>,
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// Layouts of directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum LayoutName {
    /// 225 incident directions out to 75 degrees times 7 exitant ones
    Irawan,
    /// A regular grid of directions, see --grid
    Grid,
    /// The four matrices of the Klems basis, one path for all exitant directions
    Klems,
    /// A linear light swung over face and back, seen along the normal
    Sweep,
}

/// Klems bases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum KlemsBasisName {
    /// 145 patches a side
    Full,
    /// 73
    Half,
    /// 41
    Quarter,
}

impl From<KlemsBasisName> for KlemsBasis {
    fn from(name: KlemsBasisName) -> KlemsBasis {
        match name {
            KlemsBasisName::Full => KlemsBasis::Full,
            KlemsBasisName::Half => KlemsBasis::Half,
            KlemsBasisName::Quarter => KlemsBasis::Quarter,
        }
    }
}

/// What stands for the cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PatchModel {
    /// Its fibres as the fabric's [scattering] says, micro-flakes if nothing
    Volume,
    /// Every fibre of the fabric, as it is: the ground truth of the others
    Fibres,
    /// Virtual scattering off fibres among others
    Packed,
    /// Virtual scattering off points, in the far field
    Plain,
    /// The reflectance model of the fabric's [surface] section
    Surface,
}

impl PatchModel {
    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            PatchModel::Volume => "volume",
            PatchModel::Fibres => "fibres",
            PatchModel::Packed => "packed",
            PatchModel::Plain => "plain",
            PatchModel::Surface => "surface",
        }
    }
}

/// `organza compare`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza compare scenes/fabrics/organza.toml -o report --models volume,surface --spp 4096"
)]
pub struct CompareArgs {
    /// Fabric file (TOML)
    pub fabric: PathBuf,
    /// Folder to write: report.html, report.json, pairs.csv
    #[arg(short, long)]
    pub outdir: PathBuf,
    /// What to compare; the first is the reference unless --data is
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_value = "volume,surface"
    )]
    pub models: Vec<PatchModel>,
    /// Measured values to compare with, as the reference: CSV with r,g,b or a WINDOW file (.xml)
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// Paths per pair
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u64).range(2..))]
    pub spp: u64,
    /// Stop a pair when the standard error of every channel is below this share of the value
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub target_error: Option<f64>,
    /// Texels of the longer side of the pictures
    #[arg(long, value_name = "N", default_value_t = 96, value_parser = clap::value_parser!(u32).range(8..=4096))]
    pub texels: u32,
    /// Paths per texel of the pictures
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u64).range(2..))]
    pub texel_spp: u64,
    /// Median relative error below which models are said to agree
    #[arg(long, value_name = "SHARE", default_value_t = 0.15, value_parser = parse_share)]
    pub limit: f64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Level of detail of the volumes; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub level: u8,
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM")]
    pub voxel_um: Option<f32>,
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// `organza fit`
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  organza fit scenes/fabrics/denim.toml -o fitted.toml\n  organza fit scenes/fabrics/denim.toml --what fibres --data measured.xml -o fitted.toml"
)]
pub struct FitArgs {
    /// Fabric file (TOML): where the search begins
    pub fabric: PathBuf,
    /// Fabric file to write, with the fitted values
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// What to fit
    #[arg(long, value_enum, default_value = "surface")]
    pub what: FitWhat,
    /// Measured values to fit to: CSV with r,g,b or a WINDOW file (.xml) [default for a surface: the fabric's volume]
    #[arg(long, value_name = "FILE", required_if_eq("what", "fibres"))]
    pub data: Option<PathBuf>,
    /// What stands for the volume
    #[arg(long, value_enum, default_value = "volume")]
    pub model: PatchModel,
    /// Paths per pair of the volume
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u64).range(2..))]
    pub spp: u64,
    /// Places of the search: looked at all over, then steps of each descent
    #[arg(long, value_name = "SCAN,STEPS", value_parser = parse_patience, default_value = "60,300")]
    pub patience: [u32; 2],
    /// Remember what was computed in this file, and go on from it
    #[arg(long, value_name = "FILE")]
    pub journal: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM")]
    pub voxel_um: Option<f32>,
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// What to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FitWhat {
    /// The [surface] section
    Surface,
    /// Colour, roughness and density of the fibres
    Fibres,
}

/// `organza weave`
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  organza weave satin-8-3 -o satin.png\n  organza weave draft.wif --json"
)]
pub struct WeaveArgs {
    /// A draft (.wif), a fabric file (.toml) or the name of a weave (plain, twill-3-1-s, satin-8-3, basket-2-2, herringbone)
    pub draft: String,
    /// What to write: the drawdown or the curves as a picture (.png), the curves as polylines (.obj), text (.txt) or .bcc [default: print the drawdown]
    #[arg(short, long)]
    pub outfile: Option<PathBuf>,
    /// Which curves of a fabric to write or draw
    #[arg(long, value_enum)]
    pub level: Option<CurveLevel>,
    /// Pixels per crossing
    #[arg(long, value_name = "N", default_value_t = 16)]
    pub cell_px: u32,
    /// Print repeat, floats and cover as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// How far a fabric is taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum CurveLevel {
    /// One curve per yarn
    Yarn,
    /// One curve per ply
    Ply,
    /// Every fibre
    Fibre,
}

/// `organza info`
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  organza info scenes/fabrics/organza.toml --json")]
pub struct InfoArgs {
    /// A draft (.wif), fabric or scene (.toml), volume (.ovox, .vdb, .vol) or curves (.bcc, .txt)
    pub file: PathBuf,
    /// Print as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

/// `organza completions`
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  organza completions bash > ~/.local/share/bash-completion/completions/organza"
)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: clap_complete::Shell,
}

/// `organza man`
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  organza man -o ~/.local/share/man/man1")]
pub struct ManArgs {
    /// Folder for one page a command, organza.1 and so on
    #[arg(short, long, value_name = "DIR")]
    pub outfile: PathBuf,
}

/// A crop from "X0,Y0,X1,Y1".
fn parse_crop(text: &str) -> Result<Crop, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, x1, y1]) => Ok(Crop {
            min: UVec2::new(x0, y0),
            max: UVec2::new(x1, y1),
        }),
        _ => Err("expected four pixel numbers X0,Y0,X1,Y1".into()),
    }
}

/// Two counts "A,B", each at most a thousand.
fn parse_counts(text: &str, least: u32) -> Result<[u32; 2], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[a, b]) if [a, b].iter().all(|n| (least..=1000).contains(n)) => Ok([a, b]),
        _ => Err(format!("expected two numbers from {least} to 1000, A,B")),
    }
}

fn parse_grid(text: &str) -> Result<[u32; 2], String> {
    parse_counts(text, 1)
}

fn parse_patience(text: &str) -> Result<[u32; 2], String> {
    parse_counts(text, 0)
}

/// A positive number.
fn parse_share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("expected a positive number such as 0.02".into()),
    }
}

/// Bytes from "512MiB", "2GB" or a plain number.
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "kib" | "k" => 1024.0,
        "mib" | "m" => 1024.0 * 1024.0,
        "gib" | "g" => 1024.0 * 1024.0 * 1024.0,
        _ => return Err("expected a size such as 512MiB or 2GB".into()),
    };
    match digits.trim().parse::<f64>() {
        Ok(n) if n >= 0.0 && n * unit < 9e18 => Ok((n * unit) as u64),
        _ => Err("expected a size such as 512MiB or 2GB".into()),
    }
}

/// A time from "60s", "500ms", "1.5m", "2h" or a plain number of seconds.
fn parse_duration(text: &str) -> Result<Duration, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let seconds = match &text[digits.len()..] {
        "ms" => 1e-3,
        "" | "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => f64::NAN,
    };
    digits
        .trim()
        .parse()
        .ok()
        .and_then(|n: f64| Duration::try_from_secs_f64(n * seconds).ok())
        .ok_or_else(|| "expected a time such as 60s, 500ms, 5m or 2h".into())
}

fn parse_repeats(text: &str) -> Result<UVec2, String> {
    let number = |t: &str| t.trim().parse().ok().filter(|n| (1..=4096).contains(n));
    text.split_once(',')
        .and_then(|(x, y)| Some(UVec2::new(number(x)?, number(y)?)))
        .ok_or_else(|| "expected two whole numbers from 1 to 4096 such as 8,8".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        command().debug_assert();
    }

    #[test]
    fn times_are_read_with_their_units() {
        assert_eq!(parse_duration("1.5m"), Ok(Duration::from_secs(90)));
        assert_eq!(parse_duration("250ms"), Ok(Duration::from_millis(250)));
        assert_eq!(parse_duration("0"), Ok(Duration::ZERO));
        for wrong in ["", "s", "-1s", "5 weeks", "infs", "1e400"] {
            assert!(parse_duration(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes_are_read_with_their_units() {
        assert_eq!(parse_bytes("2GiB"), Ok(2 << 30));
        assert_eq!(parse_bytes("1.5k"), Ok(1536));
        assert_eq!(parse_bytes("7"), Ok(7));
        assert!(parse_bytes("-1").is_err() && parse_bytes("2 apples").is_err());
    }
}
