//! `organza weave`

use super::Command;
use crate::error::input;
use crate::flags::CommonArgs;
use crate::flags::values::whole;
use crate::output::note;
use crate::{output, picture};
use anyhow::{Context, Result};
use clap::Args;
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::loader::Loader;
use organza_scene::{file_kind, read};
use organza_weave::{CurveLevel, Draft, Picture, curve_file};
use std::path::{Path, PathBuf};

/// `organza weave`
#[derive(Debug, Args)]
#[command(
    about = "Draw a draft or a fabric's weave",
    after_help = "Examples:\n  organza weave satin-8-3 -o satin.png\n  organza weave draft.wif --json"
)]
pub struct WeaveArgs {
    /// A draft (.wif), a fabric file (.toml) or the name of a weave (plain, twill-3-1-s, satin-8-3, basket-2-2, herringbone)
    pub draft: String,
    /// What to write: the drawdown or the curves as a picture (.png), the curves as polylines (.obj), text (.txt) or .bcc [default: print the drawdown]
    #[arg(short, long)]
    pub outfile: Option<PathBuf>,
    /// Which curves of a fabric to write or draw
    #[arg(long, value_enum, requires = "outfile")]
    pub level: Option<CurveLevelName>,
    /// Pixels per crossing of a drawdown, 1 to 1024; fewer where the picture would be wider than 8192
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = whole::<u32>(1..=1024), requires = "outfile")]
    pub cell_px: u32,
    /// Print repeat, floats and cover as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub common: CommonArgs,
}

impl Command for WeaveArgs {
    const NAME: &'static str = "weave";

    fn run(&self) -> Result<()> {
        run(self)
    }
}

/// How far a fabric is taken apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum CurveLevelName {
    /// One curve per yarn
    Yarn,
    /// One curve per ply
    Ply,
    /// Every fibre
    Fibre,
}

/// What the word on the command line means.
enum Subject {
    Draft(Draft),
    Fabric(Box<Fabric>),
}

impl Subject {
    /// # Errors
    /// No such file or weave, or a file that cannot be read.
    fn of(word: &str, overrides: &[String], loader: &Loader<'_>) -> Result<Subject> {
        let path = Path::new(word);
        let ending = path.extension().and_then(|e| e.to_str());
        let ending = ending.map(str::to_lowercase);
        let ending = ending.as_deref();
        if let (Some(set), false) = (overrides.first(), ending == Some("toml")) {
            return Err(input(format!(
                "--set {set}: {word} has no keys to override; only a fabric file (.toml) has"
            )));
        }
        match ending {
            Some("wif") => Draft::from_wif(&loader.bytes(path)?)
                .map(Subject::Draft)
                .map_err(|e| input(format!("{}: {e}", path.display()))),
            Some("toml") => Ok(Subject::Fabric(Box::new(fabric_file::load(
                path, overrides, loader,
            )?))),
            _ if word.contains(['.', '/', '\\']) || path.exists() => Err(no_draft(word, path)),
            _ => Draft::named(word)
                .map(Subject::Draft)
                .map_err(|e| input(format!("{word}: {e}"))),
        }
    }

    fn draft(&self) -> Option<&Draft> {
        match self {
            Subject::Draft(d) => Some(d),
            Subject::Fabric(f) => f.cloth.draft(),
        }
    }
}

/// What a word that is a file's name, and no draft's, is refused with.
fn no_draft(word: &str, path: &Path) -> anyhow::Error {
    if let Some(why) = read::unreachable(path) {
        return input(why);
    }
    let what = read::bytes(path).ok().and_then(|b| file_kind::of_bytes(&b));
    let what = what.unwrap_or("a file of unknown kind");
    input(format!(
        "{word}: is {what}; expected a draft (.wif), a fabric file (.toml) or the name of a weave"
    ))
}

/// Runs the command.
pub fn run(args: &WeaveArgs) -> Result<()> {
    let loader = Loader::new();
    let subject = Subject::of(&args.draft, &args.common.set, &loader)?;
    let warnings = match &subject {
        Subject::Draft(d) => &d.warnings[..],
        Subject::Fabric(f) => f.cloth.warnings(),
    };
    if !args.common.quiet {
        for warning in warnings {
            note!("organza: warning: {}: {warning}", args.draft);
        }
    }
    if let Some(path) = &args.outfile {
        output::check_writable(path)?;
        output::check_not_an_input(path, loader.inputs().iter().map(|i| &i.path))?;
        write(args, &subject, path)?;
    }
    let no_draft = || input(format!("{}: has no draft to show", args.draft));
    if args.json {
        let listing = match &subject {
            Subject::Draft(d) => serde_json::json!({ "draft": d.summary() }),
            Subject::Fabric(f) => serde_json::json!({
                "draft": f.cloth.draft().map(Draft::summary),
                "figures": f.cloth.figures(),
            }),
        };
        output::print(&(serde_json::to_string_pretty(&listing)? + "\n"))?;
    } else if args.outfile.is_none() {
        output::print(&subject.draft().ok_or_else(no_draft)?.drawdown())?;
    }
    Ok(())
}

fn write(args: &WeaveArgs, subject: &Subject, path: &Path) -> Result<()> {
    let ending = path.extension().map(|e| e.to_ascii_lowercase());
    let ending = ending.as_ref().and_then(|e| e.to_str()).unwrap_or("");
    let level = match args.level {
        None | Some(CurveLevelName::Yarn) => CurveLevel::Yarn,
        Some(CurveLevelName::Ply) => CurveLevel::Ply,
        Some(CurveLevelName::Fibre) => CurveLevel::Fibre,
    };
    match (ending, subject) {
        (_, Subject::Draft(_)) if args.level.is_some() => Err(input(format!(
            "{}: a draft has no curves for --level; name a fabric file (.toml)",
            args.draft
        ))),
        ("png", Subject::Draft(d)) => write_png(path, &d.picture(args.cell_px)),
        ("png", Subject::Fabric(f)) => match (f.cloth.draft(), args.level) {
            (Some(draft), None) => write_png(path, &draft.picture(args.cell_px)),
            _ => write_png(path, &f.cloth.picture(level, f.cloth.default_picture_mm())),
        },
        ("obj" | "txt" | "bcc", Subject::Draft(_)) => Err(input(format!(
            "{}: a draft has no curves; name a fabric file (.toml)",
            args.draft
        ))),
        ("obj" | "txt" | "bcc", Subject::Fabric(f)) => {
            let curves = f.cloth.curves(level);
            output::write_file(path, |mut out| {
                match ending {
                    "obj" => curve_file::write_obj(&curves, &mut out),
                    "txt" => curve_file::write_text(&curves, &mut out),
                    _ => curve_file::write_bcc(&curves, &mut out),
                }
                .context("writing the curves failed")
            })
        }
        _ => Err(input(format!(
            "{}: expected a name that ends in .png, .obj, .txt or .bcc",
            path.display()
        ))),
    }
}

fn write_png(path: &Path, p: &Picture) -> Result<()> {
    picture::write_rgb_png(path, p.width, p.height, &p.rgb)
}
