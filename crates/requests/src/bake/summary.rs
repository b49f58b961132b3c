//! What `organza bake` prints, and `bake.json`.

use super::{Cloth, Made};
use organza_bake::error_table::{ErrorRow, error_rows};
use organza_bake::fit::Fitted;
use organza_bake::layout::{Part, Side};
use organza_bake::model::TARGETS;
use serde_json::{Value, json};
use std::path::Path;

/// The results of a bake of one cloth.
pub struct Report<'a> {
    pub cloth: &'a Cloth<'a>,
    pub made: &'a Made,
    pub seed: u64,
    /// Names and meanings, of all cloths.
    pub textures: &'a [(String, &'static str)],
}

impl Report<'_> {
    fn rows(&self, fit: &Fitted, held_out: bool) -> Vec<ErrorRow> {
        let m = &self.made.measured;
        error_rows(&m.plan, &fit.values, &m.pairs, held_out)
    }

    /// Light that passes straight through: direction, measured share, share of the opacity.
    fn straight(&self) -> Vec<Value> {
        let open = 1.0 - self.made.maps.coverage();
        let row = |a: &organza_measure::Albedo| {
            json!({
                "theta_deg": a.incident.theta_deg,
                "phi_deg": a.incident.phi_deg,
                "measured": a.direct.mean[0],
                "standard_error": a.direct.se[0],
                "material": open,
            })
        };
        self.made.measured.straight.iter().map(row).collect()
    }

    /// The whole file `bake.json`.
    pub fn json(&self) -> Value {
        let (low, high) = self.made.maps.height_range_mm();
        let materials: Vec<Value> = TARGETS
            .iter()
            .zip(&self.made.fits)
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
        let measured = self
            .made
            .measured
            .plan
            .iter()
            .zip(&self.made.measured.pairs);
        let pairs: Vec<Value> = measured
            .enumerate()
            .map(|(k, (planned, value))| {
                let values = TARGETS.iter().zip(&self.made.fits);
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
        let folder = Some(Path::new(&self.cloth.folder));
        let is_own = |t: &&(String, &str)| Path::new(&t.0).parent() == folder;
        let own = self.textures.iter().filter(is_own);
        let textures: Vec<Value> = own
            .map(|(file, meaning)| json!({ "file": file, "meaning": meaning }))
            .collect();
        json!({
            "format": "organza bake 1",
            "fabric": self.cloth.path.display().to_string(),
            "name": self.cloth.name,
            "measured_model": self.cloth.shown.representation.name,
            "seed": self.seed,
            "tile_mm": self.made.maps.tile_mm.to_array(),
            "texels": self.made.maps.size.to_array(),
            "height_mm": [low, high],
            "relief_smoothing_mm": self.made.smoothing_mm,
            "textures": textures,
            "materials": materials,
            "straight_through": self.straight(),
            "pairs": pairs,
        })
    }

    /// The lines to print.
    pub fn lines(&self) -> Vec<String> {
        let [w, h] = self.made.maps.tile_mm.to_array();
        let [x, y] = self.made.maps.size.to_array();
        let mut lines = vec![
            format!(
                "{}: textures of {w:.3} x {h:.3} mm, {x} x {y} texels",
                self.cloth.name
            ),
            "error against the measurement, at directions that the fit has not seen:".to_owned(),
            format!(
                "{:<20} {:<34} {:>6} {:>7} {:>6}",
                "material", "light", "rms %", "bias %", "pairs"
            ),
        ];
        for (target, fit) in TARGETS.iter().zip(&self.made.fits) {
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
            100.0 * (1.0 - self.made.maps.coverage())
        ));
        for a in &self.made.measured.straight {
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
