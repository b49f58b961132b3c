//! The page of speed against error.

use super::quantity::{
    describe_choice, ends, exponent, interval, mib, percent, plain, recommended, seconds_to_noise,
    short, time,
};
use super::record::front;
use super::scaling::Series;
use super::try_all::ViewResult;
use super::{BenchReport, Sample};
use crate::picture::{Picture, Thumbnail, exposure};
use crate::plot::{Line, LogAxis, Mark, Plot, log_log};
use crate::{KeyEntry, OTHER, ReportError};
use askama::Template;
use organza_measure::{Cost, Figure, NoisyPicture, pareto_front};
use organza_scene::representation::{Build, REPRESENTATIONS, Representation};

#[derive(Template)]
#[template(path = "bench.html")]
struct Page<'a> {
    title: String,
    names: String,
    command: &'a str,
    within: Vec<String>,
    advice: Vec<AdviceRow>,
    models_key: Vec<KeyEntry>,
    fabrics: Vec<FabricPart<'a>>,
    growth: Vec<GrowthRow<'a>>,
    resolution: u32,
    spp: u64,
    truth_spp: u64,
    total: String,
}

struct AdviceRow {
    view: String,
    taken: Vec<String>,
}

struct FabricPart<'a> {
    name: &'a str,
    views: Vec<ViewPart<'a>>,
}

struct ViewPart<'a> {
    title: String,
    thumbnails: Vec<Thumbnail>,
    plots: Vec<Plot>,
    rows: Vec<ChoiceRow>,
    refusals: Vec<(String, &'a str)>,
}

struct ChoiceRow {
    choice: String,
    error: String,
    bias: String,
    setup: String,
    to_noise: String,
    efficiency: String,
    memory: String,
    on_front: bool,
}

struct GrowthRow<'a> {
    size: &'static str,
    choice: &'a str,
    ends: String,
    setup: String,
    trace: String,
    memory: String,
    points: Vec<GrowthPoint>,
}

struct GrowthPoint {
    size: String,
    setup: String,
    trace: String,
    memory: String,
}

impl BenchReport<'_> {
    /// The page: one self-contained HTML file.
    ///
    /// # Errors
    /// A picture that cannot be encoded.
    pub fn html(&self) -> Result<String, ReportError> {
        let bench = self.bench;
        let names: Vec<&str> = bench
            .fabrics
            .iter()
            .map(|f| f.sample.name.as_str())
            .collect();
        let names = names.join(", ");
        let mut fabrics = Vec::new();
        for f in &bench.fabrics {
            let views = f.views.iter().map(|v| self.view_part(f.sample, v));
            fabrics.push(FabricPart {
                name: &f.sample.name,
                views: views.collect::<Result<_, _>>()?,
            });
        }
        let models = REPRESENTATIONS.map(|r| KeyEntry::new(r.colour, r.title));
        let others = KeyEntry::new(OTHER, "other programs");
        let page = Page {
            title: format!("Speed against error: {names}"),
            names,
            command: &self.command,
            within: self.within.iter().map(|t| percent(*t)).collect(),
            advice: self.advice(),
            models_key: models.into_iter().chain([others]).collect(),
            fabrics,
            growth: bench.growth.iter().map(growth_row).collect(),
            resolution: bench.plan.resolution,
            spp: bench.plan.spp,
            truth_spp: bench.plan.truth_spp,
            total: time(self.seconds),
        };
        Ok(page.render()?)
    }

    fn advice(&self) -> Vec<AdviceRow> {
        let row = |(sample, v): (&Sample, &ViewResult)| AdviceRow {
            view: short(sample, &v.view),
            taken: self
                .within
                .iter()
                .map(|&t| v.recommendation(t).map(|r| recommended(&r, sample)))
                .map(Option::unwrap_or_default)
                .collect(),
        };
        self.bench.views().map(row).collect()
    }

    fn view_part<'v>(
        &self,
        sample: &Sample,
        v: &'v ViewResult,
    ) -> Result<ViewPart<'v>, ReportError> {
        let refusals = v.refusals.iter();
        Ok(ViewPart {
            title: capital(&v.view.description()),
            thumbnails: self.thumbnails(sample, v)?,
            plots: plots(sample, v)?,
            rows: choice_rows(sample, v),
            refusals: refusals
                .map(|r| (describe_choice(&r.choice, sample), r.why.as_str()))
                .collect(),
        })
    }

    /// The reference, every model of the fabric, and other programs.
    fn thumbnails(&self, sample: &Sample, v: &ViewResult) -> Result<Vec<Thumbnail>, ReportError> {
        let Some(truth) = v.results.first() else {
            return Ok(Vec::new());
        };
        let gain = exposure(truth.picture.mean.iter().flatten().copied());
        let size = [self.bench.plan.resolution; 2];
        let show = |picture: &NoisyPicture, caption: String| {
            let pixels = picture.mean.iter().map(|p| p.map(|v| v as f32)).collect();
            Thumbnail::new(caption, &Picture { size, pixels }.display(gain), size)
        };
        let mut shown: Vec<&Representation> = Vec::new();
        let mut list = Vec::new();
        for t in &v.results {
            let choice = &t.row.choice;
            if (choice.voxel_scale, choice.level) != (1.0, 0) || shown.contains(&choice.model) {
                continue;
            }
            shown.push(choice.model);
            let (title, bias) = (choice.model.title, percent(t.row.bias.value));
            let caption = match choice.model.build {
                Build::ExplicitFibres(_) => format!("{title}, the reference"),
                Build::Voxels(_) => {
                    let um = sample.fabric.file.voxel.size_um;
                    format!("{title}, {um} um, bias {bias}")
                }
                Build::Plies(_) | Build::Surface(_) => format!("{title}, bias {bias}"),
            };
            list.push(show(&t.picture, caption)?);
        }
        for p in &v.peers {
            let bias = percent(p.error.bias.value);
            list.push(show(&p.picture, format!("{}, bias {bias}", p.program))?);
        }
        Ok(list)
    }
}

/// A choice or another program in the plots.
struct Shown {
    words: String,
    colour: [u8; 3],
    rmse: Figure,
    cost: Cost,
}

impl Shown {
    fn mark(&self, x: f64, on_front: bool) -> Mark {
        Mark {
            x,
            y: self.rmse.value,
            low: self.rmse.low,
            high: self.rmse.high,
            colour: self.colour,
            on_front,
            hint: format!("{}: {}", self.words, interval(&self.rmse)),
        }
    }
}

/// Error over time and over memory, and as time passes.
fn plots(sample: &Sample, v: &ViewResult) -> Result<Vec<Plot>, ReportError> {
    let choices = v.results.iter().map(|t| Shown {
        words: describe_choice(&t.row.choice, sample),
        colour: t.row.choice.model.colour,
        rmse: t.row.rmse,
        cost: t.row.cost,
    });
    let peers = v.peers.iter().map(|p| Shown {
        words: p.program.clone(),
        colour: OTHER,
        rmse: p.error.rmse,
        cost: p.cost,
    });
    let all: Vec<Shown> = choices.chain(peers).collect();
    let marks = |x: fn(&Cost) -> f64| -> Vec<Mark> {
        let points: Vec<[f64; 2]> = all.iter().map(|s| [s.rmse.value, x(&s.cost)]).collect();
        let with_front = all.iter().zip(pareto_front(&points));
        with_front
            .map(|(s, on_front)| s.mark(x(&s.cost), on_front))
            .collect()
    };
    let y = LogAxis {
        title: "",
        number: percent,
        least: 0.003,
    };
    let x = |title| LogAxis {
        title,
        number: plain,
        least: 1e-3,
    };
    let lines: Vec<Line> = all
        .iter()
        .map(|s| Line {
            points: falling_error(&s.cost, s.rmse.value),
            colour: s.colour,
        })
        .filter(|l| l.points.len() > 1)
        .collect();
    Ok(vec![
        log_log(
            "model error over time to 2 % noise",
            &x("seconds"),
            &y,
            &marks(seconds_to_noise),
            &[],
        )?,
        log_log(
            "model error over memory",
            &x("MiB"),
            &y,
            &marks(|c| mib(c.memory_bytes)),
            &[],
        )?,
        log_log(
            "error of model and noise as time passes",
            &x("seconds"),
            &y,
            &[],
            &lines,
        )?,
    ])
}

fn choice_rows(sample: &Sample, v: &ViewResult) -> Vec<ChoiceRow> {
    let fibres = v.results.first().map_or(1.0, |t| t.row.cost.noise_s);
    let row = |choice: String, rmse: &Figure, bias: &Figure, cost: &Cost, on_front| ChoiceRow {
        choice,
        error: interval(rmse),
        bias: interval(bias),
        setup: time(cost.setup_s),
        to_noise: time(seconds_to_noise(cost)),
        efficiency: format!("{:.1}", fibres / cost.noise_s),
        memory: format!("{:.0} MiB", mib(cost.memory_bytes)),
        on_front,
    };
    let choices = v.results.iter().zip(front(&v.results));
    let choices = choices.map(|(t, on_front)| {
        let r = &t.row;
        let words = describe_choice(&r.choice, sample);
        row(words, &r.rmse, &r.bias, &r.cost, on_front)
    });
    let peers = v.peers.iter().map(|p| {
        let e = &p.error;
        row(p.program.clone(), &e.rmse, &e.bias, &p.cost, false)
    });
    choices.chain(peers).collect()
}

fn growth_row(s: &Series) -> GrowthRow<'_> {
    let points = s.points.iter().map(|p| GrowthPoint {
        size: plain(p.size),
        setup: format!("{:.2} s", p.setup_s),
        trace: format!("{:.2} s", p.trace_s),
        memory: format!("{:.0} MiB", mib(p.memory_bytes)),
    });
    GrowthRow {
        size: s.grows.description(),
        choice: &s.what,
        ends: ends(s),
        setup: exponent(s.setup),
        trace: exponent(s.trace),
        memory: exponent(s.memory),
        points: points.collect(),
    }
}

/// The error over time, from just after the setup to an hour.
fn falling_error(cost: &Cost, model_error: f64) -> Vec<[f64; 2]> {
    const STEPS: u32 = 48;
    const HOUR_S: f64 = 3600.0;
    let start = cost.noise_s;
    let end = 4e6 * start;
    (0..=STEPS)
        .filter_map(|k| {
            let tracing_s = start * (end / start).powf(f64::from(k) / f64::from(STEPS));
            let seconds = cost.setup_s + tracing_s;
            let error = cost.error_after(seconds, model_error)?;
            (error < 0.5 && seconds < HOUR_S).then_some([seconds, error])
        })
        .collect()
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}
