//! Comparison of models of one cloth: all are measured in the same way and compared with the
//! first.

mod judge;
mod measure;
mod page;
mod record;

pub(crate) use judge::flip;
pub use judge::{Judged, judge};
pub use measure::{ComparisonPlan, Measurement};

use organza_measure::Angles;

/// The data of a comparison.
pub struct Comparison {
    /// The cloth's name.
    pub name: String,
    /// The command that made it.
    pub command: String,
    /// All measurements, the reference first.
    pub measured: Vec<Measurement>,
    /// The differences of the others from the reference.
    pub judged: Vec<Judged>,
    /// Median relative error below which models agree.
    pub limit: f64,
}

impl Comparison {
    /// The reference.
    pub fn reference(&self) -> &str {
        self.measured.first().map_or("", |m| m.model.as_str())
    }

    /// One line for each compared model.
    pub fn summary(&self) -> Vec<String> {
        let line = |j: &Judged| {
            let m = &j.layout.median;
            format!(
                "{} against {}: median error {:.1} % ({:.1} to {:.1}), noise alone {:.1} %, 80th percentile {:.1} %",
                j.model,
                self.reference(),
                100.0 * m.value,
                100.0 * m.low,
                100.0 * m.high,
                100.0 * j.layout.noise_median,
                100.0 * j.layout.percentile_80.value,
            )
        };
        self.judged.iter().map(line).collect()
    }
}

/// A light of the pictures, which are seen along the normal.
struct Light {
    name: &'static str,
    direction: Angles,
}

const fn light(name: &'static str, theta_deg: f64, phi_deg: f64) -> Light {
    Light {
        name,
        direction: Angles { theta_deg, phi_deg },
    }
}

/// The lights of the pictures.
const LIGHTS: [Light; 3] = [
    light("Lit from the front, along the warp", 45.0, 90.0),
    light("Lit from the front, along the weft", 45.0, 0.0),
    light("Lit from behind", 160.0, 60.0),
];
