//! `klems`: the four matrices of the Klems basis.

use super::layout::{BothBands, Found, Kind, Layout, Whole};
use super::{Measuring, Values, dark_pairs, results};
use anyhow::Result;
use clap::ValueEnum;
use organza_measure::{
    KlemsBasis, KlemsBsdf, SolarKlems, measure_klems, measure_openness, write_klems, write_pairs,
};
use organza_scene::representation::ShownAs;
use organza_work::Results;
use organza_work::output::SeekWrite;
use serde_json::{Value, json};

/// The layout.
pub(crate) static LAYOUT: Layout = Layout {
    name: "klems",
    help: "The four matrices of the Klems basis, one path for all exitant directions",
    kind: Kind::Whole(Whole {
        ending: Some("xml"),
        needs_ending: false,
        takes_target_error: false,
        both_bands: BothBands::InFile,
        check: |_| Ok(()),
        count: |m| 2 * KlemsBasis::from(m.job.klems_basis).len(),
        measure,
    }),
};

/// Klems bases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum KlemsBasisName {
    /// 145 patches a side
    #[default]
    Full,
    /// 73
    Half,
    /// 41
    Quarter,
}

impl From<KlemsBasisName> for KlemsBasis {
    fn from(name: KlemsBasisName) -> KlemsBasis {
        match name {
            KlemsBasisName::Full => KlemsBasis::Full,
            KlemsBasisName::Half => KlemsBasis::Half,
            KlemsBasisName::Quarter => KlemsBasis::Quarter,
        }
    }
}

fn measure(m: &Measuring<'_>) -> Result<Found> {
    let (spp, seed, basis) = (m.job.spp, m.job.seed, m.job.klems_basis.into());
    let (bsdf, stats) = measure_klems(m.patch(), basis, spp, seed, m.watch)?;
    let mut paths = stats.paths;
    let mut solar = None;
    if let Some(patch) = m.subject.patches.get(1) {
        let (sun, more) = measure_klems(patch, basis, spp, seed, m.watch)?;
        paths += more.paths;
        solar = Some((
            sun,
            measure_openness(patch, &m.effort, &|_| m.job.context.flow())?.0,
        ));
    }
    Ok(Found {
        values: Box::new(Klems {
            bsdf,
            solar,
            thickness_mm: m.subject.thickness_mm,
            name: m.name(),
        }),
        paths,
        heavy_tails: 0,
        count: m.count(),
    })
}

struct Klems {
    bsdf: KlemsBsdf,
    /// The same for all of the sun's radiation, and the openness.
    solar: Option<(KlemsBsdf, f64)>,
    thickness_mm: f64,
    name: String,
}

impl Values for Klems {
    fn what(&self) -> &'static str {
        "klems"
    }

    fn results(&self, paths: u64) -> Results {
        results::klems(&self.bsdf, paths)
    }

    fn write(&self, ending: &str, out: &mut dyn SeekWrite) -> Result<()> {
        if ending != "xml" {
            return Ok(write_pairs(&self.bsdf.pairs(), out)?);
        }
        let solar = self.solar.as_ref().map(|(bsdf, openness)| SolarKlems {
            bsdf,
            thickness_mm: self.thickness_mm,
            openness: *openness,
        });
        let text = write_klems(&self.bsdf, solar, &self.name)?;
        Ok(out.write_all(text.as_bytes())?)
    }

    fn list(&self) -> Value {
        json!(self.bsdf.pairs())
    }

    fn line(&self) -> Option<String> {
        let along = |matrix| self.bsdf.hemispherical(matrix, 0);
        let (r, t) = (
            along(&self.bsdf.reflection[0]),
            along(&self.bsdf.transmission[0]),
        );
        Some(format!("along the normal R {r:.4?}, T {t:.4?}"))
    }

    fn dark(&self, shown: Option<ShownAs>) -> [usize; 2] {
        dark_pairs(shown, &self.bsdf.pairs())
    }
}
