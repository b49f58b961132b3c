//! What a fit to photographs found, as it is printed.

use super::agreement::{self, Agreement};
use super::model::SYSTEMS;
use super::photographs::Photographs;
use super::search::SearchResult;
use super::sides::Side;
use crate::FitJob;
use crate::triple;
use anyhow::Result;
use organza_photograph::{ThreadGrid, name_of};
use organza_report::PhotographFit;
use organza_weave::Draft;
use serde_json::{Value, json};
use std::path::Path;

/// The name of a draft, or its rows.
pub fn shown_name(draft: &Draft) -> String {
    name_of(draft).unwrap_or_else(|| draft.drawdown().trim().replace('\n', "/"))
}

/// What a fit found.
pub struct Answer<'a> {
    /// Where the threads are.
    pub grid: &'a ThreadGrid,
    /// Spacing of warp and weft.
    pub spacing_mm: [f64; 2],
    /// Colours of one repeat of the threads of warp and weft.
    pub thread_colours: &'a [Vec<[f64; 3]>; 2],
    /// Widths of their threads.
    pub widths_mm: [f64; 2],
    /// The draft.
    pub draft: &'a Draft,
    /// How certain it is, from 0 to 1.
    pub confidence: f64,
    /// The likeliest ones, and how likely they are.
    pub likely: Vec<(String, f64)>,
    /// Whether the arguments name it.
    pub is_given: bool,
    /// The other values.
    pub found: &'a SearchResult,
    /// The photographs.
    pub sides: &'a [Side],
    /// How well the pictures agree with them.
    pub agreement: Vec<Agreement>,
}

impl Answer<'_> {
    /// What is printed.
    pub fn words(&self) -> Vec<String> {
        let mut list = Vec::new();
        let angles = self.grid.angles_deg();
        for (k, system) in SYSTEMS.into_iter().enumerate() {
            let error = match self.width_se_mm(k) {
                Some(error) => format!("+- {error:.4} mm"),
                None => "mm (most alike of a few)".to_owned(),
            };
            list.push(format!(
                "{system}: {:.3} threads per cm, turned by {:.2} degrees; width {:.4} {error}; colour {}",
                10.0 / self.spacing_mm[k],
                angles[k],
                self.widths_mm[k],
                triple(self.found.trial.colours[k]),
            ));
        }
        for (colours, system) in self.thread_colours.iter().zip(SYSTEMS) {
            if colours.len() > 1 {
                let runs = colours.chunk_by(|a, b| a == b);
                let run = |run: &[[f64; 3]]| format!("{} of {}", run.len(), triple(run[0]));
                let runs: Vec<String> = runs.map(run).collect();
                let all = colours.len();
                list.push(format!(
                    "{system}: repeats after {all} threads: {}",
                    runs.join(", ")
                ));
            }
        }
        list.push(match self.is_given {
            true => format!("draft: {}, given", shown_name(self.draft)),
            false => format!("draft: {}", super::named(&self.likely)),
        });
        for (side, agreement) in self.sides.iter().zip(&self.agreement) {
            list.push(format!("{}: {agreement}", side.name));
        }
        list.extend(self.sides.iter().filter_map(Side::vignetting));
        list
    }

    /// Standard error of a width: threads are as wide as the root of their count. None where that
    /// was not searched for.
    fn width_se_mm(&self, k: usize) -> Option<f64> {
        let name = format!("yarn.{}.tex", SYSTEMS[k]);
        let tex = self.found.parameters.iter().find(|p| p.name == name)?;
        Some(0.5 * self.widths_mm[k] * tex.se / tex.value.max(1e-9))
    }

    /// For programs.
    pub fn figures(&self) -> Value {
        let sides = self.sides.iter().zip(&self.agreement);
        let widths_se_mm = [0, 1].map(|k| self.width_se_mm(k));
        json!({
            "spacing_mm": self.spacing_mm,
            "angles_deg": self.grid.angles_deg(),
            "draft": shown_name(self.draft),
            "next_draft": self.likely.get(1).map(|l| &l.0).filter(|_| !self.is_given),
            "likely": self.likely.iter().map(|(n, share)| json!({"draft": n, "share": share})).collect::<Vec<Value>>(),
            "confidence": self.confidence,
            "thread_colours": self.thread_colours,
            "widths_mm": self.widths_mm,
            "widths_se_mm": widths_se_mm,
            "residual": self.found.residual,
            "sides": sides.map(|(s, a)| a.json(s.name)).collect::<Vec<Value>>(),
        })
    }

    /// The report.
    pub fn page(&self, args: &FitJob, front: &Path, photographs: &Photographs) -> Result<String> {
        let pictures = self.found.pictures.iter().zip(&self.agreement);
        let shown = self.sides.iter().zip(photographs.all()).zip(pictures);
        let shown = shown.map(|((side, whole), (picture, agreement))| {
            agreement::shown(side, whole, picture, agreement)
        });
        let page = PhotographFit {
            title: format!("Fitted to {}", front.display()),
            command: args.context.command.clone(),
            lines: self.words(),
            sides: shown.collect(),
        };
        Ok(page.html()?)
    }
}
