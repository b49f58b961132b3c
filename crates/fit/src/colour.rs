//! Fitting the colour of fibres so that the cloth reflects a wanted colour.

use super::cloth::model::fitted;
use super::fibres::{optics_given_way, optics_keys, own_colour, yarns};
use super::{Fit, FitJob, check_outputs, effort, finish_with, options, read_fabric, table, triple};
use anyhow::Result;
use organza_basis::{Rgb, Stopped, nearest_name};
use organza_measure::fit::Determined;
use organza_measure::{Angles, Effort, Measured, match_colour, measure_albedos};
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::patches::{AnyPatch, Matter};
use organza_scene::representation::{EXPLICIT_FIBRES, MICROFLAKE};
use organza_weave::colour_list::{OneColour, hex_of, one};
use organza_work::building::watched;
use organza_work::{Progress, of_option};
use serde_json::json;

/// Angle of the beam to the normal, degrees. By reciprocity what is reflected everywhere from
/// there is what a spectrophotometer of the geometry di:8 shows [CIE2018].
const BEAM_DEG: f64 = 8.0;

/// Azimuths of the beam: instruments average over turns of the sample.
const AZIMUTHS_DEG: [f64; 4] = [0.0, 90.0, 180.0, 270.0];

/// Paths from each of them by default.
const PATHS: u64 = 16384;

/// The darkest and the brightest colour that fibres may get.
const RANGE: [f64; 2] = [0.0, 0.98];

/// Error of the search, share of light beside the wanted one: a tenth of a step of 8 bits in
/// middle grey.
const TOLERANCE: f64 = 0.0005;

/// The target.
pub(crate) static TARGET: crate::Target = crate::Target {
    name: "colour",
    about: "Colour of the fibres at which the cloth reflects a wanted colour",
    example: "scenes/fabrics/linen.toml --colour rust -o dyed.toml",
    fields: &["colour", "yarn", "model", "voxel_um"],
    check: |args| wanted(args).map(drop),
    run,
};

/// Reads `--colour`: a name, `#rrggbb`, or three linear channels.
pub(crate) fn parse_colour(text: &str) -> Result<OneColour, String> {
    if !text.contains(',') {
        return one(text.trim()).map(OneColour);
    }
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[r, g, b]) => Ok(OneColour(Rgb::new(r, g, b))),
        _ => Err("expected a colour such as #8c3b2e, or its linear channels R,G,B".into()),
    }
}

fn wanted(args: &Fit) -> Result<[f64; 3]> {
    let colour = args.colour.ok_or_else(|| {
        of_option(
            "colour",
            "expected the colour of the cloth, such as #8c3b2e or 0.26,0.04,0.03",
        )
    })?;
    let channels = colour.0.0.to_array().map(f64::from);
    if channels.iter().all(|c| (0.0..=1.0).contains(c)) {
        return Ok(channels);
    }
    let why = format!(
        "expected shares of light from 0 to 1, found {}",
        triple(channels)
    );
    Err(of_option("colour", why))
}

/// The yarns that get another colour.
fn dyed(args: &FitJob, fabric: &Fabric) -> Result<Vec<String>> {
    let all = yarns(fabric);
    let Some(name) = &args.yarn else {
        return Ok(all);
    };
    if all.contains(name) {
        return Ok(vec![name.clone()]);
    }
    let hint = nearest_name(name, all.iter().map(String::as_str));
    let hint = hint.map_or_else(String::new, |near| format!("; did you mean {near:?}?"));
    let all = all.join(", ");
    let why = format!("the cloth has no yarn {name:?}{hint} It has: {all}");
    Err(of_option("yarn", why))
}

fn run(args: &FitJob) -> Result<super::Fitted> {
    let wanted = wanted(args)?;
    let (fabric, read) = read_fabric(args)?;
    check_outputs(args, &args.context, &read)?;
    let (shown, _) = fitted(args)?;
    let dyed = dyed(args, &fabric)?;
    note_patterns(args, &fabric, &dyed);
    let stated = [&EXPLICIT_FIBRES, &MICROFLAKE].map(|shown| shown.fitted);
    let given_way = match stated[0] {
        Some(fibres) => optics_given_way(args, fibres, &dyed)?,
        None => Vec::new(),
    };
    let matter = watched(&args.context, |loader| {
        let options = options(args, loader);
        Ok(Matter::new(&fabric, args.fabric_path(), shown, &options)?)
    })?;
    let shares = shares(&fabric, &dyed);
    let keys = |colour: [f64; 3]| {
        let mut keys = args.set.clone();
        for (yarn, share) in dyed.iter().zip(&shares) {
            let own = std::array::from_fn(|c| share[c] * colour[c]);
            // Both models get it, so that the cloth has one colour near and far.
            let stated = stated.into_iter().flatten();
            keys.extend(stated.map(|model| {
                let [colour, _rough] = optics_keys(model, yarn, own, model.start);
                colour
            }));
        }
        keys
    };
    let progress = Progress::new("fitting", 16, &args.context);
    let mut count = 0;
    let unwatched = args.context.loader();
    let mut reflected = |colour: [f64; 3], seed: u64| -> Result<Measured> {
        count += 1;
        Stopped::check(progress.at(count))?;
        let path = args.fabric_path();
        let changed = fabric_file::load_changed(path, &given_way, &keys(colour), &unwatched)?;
        let patch = matter.patch(&changed, path, &options(args, &unwatched))?;
        reflectance(args, &patch, seed)
    };
    let [dark, bright] = [
        reflected([RANGE[0]; 3], args.seed)?,
        reflected([RANGE[1]; 3], args.seed)?,
    ];
    check_reach(wanted, &dark, &bright)?;
    let start = std::array::from_fn(|c| wanted[c].clamp(RANGE[0], RANGE[1]));
    let near = |value: f64, wanted: f64| (value - wanted).abs() <= TOLERANCE;
    let (colour, found) = match_colour(
        wanted,
        ([RANGE; 3], start),
        &near,
        |m: &Measured| m.mean,
        &mut |colour| reflected(colour, args.seed),
    )?;
    // Other random numbers than those of the search tell how good it is.
    let seen = reflected(colour, args.seed.wrapping_add(1))?;
    progress.finish();
    let error: [f64; 3] = std::array::from_fn(|c| found.se[c].hypot(seen.se[c]).hypot(TOLERANCE));
    let is_met = (0..3).all(|c| (seen.mean[c] - wanted[c]).abs() <= 3.5 * error[c]);
    let words = format!(
        "{}: the cloth reflects {} +- {}, wanted {}; as sRGB {}, wanted {}.",
        if is_met { "Met" } else { "Not met" },
        triple(seen.mean),
        triple(error),
        triple(wanted),
        hex(seen.mean),
        hex(wanted),
    );
    let parameters: Vec<Determined> = (0..3)
        .map(|c| Determined {
            name: format!("colour.{}", ["r", "g", "b"][c]),
            value: colour[c],
            // The cloth is about proportional to its fibres, above what their surface reflects.
            se: error[c] * colour[c] / (seen.mean[c] - dark.mean[c]).max(error[c]),
            is_fixed: is_met,
        })
        .collect();
    let figures = json!({ "reflected": seen, "error": error, "wanted": wanted });
    let table = table(args, &given_way, &keys(colour))?;
    finish_with(args, &table, &parameters, &[words], (figures, None))
}

/// What a patch reflects of the beam, mean over its azimuths.
fn reflectance(args: &FitJob, patch: &AnyPatch, seed: u64) -> Result<Measured> {
    let beams = AZIMUTHS_DEG.map(|phi_deg| Angles::new(BEAM_DEG, phi_deg));
    let effort = Effort {
        paths: args.spp.unwrap_or(PATHS),
        seed,
        ..effort(args)
    };
    let results = measure_albedos(patch, &beams, &effort, &|_| args.context.flow())?;
    let count = results.list.len() as f64;
    let mean = |c: usize| {
        results
            .list
            .iter()
            .map(|a| a.reflected.mean[c])
            .sum::<f64>()
            / count
    };
    let se = |c: usize| {
        let squares = results.list.iter().map(|a| a.reflected.se[c].powi(2));
        squares.sum::<f64>().sqrt() / count
    };
    Ok(Measured::new(
        std::array::from_fn(mean),
        std::array::from_fn(se),
    ))
}

/// Refuses a colour that no fibres give the cloth.
fn check_reach(wanted: [f64; 3], dark: &Measured, bright: &Measured) -> Result<()> {
    let missed: Vec<String> = (0..3)
        .filter(|&c| wanted[c] < dark.mean[c] || wanted[c] > bright.mean[c])
        .map(|c| {
            let name = ["red", "green", "blue"][c];
            let (low, high) = (dark.mean[c], bright.mean[c]);
            format!("{name} {:.4} is outside {low:.4} to {high:.4}", wanted[c])
        })
        .collect();
    if missed.is_empty() {
        return Ok(());
    }
    let why = format!(
        "cannot be reached: {}; the darkest and brightest fibres give the cloth {} and {}",
        missed.join(", "),
        hex(dark.mean),
        hex(bright.mean),
    );
    Err(of_option("colour", why))
}

/// Colours of yarns against the brightest of them, which keep their proportions.
fn shares(fabric: &Fabric, dyed: &[String]) -> Vec<[f64; 3]> {
    let own: Vec<[f64; 3]> = dyed.iter().map(|yarn| own_colour(fabric, yarn)).collect();
    let most = |c: usize| own.iter().map(|o| o[c]).fold(0.0, f64::max);
    let share = |o: &[f64; 3], c: usize| if most(c) > 0.0 { o[c] / most(c) } else { 1.0 };
    own.iter()
        .map(|o| std::array::from_fn(|c| share(o, c)))
        .collect()
}

/// Says which yarns lose a pattern: each gets one colour.
fn note_patterns(args: &FitJob, fabric: &Fabric, dyed: &[String]) {
    for yarn in dyed {
        let own = fabric.cloth.materials().iter().filter(|m| m.yarn == *yarn);
        let colours = own.filter_map(|m| m.colour.map(|c| c.0.to_array()));
        let colours: Vec<[f32; 3]> = colours.collect();
        if colours.iter().any(|c| *c != colours[0]) {
            let words = format!("all fibres of {yarn} get one colour in place of several");
            args.context.note(words);
        }
    }
}

fn hex(colour: [f64; 3]) -> String {
    hex_of(Rgb::from(colour.map(|c| c as f32)))
}
