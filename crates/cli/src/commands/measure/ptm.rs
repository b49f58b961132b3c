//! `organza measure --layout ptm`.

use super::summary::{Summary, write};
use super::{MeasureArgs, ends_in};
use crate::error::after_option;
use crate::flags::values::whole;
use anyhow::Result;
use clap::Args;
use organza_basis::Watch;
use organza_measure::{MapEffort, TexelGrid, measure_polynomial_map, write_polynomial_map};
use organza_scene::patches::AnyPatch;
use serde_json::json;

/// Flags of the layout.
#[derive(Debug, Args)]
pub struct PtmArgs {
    /// Positions of the lamp of --layout ptm, 12 to 1000, spread out to 75 degrees from the normal
    #[arg(long, value_name = "N", default_value_t = 48, value_parser = whole::<u32>(12..=1000))]
    pub ptm_lamps: u32,
}

/// Checks the name of the table.
///
/// # Errors
/// A table of another kind.
pub fn wanted(args: &MeasureArgs) -> Result<u32> {
    if args.outfile.is_none() || !ends_in(args, "ptm") {
        return Err(after_option(
            "layout",
            "ptm needs a table that ends in .ptm",
        ));
    }
    Ok(args.ptm.ptm_lamps)
}

/// Measures the map and writes it.
///
/// # Errors
/// Those of the measurement and of the output.
pub fn run(
    args: &MeasureArgs,
    lamps: u32,
    (patch, grid): (&AnyPatch, &TexelGrid),
    watch: Watch<'_>,
    summary: &mut Summary,
) -> Result<()> {
    let needed = organza_measure::polynomial_map_memory_bytes(grid.texels);
    super::check_table_memory(args, "--texels", needed)?;
    let effort = MapEffort {
        lamps,
        paths: args.spp,
        seed: args.seed,
    };
    let map = measure_polynomial_map(patch, grid, &effort, watch)?;
    write(args, |out| write_polynomial_map(&map, out))?;
    summary.what = "ptm";
    summary.paths = args.spp * u64::from(lamps) * u64::from(grid.texels.element_product());
    summary.extra = vec![
        ("lamps", json!(lamps)),
        ("mean", json!(map.mean)),
        ("residual", json!(map.residual)),
        ("residual_by_noise", json!(map.noise)),
    ];
    summary.result_line = Some(format!(
        "mean value {:.4} of white; residual of the polynomials {:.4}, of which noise {:.4}",
        map.mean, map.residual, map.noise
    ));
    Ok(())
}
