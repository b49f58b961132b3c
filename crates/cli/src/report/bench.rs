//! The report of speed against error.

use crate::bench::scaling::Series;
use crate::bench::stage::{Sample, View, distance_words};
use crate::bench::try_all::{Plan, Tried, ViewResult};
use organza_measure::{Cost, Figure, Growth, pareto_front};
use organza_scene::auto::choice::Choice;
use organza_scene::auto::table::{Candidate, Recommendation, candidates, recommend};
use organza_scene::representation::FIBRES;
use serde_json::{Value, json};
use std::fmt::Write;

/// Everything on the page.
pub struct BenchReport<'a> {
    /// The command that made it.
    pub command: String,
    pub plan: &'a Plan,
    pub fabrics: &'a [(&'a Sample, Vec<ViewResult>)],
    pub growth: &'a [Series],
    /// Tolerances of the recommendations.
    pub within: &'a [f64],
    /// How long it all took.
    pub seconds: f64,
}

/// Relative noise at which times are compared.
const NOISE: f64 = 0.02;

/// Seconds until a picture's own noise is [`NOISE`].
pub(super) fn seconds_to_noise(cost: &Cost) -> f64 {
    cost.setup_s + cost.noise_s / (NOISE * NOISE)
}

/// Which results no other beats in error, time and memory together.
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

pub(super) fn percent(share: f64) -> String {
    let p = 100.0 * share;
    if p.abs() < 9.95 {
        format!("{p:.1} %")
    } else {
        format!("{p:.0} %")
    }
}

pub(super) fn interval(f: &Figure) -> String {
    format!(
        "{} ({} to {})",
        percent(f.value),
        percent(f.low),
        percent(f.high)
    )
}

pub(super) fn time(seconds: f64) -> String {
    match seconds {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 5940.0 => format!("{s:.0} s"),
        s => format!("{:.1} h", s / 3600.0),
    }
}

pub(super) fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

impl BenchReport<'_> {
    pub(super) fn recommendation(view: &ViewResult, tolerance: f64) -> Option<Recommendation> {
        let rows = view.results.iter().map(|t| &t.row);
        let list: Vec<Candidate> = candidates(rows, &[view.view.lit]);
        recommend(&list, tolerance)
    }

    /// A sentence for every fabric, distance, light and tolerance.
    pub fn recommendations(&self) -> Vec<String> {
        let mut list = Vec::new();
        for (sample, views) in self.fabrics {
            for view in views {
                for &tolerance in self.within {
                    let advice = Self::recommendation(view, tolerance)
                        .map(|r| recommended(&r, sample))
                        .unwrap_or_default();
                    list.push(format!(
                        "{}, {}, within {}: {advice}",
                        sample.name,
                        view.view.words(),
                        percent(tolerance)
                    ));
                }
            }
        }
        list
    }

    /// Every figure.
    pub fn json(&self) -> Value {
        let fabrics: Vec<Value> = self
            .fabrics
            .iter()
            .map(|(sample, views)| {
                let views: Vec<Value> = views.iter().map(|v| self.view_json(sample, v)).collect();
                json!({ "fabric": sample.name, "voxel_um": sample.fabric.file.voxel.size_um, "views": views })
            })
            .collect();
        json!({
            "command": self.command,
            "version": env!("CARGO_PKG_VERSION"),
            "resolution": self.plan.resolution,
            "samples": self.plan.spp,
            "samples_of_truth": self.plan.truth_spp,
            "within": self.within,
            "fabrics": fabrics,
            "growth": self.growth,
        })
    }

    fn view_json(&self, sample: &Sample, v: &ViewResult) -> Value {
        let own_um = sample.fabric.file.voxel.size_um;
        let results: Vec<Value> = v
            .results
            .iter()
            .zip(front(&v.results))
            .map(|(t, on_front)| {
                json!({
                    "choice": t.row.choice, "words": t.row.choice.words(own_um),
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
            .map(|r| json!({ "choice": r.choice.words(own_um), "why": r.why }))
            .collect();
        let peers: Vec<Value> = v
            .peers
            .iter()
            .map(|p| json!({ "program": p.program, "error": p.error, "cost": p.cost }))
            .collect();
        let recommended: Vec<Value> = self
            .within
            .iter()
            .map(|&t| json!({ "within": t, "recommendation": Self::recommendation(v, t) }))
            .collect();
        json!({
            "pixel_mm": v.view.pixel_mm, "lit": v.view.lit.name(), "results": results,
            "refused": refused, "peers": peers, "recommended": recommended,
        })
    }

    /// The recommendations, and how cost grows, as tables of text.
    pub fn markdown(&self) -> String {
        let mut text = format!("`{}`\n\n", self.command);
        let _ = write!(text, "| fabric, pixel, lit from |");
        for t in self.within {
            let _ = write!(text, " within {} |", percent(*t));
        }
        let _ = writeln!(text, "\n|---|{}", "---|".repeat(self.within.len()));
        for (sample, views) in self.fabrics {
            for v in views {
                let _ = write!(text, "| {} |", short(sample, &v.view));
                for &t in self.within {
                    let advice = Self::recommendation(v, t).map(|r| recommended(&r, sample));
                    let _ = write!(text, " {} |", advice.unwrap_or_default());
                }
                text.push('\n');
            }
        }
        let _ = writeln!(
            text,
            "\n| fabric, pixel, lit from | choice | error | bias | s to {} noise | MiB |\n|---|---|---|---|---|---|",
            percent(NOISE)
        );
        for (sample, views) in self.fabrics {
            for v in views {
                for t in &v.results {
                    let _ = writeln!(
                        text,
                        "| {} | {} | {} | {} | {:.1} | {:.0} |",
                        short(sample, &v.view),
                        t.row.choice.words(sample.fabric.file.voxel.size_um),
                        interval(&t.row.rmse),
                        interval(&t.row.bias),
                        seconds_to_noise(&t.row.cost),
                        mib(t.row.cost.memory_bytes),
                    );
                }
                for p in &v.peers {
                    let _ = writeln!(
                        text,
                        "| {} | {} | {} | {} | {:.1} | {:.0} |",
                        short(sample, &v.view),
                        p.program,
                        interval(&p.error.rmse),
                        interval(&p.error.bias),
                        seconds_to_noise(&p.cost),
                        mib(p.cost.memory_bytes),
                    );
                }
            }
        }
        if !self.growth.is_empty() {
            let _ = writeln!(
                text,
                "\n| what grows | choice | from, to | setup | tracing | memory |\n|---|---|---|---|---|---|"
            );
            for s in self.growth {
                let ends = ends(s);
                let _ = writeln!(
                    text,
                    "| {} | {} | {ends} | {} | {} | {} |",
                    s.grows.words(),
                    s.what,
                    exponent(s.setup),
                    exponent(s.trace),
                    exponent(s.memory),
                );
            }
        }
        text
    }
}

/// "denim, 0.1 mm (34 cm), front"
pub(super) fn short(sample: &Sample, view: &View) -> String {
    format!(
        "{}, {} mm ({}), {}",
        sample.name,
        view.pixel_mm,
        distance_words(view.pixel_mm),
        view.lit.name()
    )
}

/// "micro-flakes, 20 um, level 1: 3.1 s (fibres 40 s)"
pub(super) fn recommended(r: &Recommendation, sample: &Sample) -> String {
    let words = words(&r.taken.choice, sample);
    match (r.seconds, r.fibres_s) {
        (Some(own), _) if r.taken.choice.model == &FIBRES => {
            format!("{words}: {}", time(own))
        }
        (Some(own), Some(fibres)) => format!(
            "{words}: {} (fibres {}); error {}, at most {}",
            time(own),
            time(fibres),
            percent(r.taken.rmse.value),
            percent(r.taken.rmse.high)
        ),
        _ => format!(
            "none; {words} is closest with {}",
            percent(r.taken.rmse.value)
        ),
    }
}

fn words(choice: &Choice, sample: &Sample) -> String {
    choice.words(sample.fabric.file.voxel.size_um)
}

pub(super) fn ends(s: &Series) -> String {
    match (s.points.first(), s.points.last()) {
        (Some(a), Some(b)) => format!("{} to {}", plain(a.size), plain(b.size)),
        _ => String::new(),
    }
}

pub(super) fn exponent(g: Option<Growth>) -> String {
    g.map_or("-".into(), |g| {
        let error = g.standard_error;
        let error = error.map_or("two points".into(), |e| format!("{e:.2}"));
        format!("{:.2} ({error}), {:.2}", g.exponent, g.last_exponent)
    })
}

pub(super) fn plain(x: f64) -> String {
    if x >= 100.0 || x == x.round() {
        format!("{x:.0}")
    } else {
        format!("{}", (x * 100.0).round() / 100.0)
    }
}
