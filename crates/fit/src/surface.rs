//! Fitting the surface model: to the volume of the same file, or to measured
//! values.

use super::{
    Fit, FitJob, check_outputs, effort, finish, journal_key, open_journal, options, read_fabric,
    table,
};
use anyhow::{Context, Result};
use organza_basis::{Rgb, Stopped};
use organza_measure::fit::Patience;
use organza_measure::{
    Angles, Effort, Pair, PairValue, fit_surface, in_plane_layout, irawan_layout, measure_albedos,
    measure_pairs,
};
use organza_scene::loader::Input;
use organza_scene::patches::{AnyPatch, fabric_patch};
use organza_scene::representation::ShownAs;
use organza_surface::MeasuredTransmission;
use organza_work::Progress;
use organza_work::building::watched;
use organza_work::measured_values;
use organza_work::number_journal::{PAIR_NUMBERS, pair_numbers, pair_values};
use organza_work::{input, of_file, of_key};
use toml::Value;

/// Pairs that are measured between two entries of the journal.
const BATCH: usize = 128;

/// Step of difference quotients as a share of the range: the model is exact to
/// a hundredth of it.
const STRIDE: f64 = 1e-3;

/// The target.
pub(crate) static TARGET: crate::Target = crate::Target {
    name: "surface",
    about: "The [surface] section: Irawan's model of the weave, from measured values or from the fabric's own volume",
    example: "scenes/fabrics/denim.toml -o fitted.toml",
    fields: &["data", "model", "patience", "journal", "voxel_um"],
    check,
    run,
};

fn check(args: &Fit) -> Result<()> {
    let own = "applies only to a fit to the fabric's own volume";
    match args.data {
        Some(_) => args.refuse(&["model", "journal", "voxel_um"], own),
        None => Ok(()),
    }
}

fn run(args: &FitJob) -> Result<super::Fitted> {
    let (mut fabric, read) = read_fabric(args)?;
    check_outputs(args, &args.context, &read)?;
    // A fabric without the section gets one.
    fabric.file.surface.get_or_insert_default();
    let fabric = fabric;
    let mut start = fabric
        .surface_spec(args.fabric_path())?
        .resolved()
        .map_err(|e| of_key(args.fabric_path(), "surface", e))?;
    let data = match &args.data {
        Some(path) => measured_values::read(path, &args.context)?,
        None => {
            let patch = watched(&args.context, |loader| {
                let options = options(args, loader);
                let shown = args.model.of(&fabric, args.fabric_path())?;
                Ok(fabric_patch(&fabric, args.fabric_path(), shown, &options)?)
            })?;
            let shown = args.model.of(&fabric, args.fabric_path())?;
            let (data, results) = measure(args, shown, &read, &patch)?;
            // Gaps, and how much light goes through at all, are not in pairs.
            let fitted = results.fit().map_err(|e| input(e.to_string()))?;
            start.transmission = Some(fitted);
            data
        }
    };
    let [scan, steps] = args.patience.unwrap_or([200, 400]);
    let patience = Patience {
        scan,
        steps,
        stride: STRIDE,
    };
    let most = 2 * (u64::from(scan) + 4 * u64::from(steps));
    let progress = Progress::new("fitting", most, &args.context);
    let mut count = 0;
    let fitted = fit_surface(&start, &data, &patience, &mut || {
        count += 1;
        progress.at(count)
    })
    .map_err(|e| of_file(args.fabric_path(), e))?;
    progress.finish();
    let section = Value::try_from(&fitted.spec).context("the surface cannot be written")?;
    let mut table = table(args, &[], &[])?;
    table.insert("surface".into(), section);
    let words = format!(
        "Reflected light: median error {:.1} %. All values: {:.2} of the expected errors.",
        100.0 * fitted.median_relative,
        fitted.residual
    );
    finish(args, &table, &fitted.parameters, &words)
}

/// Rings and azimuths of the light whose transmission through the cloth is measured,
/// degrees.
const THETA_DEG: [f64; 5] = [0.0, 20.0, 40.0, 55.0, 70.0];
const PHI_DEG: [f64; 3] = [0.0, 45.0, 90.0];

/// Values of the volume, in batches that the journal stores.
fn measure(
    args: &FitJob,
    shown: ShownAs,
    read: &[Input],
    patch: &AnyPatch,
) -> Result<(Vec<PairValue>, MeasuredTransmission)> {
    let mut pairs: Vec<Pair> = irawan_layout();
    pairs.extend(in_plane_layout(30.0));
    pairs.extend(in_plane_layout(60.0));
    let key = journal_key(args, &shown.to_string(), read)?;
    let mut journal = open_journal(args, &key)?;
    let progress = Progress::new("measuring", pairs.len() as u64, &args.context);
    let mut list = Vec::with_capacity(pairs.len());
    for (batch, pairs) in pairs.chunks(BATCH).enumerate() {
        let effort = Effort {
            seed: args.seed ^ (batch as u64) << 40,
            ..effort(args)
        };
        let numbers = journal.once(&[batch as f64], PAIR_NUMBERS * pairs.len(), || {
            let results = measure_pairs(patch, pairs, &effort, &|_| args.context.flow())?.list;
            Ok(pair_numbers(&results))
        })?;
        list.extend(pair_values(pairs, args.paths(), &numbers));
        Stopped::check(progress.at(list.len() as u64))?;
    }
    let incident: Vec<Angles> = THETA_DEG
        .into_iter()
        .flat_map(|theta_deg| PHI_DEG.map(|phi_deg| Angles { theta_deg, phi_deg }))
        .collect();
    let passed = journal.once(&[-1.0], 4 * incident.len(), || {
        let effort = Effort {
            paths: 16 * args.paths(),
            ..effort(args)
        };
        let results = measure_albedos(patch, &incident, &effort, &|_| args.context.flow())?.list;
        let numbers = results.iter().flat_map(|a| {
            let [r, g, b] = a.transmitted.mean;
            [a.direct.mean[1], r, g, b]
        });
        Ok(numbers.collect())
    })?;
    progress.finish();
    let mut through = MeasuredTransmission::default();
    for (a, v) in incident.iter().zip(passed.chunks_exact(4)) {
        let [straight, r, g, b] = [v[0], v[1], v[2], v[3]].map(|x| x as f32);
        through.direct.push((a.direction(), straight));
        through.scattered.push((a.direction(), Rgb::new(r, g, b)));
    }
    let behind = list.iter().filter(|v| v.pair.exitant.theta_deg > 90.0);
    through.pairs = behind
        .map(|v| {
            let [r, g, b] = v.bsdf.mean.map(|x| x as f32);
            let (i, o) = (v.pair.incident, v.pair.exitant);
            (i.direction(), o.direction(), Rgb::new(r, g, b))
        })
        .collect();
    Ok((list, through))
}
