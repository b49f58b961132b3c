//! Fitting the fibres of a volume to measured reflection and transmission.

use super::descent::{is_final, moved, nearest};
use super::{
    FitJob, check_outputs, effort, finish, journal_key, measured, open_journal, options,
    read_fabric, table,
};
use anyhow::Result;
use organza_measure::fit::{Bound, determine};
use organza_measure::{
    Angles, Effort, Measured, Pair, PairValue, measure_albedos, measure_pairs, read_klems,
};
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::file_kind::Wanted;
use organza_scene::optics;
use organza_scene::patches::{AnyPatch, Matter};
use organza_scene::representation::{FittedOptics, ShownAs};
use organza_work::Context;
use organza_work::measured_values;
use organza_work::{of_file, of_key};
use std::collections::BTreeSet;
use toml::{Table, Value};

/// The data of a measurement, and how to simulate the same for a fabric.
pub enum Observed {
    /// Values of pairs.
    Pairs(Vec<PairValue>),
    /// Reflected and transmitted light of some directions.
    Hemispheres(Vec<(Angles, [Measured; 2])>),
}

impl Observed {
    /// Reads a table of pairs or a WINDOW file.
    ///
    /// # Errors
    /// Names the file and the place.
    pub fn read(path: &std::path::Path, context: &Context) -> Result<Observed> {
        let is_xml = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("xml"));
        if !is_xml {
            return Ok(Observed::Pairs(measured_values::read(path, context)?));
        }
        let bsdf = read_klems(&context.loader().text_of(path, Wanted::Text)?)
            .map_err(|e| of_file(path, e))?;
        let mut list = Vec::new();
        for (side, theta) in [(0, 0.0), (1, 180.0)] {
            for from in (0..bsdf.basis.len()).step_by(bsdf.basis.len() / 6) {
                let exact = |m| Measured::new(bsdf.hemispherical(m, from), [0.0; 3]);
                let [r, t] = [&bsdf.reflection[side], &bsdf.transmission[side]].map(exact);
                let angles = bsdf.incident(from, theta == 0.0);
                list.push((angles, [r, t]));
            }
        }
        Ok(Observed::Hemispheres(list))
    }

    /// The observed values.
    pub fn list(&self) -> Vec<Measured> {
        match self {
            Observed::Pairs(list) => list.iter().map(|v| v.bsdf).collect(),
            Observed::Hemispheres(list) => list.iter().flat_map(|(_, parts)| *parts).collect(),
        }
    }

    /// The same, to be changed, in the same order.
    pub fn list_mut(&mut self) -> Vec<&mut Measured> {
        match self {
            Observed::Pairs(list) => list.iter_mut().map(|v| &mut v.bsdf).collect(),
            Observed::Hemispheres(list) => list.iter_mut().flat_map(|(_, parts)| parts).collect(),
        }
    }

    /// Those entries, pairs or directions, that `is_kept` for their index.
    pub fn filtered(&self, is_kept: impl Fn(usize) -> bool) -> Observed {
        let kept = |k: &usize| is_kept(*k);
        match self {
            Observed::Pairs(list) => {
                let places = (0..list.len()).filter(kept);
                Observed::Pairs(places.map(|k| list[k]).collect())
            }
            Observed::Hemispheres(list) => {
                let places = (0..list.len()).filter(kept);
                Observed::Hemispheres(places.map(|k| list[k]).collect())
            }
        }
    }

    /// What each of them is.
    pub fn labels(&self) -> Vec<String> {
        let degrees = |a: &Angles| format!("{:.0},{:.0}", a.theta_deg, a.phi_deg);
        match self {
            Observed::Pairs(list) => list
                .iter()
                .map(|v| {
                    let pair = &v.pair;
                    format!("{} to {}", degrees(&pair.incident), degrees(&pair.exitant))
                })
                .collect(),
            Observed::Hemispheres(list) => list
                .iter()
                .flat_map(|(from, _)| {
                    ["reflected", "transmitted"].map(|part| format!("{part} of {}", degrees(from)))
                })
                .collect(),
        }
    }

    /// The observed values with their errors, channel by channel in one list.
    fn values(&self) -> Vec<[f64; 2]> {
        let list = self.list();
        let channels = list.iter().flat_map(|m| m.mean.into_iter().zip(m.se));
        channels.map(|(v, s)| [v, s]).collect()
    }

    /// The same of a patch.
    ///
    /// # Errors
    /// Those of the measurement.
    pub fn simulate(&self, args: &FitJob, patch: &AnyPatch) -> Result<Observed> {
        self.simulate_with(args, patch, &effort(args))
    }

    /// The same with another effort.
    ///
    /// # Errors
    /// Those of the measurement.
    pub fn simulate_with(
        &self,
        args: &FitJob,
        patch: &AnyPatch,
        effort: &Effort,
    ) -> Result<Observed> {
        Ok(match self {
            Observed::Pairs(list) => {
                let pairs: Vec<Pair> = list.iter().map(|v| v.pair).collect();
                Observed::Pairs(
                    measure_pairs(patch, &pairs, effort, &|_| args.context.flow())?.list,
                )
            }
            Observed::Hemispheres(list) => {
                let from: Vec<_> = list.iter().map(|l| l.0).collect();
                let results = measure_albedos(patch, &from, effort, &|_| args.context.flow())?;
                let parts = results.list.iter().map(|a| {
                    let through = Measured {
                        mean: std::array::from_fn(|c| a.transmitted.mean[c] + a.direct.mean[c]),
                        se: std::array::from_fn(|c| a.transmitted.se[c].hypot(a.direct.se[c])),
                    };
                    (a.incident, [a.reflected, through])
                });
                Observed::Hemispheres(parts.collect())
            }
        })
    }
}

/// Share of a value below which it need not be matched.
const TOLERANCE: f64 = 0.02;

/// Largest and least number of fibres, against the fabric's own.
const DENSITY: [f64; 2] = [0.5, 1.6];

/// The target.
pub(crate) static TARGET: crate::Target = crate::Target {
    name: "fibres",
    about: "Colour, roughness and density of the fibres, from measured values",
    example: "scenes/fabrics/denim.toml --data measured.csv -o fitted.toml",
    fields: &["data", "model", "patience", "journal", "voxel_um"],
    check: |args| measured(args).map(drop),
    run,
};

fn run(args: &FitJob) -> Result<super::Fitted> {
    let path = measured(args)?;
    let observed = Observed::read(path, &args.context)?;
    let values = observed.values();
    let unwatched = args.context.loader();
    let (fabric, read) = read_fabric(args)?;
    check_outputs(args, &args.context, &read)?;
    let (shown, fitted) = model(args, &fabric)?;
    let bounds = bounds(fitted, &fabric);
    let mut given_way = optics_given_way(args, fitted, &yarns(&fabric))?;
    given_way.extend(yarns(&fabric).iter().flat_map(|name| {
        // The number of fibres follows from `tex`, their place from the fraction.
        ["fibres_per_ply", "ply_radius_mm"].map(|key| format!("yarn.{name}.{key}"))
    }));
    let key = journal_key(args, &shown.to_string(), &read)?;
    let mut journal = open_journal(args, &key)?;
    let options = options(args, &unwatched);
    // Colour and roughness change no voxel; the last density comes first.
    let mut matter: Option<(f64, Matter)> = None;
    // The expected errors of the first place hold everywhere, lest the search end where noise is
    // largest.
    let mut errors: Option<Vec<f64>> = None;
    let mut residuals = |place: &[f64]| {
        let results = journal.once(place, 2 * values.len(), || {
            let keys = keys(args, fitted, &fabric, &bounds, place);
            let changed =
                fabric_file::load_changed(args.fabric_path(), &given_way, &keys, &unwatched)?;
            let density = place.last().copied().unwrap_or(1.0);
            let same = matter.take().filter(|(d, _)| *d == density);
            let (_, matter) = matter.insert(match same {
                Some(same) => same,
                None => (
                    density,
                    Matter::new(&changed, args.fabric_path(), shown, &options)?,
                ),
            });
            let patch = matter.patch(&changed, args.fabric_path(), &options)?;
            Ok(observed.simulate(args, &patch)?.values().concat())
        })?;
        let both = || results.chunks_exact(2).zip(&values);
        let errors = errors.get_or_insert_with(|| {
            let one = |(t, v): (&[f64], &[f64; 2])| t[1].hypot(v[1]).hypot(TOLERANCE * v[0]);
            both().map(one).map(|e| e.max(1e-4)).collect()
        });
        let one = |((t, v), e): ((&[f64], &[f64; 2]), &f64)| (t[0] - v[0]) / e;
        Ok(both().zip(errors.iter()).map(one).collect::<Vec<f64>>())
    };
    let (place, least) = nearest(args, &bounds, [0, 60], None, &mut residuals)?;
    let base = residuals(&place)?;
    let mut columns = Vec::new();
    for k in 0..bounds.len() {
        let (moved, step) = moved(&place, &bounds, k);
        let there = match residuals(&moved) {
            Err(e) if is_final(args, &e) => return Err(e),
            // What cannot be made changes nothing.
            there => there.unwrap_or_else(|_| base.clone()),
        };
        let quotient = |(a, b): (&f64, &f64)| (a - b) / step;
        columns.push(there.iter().zip(&base).map(quotient).collect());
    }
    let freedom = values.len().saturating_sub(bounds.len()).max(1);
    let variance = (least / freedom as f64).max(1.0);
    let parameters = determine(&bounds, &place, &columns, variance);
    let keys = keys(args, fitted, &fabric, &bounds, &place);
    let table = table(args, &given_way, &keys)?;
    let words = format!("Residual: {:.3} of the expected errors.", variance.sqrt());
    finish(args, &table, &parameters, &words)
}

/// Names of the yarns that have fibres in the cloth.
pub fn yarns(fabric: &Fabric) -> Vec<String> {
    let names: BTreeSet<String> = fabric
        .cloth
        .materials()
        .iter()
        .map(|m| m.yarn.clone())
        .collect();
    names.into_iter().collect()
}

/// How the cloth is shown, and which of its optics are fitted.
///
/// # Errors
/// Keys of `[scattering]` that contradict each other; a surface.
pub fn model(args: &FitJob, fabric: &Fabric) -> Result<(ShownAs, &'static FittedOptics)> {
    let shown = args.model.of(fabric, args.fabric_path())?;
    let fitted = shown.representation.fitted.ok_or_else(|| {
        of_file(
            args.fabric_path(),
            format!(
                "model {:?} has no fibres to fit; choose another with --model",
                shown.representation.name
            ),
        )
    })?;
    Ok((shown, fitted))
}

fn bounds(fitted: &FittedOptics, fabric: &Fabric) -> Vec<Bound> {
    let mut list = Vec::new();
    let mut add = |name: String, [low, high]: [f64; 2], start: f64| {
        list.push(Bound {
            name,
            low,
            high,
            start,
        });
    };
    for yarn in yarns(fabric) {
        for (letter, c) in ["r", "g", "b"].into_iter().zip(own_colour(fabric, &yarn)) {
            add(format!("{yarn}.colour.{letter}"), [0.0, 0.98], c);
        }
    }
    add(fitted.roughness.into(), fitted.range, fitted.start);
    add("density".into(), DENSITY, 1.0);
    list
}

/// Overrides of the fabric file that a place stands for.
fn keys(
    args: &FitJob,
    fitted: &FittedOptics,
    fabric: &Fabric,
    bounds: &[Bound],
    place: &[f64],
) -> Vec<String> {
    let mut keys = args.set.clone();
    let of = |name: &str| {
        let found = bounds.iter().zip(place).find(|(b, _)| b.name == name);
        found.map_or(1.0, |(_, &v)| v)
    };
    let density = of("density");
    for name in yarns(fabric) {
        let c = ["r", "g", "b"].map(|l| of(&format!("{name}.colour.{l}")));
        keys.extend(optics_keys(fitted, &name, c, of(fitted.roughness)));
        if let Some(yarn) = fabric.cloth.yarns().iter().find(|y| y.name == name) {
            keys.push(format!("yarn.{name}.tex={:?}", yarn.tex() * density));
            let fraction = yarn.fibre_volume_fraction() * density;
            keys.push(format!(
                "yarn.{name}.fibre_volume_fraction={:?}",
                fraction.min(0.9)
            ));
        }
    }
    keys
}

/// Overrides for the colour and the roughness of a yarn.
pub fn optics_keys(fitted: &FittedOptics, yarn: &str, colour: [f64; 3], rough: f64) -> [String; 2] {
    let (key, value) = (fitted.colour)(colour);
    [
        format!("optics.{yarn}.{key}={value}"),
        format!("optics.{yarn}.{}={rough:?}", fitted.roughness),
    ]
}

/// Keys of the fabric that say otherwise what [`optics_keys`] say, to be removed.
///
/// # Errors
/// Optics that tell threads apart by their colour: there is one answer for a yarn.
pub fn optics_given_way(
    args: &FitJob,
    fitted: &FittedOptics,
    yarns: &[String],
) -> Result<Vec<String>> {
    let own: Table =
        args.context
            .loader()
            .toml_of(args.fabric_path(), &args.set, Wanted::Fabric)?;
    let mut list = Vec::new();
    for yarn in yarns {
        let optics = own.get("optics").and_then(|o| o.get(yarn));
        if optics.is_some_and(Value::is_array) {
            return Err(of_key(
                args.fabric_path(),
                format!("optics.{yarn}"),
                "is a list of tables for colours of thread; a fit needs one table, or none",
            ));
        }
        for key in fitted.replaced {
            if optics.is_some_and(|o| o.get(key).is_some()) {
                list.push(format!("optics.{yarn}.{key}"));
            }
        }
    }
    if !list.is_empty() {
        let list = list.join(", ");
        args.context
            .note(format!("the fitted values replace {list}"));
    }
    Ok(list)
}

/// The colour of a yarn's fibres in the fabric as it is.
pub fn own_colour(fabric: &Fabric, yarn: &str) -> [f64; 3] {
    let own = fabric.cloth.materials().iter().find(|m| m.yarn == yarn);
    let colour = own.and_then(|m| m.colour).unwrap_or(optics::UNDYED);
    colour.0.to_array().map(f64::from)
}
