//! `organza weave`

use super::Command;
use crate::error::{after_option, of_file};
use crate::flags::CommonArgs;
use crate::flags::values::whole;
use crate::output::note;
use crate::{output, picture};
use anyhow::{Context, Result};
use clap::Args;
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::loader::Loader;
use organza_scene::subject::{self, BareDraft};
use organza_scene::{file_kind, read};
use organza_weave::{CurveLevel, Draft, Picture, curve_file};
use std::path::{Path, PathBuf};

/// `organza weave`
#[derive(Debug, Args)]
#[command(
    about = "Draw a draft or a fabric's weave",
    after_help = "Examples:\n  organza weave satin-8-3 -o satin.png\n  organza weave draft.wif -o draft.toml\n  organza weave draft.wif --json"
)]
pub struct WeaveArgs {
    /// A draft (.wif), a fabric file (.toml) or the name of a weave (plain, twill-3-1-s, satin-8-3, basket-2-2, herringbone)
    pub draft: String,
    /// What to write: the drawdown or the curves as a picture (.png), a fabric file for the draft (.toml), the curves as polylines (.obj), text (.txt) or .bcc [default: print the drawdown]
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

impl CurveLevelName {
    /// The level of a cloth's curves.
    pub fn of_cloth(self) -> CurveLevel {
        match self {
            CurveLevelName::Yarn => CurveLevel::Yarn,
            CurveLevelName::Ply => CurveLevel::Ply,
            CurveLevelName::Fibre => CurveLevel::Fibre,
        }
    }
}

/// What the word on the command line means.
enum Named {
    Draft(BareDraft),
    Fabric(Box<Fabric>),
}

impl Named {
    /// # Errors
    /// No such file or weave, or a file that cannot be read.
    fn of(word: &str, overrides: &[String], loader: &Loader<'_>) -> Result<Named> {
        let path = Path::new(word);
        let is_toml = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        if let (Some(set), false) = (overrides.first(), is_toml) {
            return Err(after_option(
                "set",
                format!("{set}: {word} has no keys to override; only a fabric file (.toml) has"),
            ));
        }
        if let Some(draft) = subject::draft_of(path, loader)? {
            return Ok(Named::Draft(draft));
        }
        if is_toml {
            let fabric = fabric_file::load(path, overrides, loader)?;
            return Ok(Named::Fabric(Box::new(fabric)));
        }
        let what = read::bytes(path).ok().and_then(|b| file_kind::of_bytes(&b));
        let what = what.unwrap_or("a file of unknown kind");
        Err(of_file(
            word,
            format!(
                "is {what}; expected a draft (.wif), a fabric file (.toml) or the name of a weave"
            ),
        ))
    }

    fn draft(&self) -> Option<&Draft> {
        match self {
            Named::Draft(d) => Some(&d.draft),
            Named::Fabric(f) => f.cloth.draft(),
        }
    }
}

/// Runs the command.
pub fn run(args: &WeaveArgs) -> Result<()> {
    let loader = Loader::new();
    let named = Named::of(&args.draft, &args.common.set, &loader)?;
    let warnings = match &named {
        Named::Draft(d) => &d.draft.warnings[..],
        Named::Fabric(f) => f.cloth.warnings(),
    };
    if !args.common.quiet {
        for warning in warnings {
            note!("organza: warning: {}: {warning}", args.draft);
        }
    }
    if let Some(path) = &args.outfile {
        output::check_writable(path)?;
        output::check_not_an_input(path, loader.inputs().iter().map(|i| &i.path))?;
        write(args, &named, path)?;
    }
    let no_draft = || of_file(&args.draft, "has no draft to show");
    if args.json {
        let listing = match &named {
            Named::Draft(d) => serde_json::json!({ "draft": d.draft.summary() }),
            Named::Fabric(f) => serde_json::json!({
                "draft": f.cloth.draft().map(Draft::summary),
                "figures": f.cloth.figures(),
            }),
        };
        output::print(&(serde_json::to_string_pretty(&listing)? + "\n"))?;
    } else if args.outfile.is_none() {
        output::print(&named.draft().ok_or_else(no_draft)?.drawdown())?;
    }
    Ok(())
}

fn write(args: &WeaveArgs, named: &Named, path: &Path) -> Result<()> {
    let ending = path.extension().map(|e| e.to_ascii_lowercase());
    let ending = ending.as_ref().and_then(|e| e.to_str()).unwrap_or("");
    let level = args.level.unwrap_or(CurveLevelName::Yarn).of_cloth();
    match (ending, named) {
        (_, Named::Draft(_)) if args.level.is_some() => Err(of_file(
            &args.draft,
            "a draft has no curves for --level; name a fabric file (.toml)",
        )),
        ("png", Named::Draft(d)) => write_png(path, &d.draft.picture(args.cell_px)),
        ("toml", Named::Draft(d)) => {
            let text = d.fabric_in(path.parent().unwrap_or(Path::new("")))?;
            output::write_file(path, |out| Ok(out.write_all(text.as_bytes())?))
        }
        ("toml", Named::Fabric(_)) => Err(of_file(
            &args.draft,
            "is a fabric file already; a fabric is written for a draft or a weave",
        )),
        ("png", Named::Fabric(f)) => match (f.cloth.draft(), args.level) {
            (Some(draft), None) => write_png(path, &draft.picture(args.cell_px)),
            _ => write_png(path, &f.cloth.picture(level, f.cloth.default_picture_mm())),
        },
        ("obj" | "txt" | "bcc", Named::Draft(_)) => Err(of_file(
            &args.draft,
            "a draft has no curves; name a fabric file (.toml)",
        )),
        ("obj" | "txt" | "bcc", Named::Fabric(f)) => {
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
        _ => Err(of_file(
            path,
            "expected a name that ends in .png, .toml, .obj, .txt or .bcc",
        )),
    }
}

fn write_png(path: &Path, p: &Picture) -> Result<()> {
    picture::write_rgb_png(path, p.width, p.height, &p.rgb)
}
