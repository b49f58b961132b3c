//! Fitting what fibres do not settle about plies: to explicit fibres of the same fabric, to
//! measured values, or to a picture lit from the front and one lit from behind at once.

mod corrections;
mod pictures;
mod target;

use super::descent::{moved, nearest};
use super::fibres::yarns;
use super::{
    Fit, FitJob, check_outputs, finish_with, journal_key, open_journal, options, read_fabric, table,
};
use anyhow::{Context, Result};
use corrections::Corrections;
use organza_measure::fit::determine;
use organza_scene::fabric_file::Fabric;
use organza_scene::patches::{Matter, PatchModel, fabric_patch};
use organza_scene::representation::{EXPLICIT_FIBRES, PLIES, ShownAs};
use organza_work::Progress;
use organza_work::building::watched;
use organza_work::identity;
use organza_work::number_journal::NumberJournal;
use organza_work::of_option;
use pictures::Pictures;
use serde_json::json;
use sha2::{Digest, Sha256};
use target::{GroupError, Part, Target, Value, errors};

/// Places that a descent evaluates by default: about ten steps.
const STEPS: u32 = 120;

/// Keys of entries of the journal that are no places of the search.
const OBSERVED: f64 = -1.0;
const HELD_OUT: f64 = -2.0;

/// The target.
pub(crate) static TARGET: crate::Target = crate::Target {
    name: "plies",
    about: "The [plies] section: what fibres do not settle about plies, from explicit fibres, measured values, or a picture lit from the front and one lit from behind",
    example: "scenes/fabrics/denim.toml -o fitted.toml --journal fit.journal",
    fields: &[
        "data",
        "model",
        "patience",
        "journal",
        "front",
        "back",
        "back_light",
        "light",
        "view",
        "width_mm",
        "white",
        "voxel_um",
    ],
    check,
    run,
};

fn run(args: &FitJob) -> Result<super::Fitted> {
    let (mut fabric, read) = read_fabric(args)?;
    check_outputs(args, &args.context, &read)?;
    let shown = PatchModel::Is(&PLIES).of(&fabric, args.fabric_path())?;
    (PLIES.check)(&fabric, args.fabric_path(), &args.context.loader())?;
    let source = Source::new(args, &fabric)?;
    let key = format!("plies {}", journal_key(args, &source.key(args)?, &read)?);
    let mut journal = open_journal(args, &key)?;
    let own = match &source {
        // Means of a picture do not tell yarns apart.
        Source::Is(Target::Pictures(_)) => Vec::new(),
        _ => yarns(&fabric),
    };
    let corrections = Corrections::new(own, &fabric.file.plies);
    // A fit starts from the model without corrections.
    fabric.file.plies = corrections.tables(&corrections.none);
    let target = source.target(args, &fabric, &mut journal)?;
    let mut plies = Fitted {
        args,
        fabric,
        shown,
        corrections: &corrections,
        target: &target,
        matter: None,
        journal,
    };
    let (place, residual, parameters) = plies.search()?;
    let mut judge = |place: &[f64]| -> Result<[Vec<GroupError>; 2]> {
        let fitted = errors(
            &plies.values(place, Part::Fitted)?,
            &target.values(Part::Fitted),
        );
        let held_out = plies.values(place, Part::HeldOut)?;
        Ok([fitted, errors(&held_out, &target.values(Part::HeldOut))])
    };
    let (before, after) = (judge(&corrections.none)?, judge(&place)?);
    let mut table = table(args, &[], &[])?;
    let section = toml::Value::try_from(corrections.tables(&place));
    table.insert(
        "plies".into(),
        section.context("the plies cannot be written")?,
    );
    let mut lines = vec![format!("Residual: {residual:.3} of the expected errors.")];
    let mut figures = json!({ "residual": residual });
    for (k, (name, key)) in [("Fitted", "fitted"), ("Held out", "held_out")]
        .into_iter()
        .enumerate()
    {
        for (before, after) in before[k].iter().zip(&after[k]) {
            lines.push(format!(
                "{name}: {}: {:.1} % before, {:.1} % after, noise {:.1} %",
                before.group,
                100.0 * before.rms,
                100.0 * after.rms,
                100.0 * after.noise
            ));
        }
        let list = |errors: &[GroupError]| errors.iter().map(GroupError::json).collect::<Vec<_>>();
        figures[key] = json!({ "before": list(&before[k]), "after": list(&after[k]) });
    }
    finish_with(args, &table, &parameters, &lines, (figures, None))
}

fn check(args: &Fit) -> Result<()> {
    let (front, back) = (args.front.is_some(), args.back.is_some());
    if front != back {
        let missing = if front { "--back" } else { "--front" };
        return Err(of_option(
            missing,
            "expected a picture, too: plies are fitted to one lit from the front and one lit from \
             behind at once",
        ));
    }
    if front && args.data.is_some() {
        return Err(of_option(
            "data",
            "plies are fitted to measured values or to pictures; give one of them",
        ));
    }
    if !front {
        let why = "applies only to pictures, --front and --back";
        let of_pictures = ["back_light", "light", "view", "width_mm", "white"];
        args.refuse(&of_pictures, why)?;
    }
    if let PatchModel::Is(model) = args.model {
        if front || args.data.is_some() {
            return Err(of_option(
                "model",
                "names what plies are fitted to; with --data or pictures there is no use for it",
            ));
        }
        if model == &PLIES {
            return Err(of_option(
                "model",
                "plies cannot be fitted to themselves; expected for example \"fibres\"",
            ));
        }
    }
    Ok(())
}

/// Where observed values come from.
enum Source {
    /// They are known.
    Is(Target),
    /// A representation of the same fabric.
    Patch(ShownAs),
}

impl Source {
    fn new(args: &FitJob, fabric: &Fabric) -> Result<Source> {
        Ok(match (&args.data, &args.front, &args.back) {
            (Some(path), ..) => Source::Is(Target::read(args, path)?),
            (_, Some(front), Some(back)) => {
                Source::Is(Target::Pictures(Pictures::read(args, front, back, fabric)?))
            }
            _ => {
                let model = match args.model {
                    PatchModel::Own => PatchModel::Is(&EXPLICIT_FIBRES),
                    given => given,
                };
                Source::Patch(model.of(fabric, args.fabric_path())?)
            }
        })
    }

    /// What the journal must know of it beside the flag `--data`.
    fn key(&self, args: &FitJob) -> Result<String> {
        if let Source::Patch(shown) = self {
            return Ok(shown.to_string());
        }
        let loader = args.context.loader();
        let mut key = String::new();
        for path in [&args.front, &args.back].into_iter().flatten() {
            key += &identity::hex(&Sha256::digest(&loader.bytes(path)?));
        }
        let taken = (
            args.light,
            args.back_light,
            args.view,
            args.width_mm,
            args.white,
        );
        Ok(format!("{key} {taken:?} {:?}", args.spp))
    }

    /// The observed values; those of a representation are measured, or come from the journal.
    fn target(self, args: &FitJob, fabric: &Fabric, journal: &mut NumberJournal) -> Result<Target> {
        let shown = match self {
            Source::Is(target) => return Ok(target),
            Source::Patch(shown) => shown,
        };
        let mut target = Target::unknown();
        let count = target.numbers().len();
        let progress = Progress::new("measuring", 1, &args.context);
        let numbers = journal.once(&[OBSERVED], count, || {
            let patch = watched(&args.context, |loader| {
                let options = options(args, loader);
                Ok(fabric_patch(fabric, args.fabric_path(), shown, &options)?)
            })?;
            target.measured(args, &patch)
        })?;
        progress.finish();
        target.set_numbers(&numbers);
        Ok(target)
    }
}

/// Plies whose corrections are searched for.
struct Fitted<'a> {
    args: &'a FitJob,
    fabric: Fabric,
    shown: ShownAs,
    corrections: &'a Corrections,
    target: &'a Target,
    /// No correction that is searched for changes the geometry.
    matter: Option<Matter>,
    journal: NumberJournal,
}

type Answer = (Vec<f64>, f64, Vec<organza_measure::fit::Determined>);

impl Fitted<'_> {
    /// Simulated values of a place, from the journal if it has them.
    fn values(&mut self, place: &[f64], part: Part) -> Result<Vec<Value>> {
        let wanted = self.target.values(part);
        let mut key = place.to_vec();
        if part == Part::HeldOut {
            key.push(HELD_OUT);
        }
        let (args, path) = (self.args, self.args.fabric_path());
        let (fabric, matter, target) = (&mut self.fabric, &mut self.matter, self.target);
        let (shown, tables) = (self.shown, self.corrections.tables(place));
        let numbers = self.journal.once(&key, 2 * wanted.len(), || {
            let loader = args.context.loader();
            let options = options(args, &loader);
            fabric.file.plies = tables;
            let matter = match matter {
                Some(matter) => matter,
                None => matter.insert(Matter::new(fabric, path, shown, &options)?),
            };
            let patch = matter.patch(fabric, path, &options)?;
            let values = target.simulate(args, &patch, part)?;
            Ok(values.iter().flat_map(|v| [v.mean, v.se]).collect())
        })?;
        let found = wanted.iter().zip(numbers.chunks_exact(2));
        let value = |(w, n): (&Value, &[f64])| Value {
            group: w.group,
            channel: w.channel,
            expected: w.expected,
            mean: n[0],
            se: n[1],
        };
        Ok(found.map(value).collect())
    }

    /// The best place, its residual, and the parameters with their errors.
    fn search(&mut self) -> Result<Answer> {
        let (args, corrections) = (self.args, self.corrections);
        let wanted = self.target.values(Part::Fitted);
        // The same everywhere, lest the search end where noise is largest.
        let start = self.values(&corrections.none, Part::Fitted)?;
        let expected = expected_errors(&start, &wanted);
        let mut residuals = |place: &[f64]| {
            let found = self.values(place, Part::Fitted)?;
            let both = found.iter().zip(&wanted).zip(&expected);
            let data = both.map(|((f, w), e)| (f.mean - w.mean) / e);
            Ok(data.chain(corrections.priors(place)).collect())
        };
        let (bounds, none) = (&corrections.bounds, Some(&corrections.none[..]));
        let (place, least) = nearest(args, bounds, [0, STEPS], none, &mut residuals)?;
        let columns = self.columns(&place, &expected)?;
        let freedom = wanted.len().saturating_sub(bounds.len()).max(1);
        let variance = least / freedom as f64;
        let parameters = determine(bounds, &place, &columns, variance.max(1.0));
        Ok((place, variance.sqrt(), parameters))
    }

    /// Derivatives of the differences, in expected errors, by each parameter. Noise looks like a
    /// derivative and would promise too much: columns are shortened by what it explains.
    fn columns(&mut self, place: &[f64], expected: &[f64]) -> Result<Vec<Vec<f64>>> {
        let base = self.values(place, Part::Fitted)?;
        let (mut columns, mut noises) = (Vec::new(), Vec::new());
        // Simulations share their random numbers. How much of the noise of a difference is left
        // is seen where there is nothing else: in channels that a parameter does not change.
        let (mut seen, mut expected_noise) = (0.0, 0.0);
        for k in 0..self.corrections.bounds.len() {
            let (moved, step) = moved(place, &self.corrections.bounds, k);
            let there = self.values(&moved, Part::Fitted)?;
            let own_channel = self.corrections.channel(k);
            let (mut column, mut noise) = (Vec::new(), 0.0);
            for ((a, b), e) in there.iter().zip(&base).zip(expected) {
                let change = (a.mean - b.mean) / (e * step);
                let variance = (a.se.powi(2) + b.se.powi(2)) / (e * step).powi(2);
                let is_other = a.channel.is_some() && own_channel.is_some();
                if is_other && a.channel != own_channel {
                    seen += change * change;
                    expected_noise += variance;
                    column.push(0.0);
                } else {
                    noise += variance;
                    column.push(change);
                }
            }
            columns.push(column);
            noises.push(noise);
        }
        let left = (seen / f64::max(expected_noise, f64::MIN_POSITIVE)).min(1.0);
        for (column, noise) in columns.iter_mut().zip(noises) {
            let own: f64 = column.iter().map(|x| x * x).sum();
            let signal = (own - left * noise).max(0.0);
            let share = (signal / own.max(f64::MIN_POSITIVE)).sqrt();
            column.iter_mut().for_each(|x| *x *= share);
        }
        Ok(columns)
    }
}

/// What is expected of the differences: noise of both, and a share of the value and of the root
/// mean square of its group.
fn expected_errors(found: &[Value], wanted: &[Value]) -> Vec<f64> {
    let rms = |group: &str| {
        let of_group = || wanted.iter().filter(|w| w.group == group);
        let square: f64 = of_group().map(|w| w.mean * w.mean).sum();
        (square / of_group().count().max(1) as f64).sqrt()
    };
    let both = found.iter().zip(wanted);
    let one = |(f, w): (&Value, &Value)| {
        let noise = f.se.hypot(w.se);
        let model = w.expected * w.mean.hypot(rms(w.group));
        noise.hypot(model).max(f64::MIN_POSITIVE)
    };
    both.map(one).collect()
}
