//! Fitting a woven cloth to photographs: its threads, its draft, its yarns and colours.

mod agreement;
mod model;
mod recognise;
mod search;
mod sides;

use super::flag_groups::{refuse_given, volume_flags};
use super::{FitArgs, FitWhat, finish_with};
use crate::error::input;
use crate::output;
use crate::progress::Progress;
use agreement::Agreement;
use anyhow::Result;
use model::{ClothModel, SYSTEMS};
use organza_photograph::{Photograph, PhotographError, Repeat, ThreadGrid, name_of, repeats};
use organza_report::PhotographFit;
use organza_weave::Draft;
use recognise::{Candidate, look, recognise};
use search::{Found, Placed, Search};
use serde_json::{Value, json};
use sides::{Side, Taken};
use std::path::Path;

/// Repeats that are considered.
const REPEATS: usize = 3;

/// Share of the folded photograph that the best draft must explain.
const MIN_LIKENESS: f64 = 0.6;

/// Least confidence in a draft that was not given.
const MIN_CONFIDENCE: f64 = 0.3;

/// Paths per texel by default.
const PATHS: u64 = 96;

/// Paths per texel while drafts are compared.
const LOOKS: u64 = 16;

/// Refuses, for other fits, flags that only photographs of a cloth have, and a missing fabric.
///
/// # Errors
/// Names the flag.
pub fn refuse_elsewhere(args: &FitArgs) -> Result<()> {
    let own = [
        ("--draft", args.draft.is_some()),
        ("--report", args.report.is_some()),
    ];
    refuse_given(&own, "applies only to --what cloth")?;
    if args.what != FitWhat::Plies {
        let pictures = [
            ("--front", args.front.is_some()),
            ("--back", args.back.is_some()),
            ("--back-light", args.back_light.is_some()),
        ];
        refuse_given(&pictures, "applies only to --what cloth and --what plies")?;
    }
    if args.fabric.is_none() {
        return Err(input(
            "<FABRIC>: expected a fabric file, a scene or a volume file; only --what cloth needs none",
        ));
    }
    Ok(())
}

/// Refuses flags that a fit to photographs does not have.
fn refuse_flags(args: &FitArgs) -> Result<()> {
    let searches = [
        ("--data", args.data.is_some()),
        ("--journal", args.journal.is_some()),
        ("--patience", args.patience.is_some()),
    ];
    let others = [&searches[..], &volume_flags(args)].concat();
    refuse_given(&others, "does not apply to --what cloth")?;
    if args.back_light.is_some() && args.back.is_none() {
        return Err(input(
            "--back-light: needs --back, the photograph against the light",
        ));
    }
    Ok(())
}

/// A photograph from a file.
fn read(args: &FitArgs, path: &Path) -> Result<Photograph> {
    let (size, pixels) =
        super::picture::read_picture(path, &args.common.host, args.memory.max_memory)?;
    let rows: Vec<[f32; 3]> = pixels.iter().map(|p| p.0.to_array()).collect();
    Photograph::new(size.x as usize, size.y as usize, &rows)
        .map_err(|e| input(format!("{}: {e}", path.display())))
}

/// The draft that the arguments name: a weave, or a WIF file.
fn given_draft(args: &FitArgs) -> Result<Option<Draft>> {
    let Some(name) = &args.draft else {
        return Ok(None);
    };
    let path = Path::new(name);
    let is_wif = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("wif"));
    let draft = if is_wif {
        let bytes = args.common.host.loader().bytes(path)?;
        Draft::from_wif(&bytes).map_err(|e| input(format!("{name}: {e}")))?
    } else {
        Draft::named(name).map_err(|e| input(format!("--draft: {e}")))?
    };
    let (ends, picks) = draft.repeat();
    let most = organza_photograph::MAX_CROSSINGS;
    if ends > most || picks > most {
        return Err(input(format!(
            "--draft: repeats after {ends} x {picks} threads, expected at most {most} x {most}"
        )));
    }
    Draft::from_fn(ends, picks, |e, p| draft.warp_up(e, p))
        .map(Some)
        .map_err(|e| input(format!("--draft: {e}")))
}

/// The front as it was recognised.
struct Seen {
    side: Side,
    candidates: Vec<Candidate>,
}

/// Compares the photograph with the drafts that its repeats allow, or with the given one.
fn see(
    taken: &Taken<'_>,
    photograph: &Photograph,
    grid: &ThreadGrid,
    model: &ClothModel<'_>,
    given: Option<&Draft>,
    paths: u64,
    step: &mut dyn FnMut(),
) -> Result<Seen> {
    if let Some(draft) = given {
        let repeat = Repeat::of_draft(draft);
        let side = taken.front(photograph, grid, repeat);
        let candidates = recognise(model, &side, vec![draft.clone()], paths, step)?;
        return Ok(Seen { side, candidates });
    }
    let mut best: Option<Seen> = None;
    for (repeat, _) in repeats(photograph, grid, REPEATS) {
        let drafts = repeat.drafts();
        if drafts.is_empty() {
            continue;
        }
        let side = taken.front(photograph, grid, repeat);
        let candidates = recognise(model, &side, drafts, paths, step)?;
        let share = |s: &Seen| {
            s.candidates
                .first()
                .map_or(0.0, |c| c.likeness.of_photograph)
        };
        let seen = Seen { side, candidates };
        // A repeat that explains nearly as much must be better by more than noise.
        if best.as_ref().is_none_or(|b| share(&seen) > 1.15 * share(b)) {
            best = Some(seen);
        }
        if best.as_ref().is_some_and(|b| {
            b.candidates
                .first()
                .is_some_and(|c| c.likeness.of_fold > MIN_LIKENESS)
        }) {
            break;
        }
    }
    best.ok_or_else(|| {
        let seen = "the crossings of the threads do not repeat".to_owned();
        input(PhotographError::NoWeave { seen }.to_string())
    })
}

/// How certain the draft of the best candidate is, from 0 to 1.
///
/// # Errors
/// Why no draft is certain enough, unless it `is_given`.
fn confidence(seen: &Seen, is_given: bool) -> Result<f64, String> {
    let none = |seen: String| PhotographError::NoWeave { seen }.to_string();
    let left = |c: &Candidate| 1.0 - c.likeness.of_fold;
    let Some(first) = seen.candidates.first() else {
        return Err(none("no draft has this repeat".into()));
    };
    let name = shown_name(&first.draft);
    if first.likeness.of_fold < MIN_LIKENESS {
        let hint = if is_given {
            "; check --draft, --light and --width-mm"
        } else {
            "; a knit, or cloth of several colours of thread, is no answer"
        };
        return Err(none(format!(
            "the most similar weave, {name}, explains {:.0} % of the repeated picture, expected \
             at least {:.0} %{hint}",
            100.0 * first.likeness.of_fold.max(0.0),
            100.0 * MIN_LIKENESS
        )));
    }
    let confidence = match seen.candidates.get(1) {
        _ if is_given => 1.0,
        None => first.likeness.of_fold,
        Some(second) => 1.0 - (left(first) / left(second).max(1e-9)).powi(2),
    };
    if confidence < MIN_CONFIDENCE && !is_given {
        let second = seen.candidates.get(1).map(|c| shown_name(&c.draft));
        return Err(none(format!(
            "{name} and {} are as similar (confidence {confidence:.2}, expected at least \
             {MIN_CONFIDENCE}); give the weave with --draft",
            second.unwrap_or_default()
        )));
    }
    Ok(confidence)
}

/// The name of a draft, or its rows.
fn shown_name(draft: &Draft) -> String {
    name_of(draft).unwrap_or_else(|| draft.drawdown().trim().replace('\n', "/"))
}

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<()> {
    refuse_flags(args)?;
    let front = args.front.as_deref();
    let front = front.ok_or_else(|| input("--front: expected a photograph of the cloth"))?;
    let Some(width_mm) = args.width_mm else {
        return Err(input(
            "--width-mm: expected the width of the cloth in the photograph, mm",
        ));
    };
    if let Some(folder) = &args.report {
        output::check_report_folder(folder, ("choices.csv", "the report of a bench"))?;
        output::check_report_folder(folder, ("pairs.csv", "a comparison"))?;
    }
    let given = given_draft(args)?;
    let photograph = read(args, front)?;
    let back = args.back.as_deref();
    let back = back.map(|path| read(args, path).map(|p| (path, p)));
    let back = back.transpose()?;
    let fail = |why: String| input(format!("{}: {why}", front.display()));
    if let Some((path, back)) = &back
        && back.size() != photograph.size()
    {
        let [w, h] = photograph.size();
        return Err(input(format!(
            "{}: has {} x {} pixels; expected {w} x {h}, as the front has",
            path.display(),
            back.size()[0],
            back.size()[1]
        )));
    }
    let mm_per_px = width_mm / photograph.size()[0] as f64;
    let grid = ThreadGrid::find(&photograph).map_err(|e| fail(e.to_string()))?;
    let spacing_mm = grid.spacing_px().map(|s| s * mm_per_px);
    let model = ClothModel::new(args, spacing_mm)?;
    let taken = Taken::new(args, &grid);
    let progress = Progress::new("fitting", 160, &args.common);
    let mut count = 0;
    let mut step = || {
        count += 1;
        progress.at(count);
    };
    let paths = args.spp.unwrap_or(PATHS);
    let seen = see(
        &taken,
        &photograph,
        &grid,
        &model,
        given.as_ref(),
        LOOKS,
        &mut step,
    )?;
    let confidence = confidence(&seen, given.is_some()).map_err(fail)?;
    let best = seen.candidates[0].clone();
    let placed = |c: &Candidate| Placed {
        shift: c.likeness.shift,
        blur: c.likeness.blur,
    };
    let mut places = vec![placed(&best)];
    let mut sides = vec![seen.side];
    if let Some((_, photograph)) = &back {
        let grid = grid.refined(photograph);
        let side = taken.back(photograph, &grid, sides[0].fold.repeat);
        step();
        let there = look(&model, &side, &best.draft, best.trial.tex, LOOKS)?;
        places.push(placed(&there));
        sides.push(side);
    }
    let search = Search::new(&model, &best.draft, &sides, paths);
    let found = search.run(best.trial, places, &mut step)?;
    progress.finish();

    let table = model.table(&best.draft, &found.trial, Some("fitted to photographs"));
    let figures = model.fabric(&best.draft, &found.trial)?.cloth.figures();
    let widths_mm = [figures.warp, figures.weft].map(|f| f.map_or(0.0, |f| f.width_mm));
    let folded = search.targets();
    let agreement: Vec<Agreement> = (sides.iter().zip(folded).zip(&found.pictures))
        .map(|((side, folded), picture)| Agreement::new(side, folded, picture))
        .collect();
    let words = words(&Answer {
        grid: &grid,
        spacing_mm,
        widths_mm,
        draft: &best.draft,
        confidence,
        is_given: given.is_some(),
        found: &found,
        sides: &sides,
        agreement: &agreement,
    });
    let page = match &args.report {
        None => None,
        Some(_) => {
            let photographs = std::iter::once(&photograph).chain(back.iter().map(|b| &b.1));
            let pictures = photographs
                .zip(folded)
                .zip(found.pictures.iter().zip(&agreement));
            let shown = sides.iter().zip(pictures);
            let shown = shown.map(|(side, ((whole, folded), (picture, agreement)))| {
                agreement::shown(side, whole, folded, picture, agreement)
            });
            let page = PhotographFit {
                title: format!("Fitted to {}", front.display()),
                command: args.common.host.command_line(),
                lines: words.clone(),
                sides: shown.collect(),
            };
            Some(page.html()?)
        }
    };
    let sides: Vec<Value> = sides
        .iter()
        .zip(&agreement)
        .map(|(s, a)| a.json(s.name))
        .collect();
    let figures = json!({
        "spacing_mm": spacing_mm,
        "angles_deg": grid.angles_deg(),
        "draft": shown_name(&best.draft),
        "confidence": confidence,
        "widths_mm": widths_mm,
        "residual": found.residual,
        "sides": sides,
    });
    finish_with(args, &table, &found.parameters, &words, (figures, page))
}

/// What a fit prints.
struct Answer<'a> {
    grid: &'a ThreadGrid,
    spacing_mm: [f64; 2],
    widths_mm: [f64; 2],
    draft: &'a Draft,
    confidence: f64,
    is_given: bool,
    found: &'a Found,
    sides: &'a [Side],
    agreement: &'a [Agreement],
}

fn words(a: &Answer<'_>) -> Vec<String> {
    let mut list = Vec::new();
    let angles = a.grid.angles_deg();
    for (k, system) in SYSTEMS.into_iter().enumerate() {
        let tex = &a.found.parameters[k];
        list.push(format!(
            "{system}: {:.3} threads per cm, turned by {:.2} degrees; width {:.4} +- {:.4} mm; \
             colour {}",
            10.0 / a.spacing_mm[k],
            angles[k],
            a.widths_mm[k],
            0.5 * a.widths_mm[k] * tex.se / tex.value.max(1e-9),
            triple(a.found.trial.colours[k]),
        ));
    }
    list.push(match a.is_given {
        true => format!("draft: {}, given", shown_name(a.draft)),
        false => format!(
            "draft: {}, confidence {:.2}",
            shown_name(a.draft),
            a.confidence
        ),
    });
    for (side, agreement) in a.sides.iter().zip(a.agreement) {
        list.push(format!("{}: {agreement}", side.name));
    }
    list
}

fn triple([r, g, b]: [f64; 3]) -> String {
    format!("{r:.4} {g:.4} {b:.4}")
}
