//! `organza fit`

use crate::flags::patch_model::{OWN, patch_model};
use crate::flags::values::{parse_angles, parse_paths, parse_patience, parse_positive, parse_seed};
use crate::flags::{CommonArgs, MemoryArgs, VoxelArgs};
use clap::Args;
use std::path::PathBuf;
mod fibres;
mod picture;
mod surface;

use super::{Command, with_threads};
use crate::error::input;
use crate::output;
use crate::output::note;
use anyhow::{Context, Result};
use organza_measure::Effort;
use organza_measure::fit::Determined;
use organza_scene::file_kind::Wanted;
use organza_scene::loader::Loader;
use organza_scene::patches::{PatchModel, PatchOptions};
use organza_scene::read;
use organza_scene::representation::SURFACE;
use serde_json::json;
use std::fmt::Write as _;
use toml::{Table, Value};

/// `organza fit`
#[derive(Debug, Args)]
#[command(
    about = "Find the surface or fibre parameters that match measured values",
    after_help = "Examples:\n  organza fit scenes/fabrics/denim.toml -o fitted.toml\n  organza fit scenes/fabrics/denim.toml --what fibres --data measured.xml -o fitted.toml\n  organza fit scenes/fabrics/denim.toml --what picture --data photograph.exr --light 30,0 --width-mm 8 -o fitted.toml"
)]
pub struct FitArgs {
    /// Fabric file (TOML) from which the search starts
    pub fabric: PathBuf,
    /// Fabric file to write, with the fitted values
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// What to fit
    #[arg(long, value_enum, default_value = "surface")]
    pub what: FitWhat,
    /// Measured values to fit to: CSV with r,g,b, a WINDOW file (.xml) or, for a picture, an .exr, .hdr or .png [default for a surface: the fabric's volume]
    #[arg(long, value_name = "FILE", required_if_eq_any([("what", "fibres"), ("what", "picture")]))]
    pub data: Option<PathBuf>,
    /// Model of the volume
    #[arg(long, default_value = OWN, value_parser = patch_model())]
    pub model: PatchModel,
    /// Paths per pair of the volume, or per texel of a picture, at least 2
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = parse_paths)]
    pub spp: u64,
    /// Evaluations: of the first scan, and at most of each descent [default: 200,400 for a surface, 0,60 for fibres]
    #[arg(long, value_name = "SCAN,STEPS", allow_hyphen_values = true, value_parser = parse_patience)]
    pub patience: Option<[u32; 2]>,
    /// Direction towards the light in the picture, polar angle and azimuth from the weft, degrees
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles, default_value = "45,0")]
    pub light: [f64; 2],
    /// Direction towards the camera of the picture
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles, default_value = "0,0")]
    pub view: [f64; 2],
    /// Width of the cloth in the picture, mm [default: the fabric's tile]
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub width_mm: Option<f64>,
    /// Value that white paper has in the picture
    #[arg(long, value_name = "VALUE", default_value_t = 1.0, value_parser = parse_positive)]
    pub white: f64,
    /// Save every evaluation to this file, and resume from it
    #[arg(long, value_name = "FILE")]
    pub journal: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = parse_seed)]
    pub seed: u64,
    #[command(flatten)]
    pub voxel: VoxelArgs,
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for FitArgs {
    const NAME: &'static str = "fit";

    fn run(&self) -> Result<()> {
        run(self)
    }
}

/// What to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FitWhat {
    /// The [surface] section
    Surface,
    /// Colour, roughness and density of the fibres
    Fibres,
    /// Colour and roughness of the fibres, from one picture of the cloth
    Picture,
}

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<()> {
    let is_fabric = |e: &std::ffi::OsStr| e.eq_ignore_ascii_case("toml");
    if !args.outfile.extension().is_some_and(is_fabric) {
        return Err(input(format!(
            "{}: expected a name that ends in .toml",
            args.outfile.display()
        )));
    }
    output::check_not_an_input(&args.outfile, &[&args.fabric])?;
    output::check_writable(&args.outfile)?;
    if let Some(journal) = &args.journal {
        output::check_writable(journal)?;
    }
    if args.model == PatchModel::Is(&SURFACE) {
        return Err(input("--model: a surface cannot stand for the volume"));
    }
    with_threads(&args.common, || match args.what {
        FitWhat::Surface => surface::run(args),
        FitWhat::Fibres => fibres::run(args),
        FitWhat::Picture => picture::run(args),
    })
}

fn options<'a>(args: &FitArgs, loader: &'a Loader<'a>) -> PatchOptions<'a> {
    PatchOptions {
        loader,
        voxel_um: args.voxel.voxel_um,
        level: 0,
        max_memory_bytes: args.memory.max_memory,
    }
}

fn effort(args: &FitArgs) -> Effort {
    Effort {
        paths: args.spp,
        seed: args.seed,
        target_error: None,
    }
}

/// The fabric file as a table, with keys removed and replaced and names of other files
/// made valid beside the new one.
fn table(args: &FitArgs, removed: &[String], overrides: &[String]) -> Result<Table> {
    let mut keys = args.common.set.clone();
    keys.extend_from_slice(overrides);
    let mut table: Table =
        Loader::new().toml_changed(&args.fabric, removed, &keys, Wanted::Fabric)?;
    if let Some(Value::Table(draft)) = table.get_mut("draft") {
        for key in ["wif", "curves"] {
            if let Some(Value::String(name)) = draft.get_mut(key) {
                let there = std::path::absolute(read::beside(&args.fabric, name))?;
                *name = there.to_string_lossy().into_owned();
            }
        }
    }
    Ok(table)
}

fn finish(args: &FitArgs, table: &Table, parameters: &[Determined], words: &str) -> Result<()> {
    let command: Vec<String> = std::env::args().collect();
    let mut text = format!("# Fitted by: {}\n# {words}\n#\n", command.join(" "));
    for p in parameters {
        let _ = writeln!(
            text,
            "# {} = {:.4} +- {:.4}{}",
            p.name,
            p.value,
            p.se,
            if p.is_fixed {
                ""
            } else {
                ", not fixed by the data"
            }
        );
    }
    let _ = write!(
        text,
        "\n{}",
        toml::to_string(table).context("the fabric cannot be written")?
    );
    output::write_file(&args.outfile, |out| {
        out.write_all(text.as_bytes()).context("writing failed")
    })?;
    if args.json {
        let answer = json!({ "parameters": parameters, "words": words });
        output::print(&(serde_json::to_string_pretty(&answer)? + "\n"))?;
    }
    if !args.common.quiet {
        note!("{words}");
        let loose: Vec<&str> = parameters
            .iter()
            .filter(|p| !p.is_fixed)
            .map(|p| p.name.as_str())
            .collect();
        if !loose.is_empty() {
            note!("not fixed by the data: {}", loose.join(", "));
        }
    }
    Ok(())
}
