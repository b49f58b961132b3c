//! What can be fitted.

use crate::{Fit, FitJob, Fitted, cloth, colour, fibres, picture, plies, shade, surface, volume};
use anyhow::Result;
use clap::ValueEnum;
use clap::builder::PossibleValue;
use organza_work::of_option;
use std::sync::LazyLock;

/// Something that can be fitted. A new one is a file with such a constant, and a line in [`TARGETS`].
pub struct Target {
    /// Its name.
    pub name: &'static str,
    /// What is found, and from what.
    pub about: &'static str,
    /// A command line, without program and command.
    pub example: &'static str,
    /// The fields of [`Fit`] that it takes beside those that all take.
    pub fields: &'static [&'static str],
    /// Refuses fields that lack others or contradict them, before any file is read.
    pub(crate) check: fn(&Fit) -> Result<()>,
    pub(crate) run: fn(&FitJob) -> Result<Fitted>,
}

/// Every target, in the order of the help.
pub static TARGETS: [&Target; 8] = [
    &surface::TARGET,
    &fibres::TARGET,
    &colour::TARGET,
    &picture::TARGET,
    &plies::TARGET,
    &shade::TARGET,
    &volume::TARGET,
    &cloth::TARGET,
];

/// A target, as requests name it.
#[derive(Clone, Copy)]
pub struct TargetName(&'static Target);

impl TargetName {
    /// The target of a name.
    pub fn named(name: &str) -> Option<TargetName> {
        let found = TARGETS.iter().find(|target| target.name == name);
        found.copied().map(TargetName)
    }

    /// What it names.
    pub fn target(self) -> &'static Target {
        self.0
    }
}

impl Default for TargetName {
    fn default() -> TargetName {
        TargetName(&surface::TARGET)
    }
}

impl std::fmt::Debug for TargetName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0.name)
    }
}

impl ValueEnum for TargetName {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<[TargetName; TARGETS.len()]> =
            LazyLock::new(|| TARGETS.map(TargetName));
        &*ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name).help(self.0.about))
    }
}

/// Refuses fields that the target does not take, and names those targets that do.
///
/// # Errors
/// Names the field.
pub(crate) fn check_fields(fit: &Fit) -> Result<()> {
    let own = fit.target.target();
    let mut others = fit
        .given()
        .into_iter()
        .filter(|(field, is_given)| *is_given && !own.fields.contains(field));
    let Some((field, _)) = others.next() else {
        return Ok(());
    };
    let takers: Vec<&str> = TARGETS
        .iter()
        .filter(|target| target.fields.contains(&field))
        .map(|target| target.name)
        .collect();
    let (name, takers) = (own.name, takers.join(", "));
    let why = format!("does not apply to the fit of a {name}, but of: {takers}");
    Err(of_option(field, why))
}
