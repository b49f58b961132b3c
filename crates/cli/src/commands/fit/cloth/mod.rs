//! Fitting a woven cloth to photographs: its threads, its draft, its yarns and colours.

mod agreement;
mod answer;
mod broyden;
mod equations;
mod first_guess;
pub mod flags;
mod means;
mod model;
mod photographs;
mod pictures;
mod placed;
mod recognise;
mod search;
mod settled;
mod sides;
mod unknowns;

use super::flag_groups::{refuse_given, volume_flags};
use super::{FitArgs, FitWhat, finish_with};
use crate::error::input;
use crate::output::{self, note};
use crate::progress::Progress;
use crate::waiting::Waiting;
use agreement::Agreement;
use answer::{Answer, shown_name};
use anyhow::Result;
use means::matched;
use model::{ClothModel, Purpose, Trial};
use organza_photograph::{
    FINE_PX, Photograph, PhotographError, Repeat, ThreadGrid, repeats, straightened,
};
use organza_weave::Draft;
use photographs::Photographs;
use placed::Placed;
use recognise::{Candidate, look, recognise, widest};
use search::Search;
use sides::{Side, Taken};
use std::path::Path;

/// Repeats that are considered.
const REPEATS: usize = 3;

/// Share of the folded photograph that the best draft must explain.
const MIN_LIKENESS: f64 = 0.6;

/// Below it the answer warns that its draft is a guess.
const SURE: f64 = 0.3;

/// Spacing of threads whose pictures take no longer than they must.
const LOOKED_AT_MM: f64 = 0.5;

/// Paths per texel of the trial cloth by default.
const PATHS: u64 = 60;

/// The cloth whose widths are printed.
const SHOWN: Purpose<'static> = Purpose::Picture {
    threads: 16,
    seed: 1,
    most_fibres: f64::INFINITY,
};

/// Refuses, for other fits, flags that only photographs of a cloth have, and a missing fabric.
///
/// # Errors
/// Names the flag.
pub fn refuse_elsewhere(args: &FitArgs) -> Result<()> {
    refuse_given(&args.cloth.given(), "applies only to --what cloth")?;
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
    let of_back = [
        ("--back-light", args.back_light.is_some()),
        ("--back-light-mm", args.cloth.back_light_mm.is_some()),
    ];
    if args.back.is_none() {
        refuse_given(&of_back, "needs --back, the photograph against the light")?;
    }
    Ok(())
}

/// The draft that the arguments name: a weave, or a WIF file.
fn given_draft(args: &FitArgs) -> Result<Option<Draft>> {
    let Some(name) = &args.cloth.draft else {
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

/// Compares the front with the drafts that repeats allow, or with the given one.
fn see(
    taken: &Taken<'_>,
    repeats: &[Repeat],
    model: &ClothModel<'_>,
    given: Option<&Draft>,
    may_guess: bool,
    step: &mut dyn FnMut(),
) -> Result<Option<Seen>> {
    if let Some(draft) = given {
        let side = taken.front(Repeat::of_draft(draft));
        let candidates = recognise(model, &side, vec![draft.clone()], may_guess, step)?;
        return Ok(Some(Seen { side, candidates }));
    }
    let mut best: Option<Seen> = None;
    for repeat in repeats {
        let drafts = repeat.drafts();
        if drafts.is_empty() {
            continue;
        }
        let side = taken.front(*repeat);
        let candidates = recognise(model, &side, drafts, may_guess, step)?;
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
    Ok(best)
}

/// How certain the draft of the best candidate is, from 0 to 1.
///
/// # Errors
/// No draft explains the photograph, unless it `is_given` or a guess will do, or none is as certain
/// as must be accepted.
fn confidence(seen: &Seen, is_given: bool, may_guess: bool, accepted: f64) -> Result<f64, String> {
    let none = |seen: String| PhotographError::NoWeave { seen }.to_string();
    let left = |c: &Candidate| 1.0 - c.likeness.of_fold;
    let Some(first) = seen.candidates.first() else {
        return Err(none("no draft has this repeat".into()));
    };
    let name = shown_name(&first.draft);
    if first.likeness.of_fold < MIN_LIKENESS && !may_guess {
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
        Some(second) => (1.0 - (left(first) / left(second).max(1e-9)).powi(2)).max(0.0),
    };
    if confidence < accepted && !is_given {
        let second = seen.candidates.get(1).map(|c| shown_name(&c.draft));
        return Err(none(format!(
            "{name} and {} are as similar (confidence {confidence:.2}, expected at least \
             {accepted}); give the weave with --draft",
            second.unwrap_or_default()
        )));
    }
    Ok(confidence)
}

/// Photographs in which threads were found.
struct Ready {
    photographs: Photographs,
    grid: ThreadGrid,
    /// How crossings may repeat, the likeliest first.
    repeats: Vec<Repeat>,
}

/// The photographs as they are, where single threads can be seen and repeat, otherwise straightened.
///
/// # Errors
/// They show no threads.
fn ready(photographs: Photographs) -> Result<Ready, PhotographError> {
    let all: Vec<&Photograph> = photographs.all().collect();
    // A photograph against the light may not show the weave.
    let straight = |fine_px: f64| {
        let found = straightened(&all, fine_px);
        found.or_else(|_| straightened(&all[..1], fine_px))
    };
    let fine = straight(FINE_PX);
    let found = match fine {
        Ok(Some(s)) => Some(s),
        Ok(None) | Err(_) => {
            let whole = ThreadGrid::find(&photographs.front.photograph);
            let repeats_of = |grid: &ThreadGrid| -> Vec<Repeat> {
                let list = repeats(&photographs.front.flat(), grid, REPEATS);
                list.into_iter().map(|r| r.0).collect()
            };
            let list = whole.as_ref().map(&repeats_of).unwrap_or_default();
            match (whole, fine) {
                (Ok(grid), fine) if !list.is_empty() || fine.is_err() => {
                    return Ok(Ready {
                        repeats: list,
                        photographs,
                        grid,
                    });
                }
                // What was said of waves says more than what was said of single threads.
                (Err(_), Err(why)) => return Err(why),
                _ => straight(f64::INFINITY)?,
            }
        }
    };
    let nothing = || PhotographError::NoWeave {
        seen: "the crossings of the threads do not repeat".to_owned(),
    };
    let s = found.ok_or_else(nothing)?;
    Ok(Ready {
        photographs: photographs.straightened(&s),
        grid: s.grid,
        repeats: vec![s.lattice.repeat],
    })
}

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<()> {
    refuse_flags(args)?;
    let front = args.front.as_deref();
    let front = front.ok_or_else(|| input("--front: expected a photograph of the cloth"))?;
    if let Some(folder) = &args.cloth.report {
        output::check_report_folder(folder, ("choices.csv", "the report of a bench"))?;
        output::check_report_folder(folder, ("pairs.csv", "a comparison"))?;
    }
    let _waiting = Waiting::new("fitting", &args.common);
    let given = given_draft(args)?;
    let fail = |why: String| input(format!("{}: {why}", front.display()));
    let ready = ready(Photographs::read(args, front)?).map_err(|e| fail(e.to_string()))?;
    let mm_per_px =
        ready.photographs.size_mm.x / ready.photographs.front.photograph.size()[0] as f64;
    let spacing_mm = ready.grid.spacing_px().map(|s| s * mm_per_px);
    let taken = Taken::new(args, &ready.photographs, &ready.grid);
    let model = ClothModel::new(args, spacing_mm, taken.turn_deg)?;
    // Thick threads look as thin ones do, and take longer: the draft is found with thin ones.
    let is_parallel = args.cloth.camera_mm.is_none() && args.cloth.light_mm.is_none();
    let smaller = match is_parallel {
        true => (spacing_mm[0].min(spacing_mm[1]) / LOOKED_AT_MM).max(1.0),
        false => 1.0,
    };
    let small = ClothModel::new(args, spacing_mm.map(|s| s / smaller), taken.turn_deg)?;
    let progress = Progress::new("fitting", 120, &args.common);
    let mut count = 0;
    let mut step = || {
        count += 1;
        progress.at(count);
    };
    let is_even = ready.photographs.is_even;
    let seen = see(
        &taken,
        &ready.repeats,
        &small,
        given.as_ref(),
        is_even,
        &mut step,
    )?;
    let mut seen = seen.ok_or_else(|| {
        let seen = "the crossings of the threads do not repeat".to_owned();
        fail(PhotographError::NoWeave { seen }.to_string())
    })?;
    let accepted = args.cloth.accept.unwrap_or(0.0);
    let confidence = confidence(&seen, given.is_some(), is_even, accepted).map_err(fail)?;
    if confidence < SURE && given.is_none() && !args.common.quiet {
        let likely = seen.candidates.iter().take(3);
        let likely: Vec<String> = likely.map(|c| shown_name(&c.draft)).collect();
        note!(
            "organza: warning: {}: the draft is a guess (confidence {confidence:.2}); as likely are {}; \
             --draft chooses",
            front.display(),
            likely.join(", ")
        );
    }
    if is_even
        && !args.cloth.quick
        && let Some(first) = seen.candidates.first_mut()
    {
        *first = widest(&small, &seen.side, first, &mut step);
    }
    for candidate in &mut seen.candidates {
        candidate.trial.tex = candidate.trial.tex.map(|t| t * smaller * smaller);
    }
    let recognised = Recognised {
        seen,
        confidence,
        is_given: given.is_some(),
    };
    let result = fit(args, front, &ready, &taken, &model, recognised, &mut step);
    progress.finish();
    result
}

/// A draft that was recognised or given.
struct Recognised {
    seen: Seen,
    confidence: f64,
    is_given: bool,
}

/// Finds the values of a cloth whose draft is known, and writes them.
fn fit(
    args: &FitArgs,
    front: &Path,
    ready: &Ready,
    taken: &Taken<'_>,
    model: &ClothModel<'_>,
    recognised: Recognised,
    step: &mut dyn FnMut(),
) -> Result<()> {
    let Recognised {
        seen,
        confidence,
        is_given,
    } = recognised;
    let best = seen.candidates[0].clone();
    let mut places = vec![Placed::of(&best.likeness)];
    let mut sides = vec![seen.side];
    if let Some(side) = taken.back(sides[0].fold.repeat) {
        step();
        let there = look(model, &side, &best.draft, best.trial.tex)?;
        places.push(Placed::of(&there.likeness));
        sides.push(side);
    }
    let start = Trial {
        lights_deg: [0, sides.len() - 1].map(|k| sides[k].view.light_deg),
        ..best.trial
    };
    let paths = args.spp.unwrap_or(PATHS);
    let mut search = Search::new(model, &best.draft, sides, paths);
    let found = match (args.cloth.quick, ready.photographs.is_even) {
        (true, _) => matched(&search, (start, places), 0, step)?,
        (_, true) => matched(&search, (start, places), means::PICTURES, step)?,
        _ => search.run(start, places, step)?,
    };

    let name = Purpose::Answer("fitted to photographs");
    let table = model.table(&best.draft, &found.trial, name);
    let figures = model
        .fabric(&best.draft, &found.trial, SHOWN)?
        .cloth
        .figures();
    let answer = Answer {
        grid: &ready.grid,
        spacing_mm: model.spacing_mm,
        widths_mm: [figures.warp, figures.weft].map(|f| f.map_or(0.0, |f| f.width_mm)),
        draft: &best.draft,
        confidence,
        second: seen
            .candidates
            .get(1)
            .map(|c| &c.draft)
            .filter(|_| !is_given),
        is_given,
        found: &found,
        agreement: (search.sides.iter().zip(&found.pictures))
            .map(|(side, picture)| Agreement::new(side, picture))
            .collect(),
        sides: &search.sides,
    };
    let words = answer.words();
    let page = match &args.cloth.report {
        None => None,
        Some(_) => Some(answer.page(args, front, &ready.photographs)?),
    };
    finish_with(
        args,
        &table,
        &found.parameters,
        &words,
        (answer.figures(), page),
    )
}
