//! Layouts: sets of directions by name, and what is measured of them.

use super::{
    Measure, Measuring, Values, in_plane, klems, ptm, rgl, rows, shade, sweep, tensor_tree,
};
use anyhow::Result;
use clap::ValueEnum;
use clap::builder::PossibleValue;
use organza_measure::{Angles, Pair};
use organza_work::{Job, of_option};
use std::sync::LazyLock;

/// A set of directions. A new one is a file with such a constant, and a line in [`LAYOUTS`].
pub(crate) struct Layout {
    /// Its name.
    pub name: &'static str,
    /// A line for help.
    pub help: &'static str,
    /// What is measured.
    pub kind: Kind,
}

/// What is measured of a layout.
pub(crate) enum Kind {
    /// Directions in the rows of a table, each on its own.
    Rows {
        /// Pairs of directions.
        pairs: fn(&Measure) -> Vec<Pair>,
        /// Incident directions.
        incident: fn(&Measure) -> Vec<Angles>,
        /// Refuses more than fit into memory.
        check: fn(&Job<Measure>) -> Result<()>,
    },
    /// All at once.
    Whole(Whole),
}

/// What is measured all at once.
pub(crate) struct Whole {
    /// Ending of its files beside `.csv` and `.json`.
    pub ending: Option<&'static str>,
    /// Whether its files have no other ending.
    pub needs_ending: bool,
    /// Whether its paths end where a target error is reached.
    pub takes_target_error: bool,
    /// Where light and sun are measured together: any file, or one of the ending.
    pub both_bands: BothBands,
    /// Refuses what does not fit into memory.
    pub check: fn(&Job<Measure>) -> Result<()>,
    /// How many times so many paths as a pair has are traced in a band.
    pub count: fn(&Measuring<'_>) -> usize,
    /// Measures it.
    pub measure: fn(&Measuring<'_>) -> Result<Found>,
}

/// Where light and sun may be measured together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BothBands {
    /// Nowhere.
    Never,
    /// In files of the layout's ending.
    InFile,
    /// Always.
    Always,
}

/// What was measured.
pub(crate) struct Found {
    /// The values.
    pub values: Box<dyn Values>,
    /// Paths traced.
    pub paths: u64,
    /// See [`organza_measure::Results::heavy_tails`].
    pub heavy_tails: usize,
    /// How many directions or pairs.
    pub count: usize,
}

/// Every layout, in the order of the help.
pub(crate) static LAYOUTS: [&Layout; 9] = [
    &rows::IRAWAN,
    &rows::GRID,
    &in_plane::LAYOUT,
    &klems::LAYOUT,
    &tensor_tree::LAYOUT,
    &rgl::LAYOUT,
    &ptm::LAYOUT,
    &sweep::LAYOUT,
    &shade::LAYOUT,
];

/// A layout, as requests name it.
#[derive(Clone, Copy)]
pub struct LayoutName(pub(crate) &'static Layout);

impl std::fmt::Debug for LayoutName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.name)
    }
}

impl ValueEnum for LayoutName {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<[LayoutName; LAYOUTS.len()]> =
            LazyLock::new(|| LAYOUTS.map(LayoutName));
        &*ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name).help(self.0.help))
    }
}

impl Layout {
    /// What is measured all at once, if it is.
    pub fn whole(&self) -> Option<&Whole> {
        match &self.kind {
            Kind::Whole(whole) => Some(whole),
            Kind::Rows { .. } => None,
        }
    }
}

/// The names of the layouts that take a target error.
pub fn with_target_error() -> String {
    let takes = |l: &&&Layout| l.whole().is_none_or(|w| w.takes_target_error);
    let names: Vec<&str> = LAYOUTS.iter().filter(takes).map(|l| l.name).collect();
    names.join(", ")
}

/// The names of the layouts whose files have an ending, as flags.
pub fn with_ending(ending: &str) -> Vec<String> {
    let has = |l: &&&Layout| l.whole().and_then(|w| w.ending) == Some(ending);
    let found = LAYOUTS.iter().filter(has);
    found.map(|l| format!("--layout {}", l.name)).collect()
}

/// Refuses a table that does not fit into memory; `option` sets its size.
pub fn check_memory(job: &Job<Measure>, option: &str, needed: u64) -> Result<()> {
    check_bytes(job, option, "the table needs", needed)
}

fn check_bytes(job: &Job<Measure>, option: &str, what_needs: &str, bytes: u64) -> Result<()> {
    let most = job.context.memory_bytes();
    if bytes <= most {
        return Ok(());
    }
    let why = format!("{what_needs} {bytes} bytes of memory, {most} are allowed: take fewer");
    Err(of_option(option, why))
}

/// Refuses more values than fit into memory.
pub fn check_count(job: &Job<Measure>, option: &str, count: u64) -> Result<()> {
    /// What a value takes while it is measured, and as JSON; upper bounds, measured.
    const BYTES_OF_VALUE: u64 = 512;
    const BYTES_OF_JSON: u64 = 5120;
    let each = match job.lists_json {
        true => BYTES_OF_JSON,
        false => BYTES_OF_VALUE,
    };
    let what_needs = format!("{count} values need");
    check_bytes(job, option, &what_needs, count.saturating_mul(each))
}
