//! The names of representations, as values of flags.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use organza_scene::patches::PatchModel;
use organza_scene::representation::{REPRESENTATIONS, Representation};

/// The representation that the fabric names.
pub const OWN: &str = "auto";

/// Reads the name of a representation.
pub fn patch_model() -> impl TypedValueParser<Value = PatchModel> {
    let own = PossibleValue::new(OWN)
        .alias("volume")
        .help("What the fabric's [scattering] names, micro-flakes if nothing");
    let others = REPRESENTATIONS.map(|r| PossibleValue::new(r.name).help(r.about));
    let values = std::iter::once(own).chain(others);
    // Every other name that the parser lets through is of the list, or the alias.
    PossibleValuesParser::new(values)
        .map(|name| Representation::named(&name).map_or(PatchModel::Own, PatchModel::Is))
}
