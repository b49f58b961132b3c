//! Speed against error: every choice of representation for a cloth, seen from several distances
//! under several lights, compared with explicit fibres.
//!
//! A separate process renders every picture, as a user would run it, so that time and memory
//! are those that a user sees.

mod page;
mod peer;
mod quantity;
mod record;
mod scaling;
mod stage;
mod trial;
mod try_all;

pub use crate::write_file::{WriteError, WriteFile};
pub use peer::Peer;
pub use scaling::{Point, Series, Size};
pub use stage::{PIXELS_MM, QUICK_PIXELS_MM, Sample, SampleSource, View, distance_m, write_rooms};
pub use trial::{Laboratory, Program};
pub use try_all::{BenchPlan, PeerResult, Refusal, Tried, ViewResult};

use crate::ReportError;
use organza_scene::auto::table::{Candidate, Recommendation, Row, candidates, recommend};
use std::ops::ControlFlow;

/// A fabric with all its views.
pub struct FabricResult<'a> {
    /// The fabric.
    pub sample: &'a Sample,
    /// The results of every view of it.
    pub views: Vec<ViewResult>,
}

/// All results of a bench.
pub struct Bench<'a> {
    /// The extent of the bench.
    pub plan: &'a BenchPlan,
    /// Results by fabric.
    pub fabrics: Vec<FabricResult<'a>>,
    /// The growth of cost with size, for the first fabric.
    pub growth: Vec<Series>,
}

impl<'a> Bench<'a> {
    /// The number of renders that [`Bench::run`] makes at most.
    pub fn max_trials(plan: &BenchPlan, samples: &[Sample], with_scaling: bool) -> usize {
        let choices = |s: &Sample| plan.views().len() * (1 + plan.choices(s).len());
        let scaling = if with_scaling {
            scaling::max_trials(plan.quick)
        } else {
            0
        };
        samples.iter().map(choices).sum::<usize>() + scaling
    }

    /// Tries every choice in every view of the fabrics and, if requested, measures the growth
    /// of cost with size. `done` is called after every render.
    ///
    /// # Errors Files that cannot be read or written, a reference that cannot be rendered, or
    /// an interruption.
    pub fn run(
        plan: &'a BenchPlan,
        samples: &'a [Sample],
        peers: &[Peer],
        with_scaling: bool,
        laboratory: &Laboratory<'_>,
        done: &dyn Fn() -> ControlFlow<()>,
    ) -> Result<Bench<'a>, ReportError> {
        let mut fabrics = Vec::new();
        for sample in samples {
            let views = plan
                .views()
                .into_iter()
                .map(|view| plan.try_all(laboratory, sample, view, peers, done))
                .collect::<Result<_, _>>()?;
            fabrics.push(FabricResult { sample, views });
        }
        let is_black = |f: &FabricResult<'_>| f.views.iter().all(|v| v.results.is_empty());
        if fabrics.iter().all(is_black) {
            let why = "explicit fibres are black in every view; there is nothing to compare with";
            return Err(ReportError::Run(why.into()));
        }
        let growth = match samples.first() {
            Some(sample) if with_scaling => {
                scaling::measure(laboratory, sample, &plan.scenes, plan.quick, done)?
            }
            _ => Vec::new(),
        };
        Ok(Bench {
            plan,
            fabrics,
            growth,
        })
    }

    /// The rows of the table that `model = "auto"` reads.
    pub fn rows(&self) -> Vec<Row> {
        self.views()
            .flat_map(|(_, v)| v.results.iter().map(|t| t.row.clone()))
            .collect()
    }

    /// Every view with its fabric.
    fn views(&self) -> impl Iterator<Item = (&Sample, &ViewResult)> {
        self.fabrics
            .iter()
            .flat_map(|f| f.views.iter().map(|v| (f.sample, v)))
    }
}

/// A bench with the data that its reports add.
pub struct BenchReport<'a> {
    /// The results.
    pub bench: &'a Bench<'a>,
    /// The command that made it.
    pub command: String,
    /// Errors, as shares of a picture's brightness, within which choices are recommended.
    pub within: &'a [f64],
    /// Total time.
    pub seconds: f64,
}

impl ViewResult {
    /// The recommendation for this view and an error of at most `tolerance`.
    fn recommendation(&self, tolerance: f64) -> Option<Recommendation> {
        let rows = self.results.iter().map(|t| &t.row);
        let list: Vec<Candidate> = candidates(rows, &[self.view.lit]);
        recommend(&list, tolerance)
    }
}
