//! `organza fit`

use super::compare::read_data;
use super::with_threads;
use crate::error::input;
use crate::fabric_file::{self, Fabric};
use crate::flags::{FitArgs, FitWhat, PatchModel};
use crate::journal::FileJournal;
use crate::patches::{PatchOptions, fabric_patch};
use crate::progress::Progress;
use crate::{optics, output, read};
use anyhow::{Context, Result};
use organza_measure::fit::{Bound, Determined, Patience, determine, search};
use organza_measure::{
    Effort, Journal, Measured, Pair, PairValue, fit_surface, in_plane_layout, irawan_layout,
    measure_albedos, measure_pairs, read_klems,
};
use serde_json::json;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use toml::{Table, Value};

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<()> {
    output::check_writable(&args.outfile)?;
    if args.model == PatchModel::Surface {
        return Err(input("--model: a surface cannot stand for the volume"));
    }
    with_threads(&args.common, || match args.what {
        FitWhat::Surface => surface(args),
        FitWhat::Fibres => fibres(args),
    })
}

fn options(args: &FitArgs) -> PatchOptions {
    PatchOptions {
        voxel_um: args.voxel.voxel_um,
        level: 0,
        max_memory_bytes: args.memory.max_memory,
        quiet: args.common.quiet,
    }
}

fn effort(args: &FitArgs) -> Effort {
    Effort {
        paths: args.spp,
        seed: args.seed,
        target_error: None,
    }
}

fn patience(args: &FitArgs) -> Patience {
    let [scan, steps] = args.patience;
    Patience {
        scan,
        steps: steps.into(),
    }
}

fn surface(args: &FitArgs) -> Result<()> {
    let fabric = fabric_file::load(&args.fabric, &args.common.set)?;
    let start = fabric.surface_spec(&args.fabric)?;
    let data = match &args.data {
        Some(path) => read_data(path)?,
        None => {
            let patch = fabric_patch(&fabric, &args.fabric, args.model, &options(args))?;
            let mut pairs: Vec<Pair> = irawan_layout();
            pairs.extend(in_plane_layout(30.0));
            pairs.extend(in_plane_layout(60.0));
            let total = pairs.len() as u64 * args.spp;
            let progress = Progress::new("measuring", total, args.common.quiet);
            let told = measure_pairs(&patch, &pairs, &effort(args), &|_| ())?;
            progress.finish();
            told.list
        }
    };
    let key = json!([start, data, args.patience]).to_string();
    let mut journal = FileJournal::open(args.journal.as_deref(), &key)?;
    let patience = patience(args);
    let steps = u64::from(patience.scan) + 4 * patience.steps;
    let progress = Progress::new("fitting", steps, args.common.quiet);
    let mut count = 0;
    let mut watch = |_: f64| {
        count += 1;
        progress.at(count);
    };
    let fitted = fit_surface(&start, &data, &patience, &mut journal, &mut watch)
        .map_err(|e| input(format!("{}: {e}", args.fabric.display())))?;
    progress.finish();
    let section = Value::try_from(&fitted.spec).context("the surface cannot be written")?;
    let mut table = table(args, &[])?;
    table.insert("surface".into(), section);
    let words = format!("Residual: {:.3} of the expected errors.", fitted.residual);
    finish(args, &table, &fitted.parameters, &words)
}

/// What a measurement told, and how to make the same of a fabric.
enum Observed {
    Pairs(Vec<PairValue>),
    /// Reflected and transmitted light of some directions.
    Hemispheres(Vec<(organza_measure::Angles, [Measured; 2])>),
}

impl Observed {
    fn read(path: &std::path::Path) -> Result<Observed> {
        let is_xml = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("xml"));
        if !is_xml {
            return Ok(Observed::Pairs(read_data(path)?));
        }
        let bsdf = read_klems(&read::text(path)?)
            .map_err(|e| input(format!("{}: {e}", path.display())))?;
        let mut list = Vec::new();
        for (side, theta) in [(0, 0.0), (1, 180.0)] {
            for from in (0..bsdf.basis.len()).step_by(bsdf.basis.len() / 6) {
                let exact = |m| Measured {
                    mean: bsdf.hemispherical(m, from),
                    se: [0.0; 3],
                };
                let [r, t] = [&bsdf.reflection[side], &bsdf.transmission[side]].map(exact);
                let angles = bsdf.incident(from, theta == 0.0);
                list.push((angles, [r, t]));
            }
        }
        Ok(Observed::Hemispheres(list))
    }

    /// The observed values with their errors, in one list.
    fn values(&self) -> Vec<[f64; 2]> {
        let channels = |m: &Measured| m.mean.into_iter().zip(m.se).map(|(v, s)| [v, s]).collect();
        match self {
            Observed::Pairs(list) => list
                .iter()
                .flat_map(|v| -> Vec<_> { channels(&v.bsdf) })
                .collect(),
            Observed::Hemispheres(list) => list
                .iter()
                .flat_map(|(_, parts)| parts.iter().flat_map(|m| -> Vec<_> { channels(m) }))
                .collect(),
        }
    }

    /// The same of a fabric.
    fn simulate(&self, args: &FitArgs, fabric: &Fabric) -> Result<Vec<[f64; 2]>> {
        let quiet = PatchOptions {
            quiet: true,
            ..options(args)
        };
        let patch = fabric_patch(fabric, &args.fabric, args.model, &quiet)?;
        let told = match self {
            Observed::Pairs(list) => {
                let pairs: Vec<Pair> = list.iter().map(|v| v.pair).collect();
                Observed::Pairs(measure_pairs(&patch, &pairs, &effort(args), &|_| ())?.list)
            }
            Observed::Hemispheres(list) => {
                let from: Vec<_> = list.iter().map(|l| l.0).collect();
                let told = measure_albedos(&patch, &from, &effort(args), &|_| ())?;
                let parts = told.list.iter().map(|a| {
                    let through = Measured {
                        mean: std::array::from_fn(|c| a.transmitted.mean[c] + a.direct.mean[c]),
                        se: std::array::from_fn(|c| a.transmitted.se[c].hypot(a.direct.se[c])),
                    };
                    (a.incident, [a.reflected, through])
                });
                Observed::Hemispheres(parts.collect())
            }
        };
        Ok(told.values())
    }
}

/// Share of a value below which it need not be matched.
const TOLERANCE: f64 = 0.02;

/// Largest and least number of fibres, against the fabric's own.
const DENSITY: [f64; 2] = [0.5, 1.6];

fn fibres(args: &FitArgs) -> Result<()> {
    let path = args
        .data
        .as_deref()
        .ok_or_else(|| input("--data: expected measured values"))?;
    let observed = Observed::read(path)?;
    let values = observed.values();
    let fabric = fabric_file::load(&args.fabric, &args.common.set)?;
    let bounds = fibre_bounds(args, &fabric);
    let key = json!([values, bounds, args.spp, args.seed, args.patience]).to_string();
    let mut journal = FileJournal::open(args.journal.as_deref(), &key)?;
    let residuals = |place: &[f64]| -> Result<Vec<f64>> {
        let changed = fabric_file::load(&args.fabric, &fibre_keys(args, &fabric, &bounds, place))?;
        let told = observed.simulate(args, &changed)?;
        let one = |(t, v): (&[f64; 2], &[f64; 2])| {
            let error = t[1].hypot(v[1]).hypot(TOLERANCE * v[0]).max(1e-4);
            (t[0] - v[0]) / error
        };
        Ok(told.iter().zip(&values).map(one).collect())
    };
    let square = |list: &[f64]| list.iter().map(|r| r * r).sum::<f64>();
    let patience = patience(args);
    let steps = u64::from(patience.scan) + 4 * patience.steps;
    let progress = Progress::new("fitting", steps, args.common.quiet);
    let mut count = 0;
    let mut failure = None;
    let mut cost = |place: &[f64]| {
        count += 1;
        progress.at(count);
        journal.recall(place).unwrap_or_else(|| {
            // A fabric whose yarns do not fit is no answer; other failures end
            // the search with their own words.
            let cost = match residuals(place) {
                Ok(list) => square(&list),
                Err(e) => {
                    failure.get_or_insert(e);
                    f64::MAX
                }
            };
            journal.keep(place, cost);
            cost
        })
    };
    let (place, least) = search(&bounds, &patience, &mut cost)
        .map_err(|e| input(format!("the search failed: {e}")))?;
    progress.finish();
    if let (true, Some(e)) = (least == f64::MAX, failure) {
        return Err(e);
    }
    let base = residuals(&place)?;
    let mut columns = Vec::new();
    for (k, b) in bounds.iter().enumerate() {
        let mut moved = place.clone();
        let step = 0.08 * (b.high - b.low);
        let step = if moved[k] + step > b.high {
            -step
        } else {
            step
        };
        moved[k] += step;
        let column = residuals(&moved)?;
        columns.push(
            column
                .iter()
                .zip(&base)
                .map(|(a, b)| (a - b) / step)
                .collect(),
        );
    }
    let freedom = values.len().saturating_sub(bounds.len()).max(1);
    let variance = (square(&base) / freedom as f64).max(1.0);
    let parameters = determine(&bounds, &place, &columns, variance);
    let table = table(args, &fibre_keys(args, &fabric, &bounds, &place))?;
    let words = format!("Residual: {:.3} of the expected errors.", variance.sqrt());
    finish(args, &table, &parameters, &words)
}

/// Names of the yarns that have fibres in the cloth.
fn yarns(fabric: &Fabric) -> Vec<String> {
    let names: BTreeSet<String> = fabric
        .cloth
        .materials()
        .iter()
        .map(|m| m.yarn.clone())
        .collect();
    names.into_iter().collect()
}

fn roughness(args: &FitArgs) -> (&'static str, [f64; 2], f64) {
    match args.model {
        PatchModel::Volume => ("end_on_ratio", [0.01, 0.9], 0.1),
        _ => ("longitudinal_deg", [1.0, 30.0], 6.0),
    }
}

fn fibre_bounds(args: &FitArgs, fabric: &Fabric) -> Vec<Bound> {
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
        let materials = fabric.cloth.materials();
        let own = materials.iter().find(|m| m.yarn == yarn);
        let colour = own.and_then(|m| m.colour).unwrap_or(optics::UNDYED);
        for (letter, c) in ["r", "g", "b"].into_iter().zip(colour.0.to_array()) {
            add(format!("{yarn}.colour.{letter}"), [0.0, 0.98], c.into());
        }
    }
    let (key, range, start) = roughness(args);
    add(key.into(), range, start);
    add("density".into(), DENSITY, 1.0);
    list
}

/// Overrides of the fabric file that a place stands for.
fn fibre_keys(args: &FitArgs, fabric: &Fabric, bounds: &[Bound], place: &[f64]) -> Vec<String> {
    let mut keys = args.common.set.clone();
    let of = |name: &str| {
        let found = bounds.iter().zip(place).find(|(b, _)| b.name == name);
        found.map_or(1.0, |(_, &v)| v)
    };
    let density = of("density");
    let (rough, _, _) = roughness(args);
    for name in yarns(fabric) {
        let c = ["r", "g", "b"].map(|l| of(&format!("{name}.colour.{l}")));
        // Flakes and fibres take their own keys for the colour of a heap.
        if args.model == PatchModel::Volume {
            let colour = organza_basis::Rgb::new(c[0] as f32, c[1] as f32, c[2] as f32);
            let albedo = optics::albedo_for_colour(colour).0.to_array();
            keys.push(format!("optics.{name}.albedo={albedo:?}"));
        } else {
            keys.push(format!("optics.{name}.colour={c:?}"));
        }
        keys.push(format!("optics.{name}.{rough}={:?}", of(rough)));
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

/// The fabric file as a table, with keys replaced and names of other files
/// made valid beside the new one.
fn table(args: &FitArgs, overrides: &[String]) -> Result<Table> {
    let mut keys = args.common.set.clone();
    keys.extend_from_slice(overrides);
    let mut table: Table = read::toml(&args.fabric, &keys)?;
    if let Some(Value::Table(draft)) = table.get_mut("draft") {
        for key in ["wif", "curves"] {
            if let Some(Value::String(name)) = draft.get_mut(key) {
                let there = std::path::absolute(read::beside(&args.fabric, name))?;
                *name = there.to_string_lossy().into_owned();
            }
        }
    }
    Ok(table)
}

#[allow(clippy::print_stdout, clippy::print_stderr)]
fn finish(args: &FitArgs, table: &Table, parameters: &[Determined], words: &str) -> Result<()> {
    let command: Vec<String> = std::env::args().collect();
    let mut text = format!("# Fitted by: {}\n# {words}\n#\n", command.join(" "));
    for p in parameters {
        let _ = writeln!(
            text,
            "# {} = {:.4} +- {:.4}{}",
            p.name,
            p.value,
            p.se,
            if p.is_fixed {
                ""
            } else {
                ", not fixed by the data"
            }
        );
    }
    let _ = write!(
        text,
        "\n{}",
        toml::to_string(table).context("the fabric cannot be written")?
    );
    output::write_file(&args.outfile, |out| {
        out.write_all(text.as_bytes()).context("writing failed")
    })?;
    if args.json {
        let told = json!({ "parameters": parameters, "words": words });
        println!("{}", serde_json::to_string_pretty(&told)?);
    }
    if !args.common.quiet {
        eprintln!("{words}");
        let loose: Vec<&str> = parameters
            .iter()
            .filter(|p| !p.is_fixed)
            .map(|p| p.name.as_str())
            .collect();
        if !loose.is_empty() {
            eprintln!("not fixed by the data: {}", loose.join(", "));
        }
    }
    Ok(())
}
