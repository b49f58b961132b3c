//! `organza merge`

use super::Command;
use crate::flags::MemoryArgs;
use crate::terminal::note;
use anyhow::Result;
use clap::Args;
use organza_picture::exr::{self, StoredRender};
use organza_picture::{Display, Rendered};
use organza_requests::render::CLAMPED;
use organza_transport::Film;
use organza_work::identity::{Difference, EngineKind, Identity, joined_engines};
use organza_work::sample_ranges::SampleRanges;
use organza_work::{input, of_file, output, picture};
use std::path::{Path, PathBuf};

/// `organza merge`
#[derive(Debug, Args)]
#[command(
    about = "Combine renders of disjoint sample ranges, bit for bit as if rendered at once",
    after_help = "Example:\n  organza render scenes/first_light.toml --samples 0..128 -o a.exr\n  organza render scenes/first_light.toml --samples 128..256 -o b.exr\n  organza merge a.exr b.exr -o all.exr"
)]
pub struct MergeArgs {
    /// Pictures of one scene and seed (.exr) with disjoint samples
    #[arg(required = true)]
    pub parts: Vec<PathBuf>,
    /// Picture to write (.exr)
    #[arg(short, long)]
    pub outfile: PathBuf,
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// Print only errors
    #[arg(long)]
    pub quiet: bool,
}

impl Command for MergeArgs {
    const NAME: &'static str = "merge";

    fn run(&self) -> Result<()> {
        run(self)
    }
}

/// A picture of some samples.
struct Part<'a> {
    path: &'a Path,
    stored: StoredRender,
    samples: SampleRanges,
}

/// Runs the command.
pub fn run(args: &MergeArgs) -> Result<()> {
    picture::format_of_parts(&args.outfile)?;
    output::check_not_an_input(&args.outfile, &args.parts)?;
    output::check_writable(&args.outfile)?;
    let limit = args
        .memory
        .max_memory
        .unwrap_or_else(organza_scene::memory::free_memory_bytes);
    let mut merged: Option<Part<'_>> = None;
    for path in &args.parts {
        let held = merged.as_ref().map_or(0, |all| all.stored.memory_bytes());
        let part = load(path, limit.saturating_sub(held))?;
        merged = Some(match merged {
            None => part,
            Some(all) => join(all, part)?,
        });
    }
    let Some(all) = merged else {
        return Err(input("expected at least one picture"));
    };
    // The order in which `render` writes them: equal pictures, equal files.
    let film = &all.stored.film;
    let mut attributes = all.stored.attributes.clone();
    attributes.remove(exr::DENOISED); // the merged colours are those of the samples
    attributes.set("spp", all.samples.count().to_string());
    attributes.set("samples", all.samples.to_string());
    let rendered = Rendered {
        layers: all.stored.layers(),
        // Sums are kept by linear formats alone.
        ..Rendered::new(film, Display::default(), &attributes)
    };
    picture::write(&args.outfile, &rendered)?;
    if !args.quiet {
        note!(
            "{}: {} x {}, samples {} of every pixel",
            args.outfile.display(),
            film.size().x,
            film.size().y,
            all.samples
        );
        if let Some(gaps) = all.samples.gaps() {
            note!("samples {gaps} are missing");
        }
    }
    Ok(())
}

fn load(path: &Path, max_memory_bytes: u64) -> Result<Part<'_>> {
    let stored = picture::read_exr(path, max_memory_bytes)?;
    let samples = stored
        .attributes
        .get("samples")
        .and_then(SampleRanges::parse)
        .ok_or_else(|| {
            of_file(
                path,
                "has no sample ranges; expected a picture of `organza render`",
            )
        })?;
    Ok(Part {
        path,
        stored,
        samples,
    })
}

fn join<'a>(mut all: Part<'a>, part: Part<'a>) -> Result<Part<'a>> {
    let first = all.path.display();
    let fail = |why: &str| of_file(part.path, format!("cannot join {first}: {why}"));
    if let Some(difference) = identity(&all)?.difference(&identity(&part)?) {
        let differ = |key: &str| {
            let word = |p: &Part<'_>| p.stored.attributes.get(key).unwrap_or("none").to_owned();
            format!("{key} is {}, but {} in {first}", word(&part), word(&all))
        };
        let why = match difference {
            Difference::Code => differ("code") + "; render both with one program",
            Difference::Seed => differ("seed"),
            Difference::Crop => differ("crop"),
            Difference::Engine => differ("backend") + "; render both with one --engine",
            Difference::Scene => "the scenes differ".to_owned(),
            Difference::Input(name) => format!("the contents of {name} differ"),
        };
        return Err(fail(&why));
    }
    let backend = |part: &Part| {
        part.stored
            .attributes
            .get("backend")
            .unwrap_or_default()
            .to_owned()
    };
    let (a, b) = (backend(&all), backend(&part));
    let Some(both) = joined_engines(&a, &b) else {
        return Err(fail(&format!("backend is {b}, but {a} in {first}")));
    };
    all.stored.attributes.set("backend", both);
    if all.stored.film.size() != part.stored.film.size() {
        return Err(fail("the sizes differ"));
    }
    all.samples = all
        .samples
        .joined(&part.samples)
        .map_err(|e| fail(&e.to_string()))?;
    let removed = |p: &Part<'_>| p.stored.attributes.get(CLAMPED)?.parse::<u128>().ok();
    if let (Some(a), Some(b)) = (removed(&all), removed(&part)) {
        let sum = a.saturating_add(b).to_string();
        all.stored.attributes.set(CLAMPED, sum);
    }
    let (stored, other) = (&mut all.stored, &part.stored);
    merge_films(&mut stored.film, &other.film);
    match (&mut stored.direct, &other.direct) {
        (Some(direct), Some(other)) => merge_films(direct, other),
        // That of some samples alone is none of the picture.
        _ => stored.direct = None,
    }
    Ok(all)
}

fn merge_films(all: &mut Film, part: &Film) {
    for (a, b) in all.pixels_mut().iter_mut().zip(part.pixels()) {
        a.merge(b);
    }
}

/// What the picture of a part is of.
fn identity(part: &Part<'_>) -> Result<Identity> {
    let missing = |key: &str| {
        of_file(
            part.path,
            format!("does not state its {key}; expected a picture of `organza render`"),
        )
    };
    let value = |key: &'static str| part.stored.attributes.get(key).ok_or_else(|| missing(key));
    let crop: Vec<u32> = value("crop")?
        .split(',')
        .filter_map(|n| n.parse().ok())
        .collect();
    Ok(Identity {
        code: value("code")?.to_owned(),
        seed: value("seed")?.parse().map_err(|_| missing("seed"))?,
        crop: crop.try_into().map_err(|_| missing("crop"))?,
        engine: EngineKind::of_backend(value("backend")?),
        engines: String::new(),
        inputs: serde_json::from_str(value("inputs")?).map_err(|_| missing("inputs"))?,
        scene: value("identity")?.to_owned(),
    })
}
