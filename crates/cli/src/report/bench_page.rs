//! The page of speed against error.

use super::bench::{
    BenchReport, ends, exponent, front, interval, mib, percent, plain, recommended,
    seconds_to_noise, short, time,
};
use super::plot::{Axis, Line, Mark, log_log};
use super::{Picture, STYLE, data_url, display, escape, exposure, svg};
use crate::bench::stage::Sample;
use crate::bench::try_all::ViewResult;
use anyhow::Result;
use organza_measure::{Cost, Figure, NoisyPicture, pareto_front};
use organza_scene::representation::{Build, REPRESENTATIONS, Representation};
use std::fmt::Write;

impl BenchReport<'_> {
    /// The page.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub fn html(&self) -> Result<String> {
        let names: Vec<&str> = self.fabrics.iter().map(|(s, _)| s.name.as_str()).collect();
        let names = escape(&names.join(", "));
        let mut page = format!(
            "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>Speed against error: {names}</title><style>{STYLE}{MORE_STYLE}</style></head><body><main><h1>Speed against error</h1><p class=\"soft\">{names}: what each way to render a cloth costs, and how far it is from the same cloth with every fibre traced.</p>"
        );
        self.advice(&mut page);
        self.legend(&mut page);
        for (sample, views) in self.fabrics {
            let _ = write!(page, "<h2>{}</h2>", escape(&sample.name));
            for view in views {
                self.view(&mut page, sample, view)?;
            }
        }
        self.growth(&mut page);
        let _ = write!(
            page,
            "<h2>How this was made</h2><pre>{}</pre><p class=\"soft\">Every render is a process of its own; seconds are those of processors, setup (weaving, voxelizing, tables) included, memory is the most it ever had. Pictures have {1} x {1} pixels, {2} samples ({3} of the truth) from other random numbers. <b>Error</b> is the root mean square over pixels and channels of the difference from the truth, over the truth's mean, after the noise of both has been taken off; brackets are 95 % intervals. <b>Within</b> 2 % counts that error and the picture's own noise together. Times hold for this picture and this machine; a picture of more pixels takes longer to the same noise in proportion. The whole took {4}. Every number is in <code>report.json</code>, the table that <code>model = \"auto\"</code> asks in <code>choices.csv</code>, the scenes in <code>scenes/</code>.</p></main></body></html>",
            escape(&self.command),
            self.plan.resolution,
            self.plan.spp,
            self.plan.truth_spp,
            time(self.seconds)
        );
        Ok(page)
    }

    fn advice(&self, page: &mut String) {
        *page += "<h2>What to take</h2><p>The fastest choice whose error and noise together are known to stay within the share of the picture's brightness at the top; in brackets the time that tracing every fibre takes. Times are processor seconds for the picture of this page, which is small; they grow with its pixels. Distances are those at which a pixel is as wide as the eye can just tell apart (an arc minute).</p><div class=\"scroll\"><table><thead><tr><th>cloth, distance, light</th>";
        for t in self.within {
            let _ = write!(page, "<th>within {}</th>", percent(*t));
        }
        *page += "</tr></thead><tbody>";
        for (sample, views) in self.fabrics {
            for v in views {
                let _ = write!(page, "<tr><td>{}</td>", escape(&short(sample, &v.view)));
                for &t in self.within {
                    let advice = Self::recommendation(v, t).map(|r| recommended(&r, sample));
                    let _ = write!(page, "<td>{}</td>", advice.unwrap_or_default());
                }
                *page += "</tr>";
            }
        }
        *page += "</tbody></table></div>";
    }

    fn legend(&self, page: &mut String) {
        *page += "<p>In the plots below: ";
        for model in REPRESENTATIONS {
            let _ = write!(
                page,
                "<span class=\"key\" style=\"background:{}\"></span>{}",
                svg::colour(model.name),
                model.title
            );
        }
        *page += "<span class=\"key\" style=\"background:#8a8a8a\"></span>other programs. Full dots are on the Pareto front of their plot: nothing is both nearer the truth and cheaper. Bars are 95 % intervals.</p>";
    }

    fn view(&self, page: &mut String, sample: &Sample, v: &ViewResult) -> Result<()> {
        let own_um = sample.fabric.file.voxel.size_um;
        let _ = write!(page, "<h3>{}</h3>", capital(&v.view.words()));
        self.pictures(page, sample, v)?;
        let of_peers = v
            .peers
            .iter()
            .map(|p| (p.program.clone(), "", p.error.rmse, p.cost));
        let all: Vec<(String, &str, Figure, Cost)> = v
            .results
            .iter()
            .map(|t| {
                let choice = &t.row.choice;
                (
                    choice.words(own_um),
                    choice.model.name,
                    t.row.rmse,
                    t.row.cost,
                )
            })
            .chain(of_peers)
            .collect();
        let marks = |x: fn(&Cost) -> f64| {
            let points: Vec<[f64; 2]> = all.iter().map(|a| [a.2.value, x(&a.3)]).collect();
            let marks = all.iter().zip(pareto_front(&points));
            marks
                .map(|((words, model, rmse, cost), on_front)| Mark {
                    x: x(cost),
                    y: rmse.value,
                    low: rmse.low,
                    high: rmse.high,
                    colour: svg::colour(model),
                    on_front,
                    label: escape(&format!("{words}: {}", interval(rmse))),
                })
                .collect::<Vec<Mark>>()
        };
        let y = Axis {
            title: "",
            number: percent,
            least: 0.003,
        };
        let x = |title| Axis {
            title,
            number: plain,
            least: 1e-3,
        };
        let seconds = log_log(
            "model error over time to 2 % noise",
            &x("seconds"),
            &y,
            &marks(seconds_to_noise),
            &[],
        );
        let memory = log_log(
            "model error over memory",
            &x("MiB"),
            &y,
            &marks(|c| mib(c.memory_bytes)),
            &[],
        );
        let lines: Vec<Line> = all
            .iter()
            .map(|(_, model, rmse, cost)| Line {
                points: curve(cost, rmse.value),
                colour: svg::colour(model),
                faint: false,
            })
            .filter(|l| l.points.len() > 1)
            .collect();
        let curves = log_log(
            "error of model and noise as time goes on",
            &x("seconds"),
            &y,
            &[],
            &lines,
        );
        let _ = write!(
            page,
            "<div class=\"row\"><figure>{seconds}</figure><figure>{memory}</figure><figure>{curves}</figure></div>"
        );
        self.table(page, sample, v);
        Ok(())
    }

    /// The truth, and every model as the fabric has it.
    fn pictures(&self, page: &mut String, sample: &Sample, v: &ViewResult) -> Result<()> {
        let Some(truth) = v.results.first() else {
            return Ok(());
        };
        let gain = exposure(truth.picture.mean.iter().flatten().copied());
        *page += "<div class=\"pics\">";
        let size = [self.plan.resolution; 2];
        let mut show = |picture: &NoisyPicture, caption: &str| -> Result<()> {
            let pixels = picture.mean.iter().map(|p| p.map(|v| v as f32)).collect();
            let image = data_url(&display(&Picture { size, pixels }, gain), size)?;
            let _ = write!(
                page,
                "<figure><img alt=\"{0}\" src=\"{image}\"><figcaption>{0}</figcaption></figure>",
                escape(caption)
            );
            Ok(())
        };
        let mut shown: Vec<&Representation> = Vec::new();
        for t in &v.results {
            let choice = &t.row.choice;
            if (choice.voxel_scale, choice.level) == (1.0, 0) && !shown.contains(&choice.model) {
                shown.push(choice.model);
                let um = sample.fabric.file.voxel.size_um;
                let title = choice.model.title;
                let caption = match choice.model.build {
                    Build::Fibres(_) => "explicit fibres, the truth".to_owned(),
                    Build::Voxels(_) => {
                        format!("{title}, {um} um, bias {}", percent(t.row.bias.value))
                    }
                    Build::Surface(_) => format!("{title}, bias {}", percent(t.row.bias.value)),
                };
                show(&t.picture, &caption)?;
            }
        }
        for p in &v.peers {
            show(
                &p.picture,
                &format!("{}, bias {}", p.program, percent(p.error.bias.value)),
            )?;
        }
        *page += "</div>";
        Ok(())
    }

    fn table(&self, page: &mut String, sample: &Sample, v: &ViewResult) {
        let own_um = sample.fabric.file.voxel.size_um;
        *page += "<details><summary>All choices</summary><div class=\"scroll\"><table><thead><tr><th>choice</th><th>error</th><th>bias</th><th>setup</th><th>to 2 % noise</th><th>efficiency</th><th>memory</th><th>front</th></tr></thead><tbody>";
        let fibres = v.results.first().map_or(1.0, |t| t.row.cost.noise_s);
        let mut line = |words: &str, rmse: &Figure, bias: &Figure, cost: &Cost, on_front: bool| {
            let _ = write!(
                page,
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1}</td><td>{:.0} MiB</td><td>{}</td></tr>",
                escape(words),
                interval(rmse),
                interval(bias),
                time(cost.setup_s),
                time(seconds_to_noise(cost)),
                fibres / cost.noise_s,
                mib(cost.memory_bytes),
                if on_front { "yes" } else { "" }
            );
        };
        for (t, on_front) in v.results.iter().zip(front(&v.results)) {
            let row = &t.row;
            line(
                &row.choice.words(own_um),
                &row.rmse,
                &row.bias,
                &row.cost,
                on_front,
            );
        }
        for p in &v.peers {
            line(&p.program, &p.error.rmse, &p.error.bias, &p.cost, false);
        }
        *page += "</tbody></table></div><p class=\"soft\">Efficiency: 1 / (squared noise x tracing time), that of explicit fibres is 1. Front: nothing is better in one of error, time and memory and no worse in the others.</p>";
        for r in &v.refusals {
            let _ = write!(
                page,
                "<p class=\"soft\">Refused: {}: {}.</p>",
                escape(&r.choice.words(own_um)),
                escape(&r.why)
            );
        }
        *page += "</details>";
    }

    fn growth(&self, page: &mut String) {
        if self.growth.is_empty() {
            return;
        }
        *page += "<h2>How cost grows with size</h2><p>On the first cloth. An exponent of 1 is in proportion, of 0 not at all; in brackets its standard error, and after it the exponent between the two largest sizes, where what stays the same counts least. Tracing of threads is by the clock, all else in processor seconds.</p><div class=\"scroll\"><table><thead><tr><th>what grows</th><th>choice</th><th>from, to</th><th>setup</th><th>tracing</th><th>memory</th></tr></thead><tbody>";
        for s in self.growth {
            let _ = write!(
                page,
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                s.grows.words(),
                s.what,
                ends(s),
                exponent(s.setup),
                exponent(s.trace),
                exponent(s.memory)
            );
        }
        *page += "</tbody></table></div><details><summary>All measurements</summary><div class=\"scroll\"><table><thead><tr><th>what grows</th><th>choice</th><th>size</th><th>setup</th><th>tracing</th><th>memory</th></tr></thead><tbody>";
        for s in self.growth {
            for p in &s.points {
                let _ = write!(
                    page,
                    "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.2} s</td><td>{:.2} s</td><td>{:.0} MiB</td></tr>",
                    s.grows.words(),
                    s.what,
                    plain(p.size),
                    p.setup_s,
                    p.trace_s,
                    mib(p.memory_bytes)
                );
            }
        }
        *page += "</tbody></table></div></details>";
    }
}

const MORE_STYLE: &str = "h3{font-size:17px;margin:30px 0 8px}details{margin:8px 0 0}summary{cursor:pointer;color:var(--soft)}.pics{margin:8px 0 14px}.pics figure{width:150px}.row{grid-template-columns:repeat(auto-fit,minmax(280px,1fr))}td{white-space:normal}";

/// How the error falls, from just after the setup to an hour.
fn curve(cost: &Cost, model_error: f64) -> Vec<[f64; 2]> {
    let start = cost.noise_s;
    let end = 4e6 * start;
    let steps = 48;
    (0..=steps)
        .filter_map(|k| {
            let tracing_s = start * (end / start).powf(f64::from(k) / f64::from(steps));
            let seconds = cost.setup_s + tracing_s;
            let error = cost.error_after(seconds, model_error)?;
            (error < 0.5 && seconds < 3600.0).then_some([seconds, error])
        })
        .collect()
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}
