//! `sweep`: a lamp swung over face and back.

use super::layout::{BothBands, Found, Kind, Layout, Whole, check_count};
use super::{Measuring, Values, results};
use anyhow::Result;
use organza_measure::{SweepValue, front_and_back, lamp_positions, measure_sweep, write_sweep};
use organza_work::Results;
use organza_work::output::SeekWrite;
use serde_json::{Value, json};

/// The layout.
pub(crate) static LAYOUT: Layout = Layout {
    name: "sweep",
    help: "A linear light swung over face and back, seen along the normal",
    kind: Kind::Whole(Whole {
        ending: None,
        needs_ending: false,
        takes_target_error: true,
        both_bands: BothBands::Never,
        check: |job| {
            let count = (4.0 * (2.0 * 75.0 / job.step + 1.0)) as u64;
            check_count(job, "step", count)
        },
        count: |m| lamp_positions(m.job.step).len(),
        measure,
    }),
};

fn measure(m: &Measuring<'_>) -> Result<Found> {
    let list = measure_sweep(m.patch(), &lamp_positions(m.job.step), &m.effort, m.watch)?;
    Ok(Found {
        paths: m.job.spp * list.len() as u64,
        heavy_tails: 0,
        count: list.len(),
        values: Box::new(Sweep(list)),
    })
}

struct Sweep(Vec<SweepValue>);

impl Values for Sweep {
    fn what(&self) -> &'static str {
        "sweep"
    }

    fn results(&self, _paths: u64) -> Results {
        results::sweep(&self.0, front_and_back(&self.0))
    }

    fn write(&self, _ending: &str, out: &mut dyn SeekWrite) -> Result<()> {
        Ok(write_sweep(&self.0, out)?)
    }

    fn list(&self) -> Value {
        json!(self.0)
    }

    fn extra(&self) -> Vec<(&'static str, Value)> {
        let [front, back] = front_and_back(&self.0);
        vec![("front_lit", json!(front)), ("back_lit", json!(back))]
    }

    fn line(&self) -> Option<String> {
        let [front, back] = front_and_back(&self.0);
        Some(format!("front-lit {front:.4?}, back-lit {back:.4?}"))
    }
}
