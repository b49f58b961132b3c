//! Fitting a woven cloth to photographs: its threads, its draft, its yarns and colours.

mod agreement;
mod answer;
mod broyden;
mod equations;
mod first_guess;
pub mod flags;
mod means;
pub(crate) mod model;
mod photographs;
mod pictures;
mod placed;
mod recognise;
mod search;
mod settled;
mod sides;
mod stripes;
mod unknowns;

use super::{Fit, FitJob, finish_with};
use agreement::Agreement;
use answer::{Answer, shown_name};
use anyhow::Result;
use means::matched;
use model::{ClothModel, Purpose, Trial};
use organza_basis::Stopped;
use organza_photograph::{
    FINE_PX, Photograph, PhotographError, Repeat, ThreadColours, ThreadGrid, repeats, straightened,
};
use organza_weave::Draft;
use organza_work::Progress;
use organza_work::Waiting;
use organza_work::output;
use organza_work::{of_file, of_option};
use photographs::Photographs;
use placed::Placed;
use recognise::{Candidate, HOPELESS, look, recognise, widest};
use search::Search;
use sides::{Side, Taken};
use std::path::Path;
use std::rc::Rc;

/// Repeats that are considered.
const REPEATS: usize = 3;

/// Share of the folded photograph that the best draft must explain.
const MIN_LIKENESS: f64 = 0.6;

/// Below it the answer warns that its draft is a guess.
const SURE: f64 = 0.6;
/// Drafts that are named with how likely they are.
const NAMED: usize = 3;

/// Spacing of threads whose pictures take no longer than they must.
const LOOKED_AT_MM: f64 = 0.5;

/// Paths per texel of the trial cloth by default.
const PATHS: u64 = 60;

/// Share of what one colour of each place of a repeat leaves that threads of several colours explain.
const BEYOND: f64 = 0.4;
/// Radii, pixels, by which photographs are levelled to find the threads of striped cloth.
const LEVEL_PX: [usize; 2] = [3, 5];

/// The cloth whose widths are printed.
const SHOWN: Purpose<'static> = Purpose::Picture {
    threads: 16,
    seed: 1,
    most_fibres: f64::INFINITY,
};

fn is_wif(name: &str) -> bool {
    let ending = Path::new(name).extension();
    ending.is_some_and(|e| e.eq_ignore_ascii_case("wif"))
}

fn named_draft(name: &str) -> Result<Draft> {
    Draft::named(name).map_err(|e| of_option("draft", e))
}

/// The draft that the arguments name: a weave, or a WIF file.
fn given_draft(args: &FitJob) -> Result<Option<Draft>> {
    let Some(name) = &args.draft else {
        return Ok(None);
    };
    let draft = if is_wif(name) {
        let bytes = args.context.loader().bytes(Path::new(name))?;
        Draft::from_wif(&bytes).map_err(|e| of_file(name, e))?
    } else {
        named_draft(name)?
    };
    let (ends, picks) = draft.repeat();
    let most = organza_photograph::MAX_CROSSINGS;
    if ends > most || picks > most {
        return Err(of_option(
            "draft",
            format!("repeats after {ends} x {picks} threads, expected at most {most} x {most}"),
        ));
    }
    Draft::from_fn(ends, picks, |e, p| draft.warp_up(e, p))
        .map(Some)
        .map_err(|e| of_option("draft", e))
}

/// The front as it was recognised.
struct Seen {
    side: Side,
    candidates: Vec<Candidate>,
}

impl Seen {
    /// How likely each candidate is: as the inverse square of what it leaves of the fold, and one alone as
    /// what it explains.
    fn shares(&self) -> Vec<f64> {
        let weight = |c: &Candidate| (1.0 - c.likeness.of_fold).max(1e-3).powi(-2);
        let total: f64 = self.candidates.iter().map(weight).sum();
        match &self.candidates[..] {
            [only] => vec![only.likeness.of_fold],
            all => all.iter().map(|c| weight(c) / total).collect(),
        }
    }

    /// The likeliest drafts.
    fn likely(&self) -> Vec<(String, f64)> {
        let names = self.candidates.iter().map(|c| shown_name(&c.draft));
        names.zip(self.shares()).take(NAMED).collect()
    }
}

/// Called after each picture of a search, which ends where it was stopped.
type Step<'a> = &'a mut dyn FnMut() -> Result<(), Stopped>;

/// Compares the front with the drafts that repeats allow, or with the given one.
fn see(
    taken: &Taken<'_>,
    repeats: &[Repeat],
    model: &ClothModel<'_>,
    given: Option<&Draft>,
    may_guess: bool,
    step: Step<'_>,
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
    let Some(first) = seen.candidates.first() else {
        return Err(none("no draft has this repeat".into()));
    };
    let name = shown_name(&first.draft);
    if first.likeness.of_photograph < HOPELESS && !may_guess && !is_given {
        return Err(none(format!(
            "the most similar weave, {name}, explains {:.1} % of the picture, expected at least {:.0} %; a \
             knit, a blurred picture, or cloth of several colours of thread, is no answer",
            100.0 * first.likeness.of_photograph.max(0.0),
            100.0 * HOPELESS
        )));
    }
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
    let shares = seen.shares();
    let confidence = match is_given {
        true => 1.0,
        false => shares[0],
    };
    if confidence < accepted && !is_given {
        return Err(too_unlikely(&seen.likely(), accepted));
    }
    Ok(confidence)
}

/// Drafts with how likely they are, in words; none below a per cent.
fn named(likely: &[(String, f64)]) -> String {
    let likely = likely.iter().filter(|l| l.1 >= 0.01);
    let each = |(name, share): &(String, f64)| format!("{name} ({:.0} %)", 100.0 * share);
    let each: Vec<String> = likely.map(each).collect();
    each.join(", ")
}

/// Why drafts are refused that are less likely than must be accepted.
fn too_unlikely(likely: &[(String, f64)], accepted: f64) -> String {
    let seen = format!(
        "likely are {}, and {:.0} % are expected; give the weave with --draft",
        named(likely),
        100.0 * accepted
    );
    PhotographError::NoWeave { seen }.to_string()
}

/// Photographs in which threads were found.
struct Ready {
    photographs: Photographs,
    grid: ThreadGrid,
    /// How crossings may repeat, the likeliest first.
    repeats: Vec<Repeat>,
    /// Whether single threads cannot be seen, so that a guess must do.
    may_guess: bool,
}

/// The photographs straightened, if their threads have fewer pixels.
///
/// # Errors
/// They show no weave.
fn straight(photographs: &Photographs, fine_px: f64) -> Result<Option<Ready>, PhotographError> {
    let all: Vec<&Photograph> = photographs.all().collect();
    // A photograph against the light may not show the weave.
    let found =
        straightened(&all, fine_px).or_else(|_| straightened(&all[..1.min(all.len())], fine_px))?;
    Ok(found.map(|s| Ready {
        photographs: photographs.straightened(&s),
        grid: s.grid,
        repeats: vec![s.lattice.repeat],
        may_guess: fine_px.is_finite(),
    }))
}

/// The photographs as they are, where single threads can be seen and repeat, otherwise straightened.
///
/// # Errors
/// They show no threads.
fn ready(photographs: &Photographs) -> Result<Ready, PhotographError> {
    let fine = straight(photographs, FINE_PX);
    if let Ok(Some(ready)) = fine {
        return Ok(ready);
    }
    let found = ThreadGrid::find(&photographs.front.photograph).map(|grid| {
        let list = repeats(&photographs.front.flat(), &grid, REPEATS);
        Ready {
            photographs: photographs.clone(),
            grid,
            repeats: list.into_iter().map(|r| r.0).collect(),
            may_guess: false,
        }
    });
    match (found, fine) {
        (Ok(ready), fine) if !ready.repeats.is_empty() || fine.is_err() => Ok(ready),
        // What was said of waves says more than what was said of single threads.
        (Err(_), Err(why)) => Err(why),
        _ => straight(photographs, f64::INFINITY)?.ok_or_else(nothing_repeats),
    }
}

fn nothing_repeats() -> PhotographError {
    PhotographError::NoWeave {
        seen: "the crossings of the threads do not repeat".to_owned(),
    }
}

/// A draft that was recognised or given.
struct Recognised {
    seen: Seen,
    /// How likely it is.
    confidence: f64,
    is_given: bool,
    /// The likeliest drafts, and how likely they are.
    likely: Vec<(String, f64)>,
    /// Light of the threads of one repeat of stripes, as shares of the mean of warp and weft.
    stripes: Option<[Vec<[f64; 3]>; 2]>,
}

/// How threads and their cloth are computed.
struct Scaled<'a> {
    model: ClothModel<'a>,
    /// A smaller cloth that looks the same: thick threads take longer.
    small: ClothModel<'a>,
    smaller: f64,
}

impl<'a> Scaled<'a> {
    fn new(args: &'a FitJob, ready: &Ready) -> Result<Scaled<'a>> {
        let mm_per_px =
            ready.photographs.size_mm.x / ready.photographs.front.photograph.size()[0] as f64;
        let spacing_mm = ready.grid.spacing_px().map(|s| s * mm_per_px);
        let turn_deg = Taken::new(args, &ready.photographs, &ready.grid).turn_deg;
        let is_parallel = args.camera_mm.is_none() && args.light_mm.is_none();
        let smaller = match is_parallel {
            true => (spacing_mm[0].min(spacing_mm[1]) / LOOKED_AT_MM).max(1.0),
            false => 1.0,
        };
        Ok(Scaled {
            model: ClothModel::new(args, spacing_mm, turn_deg)?,
            small: ClothModel::new(args, spacing_mm.map(|s| s / smaller), turn_deg)?,
            smaller,
        })
    }
}

/// The draft of photographs, or why there is none.
fn known(
    args: &FitJob,
    ready: &Ready,
    scaled: &Scaled<'_>,
    given: Option<&Draft>,
    step: Step<'_>,
) -> Result<Result<Recognised, String>> {
    let taken = Taken::new(args, &ready.photographs, &ready.grid);
    let (repeats, may_guess) = (&ready.repeats, ready.may_guess);
    let Some(seen) = see(&taken, repeats, &scaled.small, given, may_guess, step)? else {
        return Ok(Err(nothing_repeats().to_string()));
    };
    let accepted = args.accept.unwrap_or(0.0);
    let confidence = confidence(&seen, given.is_some(), may_guess, accepted);
    Ok(confidence.map(|confidence| Recognised {
        likely: seen.likely(),
        seen,
        confidence,
        is_given: given.is_some(),
        stripes: None,
    }))
}

/// The colours of the threads and where these lie, if a system has several.
fn thread_colours(ready: &Ready, given: Option<&Draft>) -> Option<(ThreadGrid, ThreadColours)> {
    if ready.photographs.is_even {
        return None;
    }
    let flat = ready.photographs.front.flat();
    // The waves of stripes are stronger than those of threads, which all look alike once levelled.
    let even = |radius_px: &usize| ThreadGrid::strongest(&flat.levelled(*radius_px));
    let found = LEVEL_PX.iter().filter_map(even);
    let found = found.filter_map(|g| Some((g, ThreadColours::find(&flat, &g, given)?)));
    found.max_by(|a, b| a.1.explained.total_cmp(&b.1.explained))
}

impl Ready {
    /// The same of cloth that has one colour of each system; the photograph against the light is left out.
    fn without(&mut self, grid: ThreadGrid, colours: &ThreadColours) {
        let front = &mut self.photographs.front;
        front.photograph = Rc::new(colours.evened(&front.photograph, &grid));
        self.photographs.back = None;
        self.grid = grid;
        self.repeats = vec![Repeat::of_draft(&colours.draft)];
    }
}

/// The target.
pub(crate) static TARGET: crate::Target = crate::Target {
    name: "cloth",
    about: "Threads, draft, yarn counts, colours and roughness of a woven cloth, from photographs",
    example: "--front front.png --back back.png --width-mm 8 --light 30,45 --back-light 150,45 -o fitted.toml",
    fields: &[
        "front",
        "back",
        "back_light",
        "light",
        "view",
        "width_mm",
        "white",
        "model",
        "draft",
        "accept",
        "quick",
        "crop",
        "report",
        "camera_mm",
        "light_mm",
        "back_light_mm",
        "vignetting",
        "fit_white",
        "fit_light",
        "voxel_um",
    ],
    check,
    run,
};

fn check(args: &Fit) -> Result<()> {
    if args.back.is_none() {
        let why = "needs --back, the photograph against the light";
        args.refuse(&["back_light", "back_light_mm"], why)?;
    }
    if args.quick {
        let why = "takes the whole search, which --quick leaves out";
        args.refuse(&["fit_white", "fit_light"], why)?;
    }
    front(args)?;
    photographs::width_mm(args)?;
    model::fitted(args)?;
    if let Some(name) = args.draft.as_ref().filter(|name| !is_wif(name)) {
        named_draft(name)?;
    }
    if let Some(folder) = &args.report {
        output::check_report_folder(folder, ("choices.csv", "the report of a bench"))?;
        output::check_report_folder(folder, ("pairs.csv", "a comparison"))?;
    }
    Ok(())
}

/// The photograph of the face.
fn front(args: &Fit) -> Result<&Path> {
    let front = args.front.as_deref();
    front.ok_or_else(|| of_option("front", "expected a photograph of the cloth"))
}

fn run(args: &FitJob) -> Result<super::Fitted> {
    let front = front(args)?;
    let _waiting = Waiting::new("fitting", &args.context);
    let given = given_draft(args)?;
    let given = given.as_ref();
    let fail = |why: String| of_file(front, why);
    let photographs = Photographs::read(args, front)?;
    let mut ready = ready(&photographs).map_err(|e| fail(e.to_string()))?;
    let progress = Progress::new("fitting", 120, &args.context);
    let mut count = 0;
    let mut step = || {
        count += 1;
        Stopped::check(progress.at(count))
    };
    let striped = thread_colours(&ready, given);
    let is_sure = |(_, found): &&(ThreadGrid, ThreadColours)| found.beyond_repeat > BEYOND;
    let mut colours = striped.as_ref().filter(is_sure);
    if let Some((grid, found)) = colours {
        ready.without(*grid, found);
    }
    let mut scaled = Scaled::new(args, &ready)?;
    let draft = colours.map(|(_, found)| &found.draft).or(given);
    let mut recognised = known(args, &ready, &scaled, draft, &mut step)?;
    // Threads of several colours may repeat as the draft does.
    if let (Err(_), None, Some((grid, found))) = (&recognised, colours, &striped) {
        colours = striped.as_ref();
        ready.without(*grid, found);
        scaled = Scaled::new(args, &ready)?;
        recognised = known(args, &ready, &scaled, Some(&found.draft), &mut step)?;
    }
    if colours.is_some() && args.back.is_some() {
        args.context.warn(format!(
            "{}: its threads have several colours, so the photograph against the light is \
             left out",
            front.display()
        ));
    }
    // Wrinkles move threads that are seen one by one, too.
    if recognised.is_err()
        && !ready.photographs.is_even
        && let Ok(Some(straight)) = straight(&photographs, f64::INFINITY)
    {
        let other = Scaled::new(args, &straight)?;
        if let Ok(found) = known(args, &straight, &other, given, &mut step)? {
            (ready, scaled, recognised, colours) = (straight, other, Ok(found), None);
        }
    }
    let mut recognised = recognised.map_err(fail)?;
    if let Some((_, found)) = colours {
        recognised.stripes = Some([0, 1].map(|k| found.sequence(k)));
        if given.is_none() {
            recognised.likely = found.likely.iter().take(NAMED).cloned().collect();
            recognised.confidence = recognised.likely.first().map_or(0.0, |l| l.1);
            recognised.is_given = false;
            let accepted = args.accept.unwrap_or(0.0);
            if recognised.confidence < accepted {
                return Err(fail(too_unlikely(&recognised.likely, accepted)));
            }
        }
    }
    if recognised.confidence < SURE && !recognised.is_given {
        args.context.warn(format!(
            "{}: the draft is a guess: likely are {}; --draft chooses",
            front.display(),
            named(&recognised.likely)
        ));
    }
    let taken = Taken::new(args, &ready.photographs, &ready.grid);
    let seen = &mut recognised.seen;
    if ready.photographs.is_even
        && !args.quick
        && let Some(first) = seen.candidates.first_mut()
    {
        *first = widest(&scaled.small, &seen.side, first, &mut step)?;
    }
    for candidate in &mut seen.candidates {
        candidate.trial.tex = candidate.trial.tex.map(|t| t * scaled.smaller.powi(2));
    }
    let result = fit(
        args,
        front,
        &ready,
        &taken,
        &scaled.model,
        recognised,
        &mut step,
    );
    progress.finish();
    result
}

/// Finds the values of a cloth whose draft is known, and writes them.
fn fit(
    args: &FitJob,
    front: &Path,
    ready: &Ready,
    taken: &Taken<'_>,
    model: &ClothModel<'_>,
    recognised: Recognised,
    step: Step<'_>,
) -> Result<super::Fitted> {
    let Recognised {
        seen,
        confidence,
        is_given,
        likely,
        stripes,
    } = recognised;
    let best = seen.candidates[0].clone();
    let mut places = vec![Placed::of(&best.likeness)];
    let mut sides = vec![seen.side];
    if let Some(side) = taken.back(sides[0].fold.repeat) {
        step()?;
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
    let found = match (args.quick, ready.photographs.is_even) {
        (true, _) => matched(&search, (start, places), 0, step)?,
        (_, true) => matched(&search, (start, places), means::PICTURES, step)?,
        _ => search.run(start, places, step)?,
    };

    let thread_colours = stripes::thread_colours(&search, &found.trial, stripes.as_ref(), step)?;
    let answer = Purpose::Answer {
        name: "fitted to photographs",
        colours: &thread_colours,
    };
    let table = model.table(&best.draft, &found.trial, answer);
    let figures = model
        .fabric(&best.draft, &found.trial, SHOWN)?
        .cloth
        .figures();
    let answer = Answer {
        grid: &ready.grid,
        spacing_mm: model.spacing_mm,
        thread_colours: &thread_colours,
        widths_mm: [figures.warp, figures.weft].map(|f| f.map_or(0.0, |f| f.width_mm)),
        draft: &best.draft,
        confidence,
        likely,
        is_given,
        found: &found,
        agreement: (search.sides.iter().zip(&found.pictures))
            .map(|(side, picture)| Agreement::new(side, picture))
            .collect(),
        sides: &search.sides,
    };
    let words = answer.words();
    let page = match &args.report {
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
