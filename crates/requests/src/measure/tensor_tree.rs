//! `tensor-tree`: the four matrices of a tensor tree for Radiance.

use super::layout::{BothBands, Found, Kind, Layout, Whole, check_memory};
use super::{Measure, Measuring, Values, results};
use anyhow::Result;
use organza_measure::{
    TensorTree, TreeCell, TreeLayout, TreeRank, measure_tensor_tree, write_tensor_tree,
};
use organza_work::output::SeekWrite;
use organza_work::{Results, of_option};
use serde_json::{Value, json};

/// The layout.
pub(crate) static LAYOUT: Layout = Layout {
    name: "tensor-tree",
    help: "The four matrices of a tensor tree for Radiance, see --tree-depth",
    kind: Kind::Whole(Whole {
        ending: Some("xml"),
        needs_ending: true,
        takes_target_error: false,
        both_bands: BothBands::Never,
        check: |job| check_memory(job, "tree_depth", layout(job)?.memory_bytes()),
        count: |m| layout(m.job).map_or(0, |l| 2 * l.incident_cells()),
        measure,
    }),
};

fn layout(request: &Measure) -> Result<TreeLayout> {
    let (rank, depth) = (request.tree_rank, request.tree_depth);
    let kind = match rank {
        3 => TreeRank::Isotropic,
        _ => TreeRank::Anisotropic,
    };
    TreeLayout::new(kind, depth).ok_or_else(|| {
        let why = format!("expected at most 6 for --tree-rank {rank}, found {depth}");
        of_option("tree_depth", why)
    })
}

fn measure(m: &Measuring<'_>) -> Result<Found> {
    let (spp, seed) = (m.job.spp, m.job.seed);
    let (tree, stats) = measure_tensor_tree(m.patch(), layout(m.job)?, spp, seed, m.watch)?;
    let (name, prune) = (m.name(), m.job.prune);
    Ok(Found {
        values: Box::new(Tree {
            kept: write_tensor_tree(&tree, &name, prune, &mut std::io::sink())?,
            sizes: [m.job.tree_rank, m.job.tree_depth],
            tree,
            name,
            prune,
        }),
        paths: stats.paths,
        heavy_tails: 0,
        count: m.count(),
    })
}

struct Tree {
    tree: TensorTree,
    name: String,
    prune: Option<f64>,
    /// Share of the cells that the file keeps.
    kept: f64,
    /// Rank and depth.
    sizes: [u32; 2],
}

impl Tree {
    /// Reflected and transmitted light along the normal.
    fn along_normal(&self) -> [[f64; 3]; 2] {
        let (tree, normal) = (&self.tree, self.tree.along_normal());
        [&tree.reflection[0], &tree.transmission[0]]
            .map(|matrix| tree.hemispherical(matrix, normal))
    }
}

impl Values for Tree {
    fn what(&self) -> &'static str {
        "tensor_tree"
    }

    fn results(&self, paths: u64) -> Results {
        results::tensor_tree(&self.tree, paths)
    }

    fn write(&self, _ending: &str, mut out: &mut dyn SeekWrite) -> Result<()> {
        write_tensor_tree(&self.tree, &self.name, self.prune, &mut out)?;
        Ok(())
    }

    fn extra(&self) -> Vec<(&'static str, Value)> {
        let [r, t] = self.along_normal();
        let [rank, depth] = self.sizes;
        vec![
            ("rank", json!(rank)),
            ("depth", json!(depth)),
            ("values_kept", json!(self.kept)),
            ("reflected_along_normal", json!(r)),
            ("transmitted_along_normal", json!(t)),
        ]
    }

    fn line(&self) -> Option<String> {
        let [r, t] = self.along_normal();
        Some(format!(
            "along the normal R {r:.4?}, T {t:.4?}; median standard error of a cell {:.0} % of its \
             value; the file keeps {:.1} % of the cells",
            100.0 * median_error(&self.tree.reflection[0]),
            100.0 * self.kept
        ))
    }
}

/// Median of the standard errors of cells as shares of their values.
fn median_error(cells: &[TreeCell]) -> f64 {
    let share =
        |c: &TreeCell| f64::from(c.variance).sqrt() * 3.0 / f64::from(c.mean.iter().sum::<f32>());
    let mut shares: Vec<f64> = cells.iter().map(share).filter(|s| s.is_finite()).collect();
    shares.sort_by(f64::total_cmp);
    shares.get(shares.len() / 2).copied().unwrap_or(0.0)
}
