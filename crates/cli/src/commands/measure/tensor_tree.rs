//! `organza measure --layout tensor-tree`.

use super::summary::{Summary, write};
use super::{MeasureArgs, check_table_memory, ends_in, results};
use crate::error::after_option;
use crate::flags::values::{parse_share, whole};
use anyhow::Result;
use clap::Args;
use organza_basis::Watch;
use organza_measure::{TreeCell, TreeLayout, TreeRank, measure_tensor_tree, write_tensor_tree};
use organza_scene::patches::AnyPatch;
use serde_json::json;

/// Flags of the layout.
#[derive(Debug, Args)]
pub struct TreeArgs {
    /// Dimensions of --layout tensor-tree: 4 for cloth, 3 for scattering that is the same at every azimuth of the light, which is then averaged
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = whole::<u32>(3..=4))]
    pub tree_rank: u32,
    /// Depth of --layout tensor-tree: 2^N cells along each dimension; 1 to 7 for rank 3, 1 to 6 for rank 4
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = whole::<u32>(1..=7))]
    pub tree_depth: u32,
    /// Join cells of --layout tensor-tree that differ by at most this share of their value, apart from noise, e.g. 0.05 for 5 %
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub prune: Option<f64>,
}

/// What the flags ask for.
///
/// # Errors
/// A depth that the rank does not have, a table of another kind, or too little memory.
pub fn wanted(args: &MeasureArgs) -> Result<TreeLayout> {
    let (rank, depth) = (args.tree.tree_rank, args.tree.tree_depth);
    if args.outfile.is_none() || !ends_in(args, "xml") {
        return Err(after_option(
            "layout",
            "tensor-tree needs a table that ends in .xml",
        ));
    }
    let kind = match rank {
        3 => TreeRank::Isotropic,
        _ => TreeRank::Anisotropic,
    };
    let layout = TreeLayout::new(kind, depth).ok_or_else(|| {
        after_option(
            "tree_depth",
            format!("{depth}: expected at most 6 for --tree-rank {rank}"),
        )
    })?;
    check_table_memory(args, "--tree-depth", layout.memory_bytes())?;
    Ok(layout)
}

/// Measures the tree and writes it.
///
/// # Errors
/// Those of the measurement and of the output.
pub fn run(
    args: &MeasureArgs,
    layout: TreeLayout,
    patch: &AnyPatch,
    watch: Watch<'_>,
    summary: &mut Summary,
) -> Result<()> {
    let (tree, stats) = measure_tensor_tree(patch, layout, args.spp, args.seed, watch)?;
    let name = args.file.file_stem().unwrap_or_default().to_string_lossy();
    let mut joined = 0.0;
    write(args, |out| {
        joined = write_tensor_tree(&tree, &name, args.tree.prune, out)?;
        Ok(())
    })?;
    let host = &args.common.host;
    host.give(|| results::tensor_tree(&tree, stats.paths));
    let normal = tree.along_normal();
    let [r, t] = [&tree.reflection[0], &tree.transmission[0]]
        .map(|matrix| tree.hemispherical(matrix, normal));
    summary.what = "tensor_tree";
    summary.paths = stats.paths;
    summary.extra = vec![
        ("rank", json!(args.tree.tree_rank)),
        ("depth", json!(args.tree.tree_depth)),
        ("values_kept", json!(joined)),
        ("reflected_along_normal", json!(r)),
        ("transmitted_along_normal", json!(t)),
    ];
    summary.result_line = Some(format!(
        "along the normal R {r:.4?}, T {t:.4?}; median standard error of a cell {:.0} % of its \
         value; the file keeps {:.1} % of the cells",
        100.0 * median_error(&tree.reflection[0]),
        100.0 * joined
    ));
    Ok(())
}

/// Median of the standard errors of cells as shares of their values.
fn median_error(cells: &[TreeCell]) -> f64 {
    let share =
        |c: &TreeCell| f64::from(c.variance).sqrt() * 3.0 / f64::from(c.mean.iter().sum::<f32>());
    let mut shares: Vec<f64> = cells.iter().map(share).filter(|s| s.is_finite()).collect();
    shares.sort_by(f64::total_cmp);
    shares.get(shares.len() / 2).copied().unwrap_or(0.0)
}
