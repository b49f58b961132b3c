//! `organza fit`

use crate::flags::patch_model::{OWN, patch_model};
use crate::flags::values::{
    parse_angles, parse_crop, parse_paths, parse_patience, parse_positive, parse_seed,
};
use crate::flags::{CacheArgs, CommonArgs, MemoryArgs, VoxelArgs};
use clap::Args;
use std::path::{Path, PathBuf};
mod cloth;
mod fibres;
mod flag_groups;
mod picture;
mod plies;
mod shade;
mod surface;
mod volume;
mod volume_picture;
mod volume_scene;

use super::with_threads;
use crate::error::{of_file, of_option};
use crate::identity;
use crate::journal::Work;
use crate::number_journal::NumberJournal;
use crate::output;
use crate::output::note;
use crate::results::Results;
use anyhow::{Context, Result};
use organza_measure::Effort;
use organza_measure::fit::Determined;
use organza_scene::file_kind::Wanted;
use organza_scene::loader::{Input, Loader};
use organza_scene::patches::{PatchModel, PatchOptions};
use organza_scene::read;
use organza_scene::representation::Build;
use organza_transport::Crop;
use serde_json::json;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use toml::{Table, Value};

/// `organza fit`
#[derive(Debug, Args)]
#[command(
    about = "Find the surface, fibre, ply or volume parameters that match measured values, a picture or photographs",
    after_help = "Examples:\n  organza fit scenes/fabrics/denim.toml -o fitted.toml\n  organza fit scenes/fabrics/screen.toml --what fibres --data measured.xml -o fitted.toml\n  organza fit scenes/fabrics/denim.toml --what picture --data photograph.exr --light 30,0 --width-mm 8 -o fitted.toml\n  organza fit scanned.ovox --what picture --data photograph.exr --light 30,0 --width-mm 4 --fit-density -o fitted.toml\n  organza fit --what cloth --front front.png --back back.png --width-mm 8 --light 30,45 --back-light 150,45 -o fitted.toml"
)]
pub struct FitArgs {
    /// Fabric file (TOML) from which the search starts, or a scene with one object of kind = "volume", or a volume file. Fits of a cloth take yarns and fibres from it and need none
    pub fabric: Option<PathBuf>,
    /// Fabric or scene file to write, with the fitted values
    #[arg(short, long)]
    pub outfile: PathBuf,
    /// What to fit
    #[arg(long, value_enum, default_value = "surface")]
    pub what: FitWhat,
    /// Measured values to fit to: CSV with r,g,b, a WINDOW file (.xml) or, for a picture, an .exr, .hdr or .png [default for a surface: the fabric's volume, for plies: its fibres]
    #[arg(long, value_name = "FILE", required_if_eq_any([("what", "fibres"), ("what", "picture")]))]
    pub data: Option<PathBuf>,
    /// Model of the volume; what plies are fitted to [default for plies: fibres]
    #[arg(long, default_value = OWN, value_parser = patch_model())]
    pub model: PatchModel,
    /// Paths per pair of the volume, or per texel of a picture, at least 2 [default: 1024; 64 for the picture of a volume, 60 for a cloth, 32768 for a shade]
    #[arg(long, value_name = "N", value_parser = parse_paths)]
    pub spp: Option<u64>,
    /// Evaluations: of the first scan, and at most of each descent [default: 200,400 for a surface, 0,60 for fibres, 0,120 for plies]
    #[arg(long, value_name = "SCAN,STEPS", allow_hyphen_values = true, value_parser = parse_patience)]
    pub patience: Option<[u32; 2]>,
    /// Cloths and plies: photograph of the face, warp upright within 20 degrees: .png, .jpg, .tif, .exr or .hdr
    #[arg(long, value_name = "FILE")]
    pub front: Option<PathBuf>,
    /// Cloths and plies: photograph against the light, from the same place
    #[arg(long, value_name = "FILE")]
    pub back: Option<PathBuf>,
    /// Cloths and plies: direction towards the lamp of that photograph, polar angle above 90 [default: 135,0]
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles)]
    pub back_light: Option<[f64; 2]>,
    #[command(flatten)]
    pub cloth: cloth::flags::PhotographArgs,
    /// Direction towards the light in the picture, polar angle and azimuth from the weft, degrees; scenes have their own [default: 45,0]
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles)]
    pub light: Option<[f64; 2]>,
    /// Direction towards the camera of the picture; scenes have their own [default: 0,0]
    #[arg(long, value_name = "THETA,PHI", allow_hyphen_values = true, value_parser = parse_angles)]
    pub view: Option<[f64; 2]>,
    /// Width of the cloth in the picture, mm; scenes have their own [default: that of the fabric's tile or of the volume]
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub width_mm: Option<f64>,
    /// Value that white paper has in the picture [default: 1; for a scene, values are radiances]
    #[arg(long, value_name = "VALUE", value_parser = parse_positive)]
    pub white: Option<f64>,
    /// Volumes: the part of the picture to match, in its pixels [default: all of it]
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = parse_crop)]
    pub region: Option<Crop>,
    /// Volumes: a part of the picture in which only one yarn is seen, so that pixels of its hue give it an albedo of its own; one for each yarn
    #[arg(long, value_name = "YARN=X0,Y0,X1,Y1", value_parser = parse_named_region)]
    pub region_of: Vec<NamedRegion>,
    /// Volumes: standard deviation of the noise of the picture's pixels, in its values [default: 0]
    #[arg(long, value_name = "VALUE", value_parser = parse_positive)]
    pub noise: Option<f64>,
    /// Volumes: blur of the picture, standard deviation in its pixels [default: none]
    #[arg(long, value_name = "PIXELS", value_parser = parse_positive)]
    pub blur_px: Option<f64>,
    /// Volumes: find a factor of density, too
    #[arg(long)]
    pub fit_density: bool,
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
    pub cache: CacheArgs,
    #[command(flatten)]
    pub common: CommonArgs,
}

command!(FitArgs, "fit", "fitted.toml");

/// Direction towards the light of a picture by default, degrees.
const LIGHT: [f64; 2] = [45.0, 0.0];

/// Direction towards its camera by default, degrees.
const VIEW: [f64; 2] = [0.0, 0.0];

/// Direction towards the lamp behind the cloth by default, degrees.
const BACK_LIGHT: [f64; 2] = [135.0, 0.0];

impl FitArgs {
    /// The file from which the search starts; an empty path if there is none.
    fn fabric_path(&self) -> &Path {
        self.fabric.as_deref().unwrap_or(Path::new(""))
    }

    /// Paths per pair or texel.
    fn paths(&self) -> u64 {
        self.spp.unwrap_or(1024)
    }
}

/// A part of a picture in which only one yarn is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedRegion {
    /// The yarn.
    pub name: String,
    /// The part.
    pub crop: Crop,
}

fn parse_named_region(text: &str) -> Result<NamedRegion, String> {
    let (name, crop) = text
        .split_once('=')
        .ok_or("expected YARN=X0,Y0,X1,Y1, for example weft=10,10,40,20")?;
    Ok(NamedRegion {
        name: name.trim().to_owned(),
        crop: parse_crop(crop)?,
    })
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
    /// The [plies] section: what fibres do not settle about plies, from explicit fibres, measured values, or a picture lit from the front and one lit from behind
    Plies,
    /// Threads, draft, yarn counts, colours and roughness of a woven cloth, from photographs
    Cloth,
}

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<()> {
    let is_fabric = |e: &std::ffi::OsStr| e.eq_ignore_ascii_case("toml");
    if !args.outfile.extension().is_some_and(is_fabric) {
        return Err(of_file(&args.outfile, "expected a name that ends in .toml"));
    }
    output::check_writable(&args.outfile)?;
    if let Some(journal) = &args.journal {
        output::check_writable(journal)?;
        output::check_distinct(
            ("the journal", journal),
            ("the fitted fabric", &args.outfile),
        )?;
    }
    check_outputs(args, &[])?;
    if let PatchModel::Is(model) = args.model
        && matches!(model.build, Build::Surface(_))
    {
        return Err(of_option("model", "a surface cannot stand for the volume"));
    }
    if args.what == FitWhat::Cloth {
        return with_threads(&args.common, || cloth::run(args));
    }
    cloth::refuse_elsewhere(args)?;
    if volume::is_volume(args)? {
        return with_threads(&args.common, || volume::run(args));
    }
    flag_groups::refuse_volume_flags(args)?;
    with_threads(&args.common, || match args.what {
        FitWhat::Surface => surface::run(args),
        FitWhat::Fibres if shade::is_shade(args) => shade::run(args),
        FitWhat::Fibres => fibres::run(args),
        FitWhat::Picture => picture::run(args),
        FitWhat::Plies => plies::run(args),
        FitWhat::Cloth => cloth::run(args),
    })
}

/// Refuses outputs that are the fabric, the data, or files that the fabric names.
fn check_outputs(args: &FitArgs, read: &[Input]) -> Result<()> {
    let read = || {
        let named = read.iter().map(|i| i.path.as_path());
        named
            .chain(args.fabric.as_deref())
            .chain(args.data.as_deref())
            .chain(args.front.as_deref())
            .chain(args.back.as_deref())
    };
    let written = [Some(&args.outfile), args.journal.as_ref()];
    for path in written.into_iter().flatten() {
        output::check_not_an_input(path, read())?;
    }
    Ok(())
}

/// The journal of a search of this key, if one is asked for.
fn open_journal(args: &FitArgs, key: &str) -> Result<NumberJournal> {
    let work = Work {
        command: "fit",
        key,
    };
    NumberJournal::open(args.journal.as_deref(), &work)
}

/// What a search is of: the fabric after all overrides, the bytes of
/// every file that it names and of the measured values, each in its role, and how
/// the places of the search are measured.
fn journal_key(args: &FitArgs, shown: &str, read: &[Input]) -> Result<String> {
    let fabric: Table =
        args.common
            .host
            .loader()
            .toml_of(args.fabric_path(), &args.common.set, Wanted::Fabric)?;
    let loader = args.common.host.loader();
    let data = args.data.as_deref().map(|path| loader.bytes(path));
    let data = data.transpose()?;
    let key = json!({
        "fabric": identity::digest(&Value::Table(fabric)),
        "inputs": identity::named_inputs(args.fabric_path(), read),
        "data": data.map(|bytes| identity::hex(&Sha256::digest(&bytes))),
        "model": shown,
        "voxel_um": args.voxel.voxel_um,
        "spp": args.paths(),
        "seed": args.seed,
    });
    Ok(key.to_string())
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
        paths: args.paths(),
        seed: args.seed,
        target_error: None,
    }
}

/// The fabric file as a table, with keys removed and replaced and names of other files
/// made valid beside the new one.
fn table(args: &FitArgs, removed: &[String], overrides: &[String]) -> Result<Table> {
    let mut keys = args.common.set.clone();
    keys.extend_from_slice(overrides);
    let mut table: Table = args.common.host.loader().toml_changed(
        args.fabric_path(),
        removed,
        &keys,
        Wanted::Fabric,
    )?;
    if let Some(Value::Table(draft)) = table.get_mut("draft") {
        for key in ["wif", "curves"] {
            if let Some(Value::String(name)) = draft.get_mut(key) {
                let there = std::path::absolute(read::beside(args.fabric_path(), name))?;
                *name = there.to_string_lossy().into_owned();
            }
        }
    }
    Ok(table)
}

/// A comment of one line, whatever stands in names of files and yarns.
fn comment(words: &str) -> String {
    let printable = |c: char| if c.is_control() { ' ' } else { c };
    format!("# {}\n", words.chars().map(printable).collect::<String>())
}

fn finish(args: &FitArgs, table: &Table, parameters: &[Determined], words: &str) -> Result<()> {
    finish_with(
        args,
        table,
        parameters,
        &[words.to_owned()],
        (json!({}), None),
    )
}

/// The same with several lines of words, figures for programs beside the usual ones, and a page
/// for the folder of `--report`.
fn finish_with(
    args: &FitArgs,
    table: &Table,
    parameters: &[Determined],
    lines: &[String],
    (mut figures, page): (serde_json::Value, Option<String>),
) -> Result<()> {
    let host = &args.common.host;
    let mut text = comment(&format!("Fitted by: {}", host.command_line()));
    text.extend(lines.iter().map(|line| comment(line)));
    text += "#\n";
    let words = lines.join("\n");
    for p in parameters {
        let loose = if p.is_fixed {
            ""
        } else {
            ", not fixed by the data"
        };
        text += &comment(&format!(
            "{} = {:.4} +- {:.4}{loose}",
            p.name, p.value, p.se
        ));
    }
    let _ = write!(
        text,
        "\n{}",
        toml::to_string(table).context("the fabric cannot be written")?
    );
    host.give(|| {
        let mut files = vec![("fitted.toml".to_owned(), text.clone().into_bytes())];
        files.extend(
            page.clone()
                .map(|page| ("report.html".to_owned(), page.into_bytes())),
        );
        let results = Results {
            files,
            ..Results::default()
        }
        .with_figure("parameters", json!(parameters))
        .with_figure("words", words.clone());
        let extra = figures.as_object().into_iter().flatten();
        extra.fold(results, |r, (key, value)| r.with_figure(key, value.clone()))
    });
    if host.writes() {
        let mut files: Vec<(PathBuf, output::WriteFile<'_>)> = Vec::new();
        let written = |text: String| -> output::WriteFile<'_> {
            Box::new(move |out| out.write_all(text.as_bytes()).context("writing failed"))
        };
        files.push((args.outfile.clone(), written(text)));
        if let (Some(folder), Some(page)) = (&args.cloth.report, page) {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("cannot make {}", folder.display()))?;
            files.push((folder.join("report.html"), written(page)));
        }
        output::write_files(files)?;
    }
    if args.json {
        figures["parameters"] = json!(parameters);
        figures["words"] = json!(words);
        output::print(&(serde_json::to_string_pretty(&figures)? + "\n"))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_stay_on_their_line() {
        let text = comment("a\nname = 1") + &comment("b\u{7f}\r");
        assert_eq!(text, "# a name = 1\n# b  \n");
        assert!(text.parse::<Table>().unwrap().is_empty());
    }
}
