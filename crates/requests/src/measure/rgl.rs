//! `rgl`: reflection in the tensor format of the RGL material database.

use super::layout::{BothBands, Found, Kind, Layout, Whole, check_memory};
use super::{Measure, Measuring, Values, dark_pairs, median_error, results};
use anyhow::Result;
use organza_measure::{AdaptiveGrid, AdaptiveResult, measure_adaptive, write_adaptive};
use organza_scene::representation::ShownAs;
use organza_work::Results;
use organza_work::output::SeekWrite;
use serde_json::{Value, json};

/// The layout.
pub(crate) static LAYOUT: Layout = Layout {
    name: "rgl",
    help: "Reflection in the tensor format of the RGL material database, for Mitsuba, see --rgl-grid",
    kind: Kind::Whole(Whole {
        ending: Some("bsdf"),
        needs_ending: true,
        takes_target_error: true,
        both_bands: BothBands::Never,
        check: |job| check_memory(job, "rgl_grid", grid(job).memory_bytes()),
        count: |m| grid(m.job).pairs() as usize,
        measure,
    }),
};

fn grid(request: &Measure) -> AdaptiveGrid {
    let [polar, azimuths, side] = request.rgl_grid;
    AdaptiveGrid {
        polar,
        azimuths,
        side,
    }
}

fn measure(m: &Measuring<'_>) -> Result<Found> {
    let grid = grid(m.job);
    let result = measure_adaptive(m.patch(), grid, &m.effort, m.watch)?;
    let name = m.name();
    Ok(Found {
        paths: result.stats.paths,
        heavy_tails: 0,
        count: grid.incident_count(),
        values: Box::new(Rgl {
            result,
            description: format!("{name}: reflection of the face, measured by organza"),
        }),
    })
}

struct Rgl {
    result: AdaptiveResult,
    description: String,
}

impl Values for Rgl {
    fn what(&self) -> &'static str {
        "rgl"
    }

    fn results(&self, paths: u64) -> Results {
        results::pairs(&self.result.pairs, paths)
    }

    fn write(&self, _ending: &str, out: &mut dyn SeekWrite) -> Result<()> {
        Ok(write_adaptive(&self.result.brdf, &self.description, out)?)
    }

    fn extra(&self) -> Vec<(&'static str, Value)> {
        let normal = self.result.brdf.reflectance(0, 0);
        vec![
            ("pairs", json!(self.result.pairs.len())),
            ("reflected_along_normal", json!(normal)),
        ]
    }

    fn line(&self) -> Option<String> {
        let normal = self.result.brdf.reflectance(0, 0);
        let error = median_error(&self.result.pairs).unwrap_or_default();
        Some(format!("along the normal R {normal:.4?}; {error}"))
    }

    fn dark(&self, shown: Option<ShownAs>) -> [usize; 2] {
        dark_pairs(shown, &self.result.pairs)
    }
}
