//! The names of representations, as values of flags.

use crate::output::note;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use organza_scene::patches::PatchModel;
use organza_scene::representation::{REPRESENTATIONS, Representation};

/// The representation that the fabric names.
pub const OWN: &str = "auto";

/// The old name of [`OWN`].
const OLD_OWN: &str = "volume";

/// A representation as a flag names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModelFlag {
    /// The representation.
    pub model: PatchModel,
    /// Whether it was given by a name of an earlier version.
    is_old_name: bool,
}

/// Reads the name of a representation.
pub fn patch_model() -> impl TypedValueParser<Value = ModelFlag> {
    let own = PossibleValue::new(OWN)
        .help("What the fabric's [scattering] names, micro-flakes if nothing")
        .alias(OLD_OWN);
    let others = REPRESENTATIONS.map(|r| PossibleValue::new(r.name).help(r.about));
    let values = std::iter::once(own).chain(others);
    PossibleValuesParser::new(values).map(|name| ModelFlag {
        // Every other name that the parser lets through is of the list.
        model: Representation::named(&name).map_or(PatchModel::Own, PatchModel::Is),
        is_old_name: name == OLD_OWN,
    })
}

/// Warns of values of `flag` that are names of earlier versions, unless `quiet`.
pub fn warn_of_old_names(flag: &str, values: &[ModelFlag], quiet: bool) {
    if !quiet && values.iter().any(|value| value.is_old_name) {
        note!("organza: warning: {flag}: \"{OLD_OWN}\" is an old name; write \"{OWN}\"");
    }
}
