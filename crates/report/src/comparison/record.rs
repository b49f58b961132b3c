//! A comparison as figures: JSON and CSV.

use super::{Comparison, LIGHTS};
use crate::ReportError;
use serde_json::{Value, json};

impl Comparison {
    /// All figures.
    pub fn json(&self) -> Value {
        let measured: Vec<Value> = self
            .measured
            .iter()
            .map(|m| {
                json!({
                    "model": m.model, "layout": m.layout, "in_plane": m.in_plane,
                    "albedo": m.albedos, "reciprocity_se": m.reciprocity,
                    "paths": m.paths, "seconds": m.seconds,
                })
            })
            .collect();
        let judged: Vec<Value> = self
            .judged
            .iter()
            .map(|j| {
                json!({
                    "model": j.model, "layout": j.layout, "in_plane_reflected": j.reflection,
                    "in_plane_transmitted": j.transmission,
                    "flip": j.flip.iter().map(|f| f.mean).collect::<Vec<_>>(),
                    "agrees": j.layout.median.is_below(self.limit),
                })
            })
            .collect();
        json!({
            "name": self.name, "command": self.command, "reference": self.reference(),
            "limit": self.limit, "lights": LIGHTS.map(|l| l.name),
            "differences": judged, "measured": measured,
        })
    }

    /// The pairs of all models as CSV.
    ///
    /// # Errors Errors of the CSV writer, which are not expected.
    pub fn pairs_csv(&self) -> Result<String, ReportError> {
        let mut out = csv::Writer::from_writer(Vec::new());
        out.write_record([
            "model", "theta_i", "phi_i", "theta_o", "phi_o", "r", "g", "b", "se_r", "se_g", "se_b",
        ])?;
        for m in &self.measured {
            for v in m.layout.iter().chain(&m.in_plane) {
                let (i, o) = (v.pair.incident, v.pair.exitant);
                let angles = [i.theta_deg, i.phi_deg, o.theta_deg, o.phi_deg];
                let numbers = angles.iter().chain(&v.bsdf.mean).chain(&v.bsdf.se);
                let words = numbers.map(f64::to_string);
                out.write_record(std::iter::once(m.model.clone()).chain(words))?;
            }
        }
        crate::text_of(out)
    }
}
