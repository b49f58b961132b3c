//! The report of a comparison: one page that stands alone.

pub mod bench;
mod bench_page;
mod plot;
pub mod svg;

use anyhow::Result;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use organza_measure::{Albedo, Difference, Figure, PairValue};
use std::fmt::Write;

/// What single precision may add to or take from a sum of one path.
const ROUNDING: f64 = 1e-5;

/// A model and what was measured of it.
pub struct Measurement {
    /// Its name.
    pub model: String,
    /// Values at the layout's pairs.
    pub layout: Vec<PairValue>,
    /// Values in the planes of weft and warp.
    pub in_plane: Vec<PairValue>,
    /// Where light goes.
    pub albedos: Vec<Albedo>,
    /// Pictures under each light, linear.
    pub pictures: Vec<Picture>,
    /// Largest departure from reciprocity, standard errors.
    pub reciprocity: Option<f64>,
    /// Paths traced.
    pub paths: u64,
    /// Time taken.
    pub seconds: f64,
}

/// A linear picture.
pub struct Picture {
    /// Width and height.
    pub size: [u32; 2],
    /// Rows from the top.
    pub pixels: Vec<[f32; 3]>,
}

/// How a model differs from the reference.
pub struct Judged {
    /// Which model.
    pub model: String,
    /// Over the layout.
    pub layout: Difference,
    /// In the two planes, reflected.
    pub reflection: Difference,
    /// In the two planes, transmitted.
    pub transmission: Difference,
    /// Mean FLIP error [Andersson2020] of each picture and its map.
    pub flip: Vec<(f32, Vec<u8>)>,
}

/// Everything on the page.
pub struct Report {
    /// The cloth's name.
    pub name: String,
    /// The command that made it.
    pub command: String,
    /// What the models are compared with.
    pub reference: String,
    /// All that was measured, the reference first.
    pub measured: Vec<Measurement>,
    /// The others against it.
    pub judged: Vec<Judged>,
    /// Names of the lights of the pictures.
    pub lights: Vec<String>,
    /// Median relative error below which models are said to agree.
    pub limit: f64,
}

const STYLE: &str = "
:root{color-scheme:light dark;--ink:#22262b;--paper:#fbfaf7;--soft:#6a6f76;--line:#d9d5cc;--card:#fff}
@media(prefers-color-scheme:dark){:root{--ink:#e8e6e1;--paper:#17181b;--soft:#a2a5aa;--line:#3a3c41;--card:#1f2125}}
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.55 Georgia,'Times New Roman',serif}
main{max-width:1080px;margin:0 auto;padding:40px 28px 80px}
h1{font-size:34px;line-height:1.2;margin:0 0 6px}h2{font-size:22px;margin:44px 0 6px}
p{max-width:70ch}.soft,figcaption{color:var(--soft)}figcaption{font-size:14px;margin-top:4px}
svg text{font:11px ui-sans-serif,system-ui,sans-serif;fill:var(--ink)}svg .t{font-size:12px;font-weight:600}
svg .g{stroke:var(--line);fill:none}svg{width:100%;height:auto;display:block}
.row{display:grid;gap:22px;grid-template-columns:repeat(auto-fit,minmax(300px,1fr))}.row.two{grid-template-columns:repeat(auto-fit,minmax(420px,1fr))}
.bars{max-width:720px}.n{white-space:nowrap}
.pics{display:flex;flex-wrap:wrap;gap:14px}.pics figure{width:190px}
figure{margin:0}.pics img{width:100%;image-rendering:pixelated;border-radius:3px;display:block}
table{border-collapse:collapse;font:14px ui-sans-serif,system-ui,sans-serif;width:100%}
th,td{padding:6px 10px;text-align:right;border-bottom:1px solid var(--line);vertical-align:top}
th:first-child,td:first-child{text-align:left}thead th{color:var(--soft);font-weight:600}
.key{display:inline-block;width:12px;height:12px;border-radius:2px;margin:0 6px 0 14px;vertical-align:-1px}
pre{background:var(--card);border:1px solid var(--line);border-radius:4px;padding:12px 14px;overflow-x:auto;font-size:13px}
.lead{font-size:18px}.scroll{overflow-x:auto}
";

impl Report {
    /// The page.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub fn html(&self) -> Result<String> {
        let name = escape(&self.name);
        let mut page = format!(
            "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>{name}</title><style>{STYLE}</style></head><body><main>"
        );
        let models: Vec<&str> = self.measured.iter().map(|m| m.model.as_str()).collect();
        let _ = write!(
            page,
            "<h1>{name}</h1><p class=\"soft\">One cloth, {} ways to describe it: {}. Everything is compared with <b>{}</b>.</p>",
            models.len(),
            models.join(", "),
            escape(&self.reference)
        );
        for j in &self.judged {
            let _ = write!(page, "<p class=\"lead\">{}</p>", self.verdict(j));
        }
        self.pictures(&mut page)?;
        self.hemispheres(&mut page);
        self.curves(&mut page);
        self.shares(&mut page);
        self.figures(&mut page);
        let _ = write!(
            page,
            "<h2>How this was made</h2><pre>{}</pre><p class=\"soft\">Values are radiance over irradiance on the cloth, 1/sr. Intervals are 95 % bootstrap intervals over directions and noise. Every number is in <code>report.json</code>, every pair in <code>pairs.csv</code>.</p></main></body></html>",
            escape(&self.command)
        );
        Ok(page)
    }

    fn verdict(&self, j: &Judged) -> String {
        let m = &j.layout.median;
        // Noise adds to errors: what it explains is held against nobody.
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

    fn pictures(&self, page: &mut String) -> Result<()> {
        let Some(first) = self.measured.iter().find(|m| !m.pictures.is_empty()) else {
            return Ok(());
        };
        *page += "<h2>The cloth itself</h2><p>One repeat, seen from straight above under the same lights and the same exposure; beside each other model its perceptual difference (FLIP, bright is different).</p>";
        for (light, label) in self.lights.iter().enumerate() {
            let Some(reference) = first.pictures.get(light) else {
                continue;
            };
            let gain = exposure(reference.pixels.iter().flatten().map(|&v| f64::from(v)));
            let _ = write!(page, "<p><b>{}</b></p><div class=\"pics\">", escape(label));
            for m in &self.measured {
                let Some(p) = m.pictures.get(light) else {
                    continue;
                };
                let image = data_url(&display(p, gain), p.size)?;
                let _ = write!(
                    page,
                    "<figure><img alt=\"{0}\" src=\"{image}\"><figcaption>{0}</figcaption></figure>",
                    m.model
                );
                let judged = self.judged.iter().find(|j| j.model == m.model);
                if let Some((mean, map)) = judged.and_then(|j| j.flip.get(light)) {
                    let image = data_url(map, p.size)?;
                    let _ = write!(
                        page,
                        "<figure><img alt=\"difference\" src=\"{image}\"><figcaption>FLIP {mean:.3}</figcaption></figure>"
                    );
                }
            }
            *page += "</div>";
        }
        Ok(())
    }

    fn hemispheres(&self, page: &mut String) {
        let Some(first) = self.measured.iter().find(|m| m.layout.len() == 1575) else {
            return;
        };
        let values = first.layout.iter().flat_map(|v| v.bsdf.mean);
        let gain = exposure(values);
        *page += "<h2>Hemispheres</h2><p>Each disk holds all directions that light may come from, seen as a plan with the warp upward; its place says where the cloth is seen from (polar angle, azimuth from the weft).</p><div class=\"row\">";
        for m in self.measured.iter().filter(|m| m.layout.len() == 1575) {
            let _ = write!(
                page,
                "<figure>{}<figcaption>{}</figcaption></figure>",
                svg::hemispheres(&m.layout, gain),
                m.model
            );
        }
        *page += "</div>";
    }

    fn curves(&self, page: &mut String) {
        if self.measured.iter().all(|m| m.in_plane.is_empty()) {
            return;
        }
        *page += "<h2>In the planes of weft and warp</h2><p>Light at 30&deg;; luminance over the exitant angle, bands of two standard errors.";
        for m in &self.measured {
            let _ = write!(
                page,
                "<span class=\"n\"><span class=\"key\" style=\"background:{}\"></span>{}</span> ",
                svg::colour(&m.model),
                m.model
            );
        }
        *page += "</p><div class=\"row two\">";
        for (phi, plane) in [(0.0, "weft"), (90.0, "warp")] {
            for (back, kind) in [(false, "reflected"), (true, "transmitted")] {
                let list: Vec<svg::Curve> = self
                    .measured
                    .iter()
                    .map(|m| svg::Curve {
                        model: m.model.clone(),
                        points: m
                            .in_plane
                            .iter()
                            .filter(|v| {
                                v.pair.incident.phi_deg == phi
                                    && (v.pair.exitant.theta_deg > 90.0) == back
                            })
                            .map(|v| {
                                [
                                    svg::signed_angle(&v.pair.exitant, phi),
                                    luminance(v.bsdf.mean),
                                    luminance(v.bsdf.se),
                                ]
                            })
                            .collect(),
                    })
                    .collect();
                let _ = write!(
                    page,
                    "<figure>{}</figure>",
                    svg::curves(&format!("{plane}, {kind}"), &list)
                );
            }
        }
        *page += "</div>";
    }

    fn shares(&self, page: &mut String) {
        *page += "<h2>Where the light goes</h2><p>Of light from each direction (green): <span class=\"n\"><span class=\"key\" style=\"background:#e0a03a\"></span>reflected</span> <span class=\"n\"><span class=\"key\" style=\"background:#4f9fbf\"></span>transmitted</span> <span class=\"n\"><span class=\"key\" style=\"background:#b9d7e4\"></span>straight through</span> <span class=\"n\"><span class=\"key\" style=\"background:#57504a\"></span>absorbed.</span> </p>";
        let mut bars = Vec::new();
        for m in &self.measured {
            for a in &m.albedos {
                let label = format!(
                    "{}, {:.0}&deg; / {:.0}&deg;",
                    m.model, a.incident.theta_deg, a.incident.phi_deg
                );
                let part = |p: &organza_measure::Measured| p.mean[1];
                bars.push((
                    label,
                    [
                        part(&a.reflected),
                        part(&a.transmitted),
                        part(&a.direct),
                        part(&a.absorbed),
                    ],
                ));
            }
        }
        let _ = write!(
            page,
            "<figure class=\"bars\">{}</figure>",
            svg::shares(&bars)
        );
    }

    fn figures(&self, page: &mut String) {
        *page += "<h2>Figures</h2><div class=\"scroll\"><table><thead><tr><th>against the reference</th><th>median error</th><th>80th percentile</th><th>cosine-weighted RMSE</th><th>bias</th><th>noise alone</th><th>worst pair</th></tr></thead><tbody>";
        for j in &self.judged {
            let rows = [
                ("whole layout", &j.layout),
                ("in plane, reflected", &j.reflection),
                ("in plane, transmitted", &j.transmission),
            ];
            for (what, d) in rows.into_iter().filter(|r| r.1.count > 0) {
                let worst = if d.worst_relative.is_finite() {
                    format!("{:.0} %", 100.0 * d.worst_relative)
                } else {
                    "the reference has none".to_owned()
                };
                let _ = write!(
                    page,
                    "<tr><td>{}, {what}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1} %</td><td>{worst}</td></tr>",
                    j.model,
                    percent(&d.median),
                    percent(&d.percentile_80),
                    percent(&d.cosine_rmse),
                    percent(&d.bias),
                    100.0 * d.noise_median,
                );
            }
        }
        *page += "</tbody></table><table><thead><tr><th>model</th><th>energy adds to</th><th>reciprocity, worst</th><th>paths</th><th>seconds</th></tr></thead><tbody>";
        for m in &self.measured {
            // Where every path's sum is one, its error is that of adding up.
            let far = |a: &Albedo| {
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
            let energy = m.albedos.iter().map(|a| a.sum.mean[1]).sum::<f64>()
                / m.albedos.len().max(1) as f64;
            let worst = m.albedos.iter().map(far).fold(0.0, f64::max);
            let energy = if m.albedos.is_empty() {
                "-".to_owned()
            } else {
                format!("{energy:.4} (worst {worst:.1} se)")
            };
            let reciprocity = m.reciprocity.map_or("-".into(), |r| format!("{r:.1} se"));
            let _ = write!(
                page,
                "<tr><td>{}</td><td>{energy}</td><td>{reciprocity}</td><td>{}</td><td>{:.1}</td></tr>",
                m.model, m.paths, m.seconds
            );
        }
        *page += "</tbody></table></div>";
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

/// The gain that brings all but the brightest twentieth below white.
pub fn exposure(values: impl Iterator<Item = f64>) -> f32 {
    let mut list: Vec<f64> = values.collect();
    list.sort_by(f64::total_cmp);
    let bright = list.get(list.len() * 19 / 20).copied().unwrap_or(1.0);
    (0.85 / bright.max(1e-6)) as f32
}

/// Display values of a picture.
pub fn display(p: &Picture, gain: f32) -> Vec<u8> {
    let to_bytes = |v: &[f32; 3]| svg::pixel(v.map(f64::from), gain);
    p.pixels.iter().flat_map(to_bytes).collect()
}

/// A picture of 8-bit RGB for the inside of a page.
fn data_url(rgb: &[u8], size: [u32; 2]) -> Result<String> {
    let mut png = Vec::new();
    PngEncoder::new(&mut png).write_image(rgb, size[0], size[1], ExtendedColorType::Rgb8)?;
    let mut text = String::from("data:image/png;base64,");
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for chunk in png.chunks(3) {
        let word = chunk
            .iter()
            .enumerate()
            .fold(0u32, |w, (k, &b)| w | u32::from(b) << (16 - 8 * k));
        for k in 0..4 {
            let letter = LETTERS
                .get((word >> (18 - 6 * k) & 63) as usize)
                .copied()
                .unwrap_or(b'A');
            text.push(if k <= chunk.len() {
                letter as char
            } else {
                '='
            });
        }
    }
    Ok(text)
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
