//! What `organza measure` writes and prints of its values.

use super::{MeasureArgs, ends_in};
use crate::flags::patch_model::OWN;
use crate::output;
use crate::output::note;
use anyhow::{Context, Result};
use organza_measure::PairValue;
use organza_scene::patches::PatchModel;
use organza_scene::representation::{Build, ShownAs};
use serde_json::{Value, json};

/// Median of the standard errors as shares of their values.
pub fn median_error(list: &[PairValue]) -> Option<String> {
    let channels = list
        .iter()
        .flat_map(|v| v.bsdf.mean.into_iter().zip(v.bsdf.se));
    let mut shares: Vec<f64> = channels.filter(|v| v.0 > 0.0).map(|(m, s)| s / m).collect();
    shares.sort_by(f64::total_cmp);
    let median = shares.get(shares.len() / 2)?;
    Some(format!(
        "median standard error {:.2} % of the value",
        100.0 * median
    ))
}

/// How many pairs of how many met no light in any path: their standard error is zero as their
/// value is, and has no information. Surfaces are exact.
pub fn dark_pairs(shown: Option<ShownAs>, list: &[PairValue]) -> [usize; 2] {
    let is_dark = |v: &&PairValue| [v.bsdf.mean, v.bsdf.se] == [[0.0; 3]; 2];
    match shown {
        Some(s) if matches!(s.representation.build, Build::Surface(_)) => [0, list.len()],
        _ => [list.iter().filter(is_dark).count(), list.len()],
    }
}

/// What a measurement reports in the end.
pub struct Summary {
    /// Name of the list in JSON.
    pub what: &'static str,
    /// The values.
    pub list: Value,
    /// Further figures for JSON.
    pub extra: Vec<(&'static str, Value)>,
    /// A line for the terminal.
    pub result_line: Option<String>,
    /// Pairs without light in any path, of how many.
    pub dark: [usize; 2],
    /// See [`organza_measure::Results::heavy_tails`].
    pub heavy_tails: usize,
    /// How many directions or pairs.
    pub count: usize,
    /// Paths traced.
    pub paths: u64,
}

/// Writes the table, if one is asked for.
///
/// # Errors
/// The output fails.
pub fn write(
    args: &MeasureArgs,
    table: impl FnOnce(&mut dyn output::SeekWrite) -> std::io::Result<()>,
) -> Result<()> {
    match &args.outfile {
        Some(path) if !ends_in(args, "json") && args.common.host.writes() => {
            output::write_file(path, |out| table(out).context("writing the table failed"))
        }
        _ => Ok(()),
    }
}

/// What was measured: a representation, or what a scene names.
fn model_name(args: &MeasureArgs, shown: Option<ShownAs>) -> &'static str {
    match (shown, args.model) {
        (Some(shown), _) => shown.representation.name,
        (None, PatchModel::Is(representation)) => representation.name,
        (None, PatchModel::Own) => OWN,
    }
}

/// Writes and prints the summary.
///
/// # Errors
/// The output fails.
pub fn report(
    args: &MeasureArgs,
    shown: Option<ShownAs>,
    summary: Summary,
    seconds: f64,
) -> Result<()> {
    let mut map = serde_json::Map::new();
    let mut put = |key: &str, value: Value| map.insert(key.into(), value);
    put("file", json!(args.file));
    put("model", json!(model_name(args, shown)));
    put("seed", json!(args.seed));
    put("paths", json!(summary.paths));
    put("seconds", json!(seconds));
    put("heavy_tails", json!(summary.heavy_tails));
    put(summary.what, summary.list);
    for (key, value) in summary.extra {
        put(key, value);
    }
    let text = serde_json::to_string_pretty(&Value::Object(map))?;
    if let Some(path) = args.outfile.as_ref().filter(|_| ends_in(args, "json")) {
        output::write_file(path, |out| Ok(out.write_all(text.as_bytes())?))?;
    }
    if args.json {
        output::print(&(text + "\n"))?;
    }
    if !args.common.quiet {
        note!(
            "{}: {} {}, {} paths in {seconds:.1} s ({:.2} M paths/s)",
            args.file.display(),
            summary.count,
            if summary.what == "pairs" {
                "pairs"
            } else {
                "directions"
            },
            summary.paths,
            summary.paths as f64 / seconds.max(1e-9) * 1e-6,
        );
        if let Some(line) = summary.result_line {
            note!("{line}");
        }
        if summary.heavy_tails > 0 {
            note!(
                "organza: warning: {}: in {} of {} one path carries more than a quarter of the \
                 squares, so that standard errors are too small; more --spp helps",
                args.file.display(),
                summary.heavy_tails,
                summary.count
            );
        }
        let [dark, pairs] = summary.dark;
        if dark > 0 {
            note!(
                "{dark} of {pairs} pairs met no light in any path: their value 0 +- 0 is not \
                 exact, its error is not known; more --spp helps"
            );
        }
    }
    Ok(())
}
