//! Drafts, and what fabrics are woven of.

use anyhow::{Context as _, Result};
use clap::Args;
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::loader::Loader;
use organza_scene::subject::{self, BareDraft};
use organza_scene::{file_kind, read};
use organza_weave::{CurveLevel, Draft, Picture, curve_file};
use organza_work::values::whole;
use organza_work::{
    Context, Error, Job, Output, Request, Results, after_option, keys, of_file, of_option, output,
    picture,
};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A draft or a fabric, taken apart.
#[derive(Clone, Debug, Args, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Weave {
    /// A draft (.wif), a fabric file (.toml) or the name of a weave (plain, twill-3-1-s, satin-8-3, basket-2-2, herringbone)
    pub draft: String,
    /// Which curves of a fabric to write or draw
    #[arg(long, value_enum, requires = "outfile")]
    #[serde(deserialize_with = "keys::some_name")]
    pub level: Option<CurveLevelName>,
    /// Pixels per crossing of a drawdown, 1 to 1024; fewer where the picture would be wider than 8192
    #[arg(long, value_name = "N", default_value_t = Weave::default().cell_px, value_parser = whole::<u32>(1..=1024), requires = "outfile")]
    pub cell_px: u32,
    /// Override any key of the fabric file, e.g. --set warp.per_cm=30 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    #[serde(deserialize_with = "keys::overrides")]
    pub set: Vec<String>,
}

impl Default for Weave {
    fn default() -> Weave {
        Weave {
            draft: String::new(),
            level: None,
            cell_px: 16,
            set: Vec::new(),
        }
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

/// What the name of a request means.
enum Named {
    Draft(BareDraft),
    Fabric(Box<Fabric>),
}

impl Named {
    /// # Errors
    /// No such file or weave, or a file that cannot be read.
    fn of(word: &str, overrides: &[String], loader: &Loader<'_>) -> Result<Named> {
        let path = Path::new(word);
        if let Some(draft) = subject::draft_of(path, loader)? {
            return Ok(Named::Draft(draft));
        }
        if ending_of(path) == "toml" {
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

impl Request for Weave {
    const NAME: &'static str = "weave";
    type Output = Woven;

    fn adapt_to(&mut self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        // What a file can show depends on the draft.
        self.check_draft()?;
        self.check_output(path)?;
        Ok(vec![path.to_owned()])
    }

    fn check(&self, context: &Context) -> Result<()> {
        keys::check("cell_px", [self.cell_px], whole::<u32>(1..=1024))?;
        self.check_draft()?;
        for path in &context.outputs {
            output::check_not_an_input(path, [&self.draft])?;
        }
        if let (Some(set), false) = (self.set.first(), self.is_fabric()) {
            let word = &self.draft;
            return Err(after_option(
                "set",
                format!("{set}: {word} has no keys to override; only a fabric file (.toml) has"),
            ));
        }
        Ok(())
    }

    fn work(job: &Job<Weave>) -> Result<Woven> {
        let loader = job.context.loader();
        let named = Named::of(&job.draft, &job.set, &loader)?;
        let warnings = match &named {
            Named::Draft(d) => &d.draft.warnings[..],
            Named::Fabric(f) => f.cloth.warnings(),
        };
        for warning in warnings {
            job.context.warn(format!("{}: {warning}", job.draft));
        }
        job.context.check_outputs(&loader)?;
        Ok(Woven {
            request: job.request.clone(),
            named,
        })
    }
}

/// Endings of files of curves.
const CURVES: [&str; 3] = ["obj", "txt", "bcc"];

/// The ending of a name in lower case.
fn ending_of(path: &Path) -> String {
    let ending = path.extension().unwrap_or_default();
    ending.to_string_lossy().to_lowercase()
}

impl Weave {
    /// Whether it names a fabric file; else it can only be a draft.
    fn is_fabric(&self) -> bool {
        ending_of(Path::new(&self.draft)) == "toml"
    }

    fn check_draft(&self) -> Result<()> {
        match self.draft.is_empty() {
            true => Err(of_option("draft", "expected a draft, a fabric or a weave")),
            false => Ok(()),
        }
    }

    /// Refuses a file that cannot show what is named.
    fn check_output(&self, path: &Path) -> Result<()> {
        let [obj, txt, bcc] = CURVES;
        output::check_ending(path, &["png", "toml", obj, txt, bcc])?;
        let ending = &*ending_of(path);
        let why = match self.is_fabric() {
            true if ending == "toml" => {
                "is a fabric file already; a fabric is written for a draft or a weave"
            }
            false if self.level.is_some() => {
                "a draft has no curves for --level; name a fabric file (.toml)"
            }
            false if CURVES.contains(&ending) => {
                "a draft has no curves; name a fabric file (.toml)"
            }
            _ => return Ok(()),
        };
        Err(of_file(&self.draft, why))
    }
}

/// A draft, or a fabric that was woven.
pub struct Woven {
    request: Weave,
    named: Named,
}

impl Woven {
    /// The draft, if there is one.
    pub fn draft(&self) -> Option<&Draft> {
        self.named.draft()
    }

    /// The drawdown as text.
    ///
    /// # Errors
    /// There is no draft.
    pub fn drawdown(&self) -> Result<String, Error> {
        let draft = self.draft();
        let no_draft = || of_file(&self.request.draft, "has no draft to show");
        Ok(draft.ok_or_else(no_draft)?.drawdown())
    }

    /// Repeat, floats and cover.
    pub fn json(&self) -> Value {
        match &self.named {
            Named::Draft(d) => json!({ "draft": d.draft.summary() }),
            Named::Fabric(f) => json!({
                "draft": f.cloth.draft().map(Draft::summary),
                "figures": f.cloth.figures(),
            }),
        }
    }
}

impl Output for Woven {
    fn results(&self) -> Result<Results, Error> {
        let figures = self.json();
        let list = figures.as_object().into_iter().flatten();
        let all = list.fold(Results::default(), |all, (name, value)| {
            all.with_figure(name, value.clone())
        });
        Ok(all)
    }

    fn write(&self, path: &Path) -> Result<Vec<PathBuf>, Error> {
        write(&self.request, &self.named, path)?;
        Ok(vec![path.to_owned()])
    }
}

fn write(args: &Weave, named: &Named, path: &Path) -> Result<()> {
    args.check_output(path)?;
    let level = args.level.unwrap_or(CurveLevelName::Yarn).of_cloth();
    match (&*ending_of(path), named) {
        ("toml", Named::Draft(d)) => {
            let text = d.fabric_in(path.parent().unwrap_or(Path::new("")))?;
            output::write_bytes(path, text.as_bytes())
        }
        (_, Named::Draft(d)) => write_png(path, &d.draft.picture(args.cell_px)),
        ("png", Named::Fabric(f)) => match (f.cloth.draft(), args.level) {
            (Some(draft), None) => write_png(path, &draft.picture(args.cell_px)),
            _ => write_png(path, &f.cloth.picture(level, f.cloth.default_picture_mm())),
        },
        (ending, Named::Fabric(f)) => {
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
    }
}

fn write_png(path: &Path, p: &Picture) -> Result<()> {
    picture::write_rgb_png(path, p.width, p.height, &p.rgb)
}
