//! `ptm`: a polynomial texture map.

use super::layout::{BothBands, Found, Kind, Layout, Whole, check_memory};
use super::{Measuring, Values};
use anyhow::Result;
use organza_measure::{MapEffort, PolynomialMap, measure_polynomial_map, write_polynomial_map};
use organza_work::Results;
use organza_work::output::SeekWrite;
use serde_json::{Value, json};

/// The layout.
pub(crate) static LAYOUT: Layout = Layout {
    name: "ptm",
    help: "A polynomial texture map: how every texel changes with the direction of the light, see --ptm-lamps",
    kind: Kind::Whole(Whole {
        ending: Some("ptm"),
        needs_ending: true,
        takes_target_error: false,
        both_bands: BothBands::Never,
        check: |_| Ok(()),
        count: |m| m.job.ptm_lamps as usize * m.subject.grid.texels.element_product() as usize,
        measure,
    }),
};

fn measure(m: &Measuring<'_>) -> Result<Found> {
    let (grid, lamps) = (&m.subject.grid, m.job.ptm_lamps);
    let needed = organza_measure::polynomial_map_memory_bytes(grid.texels);
    check_memory(m.job, "texels", needed)?;
    let effort = MapEffort {
        lamps,
        paths: m.job.spp,
        seed: m.job.seed,
    };
    let map = measure_polynomial_map(m.patch(), grid, &effort, m.watch)?;
    Ok(Found {
        values: Box::new(Map { map, lamps }),
        paths: m.job.spp * u64::from(lamps) * u64::from(grid.texels.element_product()),
        heavy_tails: 0,
        count: m.count(),
    })
}

struct Map {
    map: PolynomialMap,
    lamps: u32,
}

impl Values for Map {
    fn what(&self) -> &'static str {
        "ptm"
    }

    fn results(&self, _paths: u64) -> Results {
        let extra = self.extra().into_iter();
        extra.fold(Results::default(), |all, (name, value)| {
            all.with_figure(name, value)
        })
    }

    fn write(&self, _ending: &str, out: &mut dyn SeekWrite) -> Result<()> {
        Ok(write_polynomial_map(&self.map, out)?)
    }

    fn extra(&self) -> Vec<(&'static str, Value)> {
        vec![
            ("lamps", json!(self.lamps)),
            ("mean", json!(self.map.mean)),
            ("residual", json!(self.map.residual)),
            ("residual_by_noise", json!(self.map.noise)),
        ]
    }

    fn line(&self) -> Option<String> {
        Some(format!(
            "mean value {:.4} of white; residual of the polynomials {:.4}, of which noise {:.4}",
            self.map.mean, self.map.residual, self.map.noise
        ))
    }
}
