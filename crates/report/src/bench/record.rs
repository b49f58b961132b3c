//! A bench as figures: JSON, and tables of text.

use super::quantity::{
    NOISE, describe_choice, ends, exponent, interval, mib, percent, recommended, seconds_to_noise,
    short,
};
use super::try_all::{Tried, ViewResult};
use super::{BenchReport, Sample};
use organza_measure::{Cost, Figure, pareto_front};
use serde_json::{Value, json};
use std::fmt::Write;

/// The Pareto front of the results in error, time and memory.
pub(super) fn front(results: &[Tried]) -> Vec<bool> {
    let of = |t: &Tried| {
        let cost = &t.row.cost;
        [
            t.row.rmse.value,
            seconds_to_noise(cost),
            cost.memory_bytes as f64,
        ]
    };
    pareto_front(&results.iter().map(of).collect::<Vec<_>>())
}

impl BenchReport<'_> {
    /// A sentence for every fabric, distance, light and tolerance.
    pub fn recommendations(&self) -> Vec<String> {
        let mut list = Vec::new();
        for (sample, view) in self.bench.views() {
            for &tolerance in self.within {
                let taken = view.recommendation(tolerance);
                let words = taken.map(|r| recommended(&r, sample)).unwrap_or_default();
                list.push(format!(
                    "{}, {}, within {}: {words}",
                    sample.name,
                    view.view.description(),
                    percent(tolerance)
                ));
            }
        }
        list
    }

    /// Every figure.
    pub fn json(&self) -> Value {
        let fabrics: Vec<Value> = self
            .bench
            .fabrics
            .iter()
            .map(|f| {
                let views = f.views.iter().map(|v| self.view_json(f.sample, v));
                json!({
                    "fabric": f.sample.name,
                    "voxel_um": f.sample.fabric.file.voxel.size_um,
                    "views": views.collect::<Vec<Value>>(),
                })
            })
            .collect();
        let plan = self.bench.plan;
        json!({
            "command": self.command,
            "version": env!("CARGO_PKG_VERSION"),
            "resolution": plan.resolution,
            "samples": plan.spp,
            "samples_of_truth": plan.truth_spp,
            "within": self.within,
            "fabrics": fabrics,
            "growth": self.bench.growth,
        })
    }

    fn view_json(&self, sample: &Sample, v: &ViewResult) -> Value {
        let results: Vec<Value> = v
            .results
            .iter()
            .zip(front(&v.results))
            .map(|(t, on_front)| {
                json!({
                    "choice": t.row.choice, "words": describe_choice(&t.row.choice, sample),
                    "backend": t.backend, "rmse": t.row.rmse, "bias": t.row.bias,
                    "noise": t.noise, "setup_s": t.row.cost.setup_s,
                    "seconds_to_noise_1": t.row.cost.noise_s,
                    "efficiency": 1.0 / t.row.cost.noise_s,
                    "memory_bytes": t.row.cost.memory_bytes, "on_front": on_front,
                })
            })
            .collect();
        let refused: Vec<Value> = v
            .refusals
            .iter()
            .map(|r| json!({ "choice": describe_choice(&r.choice, sample), "why": r.why }))
            .collect();
        let peers: Vec<Value> = v
            .peers
            .iter()
            .map(|p| json!({ "program": p.program, "error": p.error, "cost": p.cost }))
            .collect();
        let recommended: Vec<Value> = self
            .within
            .iter()
            .map(|&t| json!({ "within": t, "recommendation": v.recommendation(t) }))
            .collect();
        json!({
            "pixel_mm": v.view.pixel_mm, "lit": v.view.lit.name(), "results": results,
            "refused": refused, "peers": peers, "recommended": recommended,
        })
    }

    /// The recommendations, all choices and the growth of cost, as tables in Markdown.
    pub fn markdown(&self) -> String {
        let mut text = format!("`{}`\n\n", self.command);
        let _ = write!(text, "| fabric, pixel, lit from |");
        for t in self.within {
            let _ = write!(text, " within {} |", percent(*t));
        }
        let _ = writeln!(text, "\n|---|{}", "---|".repeat(self.within.len()));
        for (sample, v) in self.bench.views() {
            let _ = write!(text, "| {} |", short(sample, &v.view));
            for &t in self.within {
                let words = v.recommendation(t).map(|r| recommended(&r, sample));
                let _ = write!(text, " {} |", words.unwrap_or_default());
            }
            text.push('\n');
        }
        let _ = writeln!(
            text,
            "\n| fabric, pixel, lit from | choice | error | bias | s to {} noise | MiB |\n|---|---|---|---|---|---|",
            percent(NOISE)
        );
        for (sample, v) in self.bench.views() {
            let mut row = |what: &str, rmse: &Figure, bias: &Figure, cost: &Cost| {
                let _ = writeln!(
                    text,
                    "| {} | {what} | {} | {} | {:.1} | {:.0} |",
                    short(sample, &v.view),
                    interval(rmse),
                    interval(bias),
                    seconds_to_noise(cost),
                    mib(cost.memory_bytes),
                );
            };
            for t in &v.results {
                let what = describe_choice(&t.row.choice, sample);
                row(&what, &t.row.rmse, &t.row.bias, &t.row.cost);
            }
            for p in &v.peers {
                row(&p.program, &p.error.rmse, &p.error.bias, &p.cost);
            }
        }
        if !self.bench.growth.is_empty() {
            let _ = writeln!(
                text,
                "\n| what grows | choice | from, to | setup | tracing | memory |\n|---|---|---|---|---|---|"
            );
            for s in &self.bench.growth {
                let _ = writeln!(
                    text,
                    "| {} | {} | {} | {} | {} | {} |",
                    s.grows.description(),
                    s.what,
                    ends(s),
                    exponent(s.setup),
                    exponent(s.trace),
                    exponent(s.memory),
                );
            }
        }
        text
    }
}
