//! Pairs of directions, or single ones, each of which is a row of a table.

use super::layout::{Found, Kind, Layout, check_count};
use super::{Measuring, Values, dark_pairs, median_error, results, widen};
use anyhow::Result;
use organza_measure::{
    Albedo, Angles, Pair, PairValue, grid_directions, grid_layout, irawan_incident, irawan_layout,
    measure_albedo_rows, measure_openness, measure_pair_rows, write_albedos, write_pairs,
};
use organza_scene::representation::ShownAs;
use organza_work::Results;
use organza_work::output::SeekWrite;
use serde_json::{Value, json};
use std::ops::Range;

/// The layout of the measurements that Irawan's model was fitted to.
pub(crate) static IRAWAN: Layout = Layout {
    name: "irawan",
    help: "225 incident directions out to 75 degrees times 7 exitant ones",
    kind: Kind::Rows {
        pairs: |_| irawan_layout(),
        incident: |_| irawan_incident(),
        check: |_| Ok(()),
    },
};

/// A regular grid.
pub(crate) static GRID: Layout = Layout {
    name: "grid",
    help: "A regular grid of directions, see --grid",
    kind: Kind::Rows {
        pairs: |m| grid_layout(m.grid[0], m.grid[1]),
        incident: |m| grid_directions(m.grid[0], m.grid[1], true),
        check: |job| {
            let directions = 2 * u64::from(job.grid[0]) * u64::from(job.grid[1]);
            let count = match job.albedo {
                true => directions,
                false => directions.saturating_mul(directions / 2),
            };
            check_count(job, "grid", count)
        },
    },
};

/// Measures pairs.
///
/// # Errors
/// Those of the measurement.
pub fn measure_pairs(m: &Measuring<'_>, pairs: &[Pair], rows: Range<usize>) -> Result<Found> {
    let patch = m.patch();
    let mut result = measure_pair_rows(patch, pairs, rows, &m.effort, m.watch)?;
    widen(m, |table| table.widen_pairs(&mut result.list))?;
    Ok(Found {
        paths: result.stats.paths,
        heavy_tails: result.heavy_tails,
        count: result.list.len(),
        values: Box::new(Pairs(result.list)),
    })
}

/// Measures where the light of single directions goes.
///
/// # Errors
/// Those of the measurement.
pub fn measure_albedos(m: &Measuring<'_>, list: &[Angles], rows: Range<usize>) -> Result<Found> {
    let patch = m.patch();
    let mut result = measure_albedo_rows(patch, list, rows, &m.effort, m.watch)?;
    let mut of_table = 0.0;
    widen(m, |table| {
        of_table = table.noise.first().map_or(0.0, |normal| normal.straight);
        table.widen_albedos(&mut result.list)
    })?;
    let (open, se) = measure_openness(patch, &m.effort, &|_| m.job.context.flow())?;
    Ok(Found {
        paths: result.stats.paths,
        heavy_tails: result.heavy_tails,
        count: result.list.len(),
        values: Box::new(Albedos {
            list: result.list,
            openness: [open, se.hypot(of_table)],
        }),
    })
}

/// Values of pairs.
struct Pairs(Vec<PairValue>);

impl Values for Pairs {
    fn what(&self) -> &'static str {
        "pairs"
    }

    fn results(&self, paths: u64) -> Results {
        results::pairs(&self.0, paths)
    }

    fn write(&self, _ending: &str, out: &mut dyn SeekWrite) -> Result<()> {
        Ok(write_pairs(&self.0, out)?)
    }

    fn list(&self) -> Value {
        json!(self.0)
    }

    fn line(&self) -> Option<String> {
        median_error(&self.0)
    }

    fn dark(&self, shown: Option<ShownAs>) -> [usize; 2] {
        dark_pairs(shown, &self.0)
    }
}

/// Where the light of single directions goes.
struct Albedos {
    list: Vec<Albedo>,
    /// With its standard error.
    openness: [f64; 2],
}

impl Values for Albedos {
    fn what(&self) -> &'static str {
        "albedo"
    }

    fn results(&self, paths: u64) -> Results {
        results::albedos(&self.list, self.openness, paths)
    }

    fn write(&self, _ending: &str, out: &mut dyn SeekWrite) -> Result<()> {
        Ok(write_albedos(&self.list, out)?)
    }

    fn list(&self) -> Value {
        json!(self.list)
    }

    fn extra(&self) -> Vec<(&'static str, Value)> {
        let [open, se] = self.openness;
        vec![
            ("openness", json!(open)),
            ("cover_factor", json!(1.0 - open)),
            ("se_openness", json!(se)),
        ]
    }

    fn line(&self) -> Option<String> {
        let [open, se] = self.openness;
        let cover = 1.0 - open;
        Some(format!(
            "openness {open:.4} +- {se:.4}, cover factor {cover:.4}"
        ))
    }
}
