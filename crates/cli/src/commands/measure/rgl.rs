//! `organza measure --layout rgl`.

use super::summary::{Summary, dark_pairs, median_error, write};
use super::{MeasureArgs, check_table_memory, ends_in, results};
use crate::error::after_option;
use crate::flags::values::parse_rgl_grid;
use anyhow::Result;
use clap::Args;
use organza_basis::Watch;
use organza_measure::{AdaptiveGrid, Effort, measure_adaptive, write_adaptive};
use organza_scene::patches::AnyPatch;
use organza_scene::representation::ShownAs;
use serde_json::json;

/// Flags of the layout.
#[derive(Debug, Args)]
pub struct RglArgs {
    /// Directions of --layout rgl: polar angles (2 to 90) and azimuths (3 to 360) of the light, and nodes along each side of the square of exitant directions (4 to 256)
    #[arg(long, value_name = "POLAR,AZIMUTHS,SIDE", value_parser = parse_rgl_grid, default_value = "12,24,32")]
    pub rgl_grid: [u32; 3],
}

/// What the flags ask for.
///
/// # Errors
/// A table of another kind, or too little memory.
pub fn wanted(args: &MeasureArgs) -> Result<AdaptiveGrid> {
    if args.outfile.is_none() || !ends_in(args, "bsdf") {
        return Err(after_option(
            "layout",
            "rgl needs a table that ends in .bsdf",
        ));
    }
    let [polar, azimuths, side] = args.rgl.rgl_grid;
    let grid = AdaptiveGrid {
        polar,
        azimuths,
        side,
    };
    check_table_memory(args, "--rgl-grid", grid.memory_bytes())?;
    Ok(grid)
}

/// Measures the table and writes it.
///
/// # Errors
/// Those of the measurement and of the output.
pub fn run(
    args: &MeasureArgs,
    grid: AdaptiveGrid,
    (patch, shown): (&AnyPatch, Option<ShownAs>),
    (effort, watch): (&Effort, Watch<'_>),
    summary: &mut Summary,
) -> Result<()> {
    let result = measure_adaptive(patch, grid, effort, watch)?;
    let name = args.file.file_stem().unwrap_or_default().to_string_lossy();
    let description = format!("{name}: reflection of the face, measured by organza");
    write(args, |out| write_adaptive(&result.brdf, &description, out))?;
    let host = &args.common.host;
    host.give(|| results::pairs(&result.pairs, result.stats.paths));
    summary.what = "rgl";
    summary.count = grid.incident_count();
    summary.paths = result.stats.paths;
    summary.dark = dark_pairs(shown, &result.pairs);
    let normal = result.brdf.reflectance(0, 0);
    summary.extra = vec![
        ("pairs", json!(result.pairs.len())),
        ("reflected_along_normal", json!(normal)),
    ];
    let error = median_error(&result.pairs).unwrap_or_default();
    summary.result_line = Some(format!("along the normal R {normal:.4?}; {error}"));
    Ok(())
}
