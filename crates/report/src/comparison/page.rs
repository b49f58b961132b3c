//! The page of a comparison.

use super::{Comparison, Judged, LIGHTS, Measurement};
use crate::picture::{Thumbnail, exposure};
use crate::plot::{Curve, Plot, SHARES, Shares, curves, hemispheres, shares};
use crate::{KeyEntry, ReportError, colour_of};
use askama::Template;
use glam::Vec3;
use organza_measure::{Albedo, Angles, Difference, Figure, PairValue, irawan_layout};

/// The rounding error of the sum of one path in single precision.
const ROUNDING: f64 = 1e-5;

#[derive(Template)]
#[template(path = "comparison.html")]
struct Page<'a> {
    title: &'a str,
    reference: &'a str,
    command: &'a str,
    models: Vec<&'a str>,
    verdicts: Vec<String>,
    lit: Vec<Lit>,
    hemispheres: Vec<(&'a str, Plot)>,
    models_key: Vec<KeyEntry>,
    curves: Vec<Plot>,
    shares_key: Vec<KeyEntry>,
    shares: Plot,
    differences: Vec<DifferenceRow>,
    checks: Vec<CheckRow<'a>>,
}

/// Pictures under one light.
struct Lit {
    name: &'static str,
    thumbnails: Vec<Thumbnail>,
}

struct DifferenceRow {
    what: String,
    median: String,
    percentile_80: String,
    cosine_rmse: String,
    bias: String,
    noise: String,
    worst: String,
}

struct CheckRow<'a> {
    model: &'a str,
    energy: String,
    reciprocity: String,
    paths: u64,
    seconds: String,
}

impl Comparison {
    /// The page: one self-contained HTML file.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub fn html(&self) -> Result<String, ReportError> {
        let page = Page {
            title: &self.name,
            reference: self.reference(),
            command: &self.command,
            models: self.measured.iter().map(|m| m.model.as_str()).collect(),
            verdicts: self.judged.iter().map(|j| self.verdict(j)).collect(),
            lit: self.lit()?,
            hemispheres: self.hemispheres()?,
            models_key: self
                .measured
                .iter()
                .map(|m| KeyEntry::new(colour_of(&m.model), &m.model))
                .collect(),
            curves: self.curves()?,
            shares_key: SHARES.map(|(words, c)| KeyEntry::new(c, words)).into(),
            shares: shares(&self.shares())?,
            differences: self.judged.iter().flat_map(difference_rows).collect(),
            checks: self.measured.iter().map(check_row).collect(),
        };
        Ok(page.render()?)
    }

    fn verdict(&self, j: &Judged) -> String {
        let m = &j.layout.median;
        // Errors that noise explains are not errors of the model.
        let noisy = self.limit.hypot(j.layout.noise_median);
        let judged = match m.is_below(self.limit) {
            Some(false) if m.low <= noisy => "cannot be distinguished from",
            Some(true) => "within",
            Some(false) => "further off than",
            None => "cannot be distinguished from",
        };
        format!(
            "{}: {judged} {:.0} %. In the median its reflection is off by {}; noise alone would show {:.1} %.",
            j.model,
            100.0 * self.limit,
            percent(m),
            100.0 * j.layout.noise_median
        )
    }

    fn lit(&self) -> Result<Vec<Lit>, ReportError> {
        let Some(first) = self.measured.iter().find(|m| !m.pictures.is_empty()) else {
            return Ok(Vec::new());
        };
        let mut list = Vec::new();
        for (k, (light, reference)) in LIGHTS.iter().zip(&first.pictures).enumerate() {
            let gain = reference.exposure();
            let mut thumbnails = Vec::new();
            for m in &self.measured {
                let Some(p) = m.pictures.get(k) else {
                    continue;
                };
                thumbnails.push(Thumbnail::new(&m.model, &p.display(gain), p.size)?);
                let judged = self.judged.iter().find(|j| j.model == m.model);
                if let Some(flip) = judged.and_then(|j| j.flip.get(k)) {
                    let caption = format!("FLIP {:.3}", flip.mean);
                    thumbnails.push(Thumbnail {
                        alt: "difference".into(),
                        ..Thumbnail::new(caption, &flip.map, p.size)?
                    });
                }
            }
            list.push(Lit {
                name: light.name,
                thumbnails,
            });
        }
        Ok(list)
    }

    fn hemispheres(&self) -> Result<Vec<(&str, Plot)>, ReportError> {
        let pairs = irawan_layout().len();
        let mut whole = self.measured.iter().filter(|m| m.layout.len() == pairs);
        let Some(first) = whole.clone().next() else {
            return Ok(Vec::new());
        };
        let gain = exposure(first.layout.iter().flat_map(|v| v.bsdf.mean));
        whole.try_fold(Vec::new(), |mut list, m| {
            list.push((m.model.as_str(), hemispheres(&m.layout, gain)?));
            Ok(list)
        })
    }

    fn curves(&self) -> Result<Vec<Plot>, ReportError> {
        if self.measured.iter().all(|m| m.in_plane.is_empty()) {
            return Ok(Vec::new());
        }
        let mut list = Vec::new();
        for (phi_deg, plane) in [(0.0, "weft"), (90.0, "warp")] {
            for (back, kind) in [(false, "reflected"), (true, "transmitted")] {
                let lines: Vec<Curve> = self
                    .measured
                    .iter()
                    .map(|m| Curve {
                        colour: colour_of(&m.model),
                        points: in_plane(m, phi_deg, back),
                    })
                    .collect();
                list.push(curves(&format!("{plane}, {kind}"), &lines)?);
            }
        }
        Ok(list)
    }

    fn shares(&self) -> Vec<Shares> {
        let bar = |m: &Measurement, a: &Albedo| Shares {
            label: format!(
                "{}, {:.0}\u{b0} / {:.0}\u{b0}",
                m.model, a.incident.theta_deg, a.incident.phi_deg
            ),
            shares: [&a.reflected, &a.transmitted, &a.direct, &a.absorbed].map(|p| p.mean[1]),
        };
        self.measured
            .iter()
            .flat_map(|m| m.albedos.iter().map(move |a| bar(m, a)))
            .collect()
    }
}

/// Angle, luminance and its standard error in one plane on one side of the cloth.
fn in_plane(m: &Measurement, phi_deg: f64, back: bool) -> Vec<[f64; 3]> {
    let wanted = |v: &&PairValue| {
        v.pair.incident.phi_deg == phi_deg && (v.pair.exitant.theta_deg > 90.0) == back
    };
    let point = |v: &PairValue| {
        [
            signed_angle(&v.pair.exitant, phi_deg),
            luminance(v.bsdf.mean),
            luminance(v.bsdf.se),
        ]
    };
    m.in_plane.iter().filter(wanted).map(point).collect()
}

/// The signed angle of an exitant direction in the plane of a pair's light, degrees.
fn signed_angle(exitant: &Angles, phi_deg: f64) -> f64 {
    let w = exitant.direction();
    let (sin, cos) = phi_deg.to_radians().sin_cos();
    let along = w.dot(Vec3::new(cos as f32, sin as f32, 0.0));
    f64::from(along.atan2(w.z.abs())).to_degrees()
}

fn difference_rows(j: &Judged) -> impl Iterator<Item = DifferenceRow> {
    let rows = [
        ("whole layout", &j.layout),
        ("in plane, reflected", &j.reflection),
        ("in plane, transmitted", &j.transmission),
    ];
    let row = |(what, d): (&str, &Difference)| DifferenceRow {
        what: format!("{}, {what}", j.model),
        median: percent(&d.median),
        percentile_80: percent(&d.percentile_80),
        cosine_rmse: percent(&d.cosine_rmse),
        bias: percent(&d.bias),
        noise: format!("{:.1} %", 100.0 * d.noise_median),
        worst: if d.worst_relative.is_finite() {
            format!("{:.0} %", 100.0 * d.worst_relative)
        } else {
            "the reference has none".to_owned()
        },
    };
    rows.into_iter().filter(|r| r.1.count > 0).map(row)
}

fn check_row(m: &Measurement) -> CheckRow<'_> {
    // Where the sum of every path is one, its error is that of the summation.
    let off = |a: &Albedo| {
        (0..3)
            .map(|c| ((a.sum.mean[c] - 1.0).abs(), a.sum.se[c]))
            .map(|(off, se)| {
                if off < ROUNDING {
                    0.0
                } else {
                    off / se.max(1e-9)
                }
            })
            .fold(0.0, f64::max)
    };
    let energy = if m.albedos.is_empty() {
        "-".to_owned()
    } else {
        let sum: f64 = m.albedos.iter().map(|a| a.sum.mean[1]).sum();
        let worst = m.albedos.iter().map(off).fold(0.0, f64::max);
        let mean = sum / m.albedos.len() as f64;
        format!("{mean:.4} (worst {worst:.1} se)")
    };
    CheckRow {
        model: &m.model,
        energy,
        reciprocity: m.reciprocity.map_or("-".into(), |r| format!("{r:.1} se")),
        paths: m.paths,
        seconds: format!("{:.1}", m.seconds),
    }
}

fn percent(f: &Figure) -> String {
    format!(
        "{:.1} % ({:.1} to {:.1})",
        100.0 * f.value,
        100.0 * f.low,
        100.0 * f.high
    )
}

fn luminance(v: [f64; 3]) -> f64 {
    0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2]
}
