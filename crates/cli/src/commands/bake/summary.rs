//! What `organza bake` prints, and `bake.json`.

use super::Measurement;
use organza_bake::error_table::{ErrorRow, error_rows};
use organza_bake::fit::Fitted;
use organza_bake::layout::{Part, Side};
use organza_bake::maps::Maps;
use organza_bake::model::TARGETS;
use serde_json::{Value, json};
use std::path::Path;

/// The results of a bake.
pub struct Report<'a> {
    pub fabric: &'a Path,
    pub name: &'a str,
    pub model: &'static str,
    pub seed: u64,
    pub maps: &'a Maps,
    pub smoothing_mm: f32,
    /// In the order of the models.
    pub fits: &'a [Fitted],
    pub measured: &'a Measurement,
    /// Names and meanings.
    pub textures: &'a [(String, &'static str)],
}

impl Report<'_> {
    fn rows(&self, fit: &Fitted, held_out: bool) -> Vec<ErrorRow> {
        let m = self.measured;
        error_rows(&m.plan, &fit.values, &m.pairs, held_out)
    }

    /// Light that passes straight through: direction, measured share, share of the opacity.
    fn straight(&self) -> Vec<Value> {
        let open = 1.0 - self.maps.coverage();
        let row = |a: &organza_measure::Albedo| {
            json!({
                "theta_deg": a.incident.theta_deg,
                "phi_deg": a.incident.phi_deg,
                "measured": a.direct.mean[0],
                "standard_error": a.direct.se[0],
                "material": open,
            })
        };
        self.measured.straight.iter().map(row).collect()
    }

    /// The whole file `bake.json`.
    pub fn json(&self) -> Value {
        let (low, high) = self.maps.height_range_mm();
        let materials: Vec<Value> = TARGETS
            .iter()
            .zip(self.fits)
            .map(|(target, fit)| {
                json!({
                    "name": target.name,
                    "file": target.file,
                    "parameters": fit.parameters,
                    "free_parameters": fit.determined,
                    "errors_held_out": self.rows(fit, true),
                    "errors_fitted": self.rows(fit, false),
                    "cannot_show": target.limits,
                })
            })
            .collect();
        let measured = self.measured.plan.iter().zip(&self.measured.pairs);
        let pairs: Vec<Value> = measured
            .enumerate()
            .map(|(k, (planned, value))| {
                let values = TARGETS.iter().zip(self.fits);
                let materials: serde_json::Map<String, Value> = values
                    .map(|(t, fit)| (t.name.to_owned(), json!(fit.values.get(k))))
                    .collect();
                json!({
                    "incident": planned.pair.incident,
                    "exitant": planned.pair.exitant,
                    "side": planned.side,
                    "part": planned.part,
                    "is_held_out": planned.is_held_out,
                    "measured": value.bsdf.mean,
                    "standard_error": value.bsdf.se,
                    "materials": materials,
                })
            })
            .collect();
        let textures: Vec<Value> = self
            .textures
            .iter()
            .map(|(file, meaning)| json!({ "file": file, "meaning": meaning }))
            .collect();
        json!({
            "format": "organza bake 1",
            "fabric": self.fabric.display().to_string(),
            "name": self.name,
            "measured_model": self.model,
            "seed": self.seed,
            "tile_mm": self.maps.tile_mm.to_array(),
            "texels": self.maps.size.to_array(),
            "height_mm": [low, high],
            "relief_smoothing_mm": self.smoothing_mm,
            "textures": textures,
            "materials": materials,
            "straight_through": self.straight(),
            "pairs": pairs,
        })
    }

    /// The lines to print.
    pub fn lines(&self) -> Vec<String> {
        let [w, h] = self.maps.tile_mm.to_array();
        let [x, y] = self.maps.size.to_array();
        let mut lines = vec![
            format!("one repeat: {w:.3} x {h:.3} mm, {x} x {y} texels"),
            "error against the measurement, at directions that the fit has not seen:".to_owned(),
            format!(
                "{:<20} {:<34} {:>6} {:>7} {:>6}",
                "material", "light", "rms %", "bias %", "pairs"
            ),
        ];
        for (target, fit) in TARGETS.iter().zip(self.fits) {
            for row in self.rows(fit, true) {
                lines.push(format!(
                    "{:<20} {:<34} {:>6.1} {:>+7.1} {:>6}",
                    target.name,
                    light(&row),
                    100.0 * row.rms,
                    100.0 * row.bias,
                    row.pairs
                ));
            }
        }
        lines.push(format!(
            "straight through: {:.1} % by the opacity from all directions; measured",
            100.0 * (1.0 - self.maps.coverage())
        ));
        for a in &self.measured.straight {
            let axis = if a.incident.phi_deg == 0.0 {
                "weft"
            } else {
                "warp"
            };
            lines.push(format!(
                "  {:>3} degrees along the {axis}: {:.1} +- {:.1} %",
                a.incident.theta_deg,
                100.0 * a.direct.mean[0],
                100.0 * a.direct.se[0]
            ));
        }
        for target in TARGETS {
            lines.push(format!("{} ({}) cannot show:", target.name, target.file));
            lines.extend(target.limits.iter().map(|limit| format!("  - {limit}")));
        }
        lines
    }
}

/// Which light a row is about.
fn light(row: &ErrorRow) -> String {
    let side = match row.side {
        Side::Face => "reflected by the face",
        Side::Back => "reflected by the back",
        Side::Through => "scattered through",
    };
    let part = match row.part {
        None => return side.to_owned(),
        Some(Part::Highlight) => "highlight",
        Some(Part::Diffuse) => "diffuse",
        Some(Part::Grazing) => "grazing",
        Some(Part::Forward) => "forward",
        Some(Part::Spread) => "spread",
    };
    format!("  {side}: {part}")
}
